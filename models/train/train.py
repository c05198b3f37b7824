"""Trains the network that labels surfaces.

    python train.py --data surfaces/train --held-out surfaces/held-out --out columns.onnx

The README has the commands that made the data and the weights in the program. Resumes from the checkpoint beside `--out`. Real recordings take no part.
"""
import argparse
import json
import math
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from torch.nn import functional
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn
from torch.utils.data import DataLoader

from drape import draped
from heaps import heaped
from network import Columns
from pool import arriving, packed, unpacked
from samples import CROP, SHARES, Samples, surfaces_in
from start import calibrate_norms, read_weights
from surfaces import PLANES, UNKNOWN, VOXEL_NUMBERS, augmented, load, main_yaw, sites, turned
from voxels import columns, joined, varied, whole

# viola-geometry, taxonomy.rs.
CLASSES = ["other", "floor", "wall", "ceiling", "door", "window", "stairs", "bed", "sofa", "chair", "table", "desk",
           "cabinet", "shelf", "counter", "refrigerator", "stove", "washing_machine", "television", "lamp", "radiator",
           "toilet", "sink", "bathtub", "shower", "curtain", "rug", "pillow", "clothes", "mirror", "picture", "plant",
           "box", "person", "animal"]
# viola-lab, evaluate/labels/coarse.rs.
COARSE = ["floor", "wall", "ceiling", "bed", "sofa", "chair", "table", "cabinet", "door", "window", "other"]
FOLDED = [{"shelf": "cabinet", "curtain": "window"}.get(name, name) for name in CLASSES]
COARSE_OF = torch.tensor([COARSE.index(name) if name in COARSE else 10 for name in FOLDED])
# Weight of the boxes beside the classes in the loss.
BOX_WEIGHT = 0.3
# The part of the fitted bias that is kept: homes of other kinds than those it is fitted to have other fractions of the classes.
BIAS_PART = 0.5
# Samples that are used again, the latest.
POOL = 12_000
# Crops whose classes are counted.
COUNTED = 120
# Voxels that bias and temperature are fitted to.
FITTED = 150_000
# Other processors take many times longer with bf16 than with 32 bits.
HAS_BF16 = getattr(torch.cpu, "_is_avx512_bf16_supported", lambda: False)()


def rate_at(progress: float) -> float:
    """The learning rate as a fraction of the largest: a short rise, then a cosine down to 0."""
    rise = 0.03
    return progress / rise if progress < rise else 0.5 + 0.5 * math.cos(math.pi * (progress - rise) / (1 - rise))


def lovasz(probabilities: torch.Tensor, labels: torch.Tensor) -> torch.Tensor:
    """Lovasz-softmax over the classes that occur (Berman et al., 2018)."""
    classes = labels.unique()
    there = (labels[:, None] == classes).float()
    errors, order = (there - probabilities[:, classes]).abs().sort(0, descending=True)
    there = there.gather(0, order)
    total = there.sum(0)
    jaccard = 1 - (total - there.cumsum(0)) / (total + (1 - there).cumsum(0))
    steps = torch.cat([jaccard[:1], jaccard[1:] - jaccard[:-1]])
    return (errors * steps).sum(0).mean()


def class_weights(samples: list[dict]) -> torch.Tensor:
    counts = sum(np.bincount(sample["label"], minlength=256)[:len(CLASSES)] for sample in samples)
    weights = 1 / np.sqrt(counts.clip(min=counts.sum() * 1e-4) / counts.sum())
    return torch.tensor(weights / weights[counts > 0].mean(), dtype=torch.float32)


@torch.no_grad()
def answers(network: torch.nn.Module, paths: list[Path], vary: bool = False) -> tuple[torch.Tensor, torch.Tensor]:
    """Logits and labels of the voxels of whole surfaces; of other sensors, paths and homes with `vary`."""
    network.eval()
    device = next(network.parameters()).device
    all_logits, all_labels = [], []
    for number, path in enumerate(paths):
        surface = load(path)
        random = np.random.default_rng(number)
        if vary:
            surface = heaped(surface, random) if random.random() < SHARES["heaped"] else surface
            surface = draped(surface, random) if random.random() < SHARES["draped"] else surface
            surface = augmented(surface, random)
        if len(surface["xyz"]) == 0:
            continue
        surface = sites(surface, random)
        points, size = whole(turned(surface, -main_yaw(surface["normal"])))
        *inputs, labels, _ = columns(joined([points], device), 1, size)
        known = labels != UNKNOWN
        with torch.backends.cudnn.flags(benchmark=False):
            logits = network(*inputs)[0]
        all_logits.append(logits[known].float().cpu())
        all_labels.append(labels[known].cpu())
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


