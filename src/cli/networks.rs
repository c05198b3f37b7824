//! Which networks a command uses, and how they are run.

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
use viola_reconstruct::label::{self, Segmenter};

#[derive(Args, Debug, Clone, Serialize, Deserialize)]
pub struct NetworkArguments {
    /// Folder of neural networks (see `viola models list`). Without one, classes come from geometry alone.
    #[arg(long, env = "VIOLA_MODELS", value_name = "DIR")]
    pub models: Option<PathBuf>,
    #[command(flatten)]
    runtime: RuntimeArguments,
}

impl NetworkArguments {
    /// The segmentation network of the models folder; none when there is none in it.
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

    /// The networks that complete what a clip did not see; none where the models folder has none for inpainting.
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

    /// How points are labelled: a network that cannot be used is an error.
    pub fn labels(&self) -> Result<LabelParams> {
        Ok(LabelParams { segmenter: self.segmenter()?, ..LabelParams::default() })
    }

    /// The same for a service, which goes on without the network: the log has the cause, and every answer says
    /// that its classes come from geometry.
    pub fn labels_or_geometry(&self) -> LabelParams {
        self.labels().unwrap_or_else(|error| {
            tracing::error!("the network cannot be used: {error:#}");
            let unavailable = Some("the segmentation network could not be loaded".to_owned());
            LabelParams { unavailable, ..LabelParams::default() }
        })
    }
}
