//! The two faces of a thin wall. Noise and the cells of a LiDAR map may put them on one line or in reversed order,
//! and no wall would remain between them.

use super::evidence::Evidence;
use super::faces::Face;
use super::oblique::Oblique;
use nalgebra::center;

/// Thickness of a wall whose faces are nearer than `NEAR_M`.
const THINNEST_M: f64 = 0.06;
const NEAR_M: f64 = 0.03;
/// Faces are reversed by at most this much.
const REVERSED_M: f64 = 0.07;
/// Minimum part of the shorter face that the other one is behind.
const COMMON: f64 = 0.5;
/// Shorter ones are curtains and leaves.
const SHORTEST_M: f64 = 0.5;
/// Minimum part of it that shows wall up to the ceiling from one side; leaves of doors do not.
const TALL_FRACTION: f64 = 0.5;
/// Oblique faces this near each other are those of one wall, which are parallel. Their stairs need more space.
const SAME_WALL_M: f64 = 0.25;
const THINNEST_OBLIQUE_M: f64 = 0.09;
/// Sine of the largest angle between the two faces of a wall.
const PARALLEL: f64 = 0.25;

/// Moves the faces of thin walls along the axes apart: the one that was measured less well.
pub(super) fn separate(faces: &mut [Face], evidence: &Evidence) {
    for low in 0..faces.len() {
        for high in 0..faces.len() {
            let (a, b) = (&faces[low], &faces[high]);
            if a.facing.axis != b.facing.axis || a.facing.up || !b.facing.up {
                continue;
            }
            let apart_m = b.line_m - a.line_m;
            let common_m = a.to_m.min(b.to_m) - a.from_m.max(b.from_m);
            let shorter_m = (a.to_m - a.from_m).min(b.to_m - b.from_m);
            if !(-REVERSED_M..NEAR_M).contains(&apart_m) || common_m < (COMMON * shorter_m).max(SHORTEST_M) {
                continue;
            }
            let common = [a.from_m.max(b.from_m), a.to_m.min(b.to_m)];
            let is_tall = [a, b].iter().any(|face| {
                let tall = evidence.tall_fraction(face.facing, face.line_m, common);
                tall > 0.0 && tall >= TALL_FRACTION * face.fraction(common[0], common[1])
            });
            if !is_tall {
                continue;
            }
            if a.weight < b.weight {
                faces[low].line_m = b.line_m - THINNEST_M;
            } else {
                faces[high].line_m = a.line_m + THINNEST_M;
            }
        }
    }
}

/// Makes the two faces of each oblique wall parallel, and those of thin walls at least as far apart as a wall is thick.
pub(super) fn pair(faces: &mut [Oblique]) {
    for one in 0..faces.len() {
        for other in one + 1..faces.len() {
            let (a, b) = (&faces[one], &faces[other]);
            let is_opposite = a.normal.dot(&b.normal) < 0.0 && a.normal.perp(&b.normal).abs() <= PARALLEL;
            let middle = |face: &Oblique| face.at(face.length_m / 2.0);
            let thickness_m = (a.before(&middle(b)) + b.before(&middle(a))) / -2.0;
            let ends = [0.0, b.length_m].map(|along_m| a.within(&b.at(along_m))[0]);
            let common_m = ends[0].max(ends[1]).min(a.length_m) - ends[0].min(ends[1]).max(0.0);
            if !is_opposite
                || !(-REVERSED_M..SAME_WALL_M).contains(&thickness_m)
                || common_m < COMMON * a.length_m.min(b.length_m)
            {
                continue;
            }
            let normal = (a.normal * a.evidence_m() - b.normal * b.evidence_m()).normalize();
            let [of_a, of_b] = [a, b].map(middle);
            let between = center(&of_a, &of_b);
            let half_m = (normal.dot(&(of_a - of_b)) / 2.0).max(THINNEST_OBLIQUE_M / 2.0);
            let place = |from: nalgebra::Point2<f64>, off_m: f64| {
                from - normal * normal.dot(&(from - between)) + normal * off_m
            };
            faces[one].turn(place(of_a, half_m), normal);
            faces[other].turn(place(of_b, -half_m), -normal);
        }
    }
}
