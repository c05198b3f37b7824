//! Runs a neural network: named tensors in, named tensors out.
//!
//! Two runtimes stand behind one interface. `rten` is part of the program and always there; ONNX Runtime is a
//! library of the machine that is loaded when it is found, and is the only one that knows accelerators. A
//! network is loaded once and shared; any thread may run it.

mod check;
mod error;
mod library;
pub mod manifest;
pub mod signature;
mod tensor;
mod with_onnxruntime;
mod with_rten;

pub use error::NetworkError;
pub use tensor::{Data, Element, Tensor, TensorInfo};

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use with_onnxruntime::OnnxRuntimeNetwork;
use with_rten::RtenNetwork;

/// The largest model file that is opened: the weights lie in memory while the network lives.
pub const MAX_MODEL_BYTES: u64 = 4 << 30;

/// A loaded network.
pub trait Network: Send + Sync {
    fn inputs(&self) -> &[TensorInfo];

    fn outputs(&self) -> &[TensorInfo];

    /// Runs the network on one value for each of its inputs, in any order; gives each of its outputs in the
    /// order of [`Network::outputs`].
    fn run(&self, inputs: &[(&str, Tensor)]) -> Result<Vec<(String, Tensor)>, NetworkError>;

    /// Which runtime and device, for reports: `rten 0.27`, `ONNX Runtime 1.31.1 (CPU)`.
    fn runtime(&self) -> &str;

    /// Why that runtime was taken, in a sentence for the log.
    fn reason(&self) -> &str;
}

/// Which runtime is wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Runtime {
    /// ONNX Runtime where its library is found, `rten` elsewhere.
    #[default]
    Auto,
    Rten,
    OnnxRuntime,
}

/// What computes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Device {
    #[default]
    Cpu,
    /// An NVIDIA GPU, by an ONNX Runtime that was built for it.
    Cuda,
    /// Apple's Core ML, by an ONNX Runtime that was built for it.
    CoreMl,
}

/// How networks are to be run.
#[derive(Debug, Clone, Default)]
pub struct RuntimeParams {
    pub runtime: Runtime,
    /// The file of ONNX Runtime's library that someone named. It must work: that it does not is an error.
    pub library: Option<PathBuf>,
    /// Folders in which the library may lie, looked at before the usual places of the system.
    pub look_in: Vec<PathBuf>,
    pub device: Device,
    /// Threads that one run takes; without a number the runtime decides.
    pub threads: Option<NonZeroUsize>,
}

impl Device {
    fn name(self) -> &'static str {
        match self {
            Device::Cpu => "the processor",
            Device::Cuda => "CUDA",
            Device::CoreMl => "Core ML",
        }
    }
}

/// Loads a network from an ONNX file.
///
/// An ONNX Runtime that was asked for, by its library's path or with an accelerator, must work. One that is only
/// found and does not work is passed over, and [`Network::reason`] says so.
pub fn open(path: &Path, params: &RuntimeParams) -> Result<Arc<dyn Network>, NetworkError> {
    check::file(path)?;
    let rten = |reason: String| -> Result<Arc<dyn Network>, NetworkError> {
        Ok(Arc::new(RtenNetwork::open(path, params.threads, reason)?))
    };
    let onnxruntime = |library: &Path, reason: String| -> Result<Arc<dyn Network>, NetworkError> {
        Ok(Arc::new(OnnxRuntimeNetwork::open(path, library, params.device, params.threads, reason)?))
    };
    let found = |library: &Path| format!("ONNX Runtime's library {} is there", library.display());
    let asked = params.runtime == Runtime::OnnxRuntime || params.device != Device::Cpu;
    match (params.runtime, &params.library) {
        (Runtime::Rten, _) if params.device != Device::Cpu => Err(NetworkError::Device {
            device: params.device.name(),
            reason: "rten computes on the processor only".to_owned(),
        }),
        (Runtime::Rten, _) => rten("it was asked for".to_owned()),
        (_, Some(library)) => onnxruntime(library, format!("{} was named", library.display())),
        (_, None) => match library::find(&params.look_in) {
            Some(library) if asked => onnxruntime(&library, found(&library)),
            Some(library) => match library::load(&library) {
                Ok(_) => onnxruntime(&library, found(&library)),
                Err(error) => rten(format!("ONNX Runtime cannot be used: {error}")),
            },
            None if asked => Err(NetworkError::LibraryNowhere { places: library::places(&params.look_in) }),
            None => {
                rten(format!("no library of ONNX Runtime is found in {}", library::places(&params.look_in)))
            }
        },
    }
}
