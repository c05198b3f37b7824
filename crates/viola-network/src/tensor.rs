//! Values that go into a network and come out of it.

/// The type of a tensor's numbers. Integers of any other width count as [`Element::I64`]; `rten` has no
/// booleans and reports them as [`Element::I64`] too.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Element {
    F32,
    I64,
    U8,
    Bool,
}

/// The numbers of a tensor, in row-major order.
#[derive(Debug, Clone, PartialEq)]
pub enum Data {
    F32(Vec<f32>),
    I64(Vec<i64>),
    U8(Vec<u8>),
    Bool(Vec<bool>),
}

impl Data {
    pub fn len(&self) -> usize {
        match self {
            Data::F32(values) => values.len(),
            Data::I64(values) => values.len(),
            Data::U8(values) => values.len(),
            Data::Bool(values) => values.len(),
        }
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    pub fn element(&self) -> Element {
        match self {
            Data::F32(_) => Element::F32,
            Data::I64(_) => Element::I64,
            Data::U8(_) => Element::U8,
            Data::Bool(_) => Element::Bool,
        }
    }
}

#[derive(Debug, Clone, PartialEq)]
pub struct Tensor {
    pub shape: Vec<usize>,
    pub data: Data,
}

impl Tensor {
    pub fn f32(shape: impl Into<Vec<usize>>, values: Vec<f32>) -> Tensor {
        Tensor { shape: shape.into(), data: Data::F32(values) }
    }

    pub fn u8(shape: impl Into<Vec<usize>>, values: Vec<u8>) -> Tensor {
        Tensor { shape: shape.into(), data: Data::U8(values) }
    }

    /// Returns the numbers if they are [`Data::F32`].
    pub fn as_f32(&self) -> Option<&[f32]> {
        match &self.data {
            Data::F32(values) => Some(values),
            _ => None,
        }
    }
}

/// Description of a network's input or output.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TensorInfo {
    pub name: String,
    /// Length of each axis, `None` for a dynamic one. The whole shape is `None` if the file does not give the
    /// number of axes.
    pub shape: Option<Vec<Option<usize>>>,
    /// `None` if the file does not give it.
    pub element: Option<Element>,
}

impl TensorInfo {
    /// Returns the length of an axis, if it is known and fixed.
    pub fn axis(&self, axis: usize) -> Option<usize> {
        self.shape.as_ref()?.get(axis).copied()?
    }
}

/// Formats a shape for messages: `1x3x?x513`.
pub(super) fn shown<'a>(axes: impl IntoIterator<Item = &'a Option<usize>>) -> String {
    let parts: Vec<String> =
        axes.into_iter().map(|axis| axis.map_or("?".to_owned(), |n| n.to_string())).collect();
    if parts.is_empty() { "a single number".to_owned() } else { parts.join("x") }
}
