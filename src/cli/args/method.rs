//! Arguments of the alignment.

use super::completion::CompletionArguments;
use super::networks::NetworkArguments;
use crate::cli::video_tools::video_tools;
use crate::jobs::{JobParams, SurfaceLabels};
use anyhow::Result;
use clap::Args;
use serde::{Deserialize, Serialize};
use viola_align::AlignParams;
use viola_reconstruct::LabelParams;

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

    /// Returns the network for the surfaces of homes.
    pub fn surface(&self) -> Result<SurfaceLabels> {
        self.networks.surface()
    }

    /// Refuses values that exclude each other.
    pub fn check(&self) -> Result<()> {
        self.completion.check()
    }

    /// Returns the parameters of a command for its user's own clips; a network that cannot be used is an error.
    pub fn own_params(&self, seed: u64) -> Result<AlignParams> {
        let label = self.networks.labels()?;
        let complete = self.completion.params(&self.networks)?;
        Ok(AlignParams { seed, label, complete, ..AlignParams::default() })
    }

    /// Returns the parameters of a service. Networks that cannot be used are left out: the causes are logged, and every
    /// answer says so.
    pub fn params(&self) -> Result<JobParams> {
        let mut unavailable = Vec::new();
        let label = self.networks.labels_of_service(&mut unavailable);
        let complete = self.completion.params_of_service(&self.networks, &mut unavailable)?;
        let unavailable = Some(unavailable.join("; ")).filter(|text| !text.is_empty());
        let label = LabelParams { unavailable, ..label };
        let align = AlignParams { label, complete, ..AlignParams::default() };
        Ok(JobParams { align, video: video_tools(), ..JobParams::default() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        method: MethodArguments,
    }

    fn params(arguments: &str) -> Result<JobParams> {
        let words = ["viola", "--models", "none"].into_iter().chain(arguments.split_whitespace());
        Line::parse_from(words).method.params()
    }

    #[test]
    fn a_service_without_the_networks_of_the_imagination_completes_by_structure() {
        let align = params("--complete imagination").unwrap().align;
        assert_eq!(align.complete, params("").unwrap().align.complete);
        let unavailable = align.label.unavailable.unwrap();
        assert!(unavailable.contains("inpainting"), "{unavailable}");
    }

    #[test]
    fn a_completion_is_never_or_always() {
        let error = params("--complete never --complete-always").err().unwrap();
        assert!(error.is::<clap::Error>(), "{error}");
    }
}
