//! Which networks a command uses, and how they are run.

use crate::align::label::{self, Segmenter};
use crate::network::{self, RuntimeParams};
use anyhow::{Context, Result};
use clap::Args;
use std::path::PathBuf;
use std::sync::Arc;

#[derive(Args, Debug, Clone, Default)]
pub struct NetworkArguments {
    /// Folder of neural networks (see `viola models list`). Without one, classes come from geometry alone.
    #[arg(long, env = "VIOLA_MODELS", value_name = "DIR")]
    pub models: Option<PathBuf>,
    /// ONNX Runtime's library, if it is not where the system looks.
    #[arg(long, env = "ORT_DYLIB_PATH", value_name = "FILE")]
    pub onnxruntime: Option<PathBuf>,
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
        let params = RuntimeParams {
            library: self.onnxruntime.clone(),
            look_in: vec![models.clone()],
            ..RuntimeParams::default()
        };
        let network =
            network::open(&entry.path(models), &params).with_context(|| format!("network {}", entry.name))?;
        tracing::info!(network = entry.name, runtime = network.runtime(), "{}", network.reason());
        let segmenter = label::open_segmenter(&entry, network)?;
        Ok(Some(Arc::from(segmenter)))
    }
}