def fitted(loss: Callable[[], torch.Tensor], *parameters: torch.Tensor) -> None:
    """Sets the parameters to those with the least loss."""
    optimiser = torch.optim.LBFGS(parameters, max_iter=60, line_search_fn="strong_wolfe")

    def value():
        optimiser.zero_grad()
        said = loss()
        said.backward()
        return said

    optimiser.step(value)


def fit_bias(logits: torch.Tensor, labels: torch.Tensor) -> torch.Tensor:
    """The bias of each class with the least cross-entropy, at its best temperature: weighted training overrates rare classes."""
    bias, log_temperature = torch.zeros(logits.shape[1], requires_grad=True), torch.zeros((), requires_grad=True)
    fitted(lambda: functional.cross_entropy((logits + bias) / log_temperature.exp(), labels) + 1e-4 * bias.square().sum(),
           bias, log_temperature)
    return bias.detach()


def fit_temperature(logits: torch.Tensor, labels: torch.Tensor) -> torch.Tensor:
    """What the logits are divided by for the least cross-entropy."""
    log_temperature = torch.zeros((), requires_grad=True)
    fitted(lambda: functional.cross_entropy(logits / log_temperature.exp(), labels), log_temperature)
    return log_temperature.exp().detach()


def export(network: Columns, path: Path) -> None:
    network.eval()
    sample = (torch.zeros(1, PLANES, 32, 48), torch.zeros(7, dtype=torch.int64), torch.zeros(7, dtype=torch.int64),
              torch.zeros(7, VOXEL_NUMBERS))
    names = ["grid", "column", "place", "own"]
    axes = {"grid": {2: "height", 3: "width"}, **{name: {0: "voxels"} for name in names[1:] + ["logits", "box"]}}
    torch.onnx.export(network, sample, str(path), input_names=names, output_names=["logits", "box"], dynamic_axes=axes,
                      opset_version=17, dynamo=False)


def halves(held_out: list[Path]) -> tuple[list[Path], list[Path]]:
    """Surfaces of the homes with an even seed, and of those with an odd one: all clips of a home are in the same half."""
    parts = [], []
    for path in held_out:
        # The name is SET_SEED_FRAMES.
        parts[int(path.stem.split("_")[-2]) % 2].append(path)
    if not all(parts):
        raise SystemExit("the held-out surfaces need homes with even and with odd seeds")
    return parts


