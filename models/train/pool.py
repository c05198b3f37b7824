"""Crops in memory for several trainings at once: made by many processes, read by each training to its own device.

    python pool.py --data surfaces/train --out /dev/shm/pool --count 8000 --workers 16
"""
import argparse
from pathlib import Path

import numpy as np
import torch

from train import Samples, surfaces_in
from voxels import joined

# Crops of a file.
PACK = 50
# Shares that leave some samples out of each way, so that a row of the ablation can have only those.
SHARES = {"mixed": 0.2, "furnished": 0.5, "draped": 0.4, "varied": 0.8}


def packed(sample: dict) -> dict:
    """A sample in 22 bytes a point: millimetres, 127ths, and boxes with 16 bits."""
    return {"xyz": (sample["xyz"] * 1000).round().to(torch.int16), "normal": (sample["normal"] * 127).round().to(torch.int8),
            "label": sample["label"], "box": sample["box"].half(), "ways": sample["ways"], "paths": sample["paths"]}


def unpacked(sample: dict) -> dict:
    return {"xyz": sample["xyz"].float() / 1000, "normal": sample["normal"].float() / 127, "label": sample["label"],
            "box": sample["box"].float()}


def read(folder: Path, device: torch.device) -> list[dict]:
    """All crops of a pool, on the device."""
    there = lambda value: value.to(device) if isinstance(value, torch.Tensor) else value
    return [{name: there(value) for name, value in sample.items()}
            for path in sorted(folder.glob("*.crops")) for sample in torch.load(path, weights_only=False)]


def drawn(pool: list[dict], chosen: np.ndarray, device: torch.device) -> dict:
    return joined([unpacked(pool[index]) for index in chosen], device)


def write(data: list[Path], out: Path, seed: int, first: int, last: int) -> None:
    torch.set_num_threads(1)
    samples = Samples(data, seed, last, SHARES)
    crops = [packed(samples[number]) for number in range(first, last)]
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
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    print(f"{len(surfaces_in(arguments.data))} surfaces", flush=True)
    parts = [(arguments.data, arguments.out, arguments.seed, first, min(first + PACK, arguments.count))
             for first in range(0, arguments.count, PACK) if not (arguments.out / f"{first:07}.crops").exists()]
    with torch.multiprocessing.Pool(arguments.workers) as workers:
        workers.starmap(write, parts, chunksize=1)


if __name__ == "__main__":
    main()
