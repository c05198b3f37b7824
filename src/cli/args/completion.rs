//! Arguments for the completion of what a clip did not see.

use super::networks::{NetworkArguments, loaded};
use super::seconds::seconds;
use super::wrong_arguments;
use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use serde::{Deserialize, Serialize};
use std::time::Duration;
use viola_align::complete::Imagination;
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
        Ok(CompleteParams { imagination: self.imagination(networks)?, ..self.without_networks()? })
    }

    /// Returns the parameters for a service: by structure alone if a network of the imagination cannot be used. Its
    /// cause is logged and added to `unavailable`.
    pub fn params_of_service(
        &self,
        networks: &NetworkArguments,
        unavailable: &mut Vec<String>,
    ) -> Result<CompleteParams> {
        let imagination = loaded(self.imagination(networks), "inpainting or depth", unavailable);
        Ok(CompleteParams { imagination, ..self.without_networks()? })
    }

    /// Refuses values that exclude each other.
    pub fn check(&self) -> Result<()> {
        self.without_networks().map(drop)
    }

    fn without_networks(&self) -> Result<CompleteParams> {
        let when = match (self.complete, self.complete_always) {
            (Completion::Never, true) => {
                return Err(wrong_arguments("'--complete-always' cannot be used with '--complete never'"));
            }
            (Completion::Never, false) => Activation::Never,
            (_, true) => Activation::Always,
            (_, false) => CompleteParams::default().when,
        };
        Ok(CompleteParams { when, time: self.complete_seconds, ..CompleteParams::default() })
    }

    /// Returns the networks of the imagination; `None` if it is not wanted.
    fn imagination(&self, networks: &NetworkArguments) -> Result<Option<Imagination>> {
        if self.complete != Completion::Imagination {
            return Ok(None);
        }
        let found = networks.imagination()?;
        found.map(Some).context(
            "imagination needs an inpainting network: `viola models fetch migan --models DIR`, then --models DIR",
        )
    }
}
