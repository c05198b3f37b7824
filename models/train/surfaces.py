"""Labelled surfaces as `viola surfaces` writes them, and their augmentation."""
from pathlib import Path

import numpy as np

from smear import smeared

# viola-lab, surfaces.rs.
RECORD = np.dtype([("mm", "<i2", 3), ("normal", "i1", 3), ("color", "u1", 3), ("label", "u1"), ("zero", "u1"),
                   ("instance", "<u2")])
OBJECT = np.dtype([("centre", "<f4", 3), ("size", "<f4", 3), ("yaw", "<f4")])
UNKNOWN = 255
# viola-geometry, taxonomy.rs.
CEILING = 3
# viola-reconstruct, label/columns.rs: both must agree, and so must voxels.py.
CELL_M = 0.05
LOW_M = -0.075
SLICES = 60
WINDOW = 10
# viola-reconstruct, cloud.rs: the network is asked about the means of the points in voxels of this size.
SITE_M = 0.03
AROUND = [(y, x) for y in (-1, 0, 1) for x in (-1, 0, 1) if (y, x) != (0, 0)]
VOXEL_NUMBERS = 2 * (2 * WINDOW + 1) + 3 * len(AROUND) + 2 + 2 * len(AROUND)
# Planes of the grid: of each slice occupied and the mean normal's z, of each two slices the half sum of its x and of its y.
PLANES = 3 * SLICES
STRIDE = 16


def load(path: Path) -> dict:
    """The points of a surface, in metres, and the boxes of its objects; a point's `instance` counts from 1."""
    data = path.read_bytes()
    count = int(np.frombuffer(data, "<u4", 1)[0])
    records = np.frombuffer(data, RECORD, count, offset=4)
    objects = np.frombuffer(data, OBJECT, offset=4 + count * RECORD.itemsize)
    return {
        "xyz": records["mm"].astype(np.float32) / 1000,
        "normal": records["normal"].astype(np.float32) / 127,
        "label": records["label"],
        "instance": records["instance"].astype(np.int64),
        "objects": objects,
    }


def turned(surface: dict, yaw: float, mirrored: bool = False) -> dict:
    """The surface mirrored in x and then turned about z."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    turn = np.array([[cos, sin], [-sin, cos]], np.float32)
    if mirrored:
        turn = np.array([[-1, 0], [0, 1]], np.float32) @ turn
    xyz, normal, objects = surface["xyz"].copy(), surface["normal"].copy(), surface["objects"].copy()
    xyz[:, :2], normal[:, :2] = xyz[:, :2] @ turn, normal[:, :2] @ turn
    objects["centre"][:, :2] = objects["centre"][:, :2] @ turn
    objects["yaw"] = (-objects["yaw"] if mirrored else objects["yaw"]) + yaw
    return {**surface, "xyz": xyz, "normal": normal, "objects": objects}


def main_yaw(normal: np.ndarray) -> float:
    """The direction of most walls and fronts, in -45..45 degrees."""
    x, y = normal[:, 0].astype(np.float64), normal[:, 1].astype(np.float64)
    level = x * x + y * y
    upright = level > 0.75
    x, y, level = x[upright], y[upright], level[upright]
    cos2, sin2 = (x * x - y * y) / level, 2 * x * y / level
    return float(np.arctan2((2 * cos2 * sin2).sum(), (cos2 * cos2 - sin2 * sin2).sum()) / 4)


def augmented(surface: dict, random: np.random.Generator, vary: bool = True) -> dict:
    """A copy as another sensor, path of the camera, home or pose of the floor would have given; only turned without `vary`."""
    yaw = random.integers(4) * np.pi / 2 - main_yaw(surface["normal"])
    yaw += random.uniform(0, 2 * np.pi) if random.random() < 0.15 else random.normal(0, 0.04)
    surface = turned(turned(surface, yaw), 0.0, mirrored=random.random() < 0.5)
    if not vary:
        return surface
    surface = picked(surface, seen(surface, random))
    if len(surface["xyz"]) == 0:
        return surface
    xyz = surface["xyz"]
    # Homes of other sizes, and the boxes with them.
    scale = (random.uniform(0.9, 1.1) * random.uniform(0.95, 1.05, 3)).astype(np.float32)
    objects = surface["objects"]
    objects["centre"] *= scale
    objects["size"] *= scale
    xyz *= scale
    surface = smeared(surface, random)
    xyz = surface["xyz"]
    rough(surface, random)
    # The floor's height and tilt are measured, too.
    shift = np.array([*random.uniform(0, CELL_M, 2), random.normal(0, 0.02)], np.float32)
    middle = xyz[:, :2].mean(axis=0)
    tilt = random.normal(0, 0.006, 2).astype(np.float32)
    surface["normal"][:, :2] -= surface["normal"][:, 2:] * tilt
    xyz[:, 2] += (xyz[:, :2] - middle) @ tilt
    xyz += shift
    objects["centre"] += shift
    return surface


def sites(surface: dict, random: np.random.Generator) -> dict:
    """One point for each voxel of a grid in any direction, with the means of its points: the program's, label/sites.rs."""
    xyz, yaw = surface["xyz"], random.uniform(0, np.pi / 2)
    if len(xyz) == 0:
        return surface
    cos, sin = np.cos(yaw), np.sin(yaw)
    turn = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]], np.float32)
    cell = np.floor(xyz @ turn / SITE_M + random.random(3)).astype(np.int64)
    cell -= cell.min(axis=0)
    _, of = np.unique((cell[:, 0] * (cell[:, 1].max() + 1) + cell[:, 1]) * (cell[:, 2].max() + 1) + cell[:, 2], return_inverse=True)
    count = np.bincount(of)
    total = lambda values: np.stack([np.bincount(of, values[:, axis]) for axis in range(3)], axis=1)
    normal = total(surface["normal"])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.where(length > 1e-6, normal / length.clip(min=1e-6), [0, 0, 1])
    # The label and object of any of its points: the last one in a random order.
    one = np.zeros(len(count), np.int64)
    order = random.permutation(len(of))
    one[of[order]] = order
    return {**surface, "xyz": (total(xyz) / count[:, None]).astype(np.float32), "normal": normal.astype(np.float32),
            "label": surface["label"][one], "instance": surface["instance"][one]}


