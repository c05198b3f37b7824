"""Crops in a folder for several trainings at once: made by many processes, read by each training to its own device.

    python pool.py --data surfaces/train --out /dev/shm/pool --count 8000 --workers 16

It takes up surfaces that are made meanwhile, and trainings take up crops that are made meanwhile.
"""
import argparse
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch

from samples import SHARES, Samples, surfaces_in
from voxels import POINTS, joined

# Crops of a file.
PACK = 50
# Shares that leave some samples out of each way, so that a row of the ablation can have only those.
ABLATION = {"mixed": 0.2, "shelved": 0.4, "furnished": 0.5, "heaped": 0.6, "draped": 0.4, "varied": 0.8}


def packed(sample: dict) -> dict:
    """The points of a sample in 22 bytes each: millimetres, 127ths, and boxes with 16 bits."""
    return {"xyz": (sample["xyz"] * 1000).round().to(torch.int16), "normal": (sample["normal"] * 127).round().to(torch.int8),
            "label": sample["label"], "box": sample["box"].half()}


def unpacked(sample: dict) -> dict:
    return {"xyz": sample["xyz"].float() / 1000, "normal": sample["normal"].float() / 127, "label": sample["label"],
            "box": sample["box"].float()}


def read(folder: Path, device: torch.device) -> list[dict]:
    """All crops of a pool, on the device."""
    there = lambda value: value.to(device) if isinstance(value, torch.Tensor) else value
    return [{name: there(value) for name, value in sample.items()}
            for path in sorted(folder.glob("*.crops")) for sample in torch.load(path, weights_only=False)]


def arriving(folder: Path, count: int, seed: int) -> Iterator[list[dict]]:
    """`count` crops at a time of files in a random order, and none while there is no new file. Ends never."""
    random, known, waiting = np.random.default_rng(seed), set(), []
    while True:
        if len(waiting) < count:
            unread = sorted(set(folder.glob("*.crops")) - known)
            if unread:
                path = unread[random.integers(len(unread))]
                known.add(path)
                waiting += [{name: crop[name] for name in POINTS} for crop in torch.load(path, weights_only=False)]
            else:
                time.sleep(0.005)
        yield waiting[:count]
        waiting = waiting[count:]


def drawn(pool: list[dict], chosen: np.ndarray, device: torch.device) -> dict:
    return joined([unpacked(pool[index]) for index in chosen], device)


def write(data: list[Path], out: Path, seed: int, first: int, last: int, shares: dict) -> None:
    torch.set_num_threads(1)
    samples = Samples(data, seed, last, shares)
    made = (samples[number] for number in range(first, last))
    crops = [{**packed(sample), "ways": sample["ways"], "paths": sample["paths"]} for sample in made]
    unfinished = out / f"{first:07}.part"
    torch.save(crops, unfinished)
    unfinished.rename(out / f"{first:07}.crops")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, nargs="+")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--count", type=int, default=8000)
    parser.add_argument("--workers", type=int, default=1, help="processes")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--ablation", action="store_true", help="leaves some samples out of each way, for ablate.py")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    print(f"{len(surfaces_in(arguments.data))} surfaces", flush=True)
    shares = ABLATION if arguments.ablation else SHARES
    parts = [(arguments.data, arguments.out, arguments.seed, first, min(first + PACK, arguments.count), shares)
             for first in range(0, arguments.count, PACK) if not (arguments.out / f"{first:07}.crops").exists()]
    with torch.multiprocessing.Pool(arguments.workers) as workers:
        workers.starmap(write, parts, chunksize=1)


if __name__ == "__main__":
    main()
