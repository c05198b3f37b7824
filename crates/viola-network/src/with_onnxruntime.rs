//! Networks run by ONNX Runtime.

use super::library::{self, OnnxRuntime};
use super::{Data, Device, Element, Network, NetworkError, Tensor, TensorInfo, Weights, check};
use ort::ep::{self, ExecutionProvider, ExecutionProviderDispatch};
use ort::session::builder::GraphOptimizationLevel;
use ort::session::{Session, SessionInputValue};
use ort::value::{DynValue, Outlet, TensorElementType, TensorRef};
use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

pub(super) struct OnnxRuntimeNetwork {
    /// The binding needs exclusive access to a session during a run. One run takes all threads anyway.
    session: Mutex<Session>,
    inputs: Vec<TensorInfo>,
    outputs: Vec<TensorInfo>,
    /// Types of the inputs in the file, in the order of `inputs`.
    types: Vec<Option<TensorElementType>>,
    runtime: String,
    reason: String,
}

impl OnnxRuntimeNetwork {
    pub(super) fn open(
        weights: &Weights,
        library: &Path,
        device: Device,
        threads: Option<NonZeroUsize>,
        reason: String,
    ) -> Result<OnnxRuntimeNetwork, NetworkError> {
        let loaded = library::load(library)?;
        let refuse = |reason: String| NetworkError::NotANetwork { file: weights.name(), reason };
        let provider = provider(device)?;
        let session = check::guarded(
            || session(loaded, weights, provider, threads).map_err(|error| refuse(first_line(&error))),
            refuse,
        )?;
        let (inputs, outputs) = (infos(session.inputs()), infos(session.outputs()));
        if outputs.is_empty() {
            return Err(refuse("it has no outputs".to_owned()));
        }
        let types = session.inputs().iter().map(|outlet| outlet.dtype().tensor_type()).collect();
        let on = match device {
            Device::Cpu => "CPU",
            Device::Cuda => "CUDA",
            Device::CoreMl => "Core ML",
        };
        let runtime = format!("ONNX Runtime {} ({on})", loaded.version);
        Ok(OnnxRuntimeNetwork { session: Mutex::new(session), inputs, outputs, types, runtime, reason })
    }
}

fn session(
    loaded: &OnnxRuntime,
    weights: &Weights,
    provider: Option<ExecutionProviderDispatch>,
    threads: Option<NonZeroUsize>,
) -> Result<Session, ort::Error> {
    let mut builder = Session::builder(&loaded.environment)?
        .with_optimization_level(GraphOptimizationLevel::Level3)?
        .with_deterministic_compute(true)?
        // Threads that wait for work must not keep a core busy: other stages need it.
        .with_intra_op_spinning(false)?;
    if let Some(threads) = threads {
        builder = builder.with_intra_threads(threads.get())?;
    }
    if let Some(provider) = provider {
        builder = builder.with_execution_providers([provider])?;
    }
    match weights {
        Weights::File(path) => builder.commit_from_file(path),
        Weights::BuiltIn { bytes, .. } => builder.commit_from_memory(bytes),
    }
}

/// Returns the accelerator's provider, or `None` for the CPU.
fn provider(device: Device) -> Result<Option<ExecutionProviderDispatch>, NetworkError> {
    let (name, available, provider) = match device {
        Device::Cpu => return Ok(None),
        Device::Cuda => ("CUDA", ep::CUDA::is_available(), ep::CUDA::default().build()),
        Device::CoreMl => ("Core ML", ep::CoreML::is_available(), ep::CoreML::default().build()),
    };
    match available {
        Ok(true) => Ok(Some(provider.error_on_failure())),
        Ok(false) => Err(NetworkError::Device {
            device: name,
            reason: "this ONNX Runtime was built without it".to_owned(),
        }),
        Err(error) => Err(NetworkError::Device { device: name, reason: first_line(&error) }),
    }
}

/// Returns an error's first line: ONNX Runtime adds a stack trace to some of its errors.
fn first_line<R>(error: &ort::Error<R>) -> String {
    error.message().lines().next().unwrap_or_default().to_owned()
}

impl Network for OnnxRuntimeNetwork {
    fn inputs(&self) -> &[TensorInfo] {
        &self.inputs
    }

    fn outputs(&self) -> &[TensorInfo] {
        &self.outputs
    }

