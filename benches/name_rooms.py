#!/usr/bin/env python3
"""Divides the floor of a Valetudo map into named rooms, as its owner would on the robot's application.

name_rooms.py MAP.json OUT.json NAME=X0,Y0,X1,Y1 ...

Each cell of the floor goes to the first rectangle that holds it, in metres of viola's map frame (origin at the lower-left corner
of `size`, y up); cells in none stay floor.
"""
import json
import sys


def cells(layer):
    runs = layer["compressedPixels"]
    for x, y, count in zip(runs[0::3], runs[1::3], runs[2::3]):
        for i in range(count):
            yield x + i, y


def layer(kind, meta, pixels, cell_cm):
    runs = [number for x, y in pixels for number in (x, y, 1)]
    meta = {"area": len(pixels) * cell_cm * cell_cm, **meta}
    return {"__class": "MapLayer", "type": kind, "metaData": meta, "pixels": [], "compressedPixels": runs}


def main():
    source, target, *wanted = sys.argv[1:]
    rooms = []
    for room in wanted:
        name, corners = room.split("=")
        rooms.append((name, [float(number) for number in corners.split(",")]))
    with open(source) as file:
        home = json.load(file)
    height_cm, cell_cm = home["size"]["y"], home["pixelSize"]
    rest, inside = [], [[] for _ in rooms]
    for x, y in (cell for one in home["layers"] if one["type"] == "floor" for cell in cells(one)):
        x_m, y_m = (x + 0.5) * cell_cm / 100, (height_cm - (y + 0.5) * cell_cm) / 100
        within = (at for (_, (x0, y0, x1, y1)), at in zip(rooms, inside) if x0 <= x_m < x1 and y0 <= y_m < y1)
        next(within, rest).append((x, y))
    layers = [one for one in home["layers"] if one["type"] != "floor"]
    layers += [layer("floor", {}, rest, cell_cm)] if rest else []
    for number, ((name, _), pixels) in enumerate(zip(rooms, inside), 1):
        layers.append(layer("segment", {"segmentId": str(number), "name": name, "active": False}, pixels, cell_cm))
    with open(target, "w") as file:
        json.dump({**home, "layers": layers}, file)


main()
