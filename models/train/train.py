"""Trains the network that labels surfaces.

    python train.py --data surfaces/train --held-out surfaces/held-out --out columns.onnx

The README has the commands that made the data and the weights in the program. Resumes from the checkpoint beside `--out`. Real recordings take no part.
"""
import argparse
import json
import math
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
import torch
from torch.nn import functional
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn

from drape import draped
from furnish import furnished
from network import Columns
from start import calibrate_norms, read_weights
from surfaces import PLANES, SLICES, UNKNOWN, VOXEL_NUMBERS, augmented, columns, load, main_yaw, mixed, turned

# viola-geometry, taxonomy.rs.
CLASSES = ["other", "floor", "wall", "ceiling", "door", "window", "stairs", "bed", "sofa", "chair", "table", "desk",
           "cabinet", "shelf", "counter", "refrigerator", "stove", "washing_machine", "television", "lamp", "radiator",
           "toilet", "sink", "bathtub", "shower", "curtain", "rug", "pillow", "clothes", "mirror", "picture", "plant",
           "box", "person", "animal"]
# viola-lab, evaluate/labels/coarse.rs.
COARSE = ["floor", "wall", "ceiling", "bed", "sofa", "chair", "table", "cabinet", "door", "window", "other"]
FOLDED = [{"shelf": "cabinet", "curtain": "window"}.get(name, name) for name in CLASSES]
COARSE_OF = torch.tensor([COARSE.index(name) if name in COARSE else 10 for name in FOLDED])
CROP = 128
# Weight of the boxes beside the classes in the loss.
BOX_WEIGHT = 0.3
# Fraction of the samples that are two surfaces in one place.
MIXED = 0.15
# Fraction of the samples that get objects of others.
FURNISHED = 0.5
# Fraction of the samples that get a curtain before a wall.
DRAPED = 0.4
# Other processors take many times longer with bf16 than with 32 bits.
HAS_BF16 = torch.cpu._is_avx512_bf16_supported()
# Batches ahead of the network.
AHEAD = 6


