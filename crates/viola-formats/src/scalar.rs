//! Numbers of binary records, as PLY and PCD name them.

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scalar {
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

    /// Reads the number at the beginning of `bytes`, which has at least [`Scalar::bytes`].
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
