"""Writes an inpainting pipeline of `diffusers` as the files that viola reads: four networks, the tokenizer and the
settings. What viola does not do is refused here, with the name of the setting.

    text_encoder.onnx   input_ids i64 1 x length -> prompt_embeds 1 x length x width
    vae_encoder.onnx    picture -1..1, 1 x 3 x H x W -> mean, std 1 x channels x H/cell x W/cell
    unet.onnx           sample 1 x (2 channels + 1) x h x w, timestep f32 1, prompt_embeds -> prediction 1 x channels x h x w
    vae_decoder.onnx    latents -> picture
    tokenizer.json      vocabulary, merges by rank, the ids of start, end and padding, the length
    pipeline.json       latents, noise, and the settings of both schedulers
"""

import json

import torch
from diffusers import DDIMScheduler, EulerDiscreteScheduler
from diffusers.models.attention_processor import AttnProcessor

from common import compare, write

# Settings with the one value that viola computes with.
ONLY = {
    "unet": {
        "time_cond_proj_dim": None,
        "class_embed_type": None,
        "addition_embed_type": None,
        "encoder_hid_dim": None,
    },
    "vae": {"shift_factor": None, "latents_mean": None, "latents_std": None},
    "text encoder": {"use_attention_mask": False},
    "DDIM": {"trained_betas": None, "clip_sample": False, "thresholding": False, "rescale_betas_zero_snr": False},
    "Euler": {
        "trained_betas": None,
        "interpolation_type": "linear",
        "use_karras_sigmas": False,
        "use_exponential_sigmas": False,
        "use_beta_sigmas": False,
        "sigma_min": None,
        "sigma_max": None,
        "timestep_type": "discrete",
        "rescale_betas_zero_snr": False,
        "final_sigmas_type": "zero",
    },
}
BETA_SCHEDULES = ["linear", "scaled_linear"]
PREDICTIONS = ["epsilon", "v_prediction"]


class TextEncoder(torch.nn.Module):
    def __init__(self, encoder):
        super().__init__()
        self.encoder = encoder

    def forward(self, input_ids):
        return self.encoder(input_ids=input_ids)[0]


class VaeEncoder(torch.nn.Module):
    def __init__(self, vae):
        super().__init__()
        self.vae = vae

    def forward(self, picture):
        latents = self.vae.encode(picture).latent_dist
        return latents.mean, latents.std


class VaeDecoder(torch.nn.Module):
    def __init__(self, vae):
        super().__init__()
        self.vae = vae

    def forward(self, latents):
        return self.vae.decode(latents).sample


class Unet(torch.nn.Module):
    def __init__(self, unet):
        super().__init__()
        self.unet = unet

    def forward(self, sample, timestep, prompt_embeds):
        return self.unet(sample, timestep, encoder_hidden_states=prompt_embeds).sample


def refuse_others(part, config):
    for key, wanted in ONLY[part].items():
        got = config.get(key, wanted)
        if got != wanted:
            raise SystemExit(f"the {part} has {key} = {got!r}; only {wanted!r} can be run")


def one_of(config, key, known):
    if config[key] not in known:
        raise SystemExit(f"the scheduler has {key} = {config[key]!r}; only {', '.join(known)} can be run")
    return config[key]


def settings(pipe, cell):
    """What is computed outside the networks."""
    ddim = DDIMScheduler.from_config(pipe.scheduler.config).config
    euler = EulerDiscreteScheduler.from_config(pipe.scheduler.config).config
    refuse_others("unet", pipe.unet.config)
    refuse_others("vae", pipe.vae.config)
    refuse_others("text encoder", pipe.text_encoder.config.to_dict())
    refuse_others("DDIM", ddim)
    refuse_others("Euler", euler)
    return {
        "latents": {
            "channels": pipe.vae.config.latent_channels,
            "cell": cell,
            "scaling_factor": pipe.vae.config.scaling_factor,
        },
        "noise": {
            "train_steps": ddim["num_train_timesteps"],
            "beta_start": ddim["beta_start"],
            "beta_end": ddim["beta_end"],
            "beta_schedule": one_of(ddim, "beta_schedule", BETA_SCHEDULES),
            "prediction_type": one_of(ddim, "prediction_type", PREDICTIONS),
        },
        "ddim": {
            "timestep_spacing": ddim["timestep_spacing"],
            "steps_offset": ddim["steps_offset"],
            "set_alpha_to_one": ddim["set_alpha_to_one"],
        },
        "euler": {"timestep_spacing": euler["timestep_spacing"], "steps_offset": euler["steps_offset"]},
    }


