//! Point-to-point ICP (Besl and McKay, 1992): the paper's comparison.

use super::Descended;
use super::nearest::Nearest;
use viola_geometry::{Point2, Pose2, Vector2};

/// Pairs every hit with its nearest map point and solves for the least-squares pose, until convergence.
pub(super) fn iterate(start: &Pose2, hits_m: &[Point2], nearest: &Nearest, most: usize) -> Descended {
    let mut pose = *start;
    for _ in 0..most {
        let pairs = hits_m.iter().map(|hit| (*hit, nearest.nearest(&pose.apply(hit))));
        let moved = least_squares(pairs);
        let rests = moved.is_within(&pose, 1e-5, 1e-6);
        pose = moved;
        if rests {
            break;
        }
    }
    let sum: f64 = hits_m.iter().map(|hit| nearest.distance_m(&pose.apply(hit))).sum();
    Descended { map_from_clip: pose, loss_m: sum / hits_m.len().max(1) as f64 }
}

/// Returns the least-squares pose from the first to the second points, in closed form.
fn least_squares(pairs: impl Iterator<Item = (Point2, Point2)> + Clone) -> Pose2 {
    let (mut from, mut to, mut count) = (Vector2::zeros(), Vector2::zeros(), 0.0);
    for (a, b) in pairs.clone() {
        from += a.coords;
        to += b.coords;
        count += 1.0;
    }
    let (from, to) = (from / f64::max(count, 1.0), to / f64::max(count, 1.0));
    let (mut dot, mut cross) = (0.0, 0.0);
    for (a, b) in pairs {
        let (a, b) = (a.coords - from, b.coords - to);
        dot += a.dot(&b);
        cross += a.perp(&b);
    }
    let turn = Pose2::new(0.0, 0.0, cross.atan2(dot));
    let shift = to - turn.rotate(&from);
    Pose2::new(shift.x, shift.y, turn.yaw_rad)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn least_squares_undoes_a_motion() {
        let pose = Pose2::new(0.4, -1.2, 2.5);
        let points = [(0.0, 0.0), (1.0, 0.2), (-0.7, 2.0), (3.0, -1.0)].map(|(x, y)| Point2::new(x, y));
        let found = least_squares(points.iter().map(|p| (*p, pose.apply(p))));
        assert!(found.is_within(&pose, 1e-12, 1e-12));
    }
}
