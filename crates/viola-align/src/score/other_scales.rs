//! Whether the clip would fit the map much better if its unit were another one.
//!
//! Depth in a wrong unit, or a map with a wrong cell size, moves the best pose by decimetres, and nothing in the
//! probability tells: the losses of all poses grow alike. The same clip at the right scale has a much smaller loss
//! nearby.

use super::evidence::PoseScorer;
use super::rank::ScoreParams;
use crate::answer::BetterScale;
use crate::refine::{Rescaled, refine_with_scale};
use crate::scan::{Hit, VirtualScan};
use crate::target::Target;
use viola_geometry::Pose2;

/// Factors at which the descents from the best pose start, and how far each goes, in the logarithm: together 0.72 to 1.38.
const STARTS: [f64; 5] = [0.8, 0.89, 1.0, 1.12, 1.25];
const MAX_LOG: f64 = 0.1;
/// The same from other poses: with another scale, another one is the best.
const STARTS_ELSEWHERE: [f64; 2] = [0.87, 1.15];
const MAX_LOG_ELSEWHERE: f64 = 0.15;
/// Maximum number of other poses.
const ELSEWHERE: usize = 4;
/// Scales with a smaller ratio are the same: maps of robots are up to 2 % too large or too small.
const SAME_LOG: f64 = 0.04;

/// Returns the scale at which the clip fits best near one of the poses, if it is another one and its loss is smaller than
/// that of the first pose.
pub fn better_scale(
    poses: &[Pose2],
    hits: &[Hit],
    target: &Target,
    params: &ScoreParams,
) -> Option<BetterScale> {
    // The free space of the clip has no scaled copy, so it does not count.
    let scan = VirtualScan::default();
    let loss_m = |pose: &Pose2, hits: &[Hit]| {
        params.weights.loss_m(&PoseScorer::new(hits, &scan, params.unknown_fraction).evidence(pose, target))
    };
    let (best, others) = poses.split_first()?;
    let here_m = loss_m(best, hits);
    let scaled = |factor: f64| hits.iter().map(|hit| hit.scaled(factor)).collect::<Vec<Hit>>();
    let from = |start: f64, poses: &[Pose2], max_log: f64| -> Vec<BetterScale> {
        let found = refine_with_scale(poses, &scaled(start), target, max_log);
        let better = |found: Rescaled| {
            let factor = start * found.factor;
            // A smaller clip has smaller distances to everything.
            let there_m = loss_m(&found.map_from_clip, &scaled(factor)) / factor.min(1.0);
            BetterScale { factor, gain_m: here_m - there_m }
        };
        found.into_iter().map(better).collect()
    };
    let others = &others[..others.len().min(ELSEWHERE)];
    let near = STARTS.iter().flat_map(|start| from(*start, &[*best], MAX_LOG));
    let elsewhere = STARTS_ELSEWHERE.iter().flat_map(|start| from(*start, others, MAX_LOG_ELSEWHERE));
    let is_other = |found: &BetterScale| found.factor.ln().abs() > SAME_LOG && found.gain_m > 0.0;
    let found = near.chain(elsewhere).filter(is_other);
    found.max_by(|a, b| a.gain_m.total_cmp(&b.gain_m))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::target::l_shaped_room;
    use viola_geometry::{Point2, Vector2};

    #[test]
    fn a_clip_in_another_unit_fits_better_in_its_own() {
        let target = Target::from_points(l_shaped_room(), None, None).unwrap();
        let truth = Pose2::new(1.2, 1.7, 0.6);
        let far = Pose2::new(3.0, 1.0, 2.0);
        for unit in [0.8, 0.9, 0.99, 1.0, 1.01, 1.12, 1.25] {
            let in_clip = |p: &Point2| truth.inverse().apply(p) / unit;
            let hits: Vec<Hit> =
                l_shaped_room().iter().map(|p| Hit::standing(in_clip(p), Vector2::x())).collect();
            let found = |poses: &[Pose2]| better_scale(poses, &hits, &target, &ScoreParams::default());
            if f64::abs(f64::ln(unit)) < SAME_LOG {
                assert_eq!(found(&[truth, far]), None, "{unit}");
                continue;
            }
            let near = Pose2::new(truth.x_m + 0.1, truth.y_m - 0.1, truth.yaw_rad);
            for poses in [[near, far], [far, near]] {
                let found = found(&poses);
                let is_own = |found: BetterScale| (found.factor / unit - 1.0).abs() < 0.01;
                assert!(found.is_some_and(|found| is_own(found) && found.gain_m > 0.01), "{unit} {found:?}");
            }
        }
        assert_eq!(better_scale(&[], &[], &target, &ScoreParams::default()), None);
    }
}
