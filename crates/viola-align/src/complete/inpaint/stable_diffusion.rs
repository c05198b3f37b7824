//! Stable Diffusion for inpainting (Rombach et al., "High-Resolution Image Synthesis with Latent Diffusion
//! Models", 2022): noise becomes a picture in many small steps, each conditioned on the prompt, the mask and
//! the masked picture.

mod frame;
mod parts;
mod schedule;
mod settings;
mod tokenizer;

use super::{InpaintError, Inpainter, hole};
use frame::Frame;
use image::{GrayImage, RgbImage};
use parts::Parts;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use schedule::Schedule;
use settings::Settings;
use std::path::Path;
use tokenizer::Tokenizer;
use viola_network::manifest::{Channels, Input, Layout, ModelEntry, Output};
use viola_network::{RuntimeParams, Tensor};

/// A pipeline with fixed prompt, steps and networks.
pub struct StableDiffusion {
    name: String,
    input: Input,
    settings: Settings,
    schedule: Schedule,
    guidance: f32,
    prompt: Tensor,
    /// `None` if guidance does not use it.
    negative: Option<Tensor>,
    parts: Parts,
}

/// Standard normal numbers, one for each latent, channel by channel.
#[derive(Debug, Clone, PartialEq)]
pub struct Noise {
    /// Initial latents of the picture.
    pub initial: Vec<f32>,
    /// Noise that samples the masked picture's latents from their distribution.
    pub encoding: Vec<f32>,
}

/// Output of the networks.
#[derive(Debug, Clone, PartialEq)]
pub struct Generated {
    /// The last latents, channel by channel, not yet scaled for the decoder.
    pub latents: Vec<f32>,
    /// The decoded picture at the size of the given one; parts outside the holes are generated, too.
    pub picture: RgbImage,
}

impl StableDiffusion {
    /// Opens the pipeline in the folder of the entry's file.
    pub fn open(
        entry: &ModelEntry,
        models: &Path,
        params: &RuntimeParams,
    ) -> Result<StableDiffusion, InpaintError> {
        let misfit = |problem: String| InpaintError::Misfit { network: entry.name.clone(), problem };
        let (Some(input), Some(Output::Diffusion(diffusion))) = (&entry.input, &entry.output) else {
            return Err(misfit("it is not a diffusion pipeline".to_owned()));
        };
        let halves = input.mean == [0.5; 3] && input.std == [0.5; 3];
        if !halves || input.layout != Layout::Nchw || input.channels != Channels::Rgb {
            return Err(misfit("pictures go in as red, green and blue with mean 0.5 and std 0.5".to_owned()));
        }
        let file = entry.path(models);
        let folder = file.parent().unwrap_or(models);
        let settings: Settings = settings::read(&file).map_err(misfit)?;
        settings.check().map_err(misfit)?;
        let schedule = Schedule::new(&settings, diffusion.scheduler, diffusion.steps).map_err(misfit)?;
        let words = settings::read(&folder.join("tokenizer.json")).map_err(misfit)?;
        let tokenizer = Tokenizer::new(words).map_err(misfit)?;
        let tokens = tokenizer.encode(&diffusion.prompt).map_err(misfit)?;
        let negative = tokenizer.encode(&diffusion.negative_prompt).map_err(misfit)?;
        // The prompts are fixed, so their encoder is needed only here.
        let encoder = parts::open(folder, "text_encoder.onnx", params)?;
        parts::is_text_encoder(&encoder, tokens.len()).map_err(misfit)?;
        let prompt = parts::embed(&encoder, tokens)?;
        let negative = match diffusion.guidance > 1.0 {
            true => Some(parts::embed(&encoder, negative)?),
            false => None,
        };
        drop(encoder);
        let parts = Parts::open(folder, params, input, &settings.latents, &prompt.shape, misfit)?;
        Ok(StableDiffusion {
            name: format!("{}, {}", entry.name, parts.runtime()),
            input: input.clone(),
            settings,
            schedule,
            guidance: diffusion.guidance,
            prompt,
            negative,
            parts,
        })
    }

    /// Returns the noise of a seed.
    pub fn noise(&self, seed: u64) -> Noise {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut numbers = || (0..self.parts.latents()).map(|_| normal(&mut rng)).collect();
        Noise { initial: numbers(), encoding: numbers() }
    }

    /// Fills the holes, from given noise.
    pub fn generate(
        &self,
        picture: &RgbImage,
        hole: &GrayImage,
        noise: &Noise,
        keep_going: &dyn Fn() -> bool,
    ) -> Result<Generated, InpaintError> {
        hole::any(picture, hole)?;
        let wanted = self.parts.latents();
        for numbers in [&noise.initial, &noise.encoding] {
            if numbers.len() != wanted {
                let got = format!("noise of {} numbers", numbers.len());
                return Err(InpaintError::Shape { got, want: wanted.to_string() });
            }
        }
        let go_on = || if keep_going() { Ok(()) } else { Err(InpaintError::Cancelled) };
        go_on()?;
        let scale = &self.settings.latents;
        let frame = Frame::new(picture, hole, &self.input, self.parts.size, scale.cell);
        let (mean, std) = self.parts.encode(frame.masked.clone())?;
        let masked: Vec<f32> = mean
            .iter()
            .zip(&std)
            .zip(&noise.encoding)
            .map(|((mean, std), noise)| (mean + std * noise) * scale.scaling_factor)
            .collect();
        let mut latents: Vec<f32> =
            noise.initial.iter().map(|value| value * self.schedule.start as f32).collect();
        for step in &self.schedule.steps {
            go_on()?;
            let seen: Vec<f32> = latents.iter().map(|value| value * step.input_scale as f32).collect();
            let mut said = self.parts.predict(&seen, &frame.mask, &masked, step.timestep, &self.prompt)?;
            if let Some(negative) = &self.negative {
                go_on()?;
                let without = self.parts.predict(&seen, &frame.mask, &masked, step.timestep, negative)?;
                for (said, without) in said.iter_mut().zip(&without) {
                    *said = without + self.guidance * (*said - without);
                }
            }
            for (latent, said) in latents.iter_mut().zip(&said) {
                *latent = (f64::from(*latent) * step.keep + f64::from(*said) * step.add) as f32;
            }
        }
        go_on()?;
        let decoded =
            self.parts.decode(latents.iter().map(|value| value / scale.scaling_factor).collect())?;
        let picture = frame.picture(&decoded)?;
        Ok(Generated { latents, picture })
    }
}

impl Inpainter for StableDiffusion {
    fn inpaint(
        &self,
        picture: &RgbImage,
        hole: &GrayImage,
        seed: u64,
        keep_going: &dyn Fn() -> bool,
    ) -> Result<RgbImage, InpaintError> {
        if !hole::any(picture, hole)? {
            return Ok(picture.clone());
        }
        let generated = self.generate(picture, hole, &self.noise(seed), keep_going)?;
        Ok(hole::put_back(picture, hole, &generated.picture))
    }

    fn name(&self) -> String {
        self.name.clone()
    }
}

/// Returns a standard normal number (Box and Muller, 1958).
fn normal(rng: &mut ChaCha8Rng) -> f32 {
    // In (0, 1], so that the logarithm is finite.
    let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
    (radius * (std::f64::consts::TAU * rng.random::<f64>()).cos()) as f32
}
