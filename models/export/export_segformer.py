"""Exports a SegFormer with its weights from the Hugging Face hub, or from a folder, to one ONNX file.

    pip install -r models/export/requirements.txt
    python models/export/export_segformer.py --out MODELS/segformer-ade20k/segformer.onnx

The built-in manifest has the entry `segformer-ade20k` for the result. Mind the licence of the weights.
"""

import argparse
from pathlib import Path

from transformers import SegformerForSemanticSegmentation

from common import check, export, side


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--weights", default="nvidia/segformer-b2-finetuned-ade-512-512", help="name or folder")
    parser.add_argument("--width", type=side, default=640, help="of the input; that of 4:3 pictures by default")
    parser.add_argument("--height", type=side, default=480)
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()

    network = SegformerForSemanticSegmentation.from_pretrained(given.weights).eval()
    classes = network.config.num_labels
    if classes != 150:
        print(f"{classes} classes: write an entry of your own into models.toml, with their class table")
    given.out.parent.mkdir(parents=True, exist_ok=True)
    export(network, ["logits"], given.width, given.height, str(given.out))
    check(network, ["logits"], given.width, given.height, str(given.out))


if __name__ == "__main__":
    main()
