"""Heaps on level surfaces and bulges before upright ones: bedding, cushions, clothes, bags, and what lies on tables and hangs on walls."""
import numpy as np

from surfaces import UNKNOWN

# viola-geometry, taxonomy.rs.
OTHER, BED, SOFA, CHAIR, PILLOW, CLOTHES = 0, 7, 8, 9, 27, 28
SOFT = [BED, SOFA, CHAIR, PILLOW, CLOTHES]
# Structure, and the fronts of furniture: things hang before it, and are no part of it.
BEFORE = [2, 4, 5]
# Points of one surface: their height over its plane, and the cosine between the normals.
FLAT_M, ALIKE = 0.05, 0.75
# Things that are less thick keep the class below them: covers, cloths, papers.
THIN_M = 0.03
FEWEST = 12


def bump(u: np.ndarray, v: np.ndarray, height_m: float, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Height of a heap at places whose distance from its middle is 1 at its border, and the slopes along both axes."""
    flat, soft = random.uniform(1.5, 6), random.uniform(1, 2)
    r2 = (u * u + v * v).clip(1e-6, 1)
    rim = 1 - r2 ** (flat / 2)
    high = rim ** soft
    steep = -soft * rim.clip(1e-3) ** (soft - 1) * flat * r2 ** (flat / 2 - 1)
    # Folds and single things in it.
    rough, wave = random.uniform(0, 0.35), random.normal(0, 4, 2)
    phase = u * wave[0] + v * wave[1] + random.uniform(0, 6.28)
    folds, slope = 1 + rough * np.sin(phase), rough * np.cos(phase)
    along = lambda at, k: height_m * (steep * at * folds + high * slope * wave[k])
    return height_m * high * folds, along(u, 0), along(v, 1)


def heap(surface: dict, spot: int, random: np.random.Generator) -> dict:
    """The surface with one heap on it, whose middle is a point of it."""
    xyz, normal, label = surface["xyz"], surface["normal"], surface["label"]
    out, own = normal[spot], label[spot]
    if own == UNKNOWN or 0.35 < abs(out[2]) < 0.8 or out[2] < -0.35 or xyz[spot, 2] > 2.1:
        return surface
    is_level = out[2] > 0.8
    out = np.array([0, 0, 1.0]) if is_level else np.array([out[0], out[1], 0]) / np.hypot(out[0], out[1])
    yaw = random.uniform(0, 2 * np.pi)
    side = np.array([np.cos(yaw), np.sin(yaw), 0]) if is_level else np.array([-out[1], out[0], 0])
    other = np.cross(out, side)
    if own in SOFT:
        sides_m, height_m = random.uniform(0.1, 0.5, 2), random.uniform(0.02, 0.18)
    else:
        sides_m, height_m = random.uniform(0.05, 0.35) * random.uniform(0.5, 1.5, 2), random.uniform(0.02, 0.35)
    if not is_level:
        height_m *= 0.6 if own in BEFORE else 0.3
    at = xyz - xyz[spot]
    over, u, v = at @ out, at @ side / sides_m[0], at @ other / sides_m[1]
    here = np.flatnonzero((np.abs(over) < FLAT_M) & (u * u + v * v < 1) & (normal @ out > ALIKE))
    if len(here) < FEWEST:
        return surface
    # A steep flank has more surface than the place below it.
    times = 1 + min(3, int(height_m / sides_m.min()))
    which = np.repeat(here, times)
    new_u = u[which] + random.normal(0, 0.02, len(which)) / sides_m[0]
    new_v = v[which] + random.normal(0, 0.02, len(which)) / sides_m[1]
    kept = new_u * new_u + new_v * new_v < 1
    which, new_u, new_v = which[kept], new_u[kept], new_v[kept]
    high, slope_u, slope_v = bump(new_u, new_v, height_m, random)
    moved = (new_u - u[which])[:, None] * sides_m[0] * side + (new_v - v[which])[:, None] * sides_m[1] * other
    turned = out - (slope_u / sides_m[0])[:, None] * side - (slope_v / sides_m[1])[:, None] * other
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    # What is soft, and the front of furniture, is still what it is.
    stays = own in SOFT or not (is_level or own in BEFORE)
    covered = np.zeros(len(which), bool) if stays else high > THIN_M
    keep = np.ones(len(xyz), bool)
    keep[here] = False
    new = {"xyz": (xyz[which] + moved + high[:, None] * out).astype(np.float32), "normal": turned.astype(np.float32),
           "label": np.where(covered, OTHER, label[which]).astype(label.dtype),
           "instance": np.where(covered, 0, surface["instance"][which])}
    return {**surface, **{name: np.concatenate([surface[name][keep], part]) for name, part in new.items()}}


def heaped(surface: dict, random: np.random.Generator) -> dict:
    """The surface with some heaps, more on soft furniture and on what stands about than on floors and walls."""
    if len(surface["xyz"]) == 0:
        return surface
    for _ in range(random.integers(4, 60)):
        spots = random.integers(len(surface["xyz"]), size=4)
        # Floors, walls, ceilings and openings have the most points.
        spots = sorted(spots, key=lambda spot: 1 <= surface["label"][spot] <= 5)
        surface = heap(surface, spots[0], random)
    return surface
