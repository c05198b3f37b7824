//! The settings that an export writes beside its networks.

use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::io::Read;
use std::path::Path;

/// Maximum bytes of a settings file; CLIP's vocabulary with its merges has two million.
const MAX_BYTES: u64 = 16 << 20;

/// `pipeline.json`: parameters of the computation outside the networks.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Settings {
    pub(super) latents: Latents,
    pub(super) noise: NoiseLevels,
    pub(super) ddim: Ddim,
    pub(super) euler: Euler,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Latents {
    pub(super) channels: usize,
    /// Pixels of the picture along each side of a latent.
    pub(super) cell: usize,
    /// Factor of the encoder's latents.
    pub(super) scaling_factor: f32,
}

/// Noise at each step of the training.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct NoiseLevels {
    pub(super) train_steps: usize,
    pub(super) beta_start: f64,
    pub(super) beta_end: f64,
    pub(super) beta_schedule: BetaSchedule,
    pub(super) prediction_type: Prediction,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum BetaSchedule {
    /// The variance that a step adds grows linearly.
    Linear,
    /// The root of that variance grows linearly.
    ScaledLinear,
}

/// Quantity that the U-Net predicts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
pub(super) enum Prediction {
    /// The noise.
    #[serde(rename = "epsilon")]
    Epsilon,
    /// Velocity (Salimans and Ho, "Progressive Distillation for Fast Sampling of Diffusion Models", 2022).
    #[serde(rename = "v_prediction")]
    Velocity,
}

/// Selection of the training's steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Spacing {
    /// From the first to the last, evenly.
    Linspace,
    /// Whole strides from the first.
    Leading,
    /// Even strides back from the last.
    Trailing,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Ddim {
    pub(super) timestep_spacing: Spacing,
    /// Added to the steps of [`Spacing::Leading`].
    pub(super) steps_offset: usize,
    /// True if the last step ends without noise; otherwise with that of the training's first step.
    pub(super) set_alpha_to_one: bool,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Euler {
    pub(super) timestep_spacing: Spacing,
    pub(super) steps_offset: usize,
}

impl Settings {
    pub(super) fn check(&self) -> Result<(), String> {
        let Settings { latents, noise, ddim, euler } = self;
        let within =
            |name: &str, fits: bool| if fits { Ok(()) } else { Err(format!("its {name} is out of range")) };
        within("latents.channels", (1..=64).contains(&latents.channels))?;
        within("latents.cell", (1..=64).contains(&latents.cell))?;
        within("latents.scaling_factor", (1e-3..=1e3).contains(&latents.scaling_factor))?;
        within("noise.train_steps", (1..=100_000).contains(&noise.train_steps))?;
        within("noise.beta_start", noise.beta_start > 0.0 && noise.beta_start <= noise.beta_end)?;
        within("noise.beta_end", noise.beta_end < 1.0)?;
        within("ddim.steps_offset", ddim.steps_offset < noise.train_steps)?;
        within("euler.steps_offset", euler.steps_offset < noise.train_steps)
    }
}

/// Reads a JSON file of at most [`MAX_BYTES`].
pub(super) fn read<T: DeserializeOwned>(path: &Path) -> Result<T, String> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let mut text = String::new();
    std::fs::File::open(path)
        .and_then(|file| file.take(MAX_BYTES + 1).read_to_string(&mut text))
        .map_err(|error| format!("{name} cannot be read: {error}"))?;
    if text.len() as u64 > MAX_BYTES {
        return Err(format!("{name} has more than {MAX_BYTES} bytes"));
    }
    serde_json::from_str(&text).map_err(|error| format!("{name}: {error}"))
}
