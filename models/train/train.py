"""Trains the network that labels surfaces.

    viola surfaces --seeds 10000..10400 --out surfaces/train
    viola surfaces --seeds 14000..14040 --out surfaces/held-out
    python train.py --data surfaces/train --held-out surfaces/held-out --out columns.onnx

Resumes from the checkpoint beside `--out`. Real recordings take no part.
"""
import argparse
import json
import time
from pathlib import Path

import numpy as np
import torch
from torch.nn import functional

from network import Columns
from surfaces import UNKNOWN, augmented, columns, load

# viola-geometry, taxonomy.rs.
CLASSES = ["other", "floor", "wall", "ceiling", "door", "window", "stairs", "bed", "sofa", "chair", "table", "desk",
           "cabinet", "shelf", "counter", "refrigerator", "stove", "washing_machine", "television", "lamp", "radiator",
           "toilet", "sink", "bathtub", "shower", "curtain", "rug", "pillow", "clothes", "mirror", "picture", "plant",
           "box", "person", "animal"]
# viola-lab, evaluate/labels/coarse.rs.
COARSE = ["floor", "wall", "ceiling", "bed", "sofa", "chair", "table", "cabinet", "door", "window", "other"]
COARSE_OF = torch.tensor([COARSE.index({"shelf": "cabinet", "curtain": "window"}.get(name, name))
                          if {"shelf": "cabinet", "curtain": "window"}.get(name, name) in COARSE else 10
                          for name in CLASSES])
CROP = 128


def batch(samples: list[dict]) -> tuple:
    """Joins samples of one grid size."""
    cells = samples[0]["grid"].shape[1] * samples[0]["grid"].shape[2]
    join = lambda name: torch.from_numpy(np.concatenate([sample[name] for sample in samples]))
    column = torch.from_numpy(np.concatenate([s["column"] + i * cells for i, s in enumerate(samples)]))
    grid = torch.from_numpy(np.stack([sample["grid"] for sample in samples]))
    return grid, column, join("slice"), join("window"), join("label")


def lovasz(probabilities: torch.Tensor, labels: torch.Tensor) -> torch.Tensor:
    """Lovasz-softmax over the classes that occur (Berman et al., 2018)."""
    losses = []
    for index in labels.unique():
        there = (labels == index).float()
        errors, order = (there - probabilities[:, index]).abs().sort(descending=True)
        there = there[order]
        total = there.sum()
        jaccard = 1 - (total - there.cumsum(0)) / (total + (1 - there).cumsum(0))
        jaccard[1:] = jaccard[1:] - jaccard[:-1].clone()
        losses.append(errors @ jaccard)
    return torch.stack(losses).mean()


def class_weights(surfaces: list[dict]) -> torch.Tensor:
    counts = sum(np.bincount(s["label"], minlength=256)[:len(CLASSES)] for s in surfaces)
    weights = 1 / np.sqrt(counts.clip(min=counts.sum() * 1e-4) / counts.sum())
    return torch.tensor(weights / weights[counts > 0].mean(), dtype=torch.float32)


@torch.no_grad()
def logits_of(network: Columns, surfaces: list[dict]) -> tuple[torch.Tensor, torch.Tensor]:
    network.eval()
    all_logits, all_labels = [], []
    for surface in surfaces:
        sample = columns(surface)
        if sample is None:
            continue
        *inputs, labels = batch([sample])
        known = labels != UNKNOWN
        all_logits.append(network(*inputs)[known])
        all_labels.append(labels[known])
    return torch.cat(all_logits), torch.cat(all_labels)


def scores(logits: torch.Tensor, labels: torch.Tensor) -> dict:
    """Accuracy and mean IoU over the coarse classes, and the expected calibration error of all classes."""
    said, truth = COARSE_OF[logits.argmax(1)], COARSE_OF[labels]
    confusion = torch.zeros(len(COARSE), len(COARSE))
    confusion.index_put_((truth, said), torch.ones(len(said)), accumulate=True)
    union = confusion.sum(0) + confusion.sum(1) - confusion.diag()
    iou = confusion.diag() / union.clamp(min=1)
    sure, best = logits.softmax(1).max(1)
    right = (best == labels).float()
    bins = (sure * 15).long().clamp(max=14)
    error = sum(abs((right[bins == b] - sure[bins == b]).sum().item()) for b in range(15)) / len(labels)
    return {"accuracy": (said == truth).float().mean().item(), "mean_iou": iou[confusion.sum(1) > 0].mean().item(),
            "calibration_error": error, "iou": dict(zip(COARSE, iou.tolist()))}


