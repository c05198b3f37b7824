"""Floor plans, by the readers of CAD programs and of PDF."""

import math
import re

import ezdxf
import numpy as np
import pypdf
from ezdxf import bbox

# Points of a PDF in a millimetre.
POINTS_OF_MM = 72 / 25.4


def area_m2(corners):
    x, y = np.array(corners)[:, 0], np.array(corners)[:, 1]
    return abs(np.dot(x, np.roll(y, 1)) - np.dot(y, np.roll(x, 1))) / 2


def dxf(truth):
    drawing = ezdxf.readfile(truth.path("plan.dxf"))
    problems = drawing.audit()
    assert not problems.errors, problems.errors
    assert drawing.dxfversion == "AC1009"
    space = drawing.modelspace()
    layers = {entity.dxf.layer for entity in space}
    assert {"WALLS", "WALL_LINES", "ROOMS"} <= layers, layers
    if truth.room:
        # The walls of the room that was filmed are along the axes of the drawing.
        length, width, _ = truth.room["size_m"]
        box = bbox.extents(space.query('*[layer=="ROOMS"]'))
        sides = sorted([box.size.x, box.size.y])
        assert abs(sides[0] - width) < 0.15 and abs(sides[1] - length) < 0.15, sides
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
    furniture = space.query('*[layer=="FURNITURE"]')
    assert bool(truth.plan["furniture"]) == (len(furniture) > 0)
    return f"{len(space)} entities on {len(layers)} layers"


def turned(corner, yaw):
    """Returns a corner of the LiDAR map's frame in the upright frame."""
    c, s = math.cos(yaw), math.sin(yaw)
    return [c * corner[0] + s * corner[1], c * corner[1] - s * corner[0]]


def pdf(truth):
    reader = pypdf.PdfReader(truth.path("plan.pdf"), strict=True)
    assert len(reader.pages) == 1
    box = reader.pages[0].mediabox
    svg = (truth.folder / "plan.svg").read_text()
    page_mm = [float(side) for side in re.search(r'width="([\d.]+)mm" height="([\d.]+)mm"', svg).groups()]
    for points, mm in zip([box.width, box.height], page_mm):
        assert abs(float(points) - mm * POINTS_OF_MM) < 1, (box, page_mm)
    assert len(reader.pages[0].get_contents().get_data()) > 1000
    return f"a page of {page_mm[0]:g} x {page_mm[1]:g} mm"
