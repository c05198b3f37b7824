//! Networks run by `rten`: pure Rust, on the CPU, with nothing to install.

use super::check;
use super::runtime::Engine;
use super::{Data, Element, Network, NetworkError, Tensor, TensorInfo, Weights};
use rten::{
    DataType, Dimension, Model, ModelOptions, NodeId, RunOptions, ThreadPool, Value, ValueOrView, ValueType,
    ValueView,
};
use rten_tensor::prelude::*;
use std::num::NonZeroUsize;
use std::sync::Arc;

struct Rten {
    model: Model,
    /// `None` is the pool that all networks share, with one thread per core.
    pool: Option<Arc<ThreadPool>>,
}

pub(super) fn open(
    weights: &Weights,
    threads: Option<NonZeroUsize>,
    reason: String,
) -> Result<Network, NetworkError> {
    let refuse = |reason: String| NetworkError::NotANetwork { file: weights.name(), reason };
    let model = check::guarded(
        || {
            // Packing the weights once, when loading, makes every run faster.
            let mut options = ModelOptions::with_all_ops();
            let options = options.prepack_weights(true);
            let loaded = match weights {
                Weights::File(path) => options.load_file(path),
                Weights::BuiltIn { bytes, .. } => options.load_static_slice(bytes),
            };
            loaded.map_err(|error| refuse(error.to_string()))
        },
        refuse,
    )?;
    let (inputs, outputs) = (infos(&model, model.input_ids()), infos(&model, model.output_ids()));
    let pool = threads.map(|threads| Arc::new(ThreadPool::with_num_threads(threads.get())));
    let (runtime, engine) = ("rten 0.27".to_owned(), Box::new(Rten { model, pool }));
    Ok(Network { inputs, outputs, runtime, reason, engine })
}

impl Engine for Rten {
    fn run(&self, inputs: &[(&str, Tensor)], outputs: &[TensorInfo]) -> Result<Vec<Tensor>, NetworkError> {
        let failed = |reason: String| NetworkError::Run { reason };
        let mut values = Vec::with_capacity(inputs.len());
        for (name, tensor) in inputs {
            let node = self.model.node_id(name).map_err(|error| failed(error.to_string()))?;
            values.push((node, value(name, tensor)?));
        }
        let options = RunOptions::default().with_thread_pool(self.pool.clone());
        let results = self.model.run(values, self.model.output_ids(), Some(options));
        let results = results.map_err(|error| failed(error.to_string()))?;
        outputs.iter().zip(results).map(|(info, value)| tensor(&info.name, value)).collect()
    }
}

fn infos(model: &Model, nodes: &[NodeId]) -> Vec<TensorInfo> {
    nodes
        .iter()
        .filter_map(|id| model.node_info(*id))
        .map(|node| TensorInfo {
            name: node.name().unwrap_or_default().to_owned(),
            shape: node.shape().map(|axes| {
                axes.into_iter()
                    .map(|axis| match axis {
                        Dimension::Fixed(length) => Some(length),
                        Dimension::Symbolic(_) => None,
                    })
                    .collect()
            }),
            element: match node.dtype() {
                Some(ValueType::Tensor(DataType::Float)) => Some(Element::F32),
                Some(ValueType::Tensor(DataType::UInt8)) => Some(Element::U8),
                Some(ValueType::Tensor(DataType::Int32)) => Some(Element::I64),
                _ => None,
            },
        })
        .collect()
}

/// Converts a value to `rten`'s types: its integers have 32 bits. Other numbers are borrowed, as the grid of a large
/// surface has 189 MB.
fn value<'a>(name: &str, tensor: &'a Tensor) -> Result<ValueOrView<'a>, NetworkError> {
    let shape = tensor.shape.as_slice();
    let owned = |values: Vec<i32>| Ok(Value::from_shape(shape, values).map_err(misfit)?.into());
    match &tensor.data {
        Data::F32(values) => Ok(ValueView::from_shape(shape, values.as_slice()).map_err(misfit)?.into()),
        Data::U8(values) => Ok(ValueView::from_shape(shape, values.as_slice()).map_err(misfit)?.into()),
        Data::Bool(values) => owned(values.iter().map(|v| i32::from(*v)).collect()),
        Data::I64(values) => {
            let values: Result<Vec<i32>, _> = values.iter().map(|v| i32::try_from(*v)).collect();
            owned(values.map_err(|_| NetworkError::InputRange { input: name.to_owned() })?)
        }
    }
}

fn misfit(error: impl std::error::Error) -> NetworkError {
    NetworkError::Run { reason: error.to_string() }
}

fn tensor(name: &str, value: Value) -> Result<Tensor, NetworkError> {
    Ok(match value {
        Value::FloatTensor(t) => Tensor { shape: t.shape().to_vec(), data: Data::F32(t.into_data()) },
        Value::UInt8Tensor(t) => Tensor { shape: t.shape().to_vec(), data: Data::U8(t.into_data()) },
        Value::Int32Tensor(t) => {
            Tensor { shape: t.shape().to_vec(), data: Data::I64(t.iter().map(|v| i64::from(*v)).collect()) }
        }
        Value::Int8Tensor(t) => {
            Tensor { shape: t.shape().to_vec(), data: Data::I64(t.iter().map(|v| i64::from(*v)).collect()) }
        }
        _ => return Err(NetworkError::OutputType { output: name.to_owned() }),
    })
}
