//! Arguments of the alignment, for the commands of a service.

use super::completion::CompletionArguments;
use super::networks::NetworkArguments;
use crate::cli::video_tools::video_tools;
use crate::jobs::JobParams;
use anyhow::Result;
use clap::Args;
use serde::{Deserialize, Serialize};
use viola_align::AlignParams;

/// Arguments of the alignment, serialised for a child process that aligns in the same way.
#[derive(Args, Debug, Clone, Serialize, Deserialize)]
pub struct MethodArguments {
    #[command(flatten)]
    networks: NetworkArguments,
    #[command(flatten)]
    completion: CompletionArguments,
}

impl MethodArguments {
    /// Returns whether networks of a models folder may be loaded.
    pub fn has_models_folder(&self) -> bool {
        self.networks.folder().is_some()
    }

    pub fn params(&self) -> Result<JobParams> {
        let align = AlignParams {
            label: self.networks.labels_of_service(),
            complete: self.completion.params(&self.networks)?,
            ..AlignParams::default()
        };
        Ok(JobParams { align, video: video_tools(), ..JobParams::default() })
    }
}