def fitted_temperature(logits: torch.Tensor, labels: torch.Tensor) -> float:
    """The temperature with the least cross-entropy, from a grid of one percent steps."""
    grid = np.exp(np.linspace(np.log(0.3), np.log(4.0), 260))
    return float(min(grid, key=lambda t: functional.cross_entropy(logits / t, labels).item()))


def export(network: Columns, path: Path) -> None:
    network.eval()
    sample = (torch.zeros(1, 104, 32, 48), torch.zeros(7, dtype=torch.int64), torch.zeros(7, dtype=torch.int64),
              torch.zeros(7, 42))
    names = ["grid", "column", "slice", "window"]
    axes = {"grid": {2: "height", 3: "width"}, **{name: {0: "voxels"} for name in names[1:]}, "logits": {0: "voxels"}}
    torch.onnx.export(network, sample, str(path), input_names=names, output_names=["logits"], dynamic_axes=axes,
                      opset_version=17, dynamo=False)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--held-out", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--steps", type=int, default=3000)
    parser.add_argument("--batch", type=int, default=8)
    parser.add_argument("--rate", type=float, default=2e-3)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    torch.manual_seed(arguments.seed)
    surfaces = [load(path) for path in sorted(arguments.data.glob("*.surface"))]
    held_out = [load(path) for path in sorted(arguments.held_out.glob("*.surface"))]
    network = Columns(len(CLASSES))
    print(f"{len(surfaces)} surfaces, {len(held_out)} held out,",
          f"{sum(p.numel() for p in network.parameters())} parameters", flush=True)
    optimiser = torch.optim.AdamW(network.parameters(), arguments.rate, weight_decay=0.02)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, arguments.rate, arguments.steps, pct_start=0.1)
    checkpoint, first = arguments.out.with_suffix(".checkpoint"), 0
    if checkpoint.exists():
        state = torch.load(checkpoint)
        first = state["step"]
        network.load_state_dict(state["network"])
        optimiser.load_state_dict(state["optimiser"])
        schedule.load_state_dict(state["schedule"])
    weights = class_weights(surfaces)
    begun, shown = time.time(), []
    for step in range(first, arguments.steps):
        # A step's samples depend on its number only, so that a resumed run is the same.
        random = np.random.default_rng([arguments.seed, step])
        samples = []
        while len(samples) < arguments.batch:
            surface = augmented(surfaces[random.integers(len(surfaces))], random)
            sample = columns(surface, CROP, random) if len(surface["xyz"]) > 500 else None
            samples += [sample] if sample is not None and len(sample["label"]) > 300 else []
        *inputs, labels = batch(samples)
        network.train()
        known = labels != UNKNOWN
        logits, labels = network(*inputs)[known], labels[known]
        loss = functional.cross_entropy(logits, labels, weights, label_smoothing=0.03)
        loss = loss + lovasz(logits.softmax(1), labels)
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimiser.step()
        schedule.step()
        shown.append(loss.item())
        if (step + 1) % 50 == 0:
            rate = (step + 1 - first) / (time.time() - begun)
            left = (arguments.steps - step - 1) / rate / 60
            print(f"step {step + 1}: loss {np.mean(shown):.3f}, {left:.0f} minutes left", flush=True)
            shown = []
        if (step + 1) % 500 == 0 or step + 1 == arguments.steps:
            torch.save({"step": step + 1, "network": network.state_dict(), "optimiser": optimiser.state_dict(),
                        "schedule": schedule.state_dict()}, checkpoint)
            print(json.dumps(scores(*logits_of(network, held_out))), flush=True)
    logits, labels = logits_of(network, held_out)
    network.temperature.fill_(fitted_temperature(logits, labels))
    result = scores(logits / network.temperature, labels)
    print(json.dumps({**result, "temperature": network.temperature.item()}), flush=True)
    export(network, arguments.out)
    arguments.out.with_suffix(".json").write_text(json.dumps({**result, "seed": arguments.seed,
                                                              "steps": arguments.steps}, indent=1) + "\n")


if __name__ == "__main__":
    main()
