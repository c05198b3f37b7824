//! State of an alignment.

use nalgebra::{SMatrix, SVector};
use viola_geometry::Pose3;

pub(super) type Matrix8 = SMatrix<f64, 8, 8>;

pub(super) type Vector8 = SVector<f64, 8>;

/// The state that steps change.
pub struct State {
    pub camera_from_key: Pose3,
    pub gain: f64,
    pub offset: f64,
    pub grey_sigma: f64,
    pub depth_sigma: f64,
}
