"""Fits the temperature of trained weights again, to the surfaces that the network is asked about now.

    python temperature.py --weights models/columns/columns.onnx --held-out surfaces/held-out --out columns.onnx

Fitted to the held-out homes with even seeds, with augmentation; prints the scores of those with odd seeds, without. The other
weights stay.
"""
import argparse
import json
from pathlib import Path

import onnx
from onnx import numpy_helper

from network import Columns
from samples import surfaces_in
from start import read_weights
from train import CLASSES, FITTED, answers, fit_temperature, halves, scores


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--weights", type=Path, required=True)
    parser.add_argument("--held-out", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    network = Columns(len(CLASSES))
    read_weights(network, arguments.weights)
    even, odd = halves(surfaces_in([arguments.held_out]))
    print("before", json.dumps(scores(*answers(network, odd))), flush=True)
    network.temperature.fill_(1)
    logits, labels = answers(network, even, vary=True)
    part = 1 + len(labels) // FITTED
    network.temperature.copy_(fit_temperature(logits[::part], labels[::part]))
    print("temperature", network.temperature.item())
    print("after", json.dumps(scores(*answers(network, odd))))
    model = onnx.load(str(arguments.weights))
    place = next(i for i in model.graph.initializer if i.name == "temperature")
    place.CopyFrom(numpy_helper.from_array(network.temperature.numpy(), "temperature"))
    onnx.save(model, str(arguments.out))


if __name__ == "__main__":
    main()
