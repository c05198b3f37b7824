//! Opens an inpainting network of the manifest.

use super::migan::MiGan;
use super::{InpaintError, Inpainter, StableDiffusion};
use std::path::Path;
use viola_network as network;
use viola_network::RuntimeParams;
use viola_network::manifest::{ModelEntry, Output, Task};

/// Opens the entry's file or files in the models folder, and checks them against the entry.
pub fn open_inpainter(
    entry: &ModelEntry,
    models: &Path,
    params: &RuntimeParams,
) -> Result<Box<dyn Inpainter>, InpaintError> {
    let misfit = |problem: String| InpaintError::Misfit { network: entry.name.clone(), problem };
    let path = entry.path(models);
    match (entry.task, &entry.input, &entry.output) {
        (Task::Inpainting, Some(input), Some(Output::Inpainting { name, mask })) => {
            let network =
                network::open(&path, params).map_err(|error| InpaintError::Open(error.to_string()))?;
            let migan = MiGan::new(&entry.name, network, input, name.as_deref(), mask.as_deref());
            Ok(Box::new(migan.map_err(misfit)?))
        }
        (Task::Inpainting, _, Some(Output::Diffusion(_))) => {
            Ok(Box::new(StableDiffusion::open(entry, models, params)?))
        }
        _ => Err(misfit("it is not an inpainting network".to_owned())),
    }
}