def tokenizer(pipe):
    """The byte pairs of CLIP's tokenizer, their ranks, and what frames a text."""
    made = json.loads(pipe.tokenizer.backend_tokenizer.to_str())["model"]
    if made["type"] != "BPE" or made["end_of_word_suffix"] != "</w>":
        raise SystemExit("the tokenizer is not CLIP's")
    merges = [pair.split(" ") if isinstance(pair, str) else pair for pair in made["merges"]]
    return {
        "vocab": pipe.tokenizer.get_vocab(),
        "merges": merges,
        "start": pipe.tokenizer.bos_token_id,
        "end": pipe.tokenizer.eos_token_id,
        "pad": pipe.tokenizer.pad_token_id,
        "length": pipe.tokenizer.model_max_length,
    }


def export_pipeline(pipe, width, height, folder, largest_constant=1 << 22):
    """Writes all files for pictures of one size, and compares each network with the original on noise."""
    cell = 2 ** (len(pipe.vae.config.block_out_channels) - 1)
    # In an order that a person can read; the folder comes last, when nothing was refused.
    told, words = settings(pipe, cell), tokenizer(pipe)
    channels = pipe.vae.config.latent_channels
    if pipe.unet.config.in_channels != 2 * channels + 1:
        raise SystemExit(f"the unet takes {pipe.unet.config.in_channels} channels: it is not one for inpainting")
    if words["length"] != pipe.text_encoder.config.max_position_embeddings:
        raise SystemExit("the tokenizer's length is not the text encoder's")
    folder.mkdir(parents=True, exist_ok=True)
    # The fused attention of torch does not pass its exporter.
    pipe.text_encoder.set_attn_implementation("eager")
    pipe.unet.set_attn_processor(AttnProcessor())
    pipe.vae.set_attn_processor(AttnProcessor())
    chance = torch.Generator().manual_seed(1)
    noise = lambda *shape: torch.randn(shape, generator=chance)
    h, w = height // cell, width // cell
    prompt = noise(1, words["length"], pipe.text_encoder.config.hidden_size)
    ids = torch.full((1, words["length"]), words["end"], dtype=torch.int64)
    ids[0, 0] = words["start"]
    for name, module, inputs, outputs in [
        ("text_encoder", TextEncoder(pipe.text_encoder), {"input_ids": ids}, ["prompt_embeds"]),
        ("vae_encoder", VaeEncoder(pipe.vae), {"picture": noise(1, 3, height, width)}, ["mean", "std"]),
        (
            "unet",
            Unet(pipe.unet),
            {
                "sample": noise(1, 2 * channels + 1, h, w),
                "timestep": torch.tensor([501.0]),
                "prompt_embeds": prompt,
            },
            ["prediction"],
        ),
        ("vae_decoder", VaeDecoder(pipe.vae), {"latents": noise(1, channels, h, w)}, ["picture"]),
    ]:
        path = str(folder / f"{name}.onnx")
        print(path)
        write(module, inputs, outputs, path, largest_constant)
        compare(module.eval(), inputs, outputs, path)
    (folder / "tokenizer.json").write_text(json.dumps(words, separators=(",", ":")) + "\n")
    (folder / "pipeline.json").write_text(json.dumps(told, indent=1) + "\n")
