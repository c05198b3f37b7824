//! Where the networks are and what runs them: the same arguments for every command that uses one.

use clap::{Args, ValueEnum};
use serde::{Deserialize, Serialize};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use viola_network::{Device, Runtime, RuntimeParams};

#[derive(Args, Debug, Clone, Serialize, Deserialize)]
pub struct RuntimeArguments {
    /// What runs networks; ONNX Runtime where its library is found unless told otherwise.
    #[arg(long, value_enum, default_value_t = RuntimeChoice::Auto)]
    runtime: RuntimeChoice,
    /// What computes; an accelerator needs an ONNX Runtime that was built for it.
    #[arg(long, value_enum, default_value_t = DeviceChoice::Cpu)]
    device: DeviceChoice,
    /// The file of ONNX Runtime's library. Without it, the models folder and the usual places are searched.
    #[arg(long, env = "ORT_DYLIB_PATH", value_name = "FILE")]
    onnxruntime: Option<PathBuf>,
    /// Threads that a network takes; all cores unless told otherwise.
    #[arg(long, value_name = "N")]
    network_threads: Option<NonZeroUsize>,
}

#[derive(Debug, Clone, Copy, ValueEnum, Serialize, Deserialize)]
enum RuntimeChoice {
    Auto,
    Rten,
    Onnxruntime,
}

#[derive(Debug, Clone, Copy, ValueEnum, Serialize, Deserialize)]
enum DeviceChoice {
    Cpu,
    Cuda,
    Coreml,
}

impl RuntimeArguments {
    /// For networks; the library is also looked for in the models folder.
    pub fn params(&self, models: Option<&Path>) -> RuntimeParams {
        RuntimeParams {
            runtime: match self.runtime {
                RuntimeChoice::Auto => Runtime::Auto,
                RuntimeChoice::Rten => Runtime::Rten,
                RuntimeChoice::Onnxruntime => Runtime::OnnxRuntime,
            },
            // An empty variable is how a shell unsets one.
            library: self.onnxruntime.clone().filter(|path| !path.as_os_str().is_empty()),
            look_in: models.map(|folder| folder.join("onnxruntime")).into_iter().collect(),
            device: match self.device {
                DeviceChoice::Cpu => Device::Cpu,
                DeviceChoice::Cuda => Device::Cuda,
                DeviceChoice::Coreml => Device::CoreMl,
            },
            threads: self.network_threads,
        }
    }
}
