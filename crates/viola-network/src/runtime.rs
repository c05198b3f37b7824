//! A loaded network, and the parameters of its runtime.

use super::error::NetworkError;
use super::tensor::{Tensor, TensorInfo};
use std::num::NonZeroUsize;
use std::path::PathBuf;

/// A loaded network.
pub trait Network: Send + Sync {
    fn inputs(&self) -> &[TensorInfo];

    fn outputs(&self) -> &[TensorInfo];

    /// Runs the network on one value for each of its inputs, in any order; returns its outputs in the order
    /// of [`Network::outputs`].
    fn run(&self, inputs: &[(&str, Tensor)]) -> Result<Vec<(String, Tensor)>, NetworkError>;

    /// Returns the runtime and device, for reports: `rten 0.27`, `ONNX Runtime 1.31.1 (CPU)`.
    fn runtime(&self) -> &str;

    /// Returns the reason for the choice of the runtime, for the log.
    fn reason(&self) -> &str;
}

/// The wanted runtime.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Runtime {
    /// ONNX Runtime if its library is found, else `rten`.
    #[default]
    Auto,
    Rten,
    OnnxRuntime,
}

/// The device that runs networks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Device {
    #[default]
    Cpu,
    /// An NVIDIA GPU; needs an ONNX Runtime built for it.
    Cuda,
    /// Apple's Core ML; needs an ONNX Runtime built for it.
    CoreMl,
}

/// Parameters of running networks.
#[derive(Debug, Clone, Default)]
pub struct RuntimeParams {
    pub runtime: Runtime,
    /// ONNX Runtime's library, if the user names one. If it does not work, that is an error.
    pub library: Option<PathBuf>,
    /// Folders that are searched for the library before the usual folders of the system.
    pub look_in: Vec<PathBuf>,
    pub device: Device,
    /// Threads of one run. Default: the runtime decides.
    pub threads: Option<NonZeroUsize>,
}

impl Device {
    pub(super) fn name(self) -> &'static str {
        match self {
            Device::Cpu => "the processor",
            Device::Cuda => "CUDA",
            Device::CoreMl => "Core ML",
        }
    }
}
