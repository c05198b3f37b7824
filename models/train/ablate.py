"""Trains a network without each addition, all on the same samples and for the same number of steps, and prints a table.

    python ablate.py --data surfaces/train --held-out surfaces/held-out --out ablation --minutes 8
"""
import argparse
import json
import time
from pathlib import Path

import numpy as np
import torch
from torch.utils.data import DataLoader

from network import Columns
from surfaces import SLICES, WINDOW
from train import CLASSES, CROP, SHARES, Samples, answers, class_weights, export, loss_of, rate_at, scores
from voxels import POINTS, columns, joined, varied

# Rows that leave out samples, and the rule for those that stay.
SAMPLES = {
    "without crowded homes": lambda sample: "crowded" not in sample["path"],
    "without objects of other homes": lambda sample: "furnished" not in sample["ways"],
    "without curtains": lambda sample: "draped" not in sample["ways"],
    "without two surfaces in one place": lambda sample: "mixed" not in sample["ways"],
    "without other sensors and paths": lambda sample: "varied" not in sample["ways"],
}
# Inputs of the head about a voxel's column, and about what is around it.
OCCUPIED = 2 * WINDOW + 1


class Blind(torch.nn.Module):
    """A network without some of its inputs."""

    def __init__(self, network: Columns, level: bool = False, around: bool = False):
        super().__init__()
        self.network, self.level, self.around = network, level, around

    def forward(self, grid, column, place, own):
        grid, own = grid.clone(), own.clone()
        if self.level:
            grid[:, 2 * SLICES:] = 0
            own[:, -16:] = 0
        if self.around:
            own[:, :2 * OCCUPIED + 24] = 0
            own[:, -16:] = 0
        return self.network(grid, column, place, own)


def rows() -> dict:
    """The name of a row, its network, and the weight of the boxes in its loss."""
    count = len(CLASSES)
    made = {"all": (Columns(count), True), **{name: (Columns(count), True) for name in SAMPLES}}
    made["without the level part of the normals"] = Blind(Columns(count), level=True), True
    made["without the voxels around one"] = Blind(Columns(count), around=True), True
    made["without boxes"] = Columns(count), False
    made["with wide coarse levels"] = Columns(count, [96, 160, 256, 384], [2, 2, 2, 2], 128), True
    return made


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, nargs="+")
    parser.add_argument("--held-out", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--minutes", type=float, required=True)
    parser.add_argument("--batch", type=int, default=8)
    parser.add_argument("--workers", type=int, default=3)
    parser.add_argument("--rate", type=float, default=3e-3)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    torch.multiprocessing.set_sharing_strategy("file_system")
    arguments.out.mkdir(parents=True, exist_ok=True)
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    torch.manual_seed(arguments.seed)
    parts = {}
    for name, (network, boxes) in rows().items():
        network = network.to(device, memory_format=torch.channels_last)
        parts[name] = network, torch.optim.AdamW(network.parameters(), weight_decay=0.02), boxes, []
    # Some samples are as they were simulated, so that one row can have only those.
    samples = Samples(arguments.data, arguments.seed, 10**7, {**SHARES, "varied": 0.75})
    weights = class_weights(samples).to(device)
    begun, step, progress = time.time(), 0, 0.0
    for new in DataLoader(samples, 4, collate_fn=list, num_workers=arguments.workers, prefetch_factor=6):
        progress = (time.time() - begun) / 60 / arguments.minutes
        if progress >= 1:
            break
        for row, (name, (network, optimiser, boxes, pool)) in enumerate(parts.items()):
            for sample in new:
                if SAMPLES.get(name, lambda _: True)(sample):
                    pool.append({part: sample[part].to(device) for part in POINTS})
            del pool[:-1500]
            if len(pool) < arguments.batch:
                continue
            for group in optimiser.param_groups:
                group["lr"] = arguments.rate * rate_at(progress)
            random = np.random.default_rng([arguments.seed, step, row])
            chosen = [pool[i] for i in random.integers(len(pool), size=arguments.batch)]
            points = varied(joined(chosen, device), len(chosen), CROP, torch.Generator(device).manual_seed(step))
            *inputs, labels, box = columns(points, len(chosen), (CROP, CROP))
            network.train()
            loss = loss_of(network, inputs, labels, box if boxes else torch.full_like(box, torch.nan), weights)
            optimiser.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
            optimiser.step()
        step += 1
        if step % 100 == 0:
            print(f"step {step}, {100 * progress:.0f} %", flush=True)
    held_out = sorted(arguments.held_out.glob("*.surface"))
    print(f"{step} steps of {arguments.batch} crops")
    table = {}
    for row, (name, (network, *_)) in enumerate(parts.items()):
        table[name] = scores(*answers(network, held_out))
        print(name, json.dumps(table[name]), flush=True)
        export(network.cpu(), arguments.out / f"{row}.onnx")
    (arguments.out / "table.json").write_text(json.dumps({"steps": step, "rows": table}, indent=1) + "\n")


if __name__ == "__main__":
    main()
