//! Arguments for the networks of a command.

use super::runtime::RuntimeArguments;
use crate::cli::models::sum;
use anyhow::{Context, Result, bail};
use clap::Args;
use clap::builder::{OsStringValueParser, TypedValueParser};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use viola_align::complete::inpaint::open_inpainter;
use viola_align::complete::monocular::open_estimator;
use viola_align::complete::{Imagination, ViewStrategy};
use viola_network as network;
use viola_network::Network;
use viola_network::manifest::{self, Installed, ModelEntry, Task};
use viola_reconstruct::LabelParams;
use viola_reconstruct::label::{self, Segmenter, SurfaceNetwork};

/// Value of `--models` that switches all networks off.
pub const NO_NETWORKS: &str = "none";

#[derive(Args, Debug, Clone, Serialize, Deserialize)]
pub struct NetworkArguments {
    /// Folder of neural networks (see `viola models list`). Without it, the built-in network classifies
    /// surfaces. `none` uses no network at all: classes then come from geometry alone.
    #[arg(long, env = "VIOLA_MODELS", value_name = "DIR", value_parser = OsStringValueParser::new().map(PathBuf::from))]
    pub models: Option<PathBuf>,
    #[command(flatten)]
    runtime: RuntimeArguments,
}

impl NetworkArguments {
    /// Returns whether all networks are switched off.
    fn is_off(&self) -> bool {
        self.models.as_deref() == Some(Path::new(NO_NETWORKS))
    }

    /// Returns the models folder; `None` without one.
    pub(super) fn folder(&self) -> Option<&Path> {
        // A shell may unset a variable by making it empty.
        self.models.as_deref().filter(|models| !self.is_off() && !models.as_os_str().is_empty())
    }

    fn installed(&self, task: Task) -> Result<Option<Installed>> {
        if self.is_off() {
            return Ok(None);
        }
        if let Some(folder) = self.folder().filter(|folder| !folder.is_dir()) {
            bail!(
                "the models folder {} does not exist; `viola models fetch NAME --models DIR` makes one",
                folder.display()
            );
        }
        manifest::installed(task, self.folder()).context("the list of networks")
    }

    fn open(&self, installed: &Installed) -> Result<Arc<dyn Network>> {
        let name = &installed.entry.name;
        let network = network::open_weights(&installed.weights, &self.runtime.params(self.folder()))
            .with_context(|| format!("network {name}"))?;
        tracing::info!(network = name, runtime = network.runtime(), "{}", network.reason());
        Ok(network)
    }

    /// Returns the segmentation network of the models folder, if one is installed.
    pub fn segmenter(&self) -> Result<Option<Arc<dyn Segmenter>>> {
        let Some(installed) = self.installed(Task::Segmentation)? else {
            if let Some(models) = self.folder() {
                tracing::warn!("no segmentation network in {}: pictures give no classes", models.display());
            }
            return Ok(None);
        };
        let segmenter = label::open_segmenter(&installed.entry, self.open(&installed)?)?;
        Ok(Some(Arc::from(segmenter)))
    }

    /// Returns the surface network: that of the models folder, else the built-in one.
    pub fn surface(&self) -> Result<Option<Arc<SurfaceNetwork>>> {
        let Some(installed) = self.installed(Task::Surface)? else { return Ok(None) };
        let network = self.open(&installed)?;
        // The sum of the file itself: another file may have replaced the one that the list tells.
        let sum = sum::of_weights(&installed.weights)?;
        let entry = ModelEntry { sha256: Some(sum), ..installed.entry };
        Ok(Some(Arc::new(SurfaceNetwork::new(&entry, network)?)))
    }

    /// Returns the networks for the completion; none without an inpainting network in the models folder.
    pub fn imagination(&self) -> Result<Option<Imagination>> {
        let Some(models) = self.folder() else { return Ok(None) };
        let Some(Installed { entry, .. }) = self.installed(Task::Inpainting)? else { return Ok(None) };
        let inpainter = open_inpainter(&entry, models, &self.runtime.params(Some(models)))
            .with_context(|| format!("network {}", entry.name))?;
        let estimator = match self.installed(Task::Depth)? {
            Some(installed) => Some(Arc::from(open_estimator(&installed.entry, self.open(&installed)?)?)),
            None => None,
        };
        let views = ViewStrategy::Frontier;
        Ok(Some(Imagination { inpainter: Arc::from(inpainter), estimator, views, max_views: 6 }))
    }

    /// Returns the parameters for labels; a network that cannot be used is an error.
    pub fn labels(&self) -> Result<LabelParams> {
        Ok(LabelParams { segmenter: self.segmenter()?, ..self.surface_labels()? })
    }

    /// Returns the parameters for labels without pictures, for simulated clips: their pictures are too plain
    /// for a network.
    pub fn surface_labels(&self) -> Result<LabelParams> {
        Ok(LabelParams { surface: self.surface()?, ..LabelParams::default() })
    }

    /// Returns the parameters for a service. A network that cannot be used is left out: the cause is logged,
    /// and every answer says so.
    pub fn labels_of_service(&self) -> LabelParams {
        let mut unavailable = Vec::new();
        let segmenter = loaded(self.segmenter(), "segmentation", &mut unavailable);
        let surface = loaded(self.surface(), "surface", &mut unavailable);
        let unavailable = Some(unavailable.join("; ")).filter(|text| !text.is_empty());
        LabelParams { segmenter, surface, unavailable, ..LabelParams::default() }
    }
}

/// Returns a network, or logs why it cannot be used and adds that to `unavailable`.
fn loaded<N>(network: Result<Option<N>>, task: &str, unavailable: &mut Vec<String>) -> Option<N> {
    network.unwrap_or_else(|error| {
        tracing::error!("the {task} network cannot be used: {error:#}");
        // The cause may name files of the host.
        unavailable.push(format!("the {task} network could not be loaded"));
        None
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        networks: NetworkArguments,
    }

    /// Home maps are labelled again if the version changed.
    #[test]
    fn a_file_that_replaces_the_built_in_network_has_another_version() {
        let own = tempfile::tempdir().unwrap();
        std::fs::create_dir(own.path().join("columns")).unwrap();
        let small = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/models/columns.onnx");
        std::fs::copy(small, own.path().join("columns/columns.onnx")).unwrap();
        let version = |models: &str| {
            let line = Line::parse_from(["viola", "--models", models]);
            line.networks.surface().unwrap().unwrap().version().to_owned()
        };
        assert_ne!(version(""), version(own.path().to_str().unwrap()));
    }
}