def batch(samples: list[dict]) -> tuple:
    """Joins samples of one grid size: the network's inputs, then labels and boxes."""
    height, width = samples[0]["size"]
    cells = height * width
    join = lambda name: torch.from_numpy(np.concatenate([sample[name] for sample in samples]))
    of_sample = torch.from_numpy(np.repeat(np.arange(len(samples)), [len(s["at"]) for s in samples]))
    at, slice_ = join("at"), join("slice")
    normal = join("normal")
    grid = torch.zeros(len(samples), PLANES, cells)
    grid[of_sample, slice_, at] = 1
    grid[of_sample, SLICES + slice_, at] = normal[:, 2]
    for part in range(2):
        grid.index_put_((of_sample, (4 + part) * SLICES // 2 + slice_ // 2, at), normal[:, part] / 2, accumulate=True)
    grid = grid.reshape(len(samples), PLANES, height, width)
    y, x = at // width, at % width
    column = of_sample * (cells // 4) + y // 2 * (width // 2) + x // 2
    return grid, column, slice_ * 4 + y % 2 * 2 + x % 2, join("own"), join("label"), join("box")


def samples_of(paths: list[Path], seed: int, step: int, count: int) -> list[dict]:
    """A step's samples depend on its number only, so that a resumed run is the same."""
    random = np.random.default_rng([seed, step])
    samples = []
    while len(samples) < count:
        surface = lambda: load(paths[random.integers(len(paths))])
        surfaces = [surface() for _ in range(1 + (random.random() < MIXED))]
        if random.random() < FURNISHED:
            surfaces[0] = furnished(surfaces[0], [surface(), surface()], random)
        if random.random() < DRAPED:
            surfaces[0] = draped(surfaces[0], random)
        surfaces = [augmented(surface, random) for surface in surfaces if len(surface["xyz"]) > 500]
        surfaces = [surface for surface in surfaces if len(surface["xyz"]) > 0]
        if not surfaces:
            continue
        sample = columns(surfaces[0] if len(surfaces) == 1 else mixed(*surfaces), CROP, random)
        samples += [sample] if sample is not None and len(sample["label"]) > 300 else []
    return samples


def rate_at(progress: float) -> float:
    """The learning rate as a fraction of the largest: a short rise, then a cosine down to 0."""
    rise = 0.03
    return progress / rise if progress < rise else 0.5 + 0.5 * math.cos(math.pi * (progress - rise) / (1 - rise))


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


def class_weights(paths: list[Path]) -> torch.Tensor:
    some = paths[::max(1, len(paths) // 200)]
    counts = sum(np.bincount(load(path)["label"], minlength=256)[:len(CLASSES)] for path in some)
    weights = 1 / np.sqrt(counts.clip(min=counts.sum() * 1e-4) / counts.sum())
    return torch.tensor(weights / weights[counts > 0].mean(), dtype=torch.float32)


@torch.no_grad()
def answers(network: torch.nn.Module, paths: list[Path], vary: bool = False) -> tuple[torch.Tensor, torch.Tensor]:
    """Logits and labels of the voxels of whole surfaces; of other sensors, paths and homes with `vary`."""
    network.eval()
    all_logits, all_labels = [], []
    for number, path in enumerate(paths):
        surface = load(path)
        if vary:
            random = np.random.default_rng(number)
            surface = draped(surface, random) if random.random() < DRAPED else surface
            surface = augmented(surface, random)
        sample = columns(turned(surface, -main_yaw(surface["normal"]))) if len(surface["xyz"]) else None
        if sample is None:
            continue
        *inputs, labels, _ = batch([sample])
        known = labels != UNKNOWN
        all_logits.append(network(*inputs)[0][known])
        all_labels.append(labels[known])
    return torch.cat(all_logits), torch.cat(all_labels)


def scores(logits: torch.Tensor, labels: torch.Tensor) -> dict:
    """Accuracy and mean IoU over the coarse classes, and the expected calibration error of all classes."""
    probabilities = logits.softmax(1)
    folded = torch.zeros(len(labels), len(COARSE)).index_add_(1, COARSE_OF, probabilities)
    said, truth = folded.argmax(1), COARSE_OF[labels]
    confusion = torch.zeros(len(COARSE), len(COARSE))
    confusion.index_put_((truth, said), torch.ones(len(said)), accumulate=True)
    union = confusion.sum(0) + confusion.sum(1) - confusion.diag()
    iou = confusion.diag() / union.clamp(min=1)
    sure, best = probabilities.max(1)
    right = (best == labels).float()
    bins = (sure * 15).long().clamp(max=14)
    error = sum(abs((right[bins == b] - sure[bins == b]).sum().item()) for b in range(15)) / len(labels)
    return {"accuracy": (said == truth).float().mean().item(), "mean_iou": iou[confusion.sum(1) > 0].mean().item(),
            "calibration_error": error, "iou": {name: round(v, 3) for name, v in zip(COARSE, iou.tolist())}}


def fit_bias(logits: torch.Tensor, labels: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """The bias of each class and the temperature with the least cross-entropy: weighted training overrates rare
    classes."""
    bias, log_temperature = torch.zeros(logits.shape[1], requires_grad=True), torch.zeros((), requires_grad=True)
    optimiser = torch.optim.LBFGS([bias, log_temperature], max_iter=60, line_search_fn="strong_wolfe")

    def loss():
        optimiser.zero_grad()
        value = functional.cross_entropy((logits + bias) / log_temperature.exp(), labels) + 1e-4 * bias.square().sum()
        value.backward()
        return value

    optimiser.step(loss)
    return bias.detach(), log_temperature.exp().detach()


def export(network: Columns, path: Path) -> None:
    network.eval()
    sample = (torch.zeros(1, PLANES, 32, 48), torch.zeros(7, dtype=torch.int64), torch.zeros(7, dtype=torch.int64),
              torch.zeros(7, VOXEL_NUMBERS))
    names = ["grid", "column", "place", "own"]
    axes = {"grid": {2: "height", 3: "width"}, **{name: {0: "voxels"} for name in names[1:] + ["logits", "box"]}}
    torch.onnx.export(network, sample, str(path), input_names=names, output_names=["logits", "box"], dynamic_axes=axes,
                      opset_version=17, dynamo=False)


def surfaces_in(folders: list[Path]) -> list[Path]:
    return sorted(path for folder in folders for path in folder.glob("*.surface"))


def loss_of(network: torch.nn.Module, inputs: list, labels: torch.Tensor, boxes: torch.Tensor,
            weights: torch.Tensor) -> torch.Tensor:
    known = labels != UNKNOWN
    grid, *inputs = inputs
    # Twice as fast on processors with bf16.
    with torch.autocast("cpu", torch.bfloat16, enabled=HAS_BF16):
        logits, said = network(grid.to(memory_format=torch.channels_last), *inputs)
    logits, said = logits.float(), said.float()
    loss = functional.cross_entropy(logits[known], labels[known], weights, label_smoothing=0.03)
    # Every other voxel: the sorting of all takes a sixth of a step.
    loss = loss + lovasz(logits[known][::2].softmax(1), labels[known][::2])
    whole = ~boxes.isnan().any(1)
    return loss + BOX_WEIGHT * functional.smooth_l1_loss(said[whole], boxes[whole], beta=0.2)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, nargs="+")
    parser.add_argument("--held-out", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--steps", type=int, default=6000)
    parser.add_argument("--minutes", type=float, default=math.inf, help="ends after this time if that comes before --steps")
    parser.add_argument("--batch", type=int, default=4)
    parser.add_argument("--rate", type=float, default=3e-3)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--start", type=Path, help="ONNX file of another run, whose weights this one begins with")
    arguments = parser.parse_args()
    torch.manual_seed(arguments.seed)
    paths = surfaces_in(arguments.data)
    held_out = sorted(arguments.held_out.glob("*.surface"))
    # The layout that convolutions on a processor are fastest in.
    network = Columns(len(CLASSES)).to(memory_format=torch.channels_last)
    smooth = AveragedModel(network, multi_avg_fn=get_ema_multi_avg_fn(0.998), use_buffers=True)
    print(f"{len(paths)} surfaces, {len(held_out)} held out,",
          f"{sum(p.numel() for p in network.parameters())} parameters", flush=True)
    optimiser = torch.optim.AdamW(network.parameters(), arguments.rate, weight_decay=0.02)
    parts = {"network": network, "smooth": smooth, "optimiser": optimiser}
    if arguments.start:
        read_weights(network, arguments.start)
        network.bias.zero_(), network.temperature.fill_(1)
        calibrate_norms(network, [batch(samples_of(paths, 0, step, arguments.batch))[:4] for step in range(16)])
        smooth.module.load_state_dict(network.state_dict())
    checkpoint, step, spent = arguments.out.with_suffix(".checkpoint"), 0, 0.0
    if checkpoint.exists():
        state = torch.load(checkpoint)
        step, spent = state["step"], state["spent"]
        for name, part in parts.items():
            part.load_state_dict(state[name])
    weights = class_weights(paths)
    begun, shown = time.time() - spent, []
    with ProcessPoolExecutor(1) as pool:
        ask = lambda step: pool.submit(samples_of, paths, arguments.seed, step, arguments.batch)
        asked = [ask(step + ahead) for ahead in range(AHEAD)]
        progress = 0.0
        while progress < 1:
            spent = time.time() - begun
            progress = max(step / arguments.steps, spent / 60 / arguments.minutes)
            for group in optimiser.param_groups:
                group["lr"] = arguments.rate * rate_at(min(progress, 1.0))
            *inputs, labels, boxes = batch(asked.pop(0).result())
            asked.append(ask(step + AHEAD))
            network.train()
            loss = loss_of(network, inputs, labels, boxes, weights)
            optimiser.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
            optimiser.step()
            smooth.update_parameters(network)
            step += 1
            shown.append(loss.item())
            if step % 50 == 0:
                left = spent / max(progress, 1e-9) * (1 - progress) / 60
                print(f"step {step}: loss {np.mean(shown):.3f}, {left:.0f} minutes left", flush=True)
                shown = []
                # Surfaces that were made meanwhile.
                paths = surfaces_in(arguments.data)
            if step % 1000 == 0 or progress >= 1:
                torch.save({"step": step, "spent": spent, **{name: part.state_dict() for name, part in parts.items()}},
                           checkpoint)
                print(json.dumps(scores(*answers(smooth, held_out[::4]))), flush=True)
    network = smooth.module
    # Fitted on one half of the held-out homes, told of the other. Varied surfaces leave more doubt than those of the
    # simulator alone, as real ones do.
    logits, labels = answers(network, held_out[::2], vary=True)
    bias, temperature = fit_bias(logits, labels)
    network.bias.copy_(bias)
    network.temperature.copy_(temperature)
    result = scores(*answers(network, held_out[1::2]))
    print(json.dumps({**result, "temperature": network.temperature.item()}), flush=True)
    export(network, arguments.out)
    arguments.out.with_suffix(".json").write_text(json.dumps({**result, "seed": arguments.seed,
                                                              "steps": step}, indent=1) + "\n")


if __name__ == "__main__":
    main()
