//! Settings of a diffusion pipeline in a manifest entry.

use serde::{Deserialize, Serialize};

/// Maximum length of a prompt, in bytes.
const MAX_PROMPT_BYTES: usize = 500;
const MAX_STEPS: usize = 200;
const MAX_GUIDANCE: f32 = 50.0;

/// Settings of a diffusion pipeline.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Diffusion {
    /// Description of the wanted content, in English and ASCII.
    #[serde(default = "prompt")]
    pub prompt: String,
    /// Description of the unwanted content.
    #[serde(default)]
    pub negative_prompt: String,
    /// Guidance scale: weight of the prompt against the negative one (Ho and Salimans, "Classifier-Free
    /// Diffusion Guidance", 2022); at 1 the negative prompt is ignored.
    #[serde(default = "guidance")]
    pub guidance: f32,
    #[serde(default = "steps")]
    pub steps: usize,
    #[serde(default)]
    pub scheduler: Scheduler,
}

/// Formula of a denoising step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Scheduler {
    /// Song et al., "Denoising Diffusion Implicit Models", 2021, without noise between the steps.
    #[default]
    Ddim,
    /// Euler's method as in Karras et al., "Elucidating the Design Space of Diffusion-Based Generative
    /// Models", 2022, without noise between the steps.
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
    /// Checks the settings; an error is the invalid field and the reason.
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
