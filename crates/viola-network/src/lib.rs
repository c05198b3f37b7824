//! Runs a neural network: named tensors in, named tensors out.
//!
//! Two runtimes have one interface. `rten` is part of the program and always available. ONNX Runtime is a
//! library of the machine, loaded if it is found, and the only runtime with accelerators. A network is loaded
//! once and shared; any thread may run it.

mod check;
mod error;
mod library;
pub mod manifest;
mod memory;
mod runtime;
pub mod signature;
mod tensor;
mod weights;
mod with_onnxruntime;
mod with_rten;

pub use error::{MAX_MODEL_BYTES, NetworkError};
pub use memory::return_large_buffers;
pub use runtime::{Device, Network, Runtime, RuntimeParams};
pub use tensor::{Data, Element, Tensor, TensorInfo};
pub use weights::Weights;

use std::path::Path;
use std::sync::Arc;

/// Loads a network from an ONNX file, as [`open_weights`] does.
pub fn open(path: &Path, params: &RuntimeParams) -> Result<Arc<Network>, NetworkError> {
    open_weights(&Weights::File(path.to_owned()), params)
}

/// Loads a network from its weights in ONNX format.
///
/// A requested ONNX Runtime (by name, library path or accelerator) must work. If one is only found and does not load, or
/// does not run the network, `rten` is the fallback: [`Network::reason`] names the error, and [`RuntimeParams::warn`]
/// receives it.
pub fn open_weights(weights: &Weights, params: &RuntimeParams) -> Result<Arc<Network>, NetworkError> {
    weights.check()?;
    let network = choose(weights, params)?;
    if network.outputs.is_empty() {
        return Err(NetworkError::NotANetwork {
            file: weights.name(),
            reason: "it has no outputs".to_owned(),
        });
    }
    Ok(Arc::new(network))
}

/// Loads a network in the runtime that the parameters select.
fn choose(weights: &Weights, params: &RuntimeParams) -> Result<Network, NetworkError> {
    let rten = |reason: String| with_rten::open(weights, params.threads, reason);
    let onnxruntime = |library: &Path, reason: String| {
        with_onnxruntime::open(weights, library, params.device, params.threads, reason)
    };
    let is_asked = params.runtime == Runtime::OnnxRuntime || params.device != Device::Cpu;
    match (params.runtime, &params.library) {
        (Runtime::Rten, _) if params.device != Device::Cpu => Err(NetworkError::Device {
            device: params.device.name(),
            reason: "rten computes on the processor only".to_owned(),
        }),
        (Runtime::Rten, _) => rten("it was asked for".to_owned()),
        (_, Some(library)) => onnxruntime(library, format!("{} was named", library.display())),
        (_, None) => match library::find(&params.look_in) {
            Some(library) => {
                let opened =
                    onnxruntime(&library, format!("ONNX Runtime's library {} is there", library.display()));
                opened.or_else(|error| if is_asked { Err(error) } else { fall_back(&error, weights, params) })
            }
            None if is_asked => {
                Err(NetworkError::LibraryNowhere { places: library::places(&params.look_in) })
            }
            None => {
                rten(format!("no library of ONNX Runtime is found in {}", library::places(&params.look_in)))
            }
        },
    }
}

/// Loads a network in `rten` because of an error of the ONNX Runtime that was found. If neither loads it, the error has
/// both causes.
fn fall_back(
    error: &NetworkError,
    weights: &Weights,
    params: &RuntimeParams,
) -> Result<Network, NetworkError> {
    let reason = format!("ONNX Runtime cannot be used: {error}");
    let opened = with_rten::open(weights, params.threads, reason);
    let network = opened.map_err(|of_rten| match (of_rten, error) {
        (NetworkError::NotANetwork { file, reason }, NetworkError::NotANetwork { reason: first, .. }) => {
            NetworkError::NotANetwork { file, reason: format!("{reason}; in ONNX Runtime: {first}") }
        }
        (of_rten, _) => of_rten,
    })?;
    if let Some(warn) = params.warn {
        warn(&format!("{} runs in {}, because {}", weights.name(), network.runtime, network.reason));
    }
    Ok(network)
}