    fn run(&self, inputs: &[(&str, Tensor)]) -> Result<Vec<(String, Tensor)>, NetworkError> {
        check::inputs(&self.inputs, inputs)?;
        let failed = |reason: String| NetworkError::Run { reason };
        check::guarded(
            || {
                let mut values = Vec::with_capacity(inputs.len());
                for (name, tensor) in inputs {
                    let place = self.inputs.iter().position(|info| info.name == *name);
                    values.push((*name, value(name, tensor, place.and_then(|at| self.types[at]))?));
                }
                let mut session = self.session.lock().unwrap_or_else(PoisonError::into_inner);
                let results = session.run(values).map_err(|error| failed(first_line(&error)))?;
                self.outputs
                    .iter()
                    .map(|info| {
                        let value = results
                            .get(&info.name)
                            .ok_or_else(|| NetworkError::OutputType { output: info.name.clone() })?;
                        Ok((info.name.clone(), tensor(&info.name, value)?))
                    })
                    .collect()
            },
            failed,
        )
    }

    fn runtime(&self) -> &str {
        &self.runtime
    }

    fn reason(&self) -> &str {
        &self.reason
    }
}

fn infos(outlets: &[Outlet]) -> Vec<TensorInfo> {
    outlets
        .iter()
        .map(|outlet| TensorInfo {
            name: outlet.name().to_owned(),
            shape: outlet
                .dtype()
                .tensor_shape()
                .map(|shape| shape.iter().map(|axis| usize::try_from(*axis).ok()).collect()),
            element: match outlet.dtype().tensor_type() {
                Some(TensorElementType::Float32) => Some(Element::F32),
                Some(TensorElementType::Uint8) => Some(Element::U8),
                Some(TensorElementType::Bool) => Some(Element::Bool),
                Some(TensorElementType::Int8 | TensorElementType::Int32 | TensorElementType::Int64) => {
                    Some(Element::I64)
                }
                _ => None,
            },
        })
        .collect()
}

/// Converts a value to the file's type. Only integers that are narrowed are copied.
fn value<'t>(
    name: &str,
    tensor: &'t Tensor,
    wanted: Option<TensorElementType>,
) -> Result<SessionInputValue<'t>, NetworkError> {
    let shape = tensor.shape.clone();
    let misfit = |error: ort::Error| NetworkError::Run { reason: first_line(&error) };
    let range = || NetworkError::InputRange { input: name.to_owned() };
    Ok(match (&tensor.data, wanted) {
        (Data::F32(values), _) => {
            TensorRef::from_array_view((shape, values.as_slice())).map_err(misfit)?.into()
        }
        (Data::U8(values), _) => {
            TensorRef::from_array_view((shape, values.as_slice())).map_err(misfit)?.into()
        }
        (Data::Bool(values), _) => {
            TensorRef::from_array_view((shape, values.as_slice())).map_err(misfit)?.into()
        }
        (Data::I64(values), Some(TensorElementType::Int32)) => {
            let values: Result<Vec<i32>, _> = values.iter().map(|v| i32::try_from(*v)).collect();
            let values = values.map_err(|_| range())?;
            ort::value::Tensor::from_array((shape, values)).map_err(misfit)?.into()
        }
        (Data::I64(values), Some(TensorElementType::Int8)) => {
            let values: Result<Vec<i8>, _> = values.iter().map(|v| i8::try_from(*v)).collect();
            let values = values.map_err(|_| range())?;
            ort::value::Tensor::from_array((shape, values)).map_err(misfit)?.into()
        }
        (Data::I64(values), _) => {
            TensorRef::from_array_view((shape, values.as_slice())).map_err(misfit)?.into()
        }
    })
}

fn tensor(name: &str, value: &DynValue) -> Result<Tensor, NetworkError> {
    let unreadable = || NetworkError::OutputType { output: name.to_owned() };
    macro_rules! read {
        ($number:ty, $data:ident, $convert:expr) => {{
            let (shape, values) = value.try_extract_tensor::<$number>().map_err(|_| unreadable())?;
            (shape.iter().map(|n| *n as usize).collect(), Data::$data($convert(values)))
        }};
    }
    let wide = |values: &[i32]| values.iter().map(|v| i64::from(*v)).collect();
    let (shape, data): (Vec<usize>, Data) = match value.dtype().tensor_type() {
        Some(TensorElementType::Float32) => read!(f32, F32, <[f32]>::to_vec),
        Some(TensorElementType::Uint8) => read!(u8, U8, <[u8]>::to_vec),
        Some(TensorElementType::Bool) => read!(bool, Bool, <[bool]>::to_vec),
        Some(TensorElementType::Int64) => read!(i64, I64, <[i64]>::to_vec),
        Some(TensorElementType::Int32) => read!(i32, I64, wide),
        Some(TensorElementType::Int8) => {
            read!(i8, I64, |values: &[i8]| values.iter().map(|v| i64::from(*v)).collect())
        }
        _ => return Err(unreadable()),
    };
    Ok(Tensor { shape, data })
}
