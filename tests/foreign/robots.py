"""Files for robots and homes, as Valetudo's routes, the map card of Home Assistant and Matter's Service Area cluster take them."""

# Zones that a Roborock robot takes at once (Valetudo, `RoborockZoneCleaningCapability.js`).
MOST_ZONES = 5
# Selections that the card sends at once if the mode has no `max_selections` (`map-mode.ts`).
MOST_SELECTIONS = 999
# A rectangle may be smaller by a cell of 5 cm at each border, and by the rounding to centimetres.
SLACK_M = 0.07
ON_WALLS = {"window", "curtain", "mirror", "picture"}
# The last tags of the namespaces Area and Landmark (Matter 1.4).
LAST_AREA, LAST_LANDMARK = 0x5C, 0x32


def are_unique(names):
    assert len(names) == len(set(names)), sorted(names)


def valetudo(truth):
    answer = truth.document("valetudo.json")
    unit_m = {"cm": 0.01, "m": 1.0}[answer["coordinates"]["unit"]]
    assert [target["id"] for target in answer["objects"]] == [thing["id"] for thing in truth.objects]
    are_unique([target["name"] for target in answer["objects"]])
    count = 0
    for target in answer["rooms"] + answer["objects"]:
        body = target["zone_cleaning"]
        if body is None:
            continue
        assert body["action"] == "clean" and 1 <= len(body["zones"]) <= MOST_ZONES, target
        sizes = [size_m(zone["points"], unit_m) for zone in body["zones"]]
        for (length, width), later in zip(sizes, sizes[1:]):
            # A robot that takes fewer zones gets the first ones.
            assert (length + SLACK_M) * (width + SLACK_M) >= later[0] * later[1], target
        count += len(sizes)
    assert count > 0
    return f"{len(answer['objects'])} objects, {count} zones"


def size_m(points, unit_m):
    """Returns the sides of a zone, whose corners go around from the upper left one."""
    a, b, c, d = (points[corner] for corner in ("pA", "pB", "pC", "pD"))
    assert a["y"] == b["y"] and c["y"] == d["y"] and a["x"] == d["x"] and b["x"] == c["x"] and a["x"] < b["x"], points
    return (b["x"] - a["x"]) * unit_m, abs(a["y"] - d["y"]) * unit_m


def calibration(truth):
    things = {target["name"]: target["class"] for target in truth.document("valetudo.json")["objects"]}
    labels = set()
    for mode in truth.document("calibration.json")["map_modes"]:
        selections = mode["predefined_selections"]
        at_once = mode.get("max_selections", MOST_SELECTIONS)
        zones = max(len(selection.get("zones", [])) for selection in selections)
        assert at_once * zones <= MOST_ZONES, (mode["template"], at_once, zones)
        names = [selection["label"]["text"] for selection in selections]
        if mode["template"] != "vacuum_clean_segment":
            # Several segments may be in one room.
            are_unique(names)
        labels.update(names)
    shown = labels & set(things)
    assert not ON_WALLS & {things[name] for name in shown}, shown
    return f"{len(labels)} labels, {len(shown)} of objects"


def matter(truth):
    names = {target["id"]: target["name"] for target in truth.document("valetudo.json")["objects"]}
    answer = truth.document("matter.json")
    maps = [one["mapID"] for one in answer["supportedMaps"]]
    areas, sources = answer["supportedAreas"], answer["sources"]
    are_unique(maps)
    are_unique([area["areaID"] for area in areas])
    are_unique([(area["mapID"], area["areaInfo"]["locationInfo"]["locationName"]) for area in areas])
    assert [area["areaID"] for area in areas] == [source["areaID"] for source in sources]
    assert 0 < len(areas) <= 255
    for area, source in zip(areas, sources):
        place, landmark = area["areaInfo"]["locationInfo"], area["areaInfo"]["landmarkInfo"]
        assert area["mapID"] in maps and 0 < len(place["locationName"].encode()) <= 128, area
        assert place["areaType"] is None or 0 <= place["areaType"] <= LAST_AREA, area
        assert (landmark is None) == (source["object"] is None), area
        assert landmark is None or 0 <= landmark["landmarkTag"] <= LAST_LANDMARK, area
        if source["object"] and source["level"] == "main":
            assert place["locationName"] == names[source["object"]], (area, names)
    return f"{len(areas)} areas on {len(maps)} maps"
