//! Whether and how a command completes what a clip did not see.

use super::networks::NetworkArguments;
use anyhow::{Result, anyhow};
use clap::{Args, ValueEnum};
use serde::{Deserialize, Serialize};
use std::time::Duration;
use viola_align::{Activation, CompleteParams};

#[derive(Args, Debug, Clone, Serialize, Deserialize)]
pub struct CompletionArguments {
    /// When to fill in what a clip did not see at the vacuum's height, and with what.
    #[arg(long, value_enum, default_value_t = Completion::Structure)]
    complete: Completion,
    /// Complete every clip, not only those that leave doubt.
    #[arg(long)]
    complete_always: bool,
    /// Take no new view once completion has taken this long.
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0)]
    complete_seconds: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
enum Completion {
    /// Nothing is filled in.
    Never,
    /// Walls go on to the floor and to each other.
    Structure,
    /// After structure, pictures filled in by the inpainting and depth networks of the models folder.
    Imagination,
}

impl CompletionArguments {
    /// Imagination without an inpainting network in the models folder is an error.
    pub fn params(&self, networks: &NetworkArguments) -> Result<CompleteParams> {
        let time = Duration::from_secs_f64(self.complete_seconds.clamp(0.0, 86_400.0));
        let mut params = CompleteParams { time, ..CompleteParams::default() };
        if self.complete_always {
            params.when = Activation::Always;
        }
        match self.complete {
            Completion::Never => params.when = Activation::Never,
            Completion::Structure => {}
            Completion::Imagination => {
                let networks = networks.imagination()?;
                params.imagination = Some(networks.ok_or_else(|| {
                    anyhow!("imagination needs an inpainting network: `viola models fetch migan --models DIR`, then --models DIR")
                })?);
            }
        }
        Ok(params)
    }
}
