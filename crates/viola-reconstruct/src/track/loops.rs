//! Finds loops, key frames that see the same again, by corners and by poses, and checks them by alignment.

use super::graph::Edge;
use super::keys::KeyFrame;
use super::place::recognise;
use super::reference::Reference;
use super::step::{Step, align};
use rayon::prelude::*;
use rustc_hash::FxHashSet;
use viola_geometry::progress::{self, Cancelled, Progress};
use viola_geometry::{Point3, Pose3};

/// Minimum distance of a loop's ends in a segment, in key frames.
const APART: usize = 3;
/// Maximum number of similar key frames tried for each.
const TRIES: usize = 4;
/// Maximum number of key frames near by pose tried for each.
const NEIGHBOURS: usize = 4;
/// Maximum number of pairs that share a reference, so that threads share the work.
const TOGETHER: usize = 8;
const MIN_OVERLAP: f64 = 0.4;
const MIN_SCORE: f64 = 0.6;
/// Maximum drift of odometry: constants, and fractions of the way and of the turns.
const DRIFT_M: f64 = 0.08;
const DRIFT_FRACTION: f64 = 0.05;
const DRIFT_RAD: f64 = 4f64.to_radians();
const DRIFT_TURN_FRACTION: f64 = 0.05;
/// Corners that must agree for two segments to be joined.
const JOINING_PAIRS: usize = 24;

/// Accumulated motion of the key frames along the clip, which bounds the drift of odometry.
struct Way {
    moved_m: Vec<f64>,
    turned_rad: Vec<f64>,
}

impl Way {
    fn along(keys: &[KeyFrame]) -> Way {
        let (mut moved_m, mut turned_rad) = (vec![0.0], vec![0.0]);
        for pair in keys.windows(2) {
            let step = pair[0].world_from_key.inverse() * pair[1].world_from_key;
            moved_m.push(moved_m[moved_m.len() - 1] + step.translation.vector.norm());
            turned_rad.push(turned_rad[turned_rad.len() - 1] + step.rotation.angle());
        }
        Way { moved_m, turned_rad }
    }

    /// Returns whether a loop is within the maximum drift of odometry.
    fn can_reach(&self, keys: &[KeyFrame], a: usize, b: usize, b_from_a: &Pose3) -> bool {
        if keys[a].segment != keys[b].segment {
            return true;
        }
        let off = b_from_a.inverse() * keys[b].world_from_key.inverse() * keys[a].world_from_key;
        let way_m = (self.moved_m[b] - self.moved_m[a]).abs();
        let turn_rad = (self.turned_rad[b] - self.turned_rad[a]).abs();
        let turn_limit = DRIFT_RAD + DRIFT_TURN_FRACTION * turn_rad;
        off.translation.vector.norm() <= DRIFT_M + DRIFT_FRACTION * way_m + 0.5 * way_m.min(1.0) * turn_limit
            && off.rotation.angle() <= turn_limit
    }
}

/// Motions of a segment that put a place within this of each other agree.
const AGREE_M: f64 = 0.3;
const AGREE_RAD: f64 = 10f64.to_radians();

/// Returns the motion of a segment with which most others agree, by where they put `at`; the first one if several do. A wrong
/// one could not be outvoted once the segment is moved.
pub(super) fn most_agreed(moves: &[Pose3], at: &Point3) -> Pose3 {
    let agrees = |a: &Pose3, b: &Pose3| {
        (a * at - b * at).norm() < AGREE_M && a.rotation.angle_to(&b.rotation) < AGREE_RAD
    };
    let count = |a: &Pose3| moves.iter().filter(|b| agrees(a, b)).count();
    let best = moves.iter().rev().max_by_key(|a| count(a));
    best.copied().unwrap_or_else(Pose3::identity)
}

/// Aligns a key frame to the reference of another one from a start; `None` if they do not fit.
fn check(reference: &Reference, key: &KeyFrame, start: &Pose3) -> Option<Step> {
    let found = align(reference, &key.pyramid(), start, (1.0, 0.0), 0)?;
    let off = start.inverse() * found.camera_from_key;
    let is_near = off.translation.vector.norm() < 0.15 && off.rotation.angle() < 0.12;
    (found.overlap >= MIN_OVERLAP && found.score() >= MIN_SCORE && is_near).then_some(found)
}

/// Returns the motion between two key frames of the same place, by their corners and then by alignment, if at least
/// [`JOINING_PAIRS`] corners agree.
pub(super) fn same_place(a: &KeyFrame, b: &KeyFrame, seed: u64) -> Option<Step> {
    let place = recognise(&a.corners, &b.corners, seed)?;
    if place.pairs < JOINING_PAIRS { None } else { check(&a.reference(), b, &place.b_from_a) }
}

