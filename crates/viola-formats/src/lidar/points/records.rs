//! Points as records of numbers, common to PLY and PCD.

use super::Cloud;
use crate::lidar::{LidarError, LidarMap};

/// Indices of a record's coordinates.
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
