//! How clips are aligned, as the command line of a service says it.

use super::completion::CompletionArguments;
use super::networks::NetworkArguments;
use super::video_tools::video_tools;
use crate::jobs::JobParams;
use anyhow::Result;
use clap::Args;
use serde::{Deserialize, Serialize};
use viola_align::AlignParams;

/// Serialized for a child that is to align in the same way.
#[derive(Args, Debug, Clone, Serialize, Deserialize)]
pub struct MethodArguments {
    #[command(flatten)]
    networks: NetworkArguments,
    #[command(flatten)]
    completion: CompletionArguments,
}

impl MethodArguments {
    pub fn params(&self) -> Result<JobParams> {
        let align = AlignParams {
            label: self.networks.labels_or_geometry(),
            complete: self.completion.params(&self.networks)?,
            ..AlignParams::default()
        };
        Ok(JobParams { align, video: video_tools() })
    }
}
