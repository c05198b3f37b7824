//! A loaded network, and the parameters of its runtime.

use super::check;
use super::error::NetworkError;
use super::tensor::{Tensor, TensorInfo};
use std::num::NonZeroUsize;
use std::path::PathBuf;

/// A loaded network.
pub struct Network {
    pub(super) inputs: Vec<TensorInfo>,
    pub(super) outputs: Vec<TensorInfo>,
    pub(super) runtime: String,
    pub(super) reason: String,
    pub(super) engine: Box<dyn Engine>,
}

/// A network in one of the runtimes.
pub(super) trait Engine: Send + Sync {
    /// Returns all outputs of the network, which are `outputs`, in their order. The inputs are checked.
    fn run(&self, inputs: &[(&str, Tensor)], outputs: &[TensorInfo]) -> Result<Vec<Tensor>, NetworkError>;
}

impl Network {
    pub fn inputs(&self) -> &[TensorInfo] {
        &self.inputs
    }

    pub fn outputs(&self) -> &[TensorInfo] {
        &self.outputs
    }

    /// Runs the network on one value for each of its inputs, in any order; returns the outputs of these names.
    pub fn run<const N: usize>(
        &self,
        inputs: &[(&str, Tensor)],
        outputs: [&str; N],
    ) -> Result<[Tensor; N], NetworkError> {
        check::inputs(&self.inputs, inputs)?;
        let failed = |reason: String| NetworkError::Run { reason };
        let results = check::guarded(|| self.engine.run(inputs, &self.outputs), failed)?;
        let mut results: Vec<(&str, Tensor)> =
            self.outputs.iter().map(|info| info.name.as_str()).zip(results).collect();
        let mut found = Vec::with_capacity(N);
        for name in outputs {
            let place = results.iter().position(|(output, _)| *output == name);
            let place = place.ok_or_else(|| failed(format!("the output {name} is missing")))?;
            found.push(results.swap_remove(place).1);
        }
        found.try_into().map_err(|_| failed("outputs are missing".to_owned()))
    }

    /// Returns the runtime and device, for reports: `rten 0.27`, `ONNX Runtime 1.31.1 (CPU)`.
    pub fn runtime(&self) -> &str {
        &self.runtime
    }

    /// Returns the reason for the choice of the runtime, for the log.
    pub fn reason(&self) -> &str {
        &self.reason
    }
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
    /// Receives a message if a library was found but cannot run a network, and `rten` runs it.
    pub warn: Option<fn(&str)>,
}

impl Device {
    pub(super) fn name(self) -> &'static str {
        match self {
            Device::Cpu => "CPU",
            Device::Cuda => "CUDA",
            Device::CoreMl => "Core ML",
        }
    }
}
