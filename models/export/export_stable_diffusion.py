"""Exports an inpainting checkpoint of Stable Diffusion, from the Hugging Face hub or from a folder, to ONNX files.

    pip install -r models/export/requirements.txt
    python models/export/export_stable_diffusion.py --out MODELS/stable-diffusion-inpainting

The built-in manifest has the entry `stable-diffusion-inpainting` for the result. Weights of more than 1.5 GB go into
a file of their own beside their network's; both belong together. Mind the licence of the weights.
"""

import argparse
from pathlib import Path

import torch
from diffusers import StableDiffusionInpaintPipeline

from stable_diffusion import export_pipeline


def side(text):
    """A side of the picture: the networks halve it six times."""
    pixels = int(text)
    if not 64 <= pixels <= 1024 or pixels % 64 != 0:
        raise argparse.ArgumentTypeError("must be a multiple of 64, up to 1024")
    return pixels


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--checkpoint", default="stable-diffusion-v1-5/stable-diffusion-inpainting", help="name or folder"
    )
    parser.add_argument("--width", type=side, default=512, help="of the picture; what it was trained on by default")
    parser.add_argument("--height", type=side, default=512)
    parser.add_argument("--out", type=Path, required=True, help="folder")
    given = parser.parse_args()

    pipe = StableDiffusionInpaintPipeline.from_pretrained(
        given.checkpoint, torch_dtype=torch.float32, safety_checker=None, requires_safety_checker=False
    )
    export_pipeline(pipe, given.width, given.height, given.out)


if __name__ == "__main__":
    main()
