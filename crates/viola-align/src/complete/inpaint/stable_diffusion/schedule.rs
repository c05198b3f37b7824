//! Coefficients of the denoising steps.
//!
//! Both schedulers are linear: with x the latents and p the U-Net's prediction, a step replaces x by the sum
//! of x and p, each times a number that depends only on the step.

use super::settings::{BetaSchedule, NoiseLevels, Prediction, Settings, Spacing};
use viola_network::manifest::Scheduler;

/// One step from more noise to less.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Step {
    /// Step of the training, an input of the U-Net.
    pub(super) timestep: f64,
    /// Factor of the latents at the U-Net's input.
    pub(super) input_scale: f64,
    /// Factors of the latents and of the U-Net's prediction in the next step's latents.
    pub(super) keep: f64,
    pub(super) add: f64,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Schedule {
    /// Standard deviation of the initial noise.
    pub(super) start: f64,
    pub(super) steps: Vec<Step>,
}

impl Schedule {
    pub(super) fn new(settings: &Settings, scheduler: Scheduler, steps: usize) -> Result<Schedule, String> {
        let noise = &settings.noise;
        if steps == 0 || steps > noise.train_steps {
            return Err(format!(
                "{steps} steps are asked for, and it was trained with {}",
                noise.train_steps
            ));
        }
        let kept = signal(noise);
        let (spacing, offset) = match scheduler {
            Scheduler::Ddim => (settings.ddim.timestep_spacing, settings.ddim.steps_offset),
            Scheduler::Euler => (settings.euler.timestep_spacing, settings.euler.steps_offset),
        };
        // DDIM looks its steps up in a table.
        let whole = scheduler == Scheduler::Ddim;
        let timesteps = timesteps(noise.train_steps, steps, spacing, offset, whole);
        if timesteps.iter().any(|t| !(0.0..=(noise.train_steps - 1) as f64).contains(t)) {
            return Err(format!("{steps} steps with an offset of {offset} leave the training's range"));
        }
        Ok(match scheduler {
            Scheduler::Ddim => {
                let stride = noise.train_steps / steps;
                let last = if settings.ddim.set_alpha_to_one { 1.0 } else { kept[0] };
                ddim(&timesteps, &kept, stride, last, noise.prediction_type)
            }
            Scheduler::Euler => euler(&timesteps, &kept, spacing, noise.prediction_type),
        })
    }
}

/// Returns for each step of the training the fraction of the variance that is still the picture's.
fn signal(noise: &NoiseLevels) -> Vec<f64> {
    let last = (noise.train_steps - 1).max(1) as f64;
    let beta = |step: usize| {
        let even = |from: f64, to: f64| from + (to - from) * step as f64 / last;
        match noise.beta_schedule {
            BetaSchedule::Linear => even(noise.beta_start, noise.beta_end),
            BetaSchedule::ScaledLinear => even(noise.beta_start.sqrt(), noise.beta_end.sqrt()).powi(2),
        }
    };
    let mut kept = 1.0;
    (0..noise.train_steps)
        .map(|step| {
            kept *= 1.0 - beta(step);
            kept
        })
        .collect()
}

/// Returns the training's steps that are used, from the one with the most noise.
fn timesteps(train_steps: usize, steps: usize, spacing: Spacing, offset: usize, whole: bool) -> Vec<f64> {
    let train = train_steps as f64;
    let at = |place: usize| match spacing {
        Spacing::Linspace => {
            let stride = if steps > 1 { (train - 1.0) / (steps as f64 - 1.0) } else { 0.0 };
            let t = (steps - 1 - place) as f64 * stride;
            if whole { t.round_ties_even() } else { t }
        }
        Spacing::Leading => ((steps - 1 - place) * (train_steps / steps) + offset) as f64,
        Spacing::Trailing => (train - place as f64 * train / steps as f64).round_ties_even() - 1.0,
    };
    (0..steps).map(at).collect()
}

/// Returns the schedule of Song et al., equation 12 without its random part. `last` is the picture's fraction
/// of the variance after the last step.
fn ddim(timesteps: &[f64], kept: &[f64], stride: usize, last: f64, prediction: Prediction) -> Schedule {
    let step = |timestep: &f64| {
        let at = *timestep as usize;
        let now = kept[at];
        let next = at.checked_sub(stride).map_or(last, |at| kept[at]);
        let (keep, add) = match prediction {
            Prediction::Epsilon => {
                let ratio = (next / now).sqrt();
                (ratio, (1.0 - next).sqrt() - ratio * (1.0 - now).sqrt())
            }
            Prediction::Velocity => {
                let noise = ((1.0 - now).sqrt(), (1.0 - next).sqrt());
                let signal = (now.sqrt(), next.sqrt());
                (signal.0 * signal.1 + noise.0 * noise.1, signal.0 * noise.1 - noise.0 * signal.1)
            }
        };
        Step { timestep: *timestep, input_scale: 1.0, keep, add }
    };
    Schedule { start: 1.0, steps: timesteps.iter().map(step).collect() }
}

/// Returns the schedule of Karras et al., algorithm 1 with Euler's method, in which latents are the picture's
/// plus noise of standard deviation sigma.
fn euler(timesteps: &[f64], kept: &[f64], spacing: Spacing, prediction: Prediction) -> Schedule {
    let sigma_at = |step: usize| ((1.0 - kept[step]) / kept[step]).sqrt();
    // Linear between two steps of the training.
    let sigma = |timestep: f64| {
        let below = timestep.floor() as usize;
        let above = (below + 1).min(kept.len() - 1);
        let fraction = timestep - timestep.floor();
        sigma_at(below) + fraction * (sigma_at(above) - sigma_at(below))
    };
    let sigmas: Vec<f64> = timesteps.iter().map(|t| sigma(*t)).chain([0.0]).collect();
    let steps = timesteps.iter().zip(sigmas.windows(2)).map(|(timestep, pair)| {
        let (now, next) = (pair[0], pair[1]);
        let variance = now * now + 1.0;
        let (keep, add) = match prediction {
            Prediction::Epsilon => (1.0, next - now),
            Prediction::Velocity => (1.0 + (next - now) * now / variance, (next - now) / variance.sqrt()),
        };
        Step { timestep: *timestep, input_scale: 1.0 / variance.sqrt(), keep, add }
    });
    let largest = sigmas[0];
    let start = match spacing {
        Spacing::Linspace | Spacing::Trailing => largest,
        Spacing::Leading => (largest * largest + 1.0).sqrt(),
    };
    Schedule { start, steps: steps.collect() }
}

#[cfg(test)]
mod tests;
