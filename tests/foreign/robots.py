"""Files for robots and homes, as Nav2's map server, Valetudo's routes, the map card of Home Assistant and Matter's Service Area
cluster take them."""

import io
import json
import zipfile

import numpy as np
from PIL import Image

# Zones that a Roborock robot takes at once (Valetudo, `RoborockZoneCleaningCapability.js`).
MOST_ZONES = 5
# Selections that the card sends at once if the mode has no `max_selections` (`map-mode.ts`).
MOST_SELECTIONS = 999
# A rectangle may be smaller by a cell of 5 cm at each border, and by the rounding to centimetres.
SLACK_M = 0.07
ON_WALLS = {"window", "curtain", "mirror", "picture"}
# The last tags of the namespaces Area and Landmark (Matter 1.4).
LAST_AREA, LAST_LANDMARK = 0x5C, 0x32


# Radius of a robot vacuum.
RADIUS_M = 0.18


def are_unique(names):
    assert len(names) == len(set(names)), sorted(names)


def nav2(truth):
    archive = zipfile.ZipFile(truth.path("nav2.zip"))
    document = lambda name: json.loads(archive.read(name))
    maps = {name: occupancy(archive, name) for name in ["map", "keepout_mask", "semantic_mask", "room_mask"]}
    frames = {name: (cells.shape, origin, cell_m) for name, (cells, origin, cell_m) in maps.items()}
    # The filters of a costmap take masks at the cells of the map.
    assert len(set(frames.values())) == 1, frames
    cells, (left, bottom), cell_m = maps["map"]
    assert (cells == 100).any()
    labels = document("labels.json")
    assert set(np.unique(maps["semantic_mask"][0])) <= {-1} | {one["value"] for one in labels["classes"]}
    assert set(np.unique(maps["room_mask"][0])) <= {0} | {one["value"] for one in labels["rooms"]}
    rows, columns = np.nonzero((cells == 100) | (maps["keepout_mask"][0] == 100))
    blocked = np.column_stack([left + (columns + 0.5) * cell_m, bottom + (rows + 0.5) * cell_m])
    answer = document("goals.json")
    area = answer["goal_area"]
    assert area["is_at_dock"] == (area["reason"] is None) and (area["area_m2"] > 0) == bool(answer["goals"]), area
    rooms = {one["room"]: one["value"] for one in labels["rooms"]}
    for goal in answer["goals"]:
        at = np.array([goal["x_m"], goal["y_m"]])
        # From the middle of a cell.
        assert np.hypot(*(blocked - at).T).min() >= RADIUS_M - cell_m, goal
        column, row = ((at - [left, bottom]) / cell_m).astype(int)
        assert goal["room"] is None or maps["room_mask"][0][row, column] == rooms[goal["room"]], goal
        assert abs(goal["yaw_rad"]) <= np.pi + 1e-3, goal
    assert len({goal["id"] for goal in answer["goals"]}) == len(answer["goals"])
    return f"{cells.shape[1]} x {cells.shape[0]} cells, {len(answer['goals'])} goals"


def occupancy(archive, name):
    """Returns the values of a map from the lower-left corner on, the corner and the side of a cell, as Nav2's map server
    (`map_io.cpp`) reads them."""
    lines = archive.read(f"{name}.yaml").decode().splitlines()
    yaml = dict(line.split(": ", 1) for line in lines)
    x_m, y_m, yaw = json.loads(yaml["origin"])
    assert yaw == 0 and yaml["negate"] == "0", yaml
    grey = np.asarray(Image.open(io.BytesIO(archive.read(json_or_text(yaml["image"])))))[::-1].astype(float)
    occupied, free = float(yaml["occupied_thresh"]), float(yaml["free_thresh"])
    dark = 1 - grey / 255
    if yaml["mode"] == "raw":
        values = np.where(grey <= 100, grey, -1)
    else:
        between = -1 if yaml["mode"] == "trinary" else np.rint((dark - free) / (occupied - free) * 100)
        values = np.where(dark > occupied, 100, np.where(dark < free, 0, between))
    return values.astype(int), (x_m, y_m), float(yaml["resolution"])


def json_or_text(value):
    """Returns a text of YAML, which may have quotes."""
    return json.loads(value) if value.startswith('"') else value


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
        if source["object"] and source["level"] == truth.level:
            assert place["locationName"] == names[source["object"]], (area, names)
    return f"{len(areas)} areas on {len(maps)} maps"
