"""Trains a network without each addition, side by side in processes of their own, and prints a table.

    python ablate.py --pool /dev/shm/pool --held-out surfaces/held-out --out ablation --minutes 5
"""
import argparse
import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import torch

from network import Columns
from pool import drawn, read
from samples import CROP, surfaces_in
from surfaces import AROUND, SLICES
from train import CLASSES, class_weights, finish, halves, loss_of, rate_at
from voxels import columns, varied

# Rows that leave out samples, and the rule for those that stay.
SAMPLES = {
    "without crowded homes": lambda sample: not any("crowded" in name for name in sample["paths"]),
    "without objects of other homes": lambda sample: "furnished" not in sample["ways"],
    "without two surfaces in one place": lambda sample: "mixed" not in sample["ways"],
    "without units before walls": lambda sample: "shelved" not in sample["ways"],
    "without heaps": lambda sample: "heaped" not in sample["ways"],
    "without curtains": lambda sample: "draped" not in sample["ways"],
    "without other sensors and paths": lambda sample: "varied" not in sample["ways"],
}
# Level parts of the normal of a voxel and of the columns beside it, the last of its numbers.
LEVEL = 2 + 2 * len(AROUND)


class Blind(Columns):
    """A network without the level parts of normals."""

    def forward(self, grid, column, place, own):
        grid, own = grid.clone(), own.clone()
        grid[:, 2 * SLICES:] = 0
        own[:, -LEVEL:] = 0
        return super().forward(grid, column, place, own)


NETWORKS = {"without the level part of the normals": Blind}
ROWS = ["all", *SAMPLES, *NETWORKS]


def train(name: str, arguments: argparse.Namespace) -> None:
    """One row: the same crops, seed and time for each."""
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    torch.set_num_threads(1)
    torch.manual_seed(arguments.seed)
    network = NETWORKS.get(name, Columns)(len(CLASSES)).to(device, memory_format=torch.channels_last)
    pool = [sample for sample in read(arguments.pool, device) if SAMPLES.get(name, lambda _: True)(sample)]
    weights = class_weights([{"label": sample["label"].cpu()} for sample in pool]).to(device)
    optimiser = torch.optim.AdamW(network.parameters(), weight_decay=0.02, fused=device.type == "cuda")
    begun, step, progress = time.time(), 0, 0.0
    while progress < 1:
        for group in optimiser.param_groups:
            group["lr"] = arguments.rate * rate_at(progress)
        random = np.random.default_rng([arguments.seed, step])
        points = drawn(pool, random.integers(len(pool), size=arguments.batch), device)
        points = varied(points, arguments.batch, CROP, torch.Generator(device).manual_seed(step))
        *inputs, labels, box = columns(points, arguments.batch, (CROP, CROP))
        network.train()
        loss = loss_of(network, inputs, labels, box, weights)
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimiser.step()
        step += 1
        progress = (time.time() - begun) / 60 / arguments.minutes
        if step % 250 == 0:
            print(f"{name}: step {step}, loss {loss.item():.3f}, {100 * progress:.0f} %", flush=True)
    torch.save(network.state_dict(), arguments.out / f"{ROWS.index(name)}.weights")
    told = {"row": name, "crops": len(pool), "seed": arguments.seed, "steps": step}
    finish(network, surfaces_in([arguments.held_out]), arguments.out / f"{ROWS.index(name)}.onnx", told)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pool", type=Path, required=True, help="folder that pool.py made")
    parser.add_argument("--held-out", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--minutes", type=float, required=True)
    parser.add_argument("--batch", type=int, default=8)
    parser.add_argument("--rate", type=float, default=3e-3)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--row", choices=ROWS, help="only this one, in this process")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    halves(surfaces_in([arguments.held_out]))  # Fails now, not after the trainings.
    if arguments.row:
        return train(arguments.row, arguments)
    rows = [subprocess.Popen([sys.executable, *sys.argv, "--row", row]) for row in ROWS]
    if any([row.wait() for row in rows]):
        raise SystemExit("a row failed")
    for path in sorted(arguments.out.glob("*.json")):
        row = json.loads(path.read_text())
        print(f"| {row['row']} | {row['steps']} | {100 * row['accuracy']:.1f} % | {row['mean_iou']:.3f} | "
              f"{row['calibration_error']:.3f} |")


if __name__ == "__main__":
    main()
