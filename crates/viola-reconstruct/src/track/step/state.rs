//! What a step knows of a frame, and how it is taken.

use nalgebra::{SMatrix, SVector};
use viola_geometry::Pose3;

pub(super) type Matrix8 = SMatrix<f64, 8, 8>;

pub(super) type Vector8 = SVector<f64, 8>;

/// How frames are aligned.
#[derive(Debug, Clone, PartialEq)]
pub struct StepParams {
    /// Steps at each layer, the finest first; the last number holds for all further layers.
    pub steps: Vec<usize>,
    /// Readings further from a point than this share of its depth are of something else, finest layer first.
    pub gates: Vec<f32>,
    /// Weight of grey against depth; 1 takes both at their estimated errors.
    pub grey_weight: f64,
    /// Information, in points, that a start has of its place and of its direction: what holds a frame in front of
    /// which nothing can be told apart.
    pub hold: [f64; 2],
    /// Steps end below this.
    pub enough_m: f64,
    pub enough_rad: f64,
}

impl Default for StepParams {
    fn default() -> Self {
        StepParams {
            steps: vec![4, 6, 8, 10],
            gates: vec![0.05, 0.08, 0.15, 0.3],
            grey_weight: 1.0,
            hold: [5e5, 3e4],
            enough_m: 1e-4,
            enough_rad: 1e-4,
        }
    }
}

/// The state that steps change.
pub struct State {
    pub camera_from_key: Pose3,
    pub gain: f64,
    pub offset: f64,
    pub grey_sigma: f64,
    pub depth_sigma: f64,
}
