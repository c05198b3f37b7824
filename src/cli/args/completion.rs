//! Arguments for the completion of what a clip did not see.

use super::networks::NetworkArguments;
use super::seconds::seconds;
use anyhow::{Result, anyhow};
use clap::{Args, ValueEnum};
use serde::{Deserialize, Serialize};
use std::time::Duration;
use viola_align::{Activation, CompleteParams};

#[derive(Args, Debug, Clone, Serialize, Deserialize)]
pub struct CompletionArguments {
    /// Method that fills in what a clip did not see at the vacuum's height.
    #[arg(long, value_enum, default_value_t = Completion::Structure)]
    complete: Completion,
    /// Complete every clip, not only those with an uncertain answer.
    #[arg(long)]
    complete_always: bool,
    /// Time after which the completion starts no new view, in seconds.
    #[arg(long, value_name = "SECONDS", default_value = "60", value_parser = seconds)]
    complete_seconds: Duration,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
enum Completion {
    /// No completion.
    Never,
    /// Extend walls to the floor and to each other.
    Structure,
    /// Structure, then pictures filled in by the inpainting and depth networks of the models folder.
    Imagination,
}

impl CompletionArguments {
    /// Returns the parameters; fails for imagination without an inpainting network in the models folder.
    pub fn params(&self, networks: &NetworkArguments) -> Result<CompleteParams> {
        let mut params = CompleteParams { time: self.complete_seconds, ..CompleteParams::default() };
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
