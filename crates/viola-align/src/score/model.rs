//! The learned numbers: weights of the loss, temperature and coefficients of the probability. `model.json` is
//! their only source; `viola evaluate --fit` writes all of it.

use super::evidence::Evidence;
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};
use std::sync::LazyLock;

/// A model with its provenance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Model {
    pub made_by: MadeBy,
    pub loss: LossWeights,
    /// A rival that loses by this much is e times less probable, for a clip of [`TYPICAL_HITS`].
    pub temperature_m: f64,
    /// Factor of the temperature in the bound of the probability by the odds of other poses; rivals at other scales count
    /// with the temperature itself.
    pub bound: f64,
    pub intercept: f64,
    pub coefficients: Vec<Coefficient>,
    pub covariance: CovarianceModel,
}

/// Calibration of the answer's covariance, fitted to the errors of right answers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CovarianceModel {
    /// Factor of the deviations by the likelihood of the hits.
    pub scale: f64,
    /// Standard deviations of the errors that the hits share: of the map and of the clip's reconstruction.
    pub floor_m: f64,
    pub floor_rad: f64,
}

/// The command, the data and the program that made a model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MadeBy {
    pub command: String,
    /// Sets, seeds and lengths of the training clips.
    pub fitted_to: String,
    pub commit: String,
    /// Numbers that the command did not make.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
}

/// Loss in metres of each kind of evidence at fraction 1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LossWeights {
    pub blocked_m: f64,
    pub hits_on_floor_m: f64,
    pub unseen_sides_m: f64,
    pub walls_on_floor_m: f64,
    pub misplaced_m: f64,
    /// Maximum misplaced fraction that counts, because rooms may have wrong names, and networks err.
    pub most_misplaced: f64,
}

/// One feature of the logistic regression.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Coefficient {
    pub feature: String,
    /// Mean and spread of the feature in the training clips.
    pub mean: f64,
    pub scale: f64,
    pub weight: f64,
}

/// The checked-in model.
pub static MODEL: LazyLock<Model> = LazyLock::new(|| {
    serde_json::from_str(include_str!("model.json")).expect("model.json is checked in and tested")
});

impl LossWeights {
    /// Returns the loss of a pose in metres, which ranks poses.
    pub fn loss_m(&self, evidence: &Evidence) -> f64 {
        evidence.distance_m
            + self.blocked_m * evidence.blocked_rays
            + self.hits_on_floor_m * evidence.hits_on_floor
            + self.unseen_sides_m * evidence.unseen_sides
            + self.walls_on_floor_m * evidence.walls_on_floor
            + self.misplaced_m * evidence.misplaced.min(self.most_misplaced)
    }
}

/// Number of hits for which the temperature is given: a typical clip of 20 frames.
pub const TYPICAL_HITS: f64 = 150.0;

impl CovarianceModel {
    /// Returns the covariance of (x_m, y_m, yaw_rad) of the middle of the hits.
    pub fn calibrated(&self, by_likelihood: &Matrix3<f64>) -> Matrix3<f64> {
        let floor = Vector3::new(self.floor_m, self.floor_m, self.floor_rad).map(|sigma| sigma * sigma);
        by_likelihood * (self.scale * self.scale) + Matrix3::from_diagonal(&floor)
    }

    /// Returns the standard deviation of the logarithm of a scale whose hits lie `radius_m` from their middle.
    pub fn scale_std(&self, by_likelihood: f64, radius_m: f64) -> f64 {
        (by_likelihood * self.scale).hypot(self.floor_m / radius_m)
    }
}

impl Model {
    /// Returns the temperature for a clip with `hits` hits. The mean of more hits has less noise.
    pub fn temperature_m(&self, hits: usize) -> f64 {
        self.temperature_m * (TYPICAL_HITS / hits.max(1) as f64).sqrt()
    }

    /// Returns the regression's probability that the first alternative is the right pose.
    pub fn probability(&self, features: &[f64]) -> f64 {
        // Beyond the range of the training, a feature counts as at the edge of the range.
        let terms = self
            .coefficients
            .iter()
            .zip(features)
            .map(|(c, x)| c.weight * ((x - c.mean) / c.scale).clamp(-4.0, 4.0));
        1.0 / (1.0 + (-(self.intercept + terms.sum::<f64>())).exp())
    }
}
