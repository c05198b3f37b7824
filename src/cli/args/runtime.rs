//! Arguments for the runtime of networks, shared by every command that uses one.

use clap::{Args, ValueEnum};
use serde::{Deserialize, Serialize};
use std::convert::Infallible;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use viola_network::{Device, Runtime, RuntimeParams};

#[derive(Args, Debug, Clone, Serialize, Deserialize)]
pub struct RuntimeArguments {
    /// Runtime of the networks; `auto` uses ONNX Runtime if its library is found, else rten.
    #[arg(long, value_enum, default_value_t = RuntimeChoice::Auto)]
    runtime: RuntimeChoice,
    /// Device that computes; an accelerator needs an ONNX Runtime that was built for it.
    #[arg(long, value_enum, default_value_t = DeviceChoice::Cpu)]
    device: DeviceChoice,
    /// File of ONNX Runtime's library; by default the models folder and the usual places are searched.
    #[arg(long, env = "ORT_DYLIB_PATH", value_name = "FILE", value_parser = path)]
    onnxruntime: Option<PathBuf>,
    /// Number of threads of a network; default: all cores.
    #[arg(long, value_name = "N")]
    network_threads: Option<NonZeroUsize>,
}

/// Takes an empty path too, which clap's own parser refuses: a shell may unset a variable by making it empty.
fn path(text: &str) -> Result<PathBuf, Infallible> {
    Ok(PathBuf::from(text))
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
    /// Returns whether a flag differs from its default. The library does not count: its variable may name it.
    pub(super) fn is_given(&self) -> bool {
        let is_default = matches!((self.runtime, self.device), (RuntimeChoice::Auto, DeviceChoice::Cpu));
        !is_default || self.network_threads.is_some()
    }

    /// Returns the parameters of the runtime; its library is also searched for in the models folder.
    pub fn params(&self, models: Option<&Path>) -> RuntimeParams {
        RuntimeParams {
            runtime: match self.runtime {
                RuntimeChoice::Auto => Runtime::Auto,
                RuntimeChoice::Rten => Runtime::Rten,
                RuntimeChoice::Onnxruntime => Runtime::OnnxRuntime,
            },
            library: self.onnxruntime.clone().filter(|path| !path.as_os_str().is_empty()),
            look_in: models.map(|folder| folder.join("onnxruntime")).into_iter().collect(),
            device: match self.device {
                DeviceChoice::Cpu => Device::Cpu,
                DeviceChoice::Cuda => Device::Cuda,
                DeviceChoice::Coreml => Device::CoreMl,
            },
            threads: self.network_threads,
            warn: Some(|text| tracing::warn!("{text}")),
        }
    }
}