def loss_of(network: torch.nn.Module, inputs: list, labels: torch.Tensor, boxes: torch.Tensor,
            weights: torch.Tensor) -> torch.Tensor:
    known = labels != UNKNOWN
    grid, *inputs = inputs
    # Twice as fast on processors with bf16.
    with torch.autocast(grid.device.type, torch.bfloat16, enabled=HAS_BF16 or grid.is_cuda):
        logits, said = network(grid.to(memory_format=torch.channels_last), *inputs)
    logits, said = logits.float(), said.float()
    loss = functional.cross_entropy(logits[known], labels[known], weights, label_smoothing=0.03)
    # A part of the voxels: the sorting of all takes a sixth of a step.
    part = max(2, int(known.sum()) // 60_000)
    loss = loss + lovasz(logits[known][::part].softmax(1), labels[known][::part])
    told = ~boxes.isnan().any(1)
    miss = functional.smooth_l1_loss(said[told], boxes[told], beta=0.2, reduction="sum") / (6 * told.sum()).clamp(min=1)
    return loss + BOX_WEIGHT * miss


@torch.no_grad()
def finish(network: Columns, held_out: list[Path], out: Path, told: dict) -> dict:
    """Fits bias and temperature, exports the network, and writes its scores beside it.

    Fitted to the held-out homes with even seeds, told of those with odd ones. Varied surfaces leave more doubt than those of
    the simulator alone, as real ones do.
    """
    even, odd = halves(held_out)
    logits, labels = answers(network, even, vary=True)
    part = 1 + len(labels) // FITTED
    logits, labels = logits[::part], labels[::part]
    with torch.enable_grad():
        bias = BIAS_PART * fit_bias(logits, labels)
        temperature = fit_temperature(logits + bias, labels)
    network.bias.copy_(bias)
    network.temperature.copy_(temperature)
    result = {**scores(*answers(network, odd)), "temperature": temperature.item(), **told}
    print(out.stem, json.dumps(result), flush=True)
    export(network.cpu(), out)
    out.with_suffix(".json").write_text(json.dumps(result, indent=1) + "\n")
    return result


def crops(arguments: argparse.Namespace, fresh: int, step: int):
    """Packed crops for each step: `fresh` new ones, made by workers; of a pool those that have arrived, at times none."""
    if arguments.pool:
        yield from arriving(arguments.pool, fresh, arguments.seed)
    samples = Samples(arguments.data, arguments.seed, arguments.steps * fresh)
    loader = DataLoader(samples, fresh, sampler=range(step * fresh, arguments.steps * fresh), collate_fn=list,
                        num_workers=arguments.workers, prefetch_factor=6)
    for new in loader:
        yield [packed(sample) for sample in new]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument("--data", type=Path, nargs="+", help="folders of surfaces")
    source.add_argument("--pool", type=Path, help="folder of crops that pool.py makes, also meanwhile")
    parser.add_argument("--held-out", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--steps", type=int, default=6000)
    parser.add_argument("--minutes", type=float, default=math.inf, help="ends after this time if that comes before --steps")
    parser.add_argument("--batch", type=int, default=4)
    parser.add_argument("--reuse", type=int, default=1, help="times that a sample is in a batch, each time varied")
    parser.add_argument("--workers", type=int, default=1, help="processes that make samples")
    parser.add_argument("--rate", type=float, default=3e-3)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--start", type=Path, help="ONNX file of another run, whose weights this one begins with")
    arguments = parser.parse_args()
    if arguments.pool and arguments.reuse == 1:
        parser.error("--pool needs a --reuse of at least 2: at times a pool has no new crops")
    torch.manual_seed(arguments.seed)
    torch.multiprocessing.set_sharing_strategy("file_system")
    torch.backends.cudnn.benchmark = True  # All crops have the same size.
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    held_out = surfaces_in([arguments.held_out])
    halves(held_out)  # Fails now, not after the training.
    fresh = max(1, arguments.batch // arguments.reuse)
    # The layout that convolutions are fastest in.
    network = Columns(len(CLASSES)).to(device, memory_format=torch.channels_last)
    smooth = AveragedModel(network, multi_avg_fn=get_ema_multi_avg_fn(0.998), use_buffers=True)
    print(f"{len(held_out)} surfaces held out, {sum(p.numel() for p in network.parameters())} parameters", flush=True)
    optimiser = torch.optim.AdamW(network.parameters(), arguments.rate, weight_decay=0.02, fused=device.type == "cuda")
    parts = {"network": network, "smooth": smooth, "optimiser": optimiser}
    checkpoint, step, spent = arguments.out.with_suffix(".checkpoint"), 0, 0.0
    first: list[dict] = []
    for new in crops(arguments, fresh, 0):
        first += new
        if len(first) >= COUNTED:
            break
    weights = class_weights(first).to(device)
    if arguments.start:
        read_weights(network, arguments.start)
        network.bias.zero_(), network.temperature.fill_(1)
        calibrate_norms(network, [columns(joined([unpacked(crop) for crop in first[4 * i:4 * i + 4]], device), 4, (CROP, CROP))[:4]
                                  for i in range(16)])
        smooth.module.load_state_dict(network.state_dict())
    if checkpoint.exists():
        state = torch.load(checkpoint, map_location=device)
        step, spent = state["step"], state["spent"]
        for name, part in parts.items():
            part.load_state_dict(state[name])
    begun, shown, pool, progress = time.time() - spent, [], [], 0.0
    for new in crops(arguments, fresh, step):
        spent = time.time() - begun
        progress = max(step / arguments.steps, spent / 60 / arguments.minutes)
        for group in optimiser.param_groups:
            group["lr"] = arguments.rate * rate_at(min(progress, 1.0))
        random = np.random.default_rng([arguments.seed, step, 1])
        new = [{name: part.to(device) for name, part in crop.items()} for crop in new]
        again = [pool[i] for i in random.integers(len(pool), size=arguments.batch - len(new))] if pool else []
        pool = (pool + new)[-POOL:] if arguments.reuse > 1 else []
        points = joined([unpacked(crop) for crop in new + again], device)
        if arguments.reuse > 1:
            points = varied(points, len(new + again), CROP, torch.Generator(device).manual_seed(int(random.integers(2**62))))
        *inputs, labels, boxes = columns(points, len(new + again), (CROP, CROP))
        network.train()
        loss = loss_of(network, inputs, labels, boxes, weights)
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimiser.step()
        smooth.update_parameters(network)
        step += 1
        shown.append(loss.detach())
        if step % 50 == 0:
            left = spent / max(progress, 1e-9) * (1 - progress) / 60
            print(f"step {step}: loss {torch.stack(shown).mean():.3f}, {left:.1f} minutes left", flush=True)
            shown = []
        if step % 1000 == 0 or progress >= 1:
            torch.save({"step": step, "spent": spent, **{name: part.state_dict() for name, part in parts.items()}},
                       checkpoint)
            print(json.dumps(scores(*answers(smooth, held_out[::8]))), flush=True)
        if progress >= 1:
            break
    finish(smooth.module, held_out, arguments.out, {"seed": arguments.seed, "steps": step})


if __name__ == "__main__":
    main()
