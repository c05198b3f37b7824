"""Makes tests/models/columns.onnx, a small network with random weights, and what PyTorch says of a surface; and
columns_nan.onnx, whose answers are not finite.

    python small.py ../../tests/models
"""
import json
import sys
from pathlib import Path

import numpy as np
import torch

from network import Columns
from surfaces import CELL_M, OBJECT, UNKNOWN, main_yaw, turned
from train import CLASSES, export
from voxels import columns, joined, whole

YAW_RAD = 0.3


def main(folder: Path) -> None:
    torch.manual_seed(7)
    random = np.random.default_rng(7)
    network = Columns(len(CLASSES), widths=[4, 4, 6, 8], hidden=12)
    # Batch norms that do something.
    for module in network.modules():
        if isinstance(module, torch.nn.BatchNorm2d):
            module.running_mean.normal_(0, 0.3)
            module.running_var.uniform_(0.5, 2.0)
    for layer in [*network.head, network.classes, network.box]:
        if isinstance(layer, torch.nn.Linear):
            layer.weight.data *= 3
    network.eval()
    # A floor and a wall, a point for each voxel at its middle; they stand askew.
    cells = np.array([[x, y, 0] for x in range(40) for y in range(30)] + [[x, 30, z] for x in range(40)
                                                                         for z in range(50)])
    cells = cells[random.random(len(cells)) < 0.5]
    normals = np.where(cells[:, 2:] == 0, [[0, 0, 1]], [[0, -1, 0]]).astype(np.float32)
    xyz = ((cells + [0.5, 0.5, 0]) * CELL_M).astype(np.float32)
    surface = {"xyz": xyz, "normal": normals, "label": np.full(len(xyz), UNKNOWN, np.uint8),
               "instance": np.zeros(len(xyz), np.int64), "objects": np.zeros(0, OBJECT)}
    askew = turned(surface, YAW_RAD)
    points, size = whole(turned(askew, -main_yaw(askew["normal"])))
    *inputs, _, _ = columns(joined([points], torch.device("cpu")), 1, size)
    with torch.no_grad():
        logits, boxes = network(*inputs)
    probabilities = logits.softmax(1).numpy()
    # The script's voxels are sorted by slice, row and place in the row, as are these.
    order = np.lexsort((cells[:, 0], cells[:, 1], cells[:, 2]))
    every = order[::97]
    export(network, folder / "columns.onnx")
    rank = np.argsort(order)
    expected = {
        "yaw_rad": YAW_RAD,
        "cells": cells.tolist(),
        "sites": [{"site": int(site), "class": int(probabilities[rank[site]].argmax()),
                   "probability": float(probabilities[rank[site]].max()), "box": boxes[rank[site]].tolist()}
                  for site in every],
    }
    broken = Columns(len(CLASSES), widths=[2, 2, 2, 2], hidden=2)
    broken.temperature.fill_(0)
    export(broken, folder / "columns_nan.onnx")
    (folder / "columns.json").write_text(json.dumps(expected, separators=(",", ":")) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
