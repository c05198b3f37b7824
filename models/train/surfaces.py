"""Labelled surfaces as `viola surfaces` writes them, and the columns that the network reads."""
from pathlib import Path

import numpy as np

# viola-lab, surfaces.rs.
RECORD = np.dtype([("mm", "<i2", 3), ("normal", "i1", 3), ("color", "u1", 3), ("label", "u1"), ("zero", "u1"),
                   ("instance", "<u2")])
UNKNOWN = 255
# viola-reconstruct, label/columns.rs: both must agree.
CELL_M = 0.05
SLICES = 52
WINDOW = 10
STRIDE = 16


def load(path: Path) -> dict:
    """The points of a surface, in metres."""
    records = np.fromfile(path, RECORD)
    return {
        "xyz": records["mm"].astype(np.float32) / 1000,
        "normal": records["normal"].astype(np.float32) / 127,
        "label": records["label"],
    }


def augmented(surface: dict, random: np.random.Generator) -> dict:
    """A turned, mirrored, shifted and slightly scaled copy with patches missing."""
    xyz, normal, label = surface["xyz"].copy(), surface["normal"].copy(), surface["label"]
    if random.random() < 0.5:
        xyz[:, 0], normal[:, 0] = -xyz[:, 0], -normal[:, 0]
    yaw = random.uniform(0, 2 * np.pi)
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]], np.float32)
    xyz[:, :2], normal[:, :2] = xyz[:, :2] @ turn.T, normal[:, :2] @ turn.T
    xyz *= random.uniform(0.95, 1.05, 3).astype(np.float32)
    xyz[:, 2] += random.normal(0, 0.015)
    xyz[:, :2] += random.uniform(0, CELL_M, 2).astype(np.float32)
    kept = np.ones(len(xyz), bool)
    for _ in range(random.integers(0, 6)):
        hole = xyz[random.integers(len(xyz))]
        kept &= np.linalg.norm(xyz - hole, axis=1) > random.uniform(0.1, 0.4)
    if random.random() < 0.3:
        # A camera that looks down sees no upper part of the room.
        kept &= xyz[:, 2] < random.uniform(1.0, 2.4)
    kept &= random.random(len(xyz)) < random.uniform(0.7, 1.0)
    return {"xyz": xyz[kept], "normal": normal[kept], "label": label[kept]}


def columns(surface: dict, crop: int | None = None, random: np.random.Generator | None = None) -> dict | None:
    """Voxels of the surface and the columns that hold them.

    `grid` is (2 * SLICES, height, width): occupied, and the mean normal's z. Voxels have their column (`column`,
    row-major in the grid), their slice (`slice`), the slices below and above in their column (`window`,
    2 * (2 * WINDOW + 1)) and their most frequent label.
    """
    xyz, normal, label = surface["xyz"], surface["normal"], surface["label"]
    cell = np.floor(xyz / CELL_M).astype(np.int64)
    inside = (cell[:, 2] >= 0) & (cell[:, 2] < SLICES)
    cell, normal, label = cell[inside], normal[inside], label[inside]
    if crop is not None and len(cell):
        corner = cell[random.integers(len(cell)), :2] - random.integers(0, crop, 2)
        near = ((cell[:, :2] >= corner) & (cell[:, :2] < corner + crop)).all(axis=1)
        cell, normal, label = cell[near], normal[near], label[near]
        cell[:, :2] -= corner
        size = (crop, crop)
    elif len(cell):
        cell[:, :2] -= cell[:, :2].min(axis=0)
        size = tuple(int(-(-(side + 1) // STRIDE) * STRIDE) for side in cell[:, :2].max(axis=0)[::-1])
    if len(cell) == 0:
        return None
    height, width = size
    key = (cell[:, 2] * height + cell[:, 1]) * width + cell[:, 0]
    voxels, of_point, counts = np.unique(key, return_inverse=True, return_counts=True)
    up = np.bincount(of_point, normal[:, 2], len(voxels)) / counts
    grid = np.zeros((2, SLICES, height * width), np.float32)
    slice_, column = voxels // (height * width), voxels % (height * width)
    grid[0, slice_, column] = 1
    grid[1, slice_, column] = up
    padded = np.pad(grid, ((0, 0), (WINDOW, WINDOW), (0, 0)))
    reach = slice_[:, None] + np.arange(2 * WINDOW + 1)
    window = padded[:, reach, column[:, None]]
    votes = np.zeros((len(voxels), 256), np.int32)
    np.add.at(votes, (of_point, label), 1)
    votes[:, UNKNOWN] = 0
    most = np.where(votes.max(axis=1) > 0, votes.argmax(axis=1), UNKNOWN)
    return {
        "grid": grid.reshape(2 * SLICES, height, width),
        "column": column,
        "slice": slice_,
        "window": window.transpose(1, 0, 2).reshape(len(voxels), -1).astype(np.float32),
        "label": most,
        "points": counts,
    }
