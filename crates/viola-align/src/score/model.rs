//! The learned numbers: weights of the loss, temperature and coefficients of the probability. `model.json` is their only
//! place; `viola evaluate --fit` writes it whole.

use super::evidence::Evidence;
use serde::{Deserialize, Serialize};
use std::sync::LazyLock;

/// A model with where it comes from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Model {
    pub made_by: MadeBy,
    pub loss: LossWeights,
    /// A rival that loses by this much is e times less probable.
    pub temperature_m: f64,
    pub intercept: f64,
    pub coefficients: Vec<Coefficient>,
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

/// What each kind of evidence adds to the loss when its share is 1, in metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LossWeights {
    pub blocked_m: f64,
    pub hits_on_floor_m: f64,
    pub unseen_sides_m: f64,
    pub walls_on_floor_m: f64,
    pub misplaced_m: f64,
    /// More than this share misplaced costs no more: rooms may have other names than they deserve, and networks err.
    pub most_misplaced: f64,
}

/// One figure of the logistic regression.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Coefficient {
    pub feature: String,
    /// The figure's mean and spread in the training clips.
    pub mean: f64,
    pub scale: f64,
    pub weight: f64,
}

/// The checked-in model.
pub static MODEL: LazyLock<Model> = LazyLock::new(|| {
    serde_json::from_str(include_str!("model.json")).expect("model.json is checked in and tested")
});

impl LossWeights {
    /// The loss of a pose in metres: what ranks poses.
    pub fn loss_m(&self, evidence: &Evidence) -> f64 {
        evidence.distance_m
            + self.blocked_m * evidence.blocked_rays
            + self.hits_on_floor_m * evidence.hits_on_floor
            + self.unseen_sides_m * evidence.unseen_sides
            + self.walls_on_floor_m * evidence.walls_on_floor
            + self.misplaced_m * evidence.misplaced.min(self.most_misplaced)
    }
}

impl Model {
    /// The regression's probability that the first alternative is the right pose.
    pub fn probability(&self, features: &[f64]) -> f64 {
        // Beyond what training saw, the figure says no more than at its edge.
        let terms = self
            .coefficients
            .iter()
            .zip(features)
            .map(|(c, x)| c.weight * ((x - c.mean) / c.scale).clamp(-4.0, 4.0));
        1.0 / (1.0 + (-(self.intercept + terms.sum::<f64>())).exp())
    }
}
