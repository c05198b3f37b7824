"""The truth that every file is compared with: the service's own documents, and the room that was filmed if it is known."""

import json
import math
from pathlib import Path

import numpy as np

# The vertices of `points.ply`, as its header lists them.
VERTEX = np.dtype([
    ("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("nx", "<f4"), ("ny", "<f4"), ("nz", "<f4"),
    ("red", "u1"), ("green", "u1"), ("blue", "u1"), ("label", "u1"),
    ("probability", "<f4"), ("views", "<u2"), ("clip", "<u2"), ("weight", "<u2"),
])


class Truth:
    def __init__(self, folder, level="main"):
        self.folder = Path(folder)
        self.level = level
        self.room = self.document("truth.json")
        self.classes = {c["id"]: c["name"] for c in self.document("classes.json")["classes"]}
        # Objects and clips of other levels are not in the files of this one.
        self.objects = [thing for thing in self.document("objects.json")["objects"] if thing["level"] == level]
        self.plan = self.document("plan.json")
        # Those in the map; `viola map` lists the others too.
        self.clips = [clip for clip in self.document("map.json")["clips"] if clip["by"] and clip["level"] == level]
        self.vertices = self.ply("points.ply")
        self.xyz = self.positions(self.vertices)

    def document(self, name):
        return json.loads((self.folder / name).read_text())

    def path(self, name):
        return str(self.folder / name)

    def ply(self, name):
        """Returns the vertices of a PLY, by its header and not by a library."""
        data = (self.folder / name).read_bytes()
        head, body = data.split(b"end_header\n", 1)
        names = [line.split()[2] for line in head.decode().splitlines() if line.startswith("property ")]
        assert names == list(VERTEX.names), names
        return np.frombuffer(body, VERTEX)

    @staticmethod
    def positions(vertices):
        return np.stack([vertices["x"], vertices["y"], vertices["z"]], axis=1).astype(float)

    def in_room(self, xyz):
        """Returns points of the LiDAR map's frame in the frame of the room, whose corner is the origin."""
        x, y, yaw = self.room["map_from_room"]
        moved = np.asarray(xyz, float)[:, :2] - [x, y]
        c, s = math.cos(yaw), math.sin(yaw)
        return np.column_stack([moved @ [c, s], moved @ [-s, c], np.asarray(xyz, float)[:, 2]])

    def is_the_room(self, xyz, tolerance_m=0.12):
        """Fails unless the points lie along the floor and the walls of the room that was filmed."""
        if not self.room:
            return
        xyz = self.in_room(xyz)
        low, high = np.percentile(xyz, 0.5, axis=0), np.percentile(xyz, 99.5, axis=0)
        length, width, height = self.room["size_m"]
        assert np.abs(low).max() < tolerance_m, low
        assert abs(high[0] - length) < tolerance_m and abs(high[1] - width) < tolerance_m, high
        # The camera looks down, so that the ceiling is not in the picture.
        assert 1.0 < high[2] < height + tolerance_m, high


def z_up(xyz):
    """Returns points of the frame of GLB, USDZ and OBJ, y up, in the LiDAR map's frame, z up."""
    xyz = np.asarray(xyz, float)
    return np.column_stack([xyz[:, 0], -xyz[:, 2], xyz[:, 1]])


def same_points(a, b, tolerance_m):
    a, b = np.asarray(a, float), np.asarray(b, float)
    assert a.shape == b.shape, (a.shape, b.shape)
    assert np.abs(a - b).max() <= tolerance_m, np.abs(a - b).max()
