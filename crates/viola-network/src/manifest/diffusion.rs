//! The settings of a diffusion pipeline that an entry of the manifest gives.

use serde::{Deserialize, Serialize};

/// The longest prompt, in bytes.
const MAX_PROMPT_BYTES: usize = 500;
const MAX_STEPS: usize = 200;
const MAX_GUIDANCE: f32 = 50.0;

/// How a picture is drawn out of noise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Diffusion {
    /// What is to be seen, in English and ASCII.
    #[serde(default = "prompt")]
    pub prompt: String,
    /// What is not to be seen.
    #[serde(default)]
    pub negative_prompt: String,
    /// How much more the prompt counts than the negative one (Ho and Salimans, "Classifier-Free Diffusion
    /// Guidance", 2022); at 1 the negative prompt is not looked at.
    #[serde(default = "guidance")]
    pub guidance: f32,
    #[serde(default = "steps")]
    pub steps: usize,
    #[serde(default)]
    pub scheduler: Scheduler,
}

/// By which formula a step takes noise away.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Scheduler {
    /// Song et al., "Denoising Diffusion Implicit Models", 2021, without noise between the steps.
    #[default]
    Ddim,
    /// Euler's method as in Karras et al., "Elucidating the Design Space of Diffusion-Based Generative Models",
    /// 2022, without noise between the steps.
    Euler,
}

fn prompt() -> String {
    "a realistic photo of an empty room".to_owned()
}

fn guidance() -> f32 {
    7.5
}

fn steps() -> usize {
    30
}

impl Diffusion {
    /// The field that is wrong, and why.
    pub(super) fn check(&self) -> Result<(), (&'static str, &'static str)> {
        for (field, text) in
            [("output.prompt", &self.prompt), ("output.negative_prompt", &self.negative_prompt)]
        {
            if text.len() > MAX_PROMPT_BYTES {
                return Err((field, "must not be longer than 500 bytes"));
            }
        }
        if !(1.0..=MAX_GUIDANCE).contains(&self.guidance) {
            return Err(("output.guidance", "must be 1 to 50"));
        }
        if !(1..=MAX_STEPS).contains(&self.steps) {
            return Err(("output.steps", "must be 1 to 200"));
        }
        Ok(())
    }
}
