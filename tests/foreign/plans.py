"""Floor plans, by the readers of CAD programs, of PDF and of pictures."""

import math
import re

import ezdxf
import numpy as np
import pypdf
from ezdxf import bbox
from PIL import Image

# Points of a PDF in a millimetre.
POINTS_OF_MM = 72 / 25.4
SHEETS_MM = {"A4": [210, 297], "A3": [297, 420]}


def area_m2(corners):
    return abs(signed_area_m2([*corners, corners[0]]))


def dxf(truth):
    drawing = ezdxf.readfile(truth.path("plan.dxf"))
    problems = drawing.audit()
    assert not problems.errors, problems.errors
    assert drawing.dxfversion == "AC1009"
    space = drawing.modelspace()
    opens_on_the_rooms(drawing)
    layers = {entity.dxf.layer for entity in space}
    assert {"WALLS", "WALL_LINES", "ROOMS"} <= layers, layers
    if truth.room:
        # The walls of the room that was filmed are along the axes of the drawing.
        length, width, _ = truth.room["size_m"]
        box = bbox.extents(space.query('*[layer=="ROOMS"]'))
        sides = sorted([box.size.x, box.size.y])
        assert abs(sides[0] - width) < 0.15 and abs(sides[1] - length) < 0.15, sides
    fractions = [wall["filmed_fraction"] for wall in truth.plan["walls"]]
    assert all(0 <= fraction <= 1 for fraction in fractions), fractions
    # If clips filmed no wall, all walls are drawn alike.
    filmed = sum(fraction >= 0.2 for fraction in fractions) or len(fractions)
    counts = [len(space.query(f'LINE[layer=="{layer}"]')) for layer in ["WALL_LINES", "WALL_LINES_UNFILMED"]]
    assert counts == [filmed, len(fractions) - filmed], (counts, fractions)
    yaw = truth.plan["plan_yaw_rad"]
    rings = [ring for room in truth.plan["rooms"] for ring in [room["polygon_m"], *room["holes_m"]]]
    drawn = space.query('POLYLINE[layer=="ROOMS"]')
    assert len(drawn) == len(rings) > 0
    for polyline, ring in zip(drawn, rings):
        corners = [[vertex.dxf.location.x, vertex.dxf.location.y] for vertex in polyline.vertices]
        assert polyline.is_closed and len(corners) == len(ring)
        assert np.abs(np.array(corners) - [turned(corner, yaw) for corner in ring]).max() < 0.002
    for room in truth.plan["rooms"]:
        holes_m2 = sum(area_m2(hole) for hole in room["holes_m"])
        assert abs(area_m2(room["polygon_m"]) - holes_m2 - room["area_m2"]) < 0.02, room
    names = [text.dxf.text for text in space.query('TEXT[layer=="ROOM_NAMES"]')]
    assert [f"{room['area_m2']:.1f} m2" for room in truth.plan["rooms"]] == names[1::2], names
    notes = [text.dxf.text for text in space.query('TEXT[layer=="NOTES"]')]
    turn = next(match for match in (re.match(r"Turn by ([-\d.]+) degrees about 0,0 ", note) for note in notes) if match)
    assert abs(float(turn[1]) - math.degrees(yaw)) < 0.001, (notes, yaw)
    assert "Units: metres" in notes and notes[0].startswith("Floor plan"), notes
    furniture = space.query('*[layer=="FURNITURE"]')
    assert bool(truth.plan["furniture"]) == (len(furniture) > 0)
    return f"{len(space)} entities on {len(layers)} layers"


def opens_on_the_rooms(drawing):
    """Without a view of its own, a program shows the surroundings of the origin."""
    [view] = drawing.viewports.get_config("*ACTIVE")
    half = np.array([view.dxf.height * view.dxf.aspect_ratio, view.dxf.height]) / 2
    low, high = np.array(view.dxf.center)[:2] - half, np.array(view.dxf.center)[:2] + half
    box = bbox.extents(drawing.modelspace().query('*[layer=="ROOMS"]'))
    assert (low < np.array(box.extmin)[:2]).all() and (high > np.array(box.extmax)[:2]).all(), (low, high, box)


