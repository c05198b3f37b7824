//! Networks run by ONNX Runtime.

use super::library::{self, OnnxRuntime};
use super::runtime::Engine;
use super::{Data, Device, Element, Network, NetworkError, Tensor, TensorInfo, Weights, check};
use ort::ep::{self, ExecutionProvider, ExecutionProviderDispatch};
use ort::session::builder::GraphOptimizationLevel;
use ort::session::{Session, SessionInputValue};
use ort::value::{DynValue, Outlet, PrimitiveTensorElementType, TensorElementType, TensorRef};
use std::collections::HashMap;
use std::fmt::Debug;
use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

struct OnnxRuntimeNetwork {
    /// The binding needs exclusive access to a session during a run. One run takes all threads anyway.
    session: Mutex<Session>,
    /// Types of the inputs in the file.
    types: HashMap<String, TensorElementType>,
}

pub(super) fn open(
    weights: &Weights,
    library: &Path,
    device: Device,
    threads: Option<NonZeroUsize>,
    reason: String,
) -> Result<Network, NetworkError> {
    let loaded = library::load(library)?;
    let refuse = |reason: String| NetworkError::NotANetwork { file: weights.name(), reason };
    let provider = provider(device)?;
    let session = check::guarded(
        || session(loaded, weights, provider, threads).map_err(|error| refuse(first_line(&error))),
        refuse,
    )?;
    let (inputs, outputs) = (infos(session.inputs()), infos(session.outputs()));
    let type_of = |input: &Outlet| Some((input.name().to_owned(), input.dtype().tensor_type()?));
    let types = session.inputs().iter().filter_map(type_of).collect();
    let runtime = format!("ONNX Runtime {} ({})", loaded.version, device.name());
    let engine = Box::new(OnnxRuntimeNetwork { session: Mutex::new(session), types });
    Ok(Network { inputs, outputs, runtime, reason, engine })
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
    let (available, provider) = match device {
        Device::Cpu => return Ok(None),
        Device::Cuda => (ep::CUDA::is_available(), ep::CUDA::default().build()),
        Device::CoreMl => (ep::CoreML::is_available(), ep::CoreML::default().build()),
    };
    let refuse = |reason: String| Err(NetworkError::Device { device: device.name(), reason });
    match available {
        Ok(true) => Ok(Some(provider.error_on_failure())),
        Ok(false) => refuse("this ONNX Runtime was built without it".to_owned()),
        Err(error) => refuse(first_line(&error)),
    }
}

/// Returns an error's first line: ONNX Runtime adds a stack trace to some of its errors.
fn first_line<R>(error: &ort::Error<R>) -> String {
    error.message().lines().next().unwrap_or_default().to_owned()
}

impl Engine for OnnxRuntimeNetwork {
    fn run(&self, inputs: &[(&str, Tensor)], outputs: &[TensorInfo]) -> Result<Vec<Tensor>, NetworkError> {
        let mut values = Vec::with_capacity(inputs.len());
        for (name, tensor) in inputs {
            values.push((*name, value(name, tensor, self.types.get(*name))?));
        }
        let mut session = self.session.lock().unwrap_or_else(PoisonError::into_inner);
        let results =
            session.run(values).map_err(|error| NetworkError::Run { reason: first_line(&error) })?;
        let output = |info: &TensorInfo| {
            let unreadable = || NetworkError::OutputType { output: info.name.clone() };
            results.get(&info.name).and_then(tensor).ok_or_else(unreadable)
        };
        outputs.iter().map(output).collect()
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
    wanted: Option<&TensorElementType>,
) -> Result<SessionInputValue<'t>, NetworkError> {
    let shape = &tensor.shape;
    match (&tensor.data, wanted) {
        (Data::F32(values), _) => view(shape, values),
        (Data::U8(values), _) => view(shape, values),
        (Data::Bool(values), _) => view(shape, values),
        (Data::I64(values), Some(TensorElementType::Int32)) => narrowed::<i32>(name, shape, values),
        (Data::I64(values), Some(TensorElementType::Int8)) => narrowed::<i8>(name, shape, values),
        (Data::I64(values), _) => view(shape, values),
    }
}

fn view<'t, T: PrimitiveTensorElementType + Debug + Clone + 'static>(
    shape: &[usize],
    values: &'t [T],
) -> Result<SessionInputValue<'t>, NetworkError> {
    Ok(TensorRef::from_array_view((shape.to_vec(), values)).map_err(misfit)?.into())
}

fn narrowed<'t, T: PrimitiveTensorElementType + Debug + Clone + TryFrom<i64> + 'static>(
    name: &str,
    shape: &[usize],
    values: &[i64],
) -> Result<SessionInputValue<'t>, NetworkError> {
    let values: Result<Vec<T>, _> = values.iter().map(|value| T::try_from(*value)).collect();
    let values = values.map_err(|_| NetworkError::InputRange { input: name.to_owned() })?;
    Ok(ort::value::Tensor::from_array((shape.to_vec(), values)).map_err(misfit)?.into())
}

fn misfit(error: ort::Error) -> NetworkError {
    NetworkError::Run { reason: first_line(&error) }
}

/// Returns the numbers of a value; `None` if they are of a type that is not read.
fn tensor(value: &DynValue) -> Option<Tensor> {
    macro_rules! read {
        ($number:ty, $data:ident, $convert:expr) => {{
            let (shape, values) = value.try_extract_tensor::<$number>().ok()?;
            (shape.iter().map(|n| *n as usize).collect(), Data::$data($convert(values)))
        }};
    }
    let (shape, data): (Vec<usize>, Data) = match value.dtype().tensor_type()? {
        TensorElementType::Float32 => read!(f32, F32, <[f32]>::to_vec),
        TensorElementType::Uint8 => read!(u8, U8, <[u8]>::to_vec),
        TensorElementType::Bool => read!(bool, Bool, <[bool]>::to_vec),
        TensorElementType::Int64 => read!(i64, I64, <[i64]>::to_vec),
        TensorElementType::Int32 => read!(i32, I64, widened),
        TensorElementType::Int8 => read!(i8, I64, widened),
        _ => return None,
    };
    Some(Tensor { shape, data })
}

fn widened<T: Copy + Into<i64>>(values: &[T]) -> Vec<i64> {
    values.iter().map(|value| (*value).into()).collect()
}