/// Returns loops between key frames that look alike.
pub(super) fn by_look(keys: &[KeyFrame], seed: u64, progress: &dyn Progress) -> Result<Vec<Edge>, Cancelled> {
    let alike = |b: usize| -> Vec<usize> {
        let apart = |a: &usize| keys[*a].segment != keys[b].segment || a + APART <= b;
        let mut alike: Vec<(usize, usize)> =
            (0..b).filter(apart).map(|a| (keys[a].similarity(&keys[b]), a)).collect();
        alike.sort_by(|x, y| y.0.cmp(&x.0).then(x.1.cmp(&y.1)));
        alike.into_iter().take(TRIES).map(|(_, a)| a).collect()
    };
    let start = |a: usize, b: usize| {
        let seed = seed ^ ((a as u64) << 32) ^ b as u64;
        let place = recognise(&keys[a].corners, &keys[b].corners, seed)?;
        let joins = keys[a].segment != keys[b].segment;
        (!joins || place.pairs >= JOINING_PAIRS).then_some(place.b_from_a)
    };
    checked(keys, &pairs(keys, alike, progress)?, start, progress)
}

/// Returns loops between key frames that are near by pose.
pub(super) fn by_pose(
    keys: &[KeyFrame],
    known: &[Edge],
    progress: &dyn Progress,
) -> Result<Vec<Edge>, Cancelled> {
    let known: FxHashSet<(usize, usize)> = known.iter().map(|edge| (edge.a, edge.b)).collect();
    let b_from_a = |a: usize, b: usize| keys[b].world_from_key.inverse() * keys[a].world_from_key;
    let nearest = |b: usize| -> Vec<usize> {
        let near = |a: usize| {
            let off = b_from_a(a, b);
            let far =
                off.translation.vector.norm() / (0.35 * keys[b].median_depth_m) + off.rotation.angle() / 0.5;
            (far, a)
        };
        let is_new = |a: &usize| keys[*a].segment == keys[b].segment && !known.contains(&(*a, b));
        let mut near: Vec<(f64, usize)> = (0..b.saturating_sub(1)).filter(is_new).map(near).collect();
        near.retain(|(far, _)| *far < 1.6);
        near.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        near.into_iter().take(NEIGHBOURS).map(|(_, a)| a).collect()
    };
    checked(keys, &pairs(keys, nearest, progress)?, |a, b| Some(b_from_a(a, b)), progress)
}

/// Returns each key frame with the earlier ones that `of` selects for it, in their order.
fn pairs(
    keys: &[KeyFrame],
    of: impl Fn(usize) -> Vec<usize> + Sync,
    progress: &dyn Progress,
) -> Result<Vec<[usize; 2]>, Cancelled> {
    let found: Result<Vec<Vec<[usize; 2]>>, Cancelled> = (0..keys.len())
        .into_par_iter()
        .map(|b| -> Result<Vec<[usize; 2]>, Cancelled> {
            progress::check(progress)?;
            Ok(of(b).into_iter().map(|a| [a, b]).collect())
        })
        .collect();
    Ok(found?.concat())
}

/// Returns the pairs of key frames that align from a start and are within the drift, in their order. A reference takes as long
/// as an alignment, so pairs with the same one are aligned together.
fn checked(
    keys: &[KeyFrame],
    pairs: &[[usize; 2]],
    start: impl Fn(usize, usize) -> Option<Pose3> + Sync,
    progress: &dyn Progress,
) -> Result<Vec<Edge>, Cancelled> {
    let way = Way::along(keys);
    let mut order: Vec<usize> = (0..pairs.len()).collect();
    order.sort_by_key(|place| pairs[*place][0]);
    let by_first = order.chunk_by(|x, y| pairs[*x][0] == pairs[*y][0]);
    let together: Vec<&[usize]> = by_first.flat_map(|places| places.chunks(TOGETHER)).collect();
    let found: Result<Vec<Vec<(usize, Edge)>>, Cancelled> = together
        .into_par_iter()
        .map(|places| -> Result<Vec<(usize, Edge)>, Cancelled> {
            progress::check(progress)?;
            let mut reference: Option<Reference> = None;
            let mut edges = Vec::new();
            for &place in places {
                let [a, b] = pairs[place];
                let Some(start) = start(a, b) else { continue };
                let reference = reference.get_or_insert_with(|| keys[a].reference());
                if let Some(found) = check(reference, &keys[b], &start)
                    && way.can_reach(keys, a, b, &found.camera_from_key)
                {
                    edges.push((place, Edge::of(a, b, &found, true)));
                }
            }
            Ok(edges)
        })
        .collect();
    let mut edges = found?.concat();
    edges.sort_by_key(|(place, _)| *place);
    Ok(edges.into_iter().map(|(_, edge)| edge).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use viola_geometry::Vector3;

    #[test]
    fn a_wrong_motion_of_a_segment_is_outvoted() {
        let at = Point3::new(4.0, 0.0, 1.0);
        let by = |x: f64, yaw: f64| Pose3::new(Vector3::new(x, 0.0, 0.0), Vector3::new(0.0, 0.0, yaw));
        let right = by(0.0, 0.0);
        assert_eq!(most_agreed(&[by(1.0, 0.0), right, by(0.02, 0.01), by(0.05, 0.0)], &at), right);
        // Alike at the origin, not at the segment.
        assert_eq!(most_agreed(&[by(0.0, 0.15), right, by(0.1, 0.0)], &at), right);
        assert_eq!(most_agreed(&[by(1.0, 0.0), right], &at), by(1.0, 0.0));
    }
}
