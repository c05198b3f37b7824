//! How much each hit counts: what stands tall is likely built in, what is low may have been moved.

use crate::scan::Hit;

/// From this vertical extent on a surface counts in full.
const TALL_M: f64 = 1.2;
/// Factor for what was filled in.
const COMPLETED_WEIGHT: f64 = 0.5;

/// How much hits count; the experiments vary it.
#[derive(Debug, Clone, PartialEq)]
pub struct HitWeightParams {
    /// Weight of a hit on something of no height; it grows to one at `tall_m`.
    pub low_weight: f64,
    /// Factor for walls that were seen only above the vacuum's height.
    pub upper_weight: f64,
}

impl Default for HitWeightParams {
    fn default() -> Self {
        HitWeightParams { low_weight: 0.5, upper_weight: 0.5 }
    }
}

/// The hits with their weights, in an order of their own, so that the answer does not depend on the order in
/// which they came; those that count nothing are left out.
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
