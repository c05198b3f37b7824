"""Hangs curtains before walls and windows: in homes they are drawn, wall to wall, and their folds are irregular."""
import numpy as np

from surfaces import picked

# viola-geometry, taxonomy.rs.
WALL, WINDOW, CURTAIN = 2, 5, 25
# Radiators and pictures are behind a curtain, too.
HIDDEN = [WALL, WINDOW, CURTAIN, 20, 30]
TRIES = 5
# Points of the wall that a curtain needs.
FEWEST = 200
# Cells that tell where the wall was seen.
SEEN_M = 0.25
# In front of the wall, and behind it to the panes of a window.
DEPTH_M = (-0.35, 0.08)


class Folds:
    """Depth of a cloth: half waves of various lengths and depths, which wander a little from top to bottom."""

    def __init__(self, width: float, random: np.random.Generator):
        half = random.uniform(0.06, 0.2)
        count = int(width / half * 2) + 4
        lengths = half * random.uniform(0.6, 1.4, count)
        self.at = np.cumsum(lengths) - width / 2 - 2 * half
        deep = random.uniform(0.01, 0.06)
        self.depth = deep * random.uniform(0.3, 1.2, count) * np.where(np.arange(count) % 2, 1, -1)
        self.wander, self.phase, self.long = random.uniform(0, 0.04), random.uniform(0, 6.28), random.uniform(1, 3)
        self.at_top = random.uniform(0.5, 1.2)
        self.deepest = float(np.abs(self.depth).max())

    def __call__(self, s: np.ndarray, z: np.ndarray) -> np.ndarray:
        s = s + self.wander * np.sin(2 * np.pi * z / self.long + self.phase)
        index = np.clip(np.searchsorted(self.at, s), 1, len(self.at) - 1)
        part = np.clip((s - self.at[index - 1]) / (self.at[index] - self.at[index - 1]), 0, 1)
        rise = (1 - np.cos(np.pi * part)) / 2
        share = 1 + (self.at_top - 1) * np.clip(z / 2.4, 0, 1)
        return share * ((1 - rise) * self.depth[index - 1] + rise * self.depth[index])


def draped(surface: dict, random: np.random.Generator) -> dict:
    """The surface with a curtain before a part of a wall; the surface itself if no wall was found."""
    xyz, normal, label = surface["xyz"], surface["normal"], surface["label"]
    spots = np.flatnonzero(np.isin(label, HIDDEN[:3]) & (np.abs(normal[:, 2]) < 0.2) & (xyz[:, 2] > 0.5) & (xyz[:, 2] < 2))
    for _ in range(TRIES if len(spots) else 0):
        spot = random.choice(spots)
        out = normal[spot, :2] / max(np.linalg.norm(normal[spot, :2]), 1e-6)
        along = np.array([-out[1], out[0]])
        at = xyz[:, :2] - xyz[spot, :2]
        s, depth = at @ along, at @ out
        width, bottom, top = random.uniform(0.8, 4.5), random.uniform(0, 0.06), random.uniform(1.9, 2.6)
        if random.random() < 0.3:
            bottom = random.uniform(0.3, 1.1)
        s -= random.uniform(-0.5, 0.5) * width
        behind = (np.abs(s) < width / 2) & (xyz[:, 2] > bottom) & (xyz[:, 2] < top) & np.isin(label, HIDDEN)
        behind &= (depth > DEPTH_M[0]) & (depth < DEPTH_M[1])
        flat = behind & (np.abs(depth) < 0.08)
        if flat.sum() >= FEWEST:
            return hung(surface, behind, flat, (spot, out, along, s), (width, bottom, top), random)
    return surface


def spread(s: np.ndarray, z: np.ndarray, flat: np.ndarray, size: tuple, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Places along and up a wall, as dense as its points `flat`, where it was seen. `s` and `z` are those of the points before
    it and behind; `size` is the width, the bottom and the top of the part that is to be covered."""
    width, bottom, top = size
    cell = lambda s, z: np.stack([(s + width) // SEEN_M, (z + 1) // SEEN_M], axis=-1).astype(np.int64)
    cells = cell(s, z)
    seen = np.zeros(cells.max(axis=0) + 3, bool)
    # A quarter of a metre of glass without depth is covered as well.
    for y, x in np.ndindex(3, 3):
        seen[cells[:, 0] + y, cells[:, 1] + x] = True
    covered = len(np.unique(cells[flat], axis=0)) * SEEN_M**2
    count = int(min(flat.sum() / max(covered, 0.1), 1500) * width * (top - bottom) * 1.1)
    new_s, new_z = random.uniform(-width / 2, width / 2, count), random.uniform(bottom, top, count)
    to = cell(new_s, new_z) + 1
    kept = (to < seen.shape).all(axis=1) & (new_s > s[flat].min()) & (new_s < s[flat].max())
    kept[kept] = seen[tuple(to[kept].T)]
    return new_s[kept], new_z[kept]


def hung(surface: dict, behind: np.ndarray, flat: np.ndarray, frame: tuple, size: tuple, random: np.random.Generator) -> dict:
    """The surface with a curtain instead of the points `behind`. `flat` are those of the wall's plane. `frame` is a point of
    the wall, the directions out of it and along it, and the place of each point along it from the curtain's middle."""
    (spot, out, along, s), width = frame, size[0]
    xyz = surface["xyz"]
    new_s, new_z = spread(s[behind], xyz[behind, 2], flat[behind], size, random)
    folds = Folds(width, random)
    depth = folds(new_s, new_z)
    step = 0.01
    slope_s = (folds(new_s + step, new_z) - folds(new_s - step, new_z)) / (2 * step)
    slope_z = (folds(new_s, new_z + step) - folds(new_s, new_z - step)) / (2 * step)
    depth += folds.deepest + random.uniform(0.02, 0.12)
    # The middle of the curtain is beside the spot.
    origin = xyz[spot, :2] - s[spot] * along
    ground = origin + new_s[:, None] * along + depth[:, None] * out
    normal = np.concatenate([out - slope_s[:, None] * along, -slope_z[:, None]], axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    new = {"xyz": np.concatenate([ground, new_z[:, None]], axis=1).astype(np.float32), "normal": normal.astype(np.float32),
           "label": np.full(len(new_s), CURTAIN, surface["label"].dtype),
           "instance": np.zeros(len(new_s), surface["instance"].dtype)}
    rest = picked(surface, ~behind)
    return {**rest, **{name: np.concatenate([rest[name], part]) for name, part in new.items()}}