def turned(corner, yaw):
    """Returns a corner of the LiDAR map's frame in the upright frame."""
    c, s = math.cos(yaw), math.sin(yaw)
    return [c * corner[0] + s * corner[1], c * corner[1] - s * corner[0]]


def page(truth):
    """Returns the sides of the page in millimetres, and its scale."""
    svg = (truth.folder / "plan.svg").read_text()
    sides_mm = [float(side) for side in re.search(r'width="([\d.]+)mm" height="([\d.]+)mm"', svg).groups()]
    return np.array(sides_mm), int(re.search(r"<desc>Scale 1:(\d+)\.", svg)[1])


def pdf(truth):
    reader = pypdf.PdfReader(truth.path("plan.pdf"), strict=True)
    assert len(reader.pages) == 1
    assert reader.metadata.title.startswith("Floor plan"), reader.metadata
    box = np.array([float(reader.pages[0].mediabox.width), float(reader.pages[0].mediabox.height)])
    sheets = [name for name, mm in SHEETS_MM.items() if np.abs(np.sort(box) - np.array(mm) * POINTS_OF_MM).max() < 1]
    assert sheets, box
    page_mm, scale = page(truth)
    content = reader.pages[0].get_contents().get_data().decode()
    points_of_px, _, _, _, left, top = [float(number) for number in content.split(" cm", 1)[0].split()]
    # The page is in the middle of the sheet.
    height = page_mm[1] * POINTS_OF_MM
    assert np.abs([2 * left + page_mm[0] * POINTS_OF_MM - box[0], 2 * top - height - box[1]]).max() < 0.5, (box, page_mm)
    # The first room is filled after the background, in true scale.
    area = re.split(r"\nf\*?\n", content)[1]
    corners = np.array(re.findall(r"^([-\d.]+) ([-\d.]+) [ml]$", area, re.MULTILINE), float)
    ring = np.array([turned(corner, truth.plan["plan_yaw_rad"]) for corner in truth.plan["rooms"][0]["polygon_m"]])
    drawn, wanted = np.ptp(corners, axis=0) * points_of_px, np.ptp(ring, axis=0) * 1000 / scale * POINTS_OF_MM
    assert np.abs(drawn - wanted).max() < 0.2, (drawn, wanted)
    return f"1:{scale} on {sheets[0]}"


def png(truth):
    page_mm, _ = page(truth)
    with Image.open(truth.path("plan.png")) as picture:
        picture.load()
        size_px, dpi = picture.size, picture.info["dpi"]
    assert list(size_px) == truth.plan["image"]["size_px"], size_px
    printed_mm = np.array(size_px) / dpi * 25.4
    assert np.abs(printed_mm - page_mm).max() < 0.3, (printed_mm, page_mm)
    return f"{size_px[0]} x {size_px[1]} pixels"


def geojson(truth):
    """RFC 7946, 3.1.6 and 5: closed rings, the outer one counter-clockwise and holes clockwise, and the box of all positions."""
    document = truth.document("plan.geojson")
    assert document["type"] == "FeatureCollection" and document["crs"]["type"] == "name"
    ids = [feature["id"] for feature in document["features"]]
    assert len(ids) == len(set(ids)), ids
    positions = []
    for feature in document["features"]:
        assert feature["type"] == "Feature" and feature["properties"]["kind"], feature
        geometry = feature["geometry"]
        if geometry["type"] == "LineString":
            assert len(geometry["coordinates"]) == 2, feature
            positions += geometry["coordinates"]
            continue
        assert geometry["type"] == "Polygon" and geometry["coordinates"], feature
        for number, ring in enumerate(geometry["coordinates"]):
            assert len(ring) >= 4 and ring[0] == ring[-1], feature
            assert (signed_area_m2(ring) > 0) == (number == 0), (number, feature)
            positions += ring
    box = [*np.min(positions, axis=0), *np.max(positions, axis=0)]
    assert np.abs(np.array(document["bbox"]) - box).max() < 1e-9, (document["bbox"], box)
    return f"{len(ids)} features"


def signed_area_m2(ring):
    """Returns the area in a closed ring, positive if the ring is counter-clockwise."""
    x, y = np.array(ring).T
    return (x[:-1] * y[1:] - x[1:] * y[:-1]).sum() / 2
