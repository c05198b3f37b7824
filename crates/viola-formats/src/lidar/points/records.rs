//! Points as records of numbers, common to CSV, PLY and PCD.

use super::Cloud;
use crate::lidar::{LidarError, LidarMap};

/// Maximum standard deviation of the heights of a 2D map's points. A scan at one height has nearly none; walls from
/// floor to ceiling, as a mesh or a 3D scan has them, have 0.7 m.
const MAX_HEIGHT_SPREAD_M: f64 = 0.25;

/// Indices of a record's coordinates.
#[derive(Clone, Copy)]
pub(super) struct Columns {
    pub x: usize,
    pub y: usize,
    pub z: Option<usize>,
}

#[derive(Default)]
pub(super) struct Points {
    cloud: Cloud,
    heights: Heights,
}

/// The heights of the points so far, in metres: Welford's mean and sum of squared deviations, lowest and highest.
#[derive(Default)]
struct Heights {
    count: f64,
    mean: f64,
    squares: f64,
    ends: Option<(f64, f64)>,
}

impl Heights {
    fn add(&mut self, height: f64) {
        self.count += 1.0;
        let from_mean = height - self.mean;
        self.mean += from_mean / self.count;
        self.squares += from_mean * (height - self.mean);
        let (low, high) = self.ends.unwrap_or((height, height));
        self.ends = Some((low.min(height), high.max(height)));
    }

    fn spread(&self) -> f64 {
        (self.squares / self.count.max(1.0)).sqrt()
    }
}

impl Points {
    pub fn add(&mut self, columns: &Columns, value: impl Fn(usize) -> f64) -> Result<(), LidarError> {
        if let Some(height_m) = columns.z.map(&value).filter(|height_m| height_m.is_finite()) {
            self.heights.add(height_m);
        }
        self.cloud.add(value(columns.x), value(columns.y))
    }

    pub fn into_map(self, format: &'static str, mut notes: Vec<String>) -> Result<LidarMap, LidarError> {
        if let Some((low_m, high_m)) = self.heights.ends
            && self.heights.spread() > MAX_HEIGHT_SPREAD_M
        {
            return Err(LidarError::ThreeDimensional { low_m, high_m });
        }
        if let Some((low, high)) = self.heights.ends.filter(|(low, high)| high > low) {
            notes.push(format!("z was ignored: points from {low:.2} to {high:.2} m were all taken as hits"));
        }
        self.cloud.into_map(format, notes)
    }
}
