"""Exports a Mask2Former with its weights from the Hugging Face hub, or from a folder, to one ONNX file.

    pip install -r models/export/requirements.txt
    python models/export/export_mask2former.py --out MODELS/mask2former-coco/mask2former.onnx

The built-in manifest has the entry `mask2former-coco` for the result. The deformable attention becomes GridSample,
which both runtimes have: nothing of it is rewritten.
"""

import argparse
from pathlib import Path

from transformers import Mask2FormerForUniversalSegmentation

from common import check, export, side

NAMES = ["class_queries_logits", "masks_queries_logits"]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--weights", default="facebook/mask2former-swin-small-coco-panoptic", help="name or folder")
    parser.add_argument("--width", type=side, default=512, help="of the input; that of 4:3 pictures by default")
    parser.add_argument("--height", type=side, default=384)
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()

    network = Mask2FormerForUniversalSegmentation.from_pretrained(given.weights).eval()
    classes = network.config.num_labels
    if classes != 133:
        print(f"{classes} classes: write an entry of your own into models.toml, with their class table")
    given.out.parent.mkdir(parents=True, exist_ok=True)
    export(network, NAMES, given.width, given.height, str(given.out))
    check(network, NAMES, given.width, given.height, str(given.out))


if __name__ == "__main__":
    main()
