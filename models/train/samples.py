"""Crops of augmented surfaces, as the network learns from them."""
from pathlib import Path

import numpy as np
from torch.utils.data import Dataset

from drape import draped
from furnish import furnished
from heaps import heaped
from shelves import shelved
from surfaces import UNKNOWN, augmented, load, mixed, sites
from voxels import cropped

CROP = 128
# Fractions of the samples: two surfaces in one place, a unit before a wall, objects of others, heaps, a curtain before a wall, another sensor or path.
SHARES = {"mixed": 0.15, "shelved": 0.5, "furnished": 0.5, "heaped": 0.6, "draped": 0.4, "varied": 1.0}
# Fewest labelled points of a sample.
FEWEST = 1000
# Samples after which a worker looks for new surfaces.
LOOK = 64


class Samples(Dataset):
    """Crops of augmented surfaces. A sample depends on its number and the surfaces there are, so that a resumed run is the same.

    `shares` are the fractions of the samples that are made in each way; a sample's `ways` tells its own, and its `paths` the
    names of all surfaces that it was made of.
    """

    def __init__(self, folders: list[Path], seed: int, count: int, shares: dict = SHARES):
        self.folders, self.seed, self.count, self.shares = folders, seed, count, shares
        self.paths, self.asked = surfaces_in(folders), 0

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, number: int) -> dict:
        self.asked += 1
        if self.asked % LOOK == 0:
            self.paths = surfaces_in(self.folders)
        random = np.random.default_rng([self.seed, number])
        while True:
            ways = {way for way, share in self.shares.items() if random.random() < share}
            sample = sample_of(self.paths, ways, random)
            if sample is not None and (sample["label"] != UNKNOWN).sum() > FEWEST:
                return {**sample, "ways": ways}


def sample_of(paths: list[Path], ways: set[str], random: np.random.Generator) -> dict | None:
    names = []

    def drawn() -> dict:
        path = paths[random.integers(len(paths))]
        names.append(path.name)
        return load(path)

    surface = drawn()
    if "shelved" in ways:
        surface = shelved(surface, random)
    if "furnished" in ways:
        surface = furnished(surface, [drawn(), drawn()], random)
    if "heaped" in ways:
        surface = heaped(surface, random)
    if "draped" in ways:
        surface = draped(surface, random)
    surfaces = [surface, drawn()] if "mixed" in ways else [surface]
    surfaces = [augmented(surface, random, "varied" in ways) for surface in surfaces if len(surface["xyz"]) > 500]
    surfaces = [surface for surface in surfaces if len(surface["xyz"]) > 0]
    if not surfaces:
        return None
    surface = sites(surfaces[0] if len(surfaces) == 1 else mixed(*surfaces), random)
    return {**cropped(surface, CROP, random), "paths": names}


def surfaces_in(folders: list[Path]) -> list[Path]:
    return sorted(path for folder in folders for path in folder.glob("*.surface"))
