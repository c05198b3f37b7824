"""Makes the fixtures of tests/imagination.rs: a tiny inpainting pipeline with random weights and what `diffusers`
makes of it.

    pip install -r models/export/requirements.txt
    python models/export/tiny_stable_diffusion.py tests/models/stable_diffusion [CHECKPOINT]

Writes the pipeline's files as export_stable_diffusion.py does, and:

    noise.f32      the initial noise, then the noise with which the masked picture is encoded: little-endian,
                   channel, row, column
    ddim.f32, euler.f32   the final latents, before they are scaled for the decoder
    ddim.png, euler.png   the final picture
    schedules.json what the schedulers of `diffusers` make of a number, for every setting that is run

With a second folder the pipeline itself is saved there, to try export_stable_diffusion.py on.
"""

import itertools
import json
import math
import sys
from pathlib import Path

import numpy as np
import torch
from diffusers import (
    AutoencoderKL,
    DDIMScheduler,
    EulerDiscreteScheduler,
    PNDMScheduler,
    StableDiffusionInpaintPipeline,
    UNet2DConditionModel,
)
from PIL import Image
from transformers import CLIPTextConfig, CLIPTextModel, CLIPTokenizer

from stable_diffusion import export_pipeline
from tiny import picture

SIDE = 64
STEPS = 20
PROMPT = "a realistic photo of an empty room"
NUMBERS = {
    "num_train_timesteps": 1000,
    "beta_start": 0.00085,
    "beta_end": 0.012,
    "beta_schedule": "scaled_linear",
}


def byte_letters():
    """CLIP's letter for each byte: printable ones stand for themselves, the others come from U+0100 on."""
    printable = [*range(33, 127), *range(161, 173), *range(174, 256)]
    others = [byte for byte in range(256) if byte not in printable]
    return [chr(b) for b in printable] + [chr(256 + n) for n in range(len(others))]


def tiny_tokenizer():
    letters = byte_letters()
    vocab = letters + [letter + "</w>" for letter in letters]
    # Among them pairs that compete for a letter, so that the order of the ranks shows.
    merges = [
        tuple(pair.split())
        for pair in [
            "o o", "p h", "r e", "t o</w>", "o f</w>", "a n</w>", "r o", "oo m</w>", "i s", "t i", "is ti",
            "e m", "p t", "pt y</w>", "em pty</w>", "a l", "re al", "ph o", "to to</w>", "t o", "i c</w>", "is t",
        ]
    ]
    vocab += ["".join(pair) for pair in merges] + ["<|startoftext|>", "<|endoftext|>"]
    return CLIPTokenizer(
        vocab={token: place for place, token in enumerate(vocab)}, merges=merges, model_max_length=77
    )


def tiny_pipeline():
    torch.manual_seed(1)
    tokenizer = tiny_tokenizer()
    text_encoder = CLIPTextModel(
        CLIPTextConfig(
            vocab_size=len(tokenizer),
            hidden_size=16,
            intermediate_size=32,
            num_hidden_layers=2,
            num_attention_heads=2,
            max_position_embeddings=77,
            bos_token_id=tokenizer.bos_token_id,
            eos_token_id=tokenizer.eos_token_id,
            pad_token_id=tokenizer.pad_token_id,
            initializer_factor=5.0,
        )
    ).eval()
    vae = AutoencoderKL(
        down_block_types=["DownEncoderBlock2D"] * 4,
        up_block_types=["UpDecoderBlock2D"] * 4,
        block_out_channels=[8, 8, 8, 8],
        layers_per_block=1,
        latent_channels=4,
        norm_num_groups=4,
        sample_size=SIDE,
    ).eval()
    unet = UNet2DConditionModel(
        sample_size=SIDE // 8,
        in_channels=9,
        out_channels=4,
        down_block_types=["CrossAttnDownBlock2D", "DownBlock2D"],
        up_block_types=["UpBlock2D", "CrossAttnUpBlock2D"],
        block_out_channels=[8, 16],
        layers_per_block=1,
        norm_num_groups=4,
        attention_head_dim=2,
        cross_attention_dim=16,
    ).eval()
    # As they come, the random weights hardly look at the picture and the words; so that a fault shows, the words
    # count more, and the decoder's colours spread over the whole range.
    with torch.no_grad():
        for name, weights in unet.named_parameters():
            if "attn2" in name and weights.dim() > 1:
                weights.mul_(3.0)
        vae.decoder.conv_out.weight.mul_(3.0)
    # The settings that Stable Diffusion's own checkpoints come with.
    scheduler = PNDMScheduler(**NUMBERS, skip_prk_steps=True, set_alpha_to_one=False, steps_offset=1)
    scheduler.register_to_config(clip_sample=False)
    return StableDiffusionInpaintPipeline(
        vae, text_encoder, tokenizer, unet, scheduler, None, None, requires_safety_checker=False
    )