def picked(surface: dict, kept: np.ndarray) -> dict:
    return {**surface, **{name: surface[name][kept] for name in ("xyz", "normal", "label", "instance")}}


def seen(surface: dict, random: np.random.Generator) -> np.ndarray:
    """Points that a camera with less range, another path, other gaps or a lower view would have measured."""
    xyz, instance = surface["xyz"], surface["instance"]
    kept = random.random(len(xyz)) < random.uniform(0.4, 1.0)
    for _ in range(random.integers(0, 6)):
        hole = xyz[random.integers(len(xyz))]
        kept &= np.linalg.norm(xyz - hole, axis=1) > random.uniform(0.1, 0.5)
    if random.random() < 0.3:
        # Dark, shiny or transparent objects give no depth, or only in parts.
        gone = random.random(instance.max(initial=0) + 1) < random.uniform(0, 0.3)
        part = np.floor(xyz / random.uniform(0.15, 0.5)).astype(np.int64) @ [73856093, 19349663, 83492791]
        kept &= ~gone[instance] | (instance == 0) | (part % 4 == 0)
    if random.random() < 0.3:
        # A camera that looks down sees no upper part of the room.
        kept &= xyz[:, 2] < random.uniform(0.8, 2.4)
    elif random.random() < 0.2:
        kept &= ~np.isin(surface["label"], CEILING)
    if random.random() < 0.2:
        # A short path, or a short range.
        eye = xyz[random.integers(len(xyz), size=random.integers(1, 4)), :2]
        range_m = random.uniform(1.5, 3.5)
        kept &= (np.linalg.norm(xyz[:, None, :2] - eye, axis=2) < range_m).any(axis=1)
    return kept


def rough(surface: dict, random: np.random.Generator) -> None:
    """Noise of the depth along the normal and of the normals, waves of the surface, and points beside it."""
    xyz, normal, count = surface["xyz"], surface["normal"], len(surface["xyz"])
    noise = random.normal(0, random.uniform(0, 0.008), count)
    if random.random() < 0.5:
        # Drift of the poses and distortion of the camera bend surfaces over decimetres.
        waves = random.normal(0, 1 / random.uniform(0.3, 1.5), (4, 3))
        phase = random.uniform(0, 2 * np.pi, 4)
        noise += random.uniform(0, 0.015) * np.sin(xyz @ waves.T + phase).mean(axis=1)
    xyz += (normal * noise[:, None]).astype(np.float32)
    if random.random() < 0.5:
        normal += random.normal(0, random.uniform(0, 0.2), normal.shape).astype(np.float32)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True).clip(min=1e-6)
    if random.random() < 0.3:
        # Mixed pixels between an object and what is behind it.
        stray = random.random(count) < random.uniform(0, 0.03)
        xyz[stray] += random.normal(0, 0.1, (stray.sum(), 3)).astype(np.float32)
        surface["label"] = np.where(stray, UNKNOWN, surface["label"]).astype(np.uint8)


def mixed(one: dict, other: dict) -> dict:
    """Two surfaces in one place (Mix3D, Nekrasov et al., 2021): shapes must tell the classes without their surroundings."""
    offset = np.where(other["instance"] > 0, len(one["objects"]), 0)
    middle = [np.append(np.median(s["xyz"][:, :2], axis=0), 0).astype(np.float32) for s in (one, other)]
    objects = other["objects"].copy()
    objects["centre"] += middle[0] - middle[1]
    join = lambda name: np.concatenate([one[name], other[name]])
    return {"xyz": np.concatenate([one["xyz"], other["xyz"] - middle[1] + middle[0]]), "normal": join("normal"),
            "label": join("label"), "instance": np.concatenate([one["instance"], other["instance"] + offset]),
            "objects": np.concatenate([one["objects"], objects])}


def boxes(surface: dict, instance: np.ndarray, xyz: np.ndarray) -> np.ndarray:
    """Offset to the centre and size along the axes of the object of each point; NaN for points without."""
    objects = surface["objects"]
    cos, sin = np.abs(np.cos(objects["yaw"])), np.abs(np.sin(objects["yaw"]))
    width, depth, height = objects["size"].T
    size = np.stack([cos * width + sin * depth, sin * width + cos * depth, height], axis=1)
    out = np.full((len(instance), 6), np.nan, np.float32)
    has = (instance > 0) & (instance <= len(objects))
    index = instance[has] - 1
    out[has, :3], out[has, 3:] = objects["centre"][index] - xyz[has], size[index]
    return out
