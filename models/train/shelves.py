"""Puts bookcases and fitted wardrobes before walls, up to wall to wall and ceiling: shelves of books and things, and closed fronts."""
import numpy as np

from drape import spread
from furnish import STRUCTURE
from surfaces import picked

# viola-geometry, taxonomy.rs.
FLOOR, WALL, CABINET, SHELF = 1, 2, 12, 13
# Doors, windows and curtains are not built over.
OPEN = [4, 5, 25]
TRIES = 6
# Points of the wall that a unit needs.
FEWEST = 200
# Points of other objects and of openings that end it.
IN_THE_WAY = 15
WIDEST_M = 4.5
# Boards and their edges.
BOARD_M = 0.025


def shelved(surface: dict, random: np.random.Generator) -> dict:
    """The surface with a unit before a part of a wall; the surface itself if no place was found."""
    xyz, normal, label = surface["xyz"], surface["normal"], surface["label"]
    spots = np.flatnonzero((label == WALL) & (np.abs(normal[:, 2]) < 0.2) & (xyz[:, 2] > 0.5) & (xyz[:, 2] < 2))
    for _ in range(TRIES if len(spots) else 0):
        spot = random.choice(spots)
        out = normal[spot, :2] / max(np.linalg.norm(normal[spot, :2]), 1e-6)
        along = np.array([-out[1], out[0]])
        at = xyz[:, :2] - xyz[spot, :2]
        deep, top = random.uniform(0.2, 0.45), random.uniform(0.7, 2.5)
        is_closed = random.random() < 0.3
        if is_closed:
            deep, top = random.uniform(0.3, 0.65), random.uniform(1.6, 2.6)
        s, depth = at @ along, at @ out
        inside = (np.abs(s) < WIDEST_M / 2) & (depth > -0.1) & (depth < deep + 0.05) & (xyz[:, 2] < top)
        flat = inside & (label == WALL) & (np.abs(depth) < 0.08)
        blocked = s[inside & (np.isin(label, OPEN) | ~np.isin(label, STRUCTURE))]
        low, high = -free(-blocked, -s[flat]), free(blocked, s[flat])
        if random.random() < 0.5:
            low, high = low * random.random(), high * random.random()
        if high - low < 0.5:
            continue
        s = s - (low + high) / 2
        inside &= np.abs(s) < (high - low) / 2
        flat &= inside
        if flat.sum() >= FEWEST:
            return unit(surface, inside, flat, (spot, out, along, s), (high - low, deep, top), is_closed, random)
    return surface


def free(blocked: np.ndarray, wall: np.ndarray) -> float:
    """How far a wall is free from 0 on: to where it ends, or something stands before it."""
    ahead = np.sort(blocked[blocked > 0])
    return float(min(wall.max(initial=0), ahead[IN_THE_WAY - 1] if len(ahead) >= IN_THE_WAY else np.inf))


def recess(s: np.ndarray, z: np.ndarray, size: tuple, is_closed: bool, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """How far behind the front a camera sees the unit at each place, and where it sees the top of a board."""
    width, deep, top = size
    if is_closed:
        # Doors that stand open a little, and handles.
        door = np.floor(s / random.uniform(0.4, 0.7)).astype(np.int64)
        ajar = np.where(random.random(64) < 0.3, random.uniform(-0.03, 0.02, 64), 0)
        return ajar[door % 64], np.zeros(len(s), bool)
    across, up = random.uniform(0.3, 1.0), random.uniform(0.22, 0.42)
    column, row = np.floor(s / across).astype(np.int64), np.floor(z / up).astype(np.int64)
    part = (column * 31 + row * 7) % 97
    full = random.uniform(0.2, 1)
    kind = random.random(97)
    tall = random.uniform(0.55, 0.95, 97)[part] * up
    # Books of one compartment stand at about the same depth; what lies before them does not.
    book = np.floor(s / random.uniform(0.02, 0.06)).astype(np.int64) * 13 + part
    back = random.uniform(0, min(0.12, deep / 2), 97)[part] + random.uniform(0, random.uniform(0.02, 0.1), 211)[book % 211]
    height = z - row * up
    is_full = (kind[part] < full) & (height < tall * random.uniform(0.8, 1, 211)[book % 211])
    behind = np.where(is_full, back, deep - BOARD_M)
    edge = (height < BOARD_M) | (np.abs(s - np.round(s / across) * across) < BOARD_M / 2)
    on_board = ~is_full & ~edge & (random.random(len(s)) < 0.4) & (z < 1.5)
    return np.where(edge, 0, behind), on_board


def unit(surface: dict, inside: np.ndarray, flat: np.ndarray, frame: tuple, size: tuple, is_closed: bool,
         random: np.random.Generator) -> dict:
    """The surface with the unit instead of the points `inside`. `frame` is a point of the wall, the directions out of it and
    along it, and the place of each point along it from the unit's middle."""
    (spot, out, along, s), (width, deep, top) = frame, size
    xyz = surface["xyz"]
    new_s, new_z = spread(s[inside], xyz[inside, 2], flat[inside], (width, 0.0, top), random)
    behind, on_board = recess(new_s, new_z, size, is_closed, random)
    count = len(new_s)
    normal = np.concatenate([np.broadcast_to(out, (count, 2)), np.zeros((count, 1))], axis=1) + random.normal(0, random.uniform(0, 0.2), (count, 3))
    ahead = deep - behind
    # The camera looks down on boards.
    ahead = np.where(on_board, random.uniform(0.02, deep, count), ahead)
    new_z = np.where(on_board, np.floor(new_z / 0.05) * 0.05, new_z)
    normal[on_board] = [0, 0, 1]
    # Its sides, and its top if that is below the eyes.
    sides = random.random(count) < 0.12
    ahead = np.where(sides, random.uniform(0, deep, count), ahead)
    ends = np.sign(new_s)
    new_s = np.where(sides, ends * width / 2, new_s)
    normal[sides] = np.concatenate([ends[sides, None] * along, np.zeros((sides.sum(), 1))], axis=1)
    if top < 1.5:
        lid = random.random(count) < deep / (deep + top)
        ahead, new_z = np.where(lid, random.uniform(0, deep, count), ahead), np.where(lid, top, new_z)
        normal[lid] = [0, 0, 1]
    normal /= np.linalg.norm(normal, axis=1, keepdims=True).clip(min=1e-6)
    origin = xyz[spot, :2] - s[spot] * along - (xyz[spot, :2] @ out - (xyz[flat][:, :2] @ out).mean()) * out
    ground = origin + new_s[:, None] * along + ahead[:, None] * out
    objects = np.append(surface["objects"], np.zeros(1, surface["objects"].dtype))
    middle = origin + deep / 2 * out
    objects[-1]["centre"], objects[-1]["size"] = [*middle, top / 2], [width, deep, top]
    objects[-1]["yaw"] = np.arctan2(out[0], -out[1])
    new = {"xyz": np.concatenate([ground, new_z[:, None]], axis=1).astype(np.float32), "normal": normal.astype(np.float32),
           "label": np.full(count, CABINET if is_closed else SHELF, surface["label"].dtype),
           "instance": np.full(count, len(objects), surface["instance"].dtype)}
    rest = picked(surface, ~inside)
    return {**rest, "objects": objects, **{name: np.concatenate([rest[name], part]) for name, part in new.items()}}
