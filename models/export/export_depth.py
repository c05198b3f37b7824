"""Exports a depth network with its weights from the Hugging Face hub, or from a folder, to one ONNX file.

    pip install -r models/export/requirements.txt
    python models/export/export_depth.py --out MODELS/depth-anything-v2-small/depth.onnx

The built-in manifest has the entry `depth-anything-v2-small` for the result of the default. Another network needs an
entry of its own: `inverse = true` where larger values are nearer, `scale` where they are not metres.
"""

import argparse
from pathlib import Path

from transformers import AutoModelForDepthEstimation

from common import check, export

NAMES = ["predicted_depth"]


def side(text):
    """A side of the input: transformers for pictures cut it into squares of 14 pixels."""
    pixels = int(text)
    if pixels < 28 or pixels % 14 != 0:
        raise argparse.ArgumentTypeError("must be a multiple of 14")
    return pixels


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--weights", default="depth-anything/Depth-Anything-V2-Small-hf", help="name or folder")
    parser.add_argument("--width", type=side, default=686, help="of the input; that of 4:3 pictures by default")
    parser.add_argument("--height", type=side, default=518)
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()

    network = AutoModelForDepthEstimation.from_pretrained(given.weights).eval()
    given.out.parent.mkdir(parents=True, exist_ok=True)
    export(network, NAMES, given.width, given.height, str(given.out))
    check(network, NAMES, given.width, given.height, str(given.out))


if __name__ == "__main__":
    main()
