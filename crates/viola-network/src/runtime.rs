//! A loaded network, and how networks are run.

use super::error::NetworkError;
use super::tensor::{Tensor, TensorInfo};
use std::num::NonZeroUsize;
use std::path::PathBuf;

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
    pub(super) fn name(self) -> &'static str {
        match self {
            Device::Cpu => "the processor",
            Device::Cuda => "CUDA",
            Device::CoreMl => "Core ML",
        }
    }
}
