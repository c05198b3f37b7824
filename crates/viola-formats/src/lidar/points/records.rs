//! Points as records of numbers, which PLY and PCD have in common.

use super::Cloud;
use crate::lidar::{LidarError, LidarMap};

/// A number of a binary record.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Scalar {
    pub fn bytes(self) -> usize {
        match self {
            Scalar::I8 | Scalar::U8 => 1,
            Scalar::I16 | Scalar::U16 => 2,
            Scalar::I32 | Scalar::U32 | Scalar::F32 => 4,
            Scalar::I64 | Scalar::U64 | Scalar::F64 => 8,
        }
    }

    /// The number at the beginning of `bytes`, which has at least [`Scalar::bytes`].
    pub fn read(self, bytes: &[u8], is_big: bool) -> f64 {
        let count = self.bytes();
        let mut little = [0; 8];
        little[..count].copy_from_slice(&bytes[..count]);
        if is_big {
            little[..count].reverse();
        }
        let [a, b, c, d, ..] = little;
        match self {
            Scalar::I8 => f64::from(a as i8),
            Scalar::U8 => f64::from(a),
            Scalar::I16 => f64::from(i16::from_le_bytes([a, b])),
            Scalar::U16 => f64::from(u16::from_le_bytes([a, b])),
            Scalar::I32 => f64::from(i32::from_le_bytes([a, b, c, d])),
            Scalar::U32 => f64::from(u32::from_le_bytes([a, b, c, d])),
            Scalar::I64 => i64::from_le_bytes(little) as f64,
            Scalar::U64 => u64::from_le_bytes(little) as f64,
            Scalar::F32 => f64::from(f32::from_le_bytes([a, b, c, d])),
            Scalar::F64 => f64::from_le_bytes(little),
        }
    }
}

/// Which numbers of a record are its coordinates.
pub(super) struct Columns {
    pub x: usize,
    pub y: usize,
    pub z: Option<usize>,
}

#[derive(Default)]
pub(super) struct Points {
    cloud: Cloud,
    /// The lowest and the highest z.
    heights_m: Option<(f64, f64)>,
}

impl Points {
    pub fn add(&mut self, columns: &Columns, value: impl Fn(usize) -> f64) -> Result<(), LidarError> {
        if let Some(height_m) = columns.z.map(&value).filter(|height_m| height_m.is_finite()) {
            let (low, high) = self.heights_m.unwrap_or((height_m, height_m));
            self.heights_m = Some((low.min(height_m), high.max(height_m)));
        }
        self.cloud.add(value(columns.x), value(columns.y))
    }

    pub fn into_map(self, format: &'static str, mut notes: Vec<String>) -> Result<LidarMap, LidarError> {
        if let Some((low, high)) = self.heights_m.filter(|(low, high)| high > low) {
            notes.push(format!("z was ignored: points from {low:.2} to {high:.2} m were all taken as hits"));
        }
        self.cloud.into_map(format, notes)
    }
}
