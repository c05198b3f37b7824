//! Arguments for the networks of a command.

use super::runtime::RuntimeArguments;
use anyhow::{Context, Result};
use clap::Args;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::sync::Arc;
use viola_align::complete::inpaint::open_inpainter;
use viola_align::complete::monocular::open_estimator;
use viola_align::complete::{Imagination, ViewStrategy};
use viola_network as network;
use viola_network::manifest::{self, Task};
use viola_reconstruct::LabelParams;
use viola_reconstruct::label::{self, Segmenter, SurfaceNetwork};

#[derive(Args, Debug, Clone, Serialize, Deserialize)]
pub struct NetworkArguments {
    /// Folder of neural networks (see `viola models list`). Without it, classes come from geometry alone.
    #[arg(long, env = "VIOLA_MODELS", value_name = "DIR")]
    pub models: Option<PathBuf>,
    #[command(flatten)]
    runtime: RuntimeArguments,
}

impl NetworkArguments {
    /// Returns the segmentation network of the models folder, if one is installed.
    pub fn segmenter(&self) -> Result<Option<Arc<dyn Segmenter>>> {
        let Some(models) = &self.models else { return Ok(None) };
        let Some(entry) = label::installed(models).context("the list of networks")? else {
            tracing::warn!(
                "no segmentation network in {}: classes come from geometry alone",
                models.display()
            );
            return Ok(None);
        };
        let params = self.runtime.params(Some(models));
        let network =
            network::open(&entry.path(models), &params).with_context(|| format!("network {}", entry.name))?;
        tracing::info!(network = entry.name, runtime = network.runtime(), "{}", network.reason());
        let segmenter = label::open_segmenter(&entry, network)?;
        Ok(Some(Arc::from(segmenter)))
    }

    /// Returns the surface network of the models folder, if one is installed.
    pub fn surface(&self) -> Result<Option<Arc<SurfaceNetwork>>> {
        let Some(models) = &self.models else { return Ok(None) };
        let Some(entry) = manifest::installed(Task::Surface, models).context("the list of networks")? else {
            return Ok(None);
        };
        let network = network::open(&entry.path(models), &self.runtime.params(Some(models)))
            .with_context(|| format!("network {}", entry.name))?;
        tracing::info!(network = entry.name, runtime = network.runtime(), "{}", network.reason());
        Ok(Some(Arc::new(SurfaceNetwork::new(&entry, network)?)))
    }

    /// Returns the networks for the completion; none without an inpainting network in the models folder.
    pub fn imagination(&self) -> Result<Option<Imagination>> {
        let Some(models) = &self.models else { return Ok(None) };
        let params = self.runtime.params(Some(models));
        let installed = |task| manifest::installed(task, models).context("the list of networks");
        let Some(entry) = installed(Task::Inpainting)? else { return Ok(None) };
        let inpainter =
            open_inpainter(&entry, models, &params).with_context(|| format!("network {}", entry.name))?;
        let estimator = match installed(Task::Depth)? {
            Some(entry) => {
                let network = network::open(&entry.path(models), &params)
                    .with_context(|| format!("network {}", entry.name))?;
                Some(Arc::from(open_estimator(&entry, network)?))
            }
            None => None,
        };
        let views = ViewStrategy::Frontier;
        Ok(Some(Imagination { inpainter: Arc::from(inpainter), estimator, views, max_views: 6 }))
    }

    /// Returns the parameters for labels; a network that cannot be used is an error.
    pub fn labels(&self) -> Result<LabelParams> {
        Ok(LabelParams { segmenter: self.segmenter()?, surface: self.surface()?, ..LabelParams::default() })
    }

    /// Returns the parameters for a service. If the network cannot be used, classes come from geometry: the
    /// cause is logged, and every answer says so.
    pub fn labels_or_geometry(&self) -> LabelParams {
        self.labels().unwrap_or_else(|error| {
            tracing::error!("the network cannot be used: {error:#}");
            let unavailable = Some("the segmentation network could not be loaded".to_owned());
            LabelParams { unavailable, ..LabelParams::default() }
        })
    }
}
