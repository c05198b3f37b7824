//! Networks run by `rten`: pure Rust, on the CPU, with nothing to install.

use super::check;
use super::{Data, Element, Network, NetworkError, Tensor, TensorInfo, Weights};
use rten::{
    DataType, Dimension, Model, ModelOptions, NodeId, RunOptions, ThreadPool, Value, ValueOrView, ValueType,
    ValueView,
};
use rten_tensor::prelude::*;
use std::num::NonZeroUsize;
use std::sync::Arc;

pub(super) struct RtenNetwork {
    model: Model,
    inputs: Vec<TensorInfo>,
    outputs: Vec<TensorInfo>,
    /// `None` is the pool that all networks share, with one thread per core.
    pool: Option<Arc<ThreadPool>>,
    reason: String,
}

impl RtenNetwork {
    pub(super) fn open(
        weights: &Weights,
        threads: Option<NonZeroUsize>,
        reason: String,
    ) -> Result<RtenNetwork, NetworkError> {
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
        let inputs = infos(&model, model.input_ids());
        let outputs = infos(&model, model.output_ids());
        if outputs.is_empty() {
            return Err(refuse("it has no outputs".to_owned()));
        }
        let pool = threads.map(|threads| Arc::new(ThreadPool::with_num_threads(threads.get())));
        Ok(RtenNetwork { model, inputs, outputs, pool, reason })
    }

    fn node(&self, name: &str) -> Result<NodeId, NetworkError> {
        self.model.node_id(name).map_err(|error| NetworkError::Run { reason: error.to_string() })
    }
}

impl Network for RtenNetwork {
    fn inputs(&self) -> &[TensorInfo] {
        &self.inputs
    }

    fn outputs(&self) -> &[TensorInfo] {
        &self.outputs
    }

    fn run(&self, inputs: &[(&str, Tensor)]) -> Result<Vec<(String, Tensor)>, NetworkError> {
        check::inputs(&self.inputs, inputs)?;
        let failed = |reason: String| NetworkError::Run { reason };
        let mut values = Vec::with_capacity(inputs.len());
        for (name, tensor) in inputs {
            values.push((self.node(name)?, value(name, tensor)?));
        }
        let options = RunOptions::default().with_thread_pool(self.pool.clone());
        let results = check::guarded(
            || {
                self.model
                    .run(values, self.model.output_ids(), Some(options))
                    .map_err(|error| failed(error.to_string()))
            },
            failed,
        )?;
        self.outputs
            .iter()
            .zip(results)
            .map(|(info, value)| Ok((info.name.clone(), tensor(&info.name, value)?)))
            .collect()
    }

    fn runtime(&self) -> &str {
        "rten 0.27"
    }

    fn reason(&self) -> &str {
        &self.reason
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
    let misfit = |reason: String| NetworkError::Run { reason };
    let owned = |values: Vec<i32>| {
        Value::from_shape(shape, values).map(ValueOrView::Value).map_err(|e| misfit(e.to_string()))
    };
    match &tensor.data {
        Data::F32(values) => {
            let view = ValueView::from_shape(shape, values.as_slice());
            view.map(ValueOrView::View).map_err(|e| misfit(e.to_string()))
        }
        Data::U8(values) => {
            let view = ValueView::from_shape(shape, values.as_slice());
            view.map(ValueOrView::View).map_err(|e| misfit(e.to_string()))
        }
        Data::Bool(values) => owned(values.iter().map(|v| i32::from(*v)).collect()),
        Data::I64(values) => {
            let values: Result<Vec<i32>, _> = values.iter().map(|v| i32::try_from(*v)).collect();
            owned(values.map_err(|_| NetworkError::InputRange { input: name.to_owned() })?)
        }
    }
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
