"""Puts objects of one surface into another: more furniture in more places than the simulated homes have."""
import numpy as np

from surfaces import picked

# viola-geometry, taxonomy.rs.
FLOOR, WALL = 1, 2
STRUCTURE = [1, 2, 3, 4, 5, 6]
PERSON, ANIMAL, RUG, DOOR, STAIRS = 33, 34, 26, 4, 6
NOT_MOVED = [PERSON, ANIMAL, RUG, DOOR, STAIRS]
# Chairs, tables and desks: the floor below them is seen, and they also stand free.
WITH_LEGS = [9, 10, 11]
TRIES = 5
# Fewest points of an object.
FEWEST = 150
# Points that are enough for a room.
MOST_POINTS = 70_000
# Surface of other objects that may be in the place of a new one, in points.
MOST_IN_THE_WAY = 40


def near(xyz: np.ndarray, centre: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Indices of the points about an object; the rest need no look."""
    reach = np.hypot(size[0], size[1]) / 2 + 0.4
    return np.flatnonzero((np.abs(xyz[:, 0] - centre[0]) < reach) & (np.abs(xyz[:, 1] - centre[1]) < reach))


def local(xyz: np.ndarray, centre: np.ndarray, yaw: float) -> np.ndarray:
    """Positions in the frame of an object: x along its width, its back towards +y."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    at = xyz - centre
    return np.stack([cos * at[:, 0] + sin * at[:, 1], cos * at[:, 1] - sin * at[:, 0], at[:, 2]], axis=1)


def taken(donor: dict, index: int) -> dict | None:
    """An object of a surface with what stands on it, in its own frame; None for structure, people, and little surface."""
    box = donor["objects"][index]
    about = near(donor["xyz"], box["centre"], box["size"])
    label, instance = donor["label"][about], donor["instance"][about]
    classes = label[instance == index + 1]
    if classes[0] in NOT_MOVED:
        return None
    at = local(donor["xyz"][about], box["centre"], box["yaw"])
    half = box["size"] / 2
    inside = (np.abs(at[:, :2]) < half[:2] + 0.04).all(axis=1) & (at[:, 2] > -half[2] - 0.02) & (at[:, 2] < half[2] + 0.45)
    inside &= ~np.isin(label, STRUCTURE) & ((instance == index + 1) | (instance == 0))
    cos, sin = np.cos(box["yaw"]), np.sin(box["yaw"])
    normal = donor["normal"][about[inside]] @ np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]], np.float32)
    # The height above the floor stays.
    return {"xyz": at[inside] + [0, 0, box["centre"][2]], "normal": normal, "label": label[inside],
            "own": instance[inside] != 0, "size": box["size"], "up": box["centre"][2], "class": int(classes[0])}


def place(surface: dict, thing: dict, random: np.random.Generator) -> tuple | None:
    """A place for an object: at a wall, or for things with legs also on free floor. None if none was found."""
    xyz, normal, label = surface["xyz"], surface["normal"], surface["label"]
    width, depth, height = thing["size"]
    at_wall = thing["class"] not in WITH_LEGS or random.random() < 0.4
    if at_wall:
        spots = np.flatnonzero((label == WALL) & (np.abs(normal[:, 2]) < 0.2) & (xyz[:, 2] > 0.2) & (xyz[:, 2] < 1.8))
    else:
        spots = np.flatnonzero(label == FLOOR)
    if len(spots) == 0:
        return None
    solid = ~np.isin(label, STRUCTURE)
    for _ in range(TRIES):
        spot = random.choice(spots)
        centre = xyz[spot].copy()
        centre[2] = thing["up"]
        yaw = random.uniform(-np.pi, np.pi)
        if at_wall:
            out = normal[spot, :2] / max(np.linalg.norm(normal[spot, :2]), 1e-6)
            yaw = np.arctan2(out[0], -out[1]) + random.normal(0, 0.03)
            centre[:2] += out * (depth / 2 + abs(random.normal(0.02, 0.04)))
        about = near(xyz, centre, thing["size"])
        at = local(xyz[about], centre, yaw)
        here = (np.abs(at) < np.array([width, depth, height]) / 2 + 0.03).all(axis=1)
        if (here & solid[about]).sum() <= MOST_IN_THE_WAY:
            return centre, yaw, about, at, here
    return None


def with_thing(surface: dict, thing: dict, random: np.random.Generator) -> dict:
    found = place(surface, thing, random)
    if found is None:
        return surface
    centre, yaw, about, at, here = found
    label, (width, depth, height) = surface["label"][about], thing["size"]
    beside = np.abs(at[:, 0]) < width / 2 - 0.03
    # The wall behind it is hidden, and the floor below it unless it has legs.
    hidden = here.copy()
    hidden |= beside & (at[:, 1] > 0) & (at[:, 1] < depth / 2 + 0.35) & (np.abs(at[:, 2]) < height / 2)
    if thing["class"] in WITH_LEGS:
        hidden &= label != FLOOR
        hidden &= (label != WALL) | (random.random(len(hidden)) < 0.5)
    elif random.random() < 0.8:
        hidden |= beside & (np.abs(at[:, 1]) < depth / 2) & (label == FLOOR)
    seen = np.ones(len(surface["xyz"]), bool)
    seen[about[hidden]] = False
    kept = picked(surface, seen)
    cos, sin = np.cos(yaw), np.sin(yaw)
    turn = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]], np.float32)
    objects = np.append(surface["objects"], np.zeros(1, surface["objects"].dtype))
    objects[-1]["centre"], objects[-1]["size"], objects[-1]["yaw"] = centre, thing["size"], yaw
    moved = (thing["xyz"] @ turn + [centre[0], centre[1], 0]).astype(np.float32)
    instance = np.where(thing["own"], len(objects), 0)
    new = {"xyz": moved, "normal": (thing["normal"] @ turn).astype(np.float32), "label": thing["label"],
           "instance": instance}
    return {**kept, "objects": objects, **{name: np.concatenate([kept[name], part]) for name, part in new.items()}}


def furnished(surface: dict, donors: list[dict], random: np.random.Generator) -> dict:
    """The surface with objects of the donors, as many as find a place; of large surfaces a part of the points."""
    if len(surface["xyz"]) > MOST_POINTS:
        surface = picked(surface, random.random(len(surface["xyz"])) < MOST_POINTS / len(surface["xyz"]))
    for donor in donors:
        seen = np.bincount(donor["instance"], minlength=len(donor["objects"]) + 1)[1:]
        known = np.flatnonzero(seen >= FEWEST)
        for index in random.permutation(known)[:random.integers(1, 16)]:
            thing = taken(donor, index)
            if thing is not None:
                surface = with_thing(surface, thing, random)
    return surface