def hole():
    """The hole that tests/imagination.rs makes: columns 18..46, rows 12..40."""
    mask = np.zeros((SIDE, SIDE), np.uint8)
    mask[12:40, 18:46] = 255
    return mask


def fill(pipe, scheduler, noise, output):
    """Both kinds of output come of the same numbers: the generator only draws the noise of the encoder."""
    pipe.scheduler = scheduler.from_config(pipe.scheduler.config)
    return pipe(
        prompt=PROMPT,
        negative_prompt="",
        image=Image.fromarray(picture(SIDE, SIDE)),
        mask_image=Image.fromarray(hole()),
        width=SIDE,
        height=SIDE,
        strength=1.0,
        num_inference_steps=STEPS,
        guidance_scale=7.5,
        latents=noise.clone(),
        generator=torch.Generator().manual_seed(3),
        output_type=output,
    ).images[0]


def schedules():
    """What each scheduler makes of a number, when the network says the sine of the step's number."""
    rows = []
    for made, spacing, prediction, betas, to_one in itertools.product(
        [DDIMScheduler, EulerDiscreteScheduler],
        ["leading", "linspace", "trailing"],
        ["epsilon", "v_prediction"],
        ["linear", "scaled_linear"],
        [False, True],
    ):
        told = {**NUMBERS, "beta_schedule": betas, "prediction_type": prediction}
        told |= {"timestep_spacing": spacing, "steps_offset": 1}
        if made is DDIMScheduler:
            told |= {"set_alpha_to_one": to_one, "clip_sample": False}
        elif to_one:
            continue
        scheduler = made(**told)
        scheduler.set_timesteps(STEPS)
        value = torch.tensor([0.7]) * scheduler.init_noise_sigma
        for place, t in enumerate(scheduler.timesteps):
            value_in = scheduler.scale_model_input(value, t)
            said = torch.tensor([math.sin(place)]) + 0.1 * value_in
            value = scheduler.step(said, t, value, return_dict=False)[0]
        rows.append(
            {
                "by": "ddim" if made is DDIMScheduler else "euler",
                "timestep_spacing": spacing,
                "prediction_type": prediction,
                "beta_schedule": betas,
                "set_alpha_to_one": to_one,
                "timesteps": [round(float(t), 3) for t in scheduler.timesteps],
                "start": float(scheduler.init_noise_sigma),
                "end": float(value),
            }
        )
    return rows


def main():
    folder = Path(sys.argv[1])
    pipe = tiny_pipeline()
    if len(sys.argv) > 2:
        pipe.save_pretrained(sys.argv[2])
    # Constants that are computed when the network runs keep the files small.
    export_pipeline(pipe, SIDE, SIDE, folder, largest_constant=1024)
    pipe.set_progress_bar_config(disable=True)
    shape = (1, 4, SIDE // 8, SIDE // 8)
    noise = torch.randn(shape, generator=torch.Generator().manual_seed(2))
    encoding = torch.randn(shape, generator=torch.Generator().manual_seed(3))
    torch.cat([noise, encoding]).numpy().astype("<f4").tofile(folder / "noise.f32")
    for name, scheduler in [("ddim", DDIMScheduler), ("euler", EulerDiscreteScheduler)]:
        latents = fill(pipe, scheduler, noise, "latent").numpy().astype("<f4")
        filled = fill(pipe, scheduler, noise, "pil")
        latents.tofile(folder / f"{name}.f32")
        filled.save(folder / f"{name}.png")
        seen = np.asarray(filled)
        print(f"{name}: latents up to {np.abs(latents).max():.3g}, colours {seen.min()} to {seen.max()}")
    (folder / "schedules.json").write_text(json.dumps(schedules(), separators=(",", ":")) + "\n")


if __name__ == "__main__":
    main()
