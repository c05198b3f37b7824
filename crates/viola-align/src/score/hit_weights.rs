//! Weights of the hits: tall surface is probably built in, low surface may have been moved.

use crate::scan::Hit;

/// Minimum vertical extent of a surface with full weight.
const TALL_M: f64 = 1.2;
/// Factor for completed hits.
const COMPLETED_WEIGHT: f64 = 0.5;

/// Parameters of the hits' weights; the experiments vary them.
#[derive(Debug, Clone, PartialEq)]
pub struct HitWeightParams {
    /// Weight of a hit on surface of zero height; it grows to one at `TALL_M`.
    pub low_weight: f64,
    /// Factor for walls that were seen only above the vacuum's height.
    pub upper_weight: f64,
}

impl Default for HitWeightParams {
    fn default() -> Self {
        HitWeightParams { low_weight: 0.5, upper_weight: 0.5 }
    }
}

/// Returns the hits with their weights, in a canonical order, so that the answer does not depend on the order
/// of the input; hits of zero weight are left out.
pub fn hit_weights(hits: &[Hit], params: &HitWeightParams) -> Vec<Hit> {
    let weight = |hit: &Hit| {
        let tall = (hit.extent_m / TALL_M).clamp(0.0, 1.0);
        let standing = params.low_weight + (1.0 - params.low_weight) * tall;
        let standing = if hit.at_vacuum_height { standing } else { standing * params.upper_weight };
        if hit.completed { standing * COMPLETED_WEIGHT } else { standing }
    };
    let mut weighed: Vec<Hit> =
        hits.iter().map(|hit| Hit { weight: weight(hit), ..*hit }).filter(|hit| hit.weight > 0.0).collect();
    weighed.sort_by(|a, b| {
        let by = |axis: fn(&Hit) -> f64| axis(a).total_cmp(&axis(b));
        by(|hit| hit.point_m.x).then(by(|hit| hit.point_m.y)).then(by(|hit| hit.weight))
    });
    weighed
}
