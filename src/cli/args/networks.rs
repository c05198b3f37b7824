//! Arguments for the networks of a command.

use super::runtime::RuntimeArguments;
use crate::cli::progress::print_line;
use crate::cli::sum;
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
use viola_network::manifest::{self, Installed, ModelEntry, Output, Task};
use viola_network::{Network, Weights};
use viola_reconstruct::LabelParams;
use viola_reconstruct::label::{self, Segmenter, SurfaceNetwork};

const VARIABLE: &str = "VIOLA_MODELS";
/// Value of `--models` that switches all networks off.
pub const NO_NETWORKS: &str = "none";

#[derive(Args, Debug, Clone, Serialize, Deserialize)]
pub struct NetworkArguments {
    /// Folder of neural networks (see `viola models list`). Without it, the built-in network classifies
    /// surfaces. `none` uses no network at all: classes then come from geometry alone.
    #[arg(long, env = VARIABLE, value_name = "DIR", value_parser = OsStringValueParser::new().map(PathBuf::from))]
    models: Option<PathBuf>,
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

    /// Returns whether the command line names a models folder or a runtime. Those of the environment do not count.
    pub fn are_given(&self) -> bool {
        let of_environment = std::env::var_os(VARIABLE).map(PathBuf::from);
        self.runtime.is_given() || (self.models.is_some() && self.models != of_environment)
    }

    /// Returns the entries and the checksums of the networks for some tasks: others may give other results.
    pub fn content(&self, tasks: &[Task]) -> Result<String> {
        let mut content = String::new();
        for task in tasks {
            let Some(Installed { entry, weights }) = self.installed(*task)? else { continue };
            let sum = match &weights {
                Weights::File(path) if matches!(entry.output, Some(Output::Diffusion(_))) => {
                    sum::of_folder(path.parent().unwrap_or(Path::new(".")))?
                }
                weights => sum::of_weights(weights)?,
            };
            content += &format!("{entry:?} {sum}\n");
        }
        Ok(content)
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

    fn open(&self, installed: &Installed) -> Result<Arc<Network>> {
        let name = &installed.entry.name;
        let network = network::open_weights(&installed.weights, &self.runtime.params(self.folder()))
            .with_context(|| format!("network {name}"))?;
        tracing::info!(network = name, runtime = network.runtime(), "{}", network.reason());
        Ok(network)
    }

    /// Returns the segmentation network of the models folder, if one is installed.
    fn segmenter(&self) -> Result<Option<Arc<dyn Segmenter>>> {
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
        let segmenter = self.segmenter()?;
        if let Some(models) = self.folder().filter(|_| segmenter.is_none()) {
            print_line(&format!("no segmentation network in {}: pictures give no classes", models.display()));
        }
        Ok(LabelParams { segmenter, ..self.surface_labels()? })
    }

    /// Returns the parameters for labels without pictures, for simulated clips: their pictures are too plain
    /// for a network.
    pub fn surface_labels(&self) -> Result<LabelParams> {
        Ok(LabelParams { surface: self.surface()?, ..LabelParams::default() })
    }

    /// Returns the parameters for a service. A network that cannot be used is left out: the cause is logged and added
    /// to `unavailable`.
    pub fn labels_of_service(&self, unavailable: &mut Vec<String>) -> LabelParams {
        let segmenter = loaded(self.segmenter(), "segmentation", unavailable);
        let surface = loaded(self.surface(), "surface", unavailable);
        LabelParams { segmenter, surface, ..LabelParams::default() }
    }
}

/// Returns a network, or logs why it cannot be used and adds that to `unavailable`.
pub(super) fn loaded<N>(network: Result<Option<N>>, task: &str, unavailable: &mut Vec<String>) -> Option<N> {
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

    /// `viola evaluate` computes the results of other networks again.
    #[test]
    fn other_files_of_a_network_have_other_contents() {
        let own = tempfile::tempdir().unwrap();
        let line = Line::parse_from(["viola", "--models", own.path().to_str().unwrap()]);
        let content = |task: Task| line.networks.content(&[task]).unwrap();
        for (task, file) in [
            (Task::Surface, "columns/columns.onnx"),
            (Task::Segmentation, "segformer-ade20k/segformer.onnx"),
            (Task::Inpainting, "stable-diffusion-inpainting/pipeline.json"),
            (Task::Inpainting, "stable-diffusion-inpainting/unet/model.onnx"),
        ] {
            let path = own.path().join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            let mut known = vec![content(task)];
            for bytes in ["first", "other"] {
                std::fs::write(&path, bytes).unwrap();
                assert!(!known.contains(&content(task)), "{file} of {bytes}");
                known.push(content(task));
            }
        }
    }
}
