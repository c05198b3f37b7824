"""What real sensors do to a surface and simulated ones do not: edges are rounded, and drifting poses double it."""
import itertools

import numpy as np

AROUND = np.array(list(itertools.product((-1, 0, 1), repeat=3)), np.int64)
# Keys of cells: along each axis fewer than this many.
SPAN = 1 << 20


def rounded(surface: dict, radius_m: float, strength: float) -> None:
    """Turns normals to the mean of those around, and moves points along theirs to the middle: depth maps are filtered."""
    xyz, normal = surface["xyz"], surface["normal"]
    cell = np.floor((xyz - xyz.min(axis=0)) / radius_m).astype(np.int64) + 1
    weights = np.array([SPAN * SPAN, SPAN, 1])
    cells, of = np.unique(cell @ weights, return_inverse=True)
    count = np.bincount(of)
    mean = lambda values: np.stack([np.bincount(of, values[:, axis]) for axis in range(3)], 1) / count[:, None]
    middles, normals = mean(xyz), mean(normal)
    total, centre, direction = np.zeros(len(xyz)), np.zeros((len(xyz), 3)), np.zeros((len(xyz), 3))
    for step in AROUND:
        key = (cell + step) @ weights
        place = np.searchsorted(cells, key).clip(max=len(cells) - 1)
        # The other side of a board is no neighbour, the other side of an edge is one.
        alike = (np.einsum("ij,ij->i", normal, normals[place]) + 0.5).clip(0, 1)
        weight = np.where(cells[place] == key, count[place] * alike, 0) / (1 + (step ** 2).sum())
        total += weight
        centre += weight[:, None] * middles[place]
        direction += weight[:, None] * normals[place]
    has = total > 0
    share = strength * has[:, None]
    total = np.where(has, total, 1)[:, None]
    offset = np.einsum("ij,ij->i", centre / total - xyz, normal)[:, None]
    xyz += (share * offset * normal).astype(np.float32)
    length = np.linalg.norm(direction, axis=1, keepdims=True)
    blend = (1 - share) * normal + share * np.where(length > 1e-6, direction / length.clip(min=1e-6), normal)
    normal[:] = blend / np.linalg.norm(blend, axis=1, keepdims=True).clip(min=1e-6)


def doubled(surface: dict, random: np.random.Generator) -> dict:
    """A part of the surface a second time, some centimetres beside it: a place seen twice with a drifted pose."""
    xyz = surface["xyz"]
    centre = xyz[random.integers(len(xyz))]
    again = np.linalg.norm(xyz[:, :2] - centre[:2], axis=1) < random.uniform(0.7, 4)
    again &= random.random(len(xyz)) < random.uniform(0.3, 1)
    yaw = random.normal(0, 0.02)
    turn = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]], np.float32)
    copy = {name: surface[name][again].copy() for name in ("xyz", "normal", "label", "instance")}
    copy["xyz"][:, :2] = (copy["xyz"][:, :2] - centre[:2]) @ turn + centre[:2]
    copy["normal"][:, :2] = copy["normal"][:, :2] @ turn
    copy["xyz"] += random.normal(0, random.uniform(0.01, 0.05), 3).astype(np.float32) * np.float32([1, 1, 0.5])
    return {**surface, **{name: np.concatenate([surface[name], copy[name]]) for name in copy}}


def wavy(surface: dict, random: np.random.Generator) -> None:
    """Waves of decimetres with their normals, stronger in some places: the noise of depth has the size of the sensor's patches."""
    xyz, normal = surface["xyz"], surface["normal"]
    count, slope = 8, random.uniform(0, 0.7)
    wavelength_m = np.exp(random.uniform(np.log(0.12), np.log(0.8), count))
    toward = random.normal(size=(count, 3))
    waves = toward / np.linalg.norm(toward, axis=1, keepdims=True) * (2 * np.pi / wavelength_m)[:, None]
    # Its surface stays within 3 or 4 cm.
    height_m = np.minimum(slope * wavelength_m / (2 * np.pi), 0.018) * np.sqrt(2 / count)
    phase = xyz @ waves.T + random.uniform(0, 2 * np.pi, count)
    slow = random.normal(0, 1.5, (2, 3))
    where = 0.5 + 0.5 * np.sin(xyz @ slow.T + random.uniform(0, 2 * np.pi, 2)).mean(axis=1, keepdims=True)
    xyz += (normal * where * (np.sin(phase) @ height_m)[:, None]).astype(np.float32)
    rise = where * ((np.cos(phase) * height_m) @ waves)
    normal -= (rise - np.einsum("ij,ij->i", rise, normal)[:, None] * normal).astype(np.float32)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True).clip(min=1e-6)


def smeared(surface: dict, random: np.random.Generator) -> dict:
    """A surface as another sensor and another tracker would have given it; as it was in some samples."""
    for _ in range(random.choice([0, 0, 1, 2])):
        surface = doubled(surface, random)
    if random.random() < 0.6:
        rounded(surface, random.uniform(0.03, 0.12), random.uniform(0.3, 1))
    if random.random() < 0.8:
        wavy(surface, random)
    return surface
