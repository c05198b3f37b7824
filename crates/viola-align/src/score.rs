//! Stage 9: scores each pose, and estimates the probability that the best one is right (paper IV-A).

mod confidence;
mod different;
mod evidence;
mod hit_weights;
mod model;
mod other_scales;
mod rank;
mod verdict;

pub use confidence::{FEATURES, ProbabilityCaps, features, fraction_of_odds, set_probabilities};
pub use different::is_different;
pub use evidence::{Evidence, PoseScorer};
pub use hit_weights::{HitWeightParams, hit_weights};
pub use model::{Coefficient, CovarianceModel, LossWeights, MODEL, MadeBy, Model, TYPICAL_HITS};
pub use other_scales::better_scale;
pub use rank::{Candidates, Ranked, ScoreParams, coverage, rank};
pub use verdict::{MIN_ALIGNED_PROBABILITY, is_sure, set_state};
