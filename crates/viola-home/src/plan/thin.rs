//! The two faces of a thin wall. Noise and the cells of a LiDAR map may put them on one line or in reversed order,
//! and no wall would remain between them.

use super::axes;
use super::evidence::Evidence;
use super::faces::Face;
use super::oblique::Oblique;
use nalgebra::center;
use viola_geometry::Point2;

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
/// A wall between two rooms that no clip saw is longer than the leaf of a door. Step along it, and minimum evidence of a step
/// from each side: that of the LiDAR is 0.8.
const LEAF_M: f64 = 1.05;
const STEP_M: f64 = 0.05;
const SURE: f32 = 0.75;
/// The rooms are this far from its middle, at this fraction of its steps.
const BESIDE_M: f64 = 0.15;
const DIVIDING: f64 = 0.8;
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
            let Some(common) = common(a, b) else { continue };
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
    if evidence.has_cells() {
        separate_between_rooms(faces, evidence);
    }
}

/// Returns the interval in which a face that looks down and one that looks up may be those of one thin wall.
fn common(a: &Face, b: &Face) -> Option<[f64; 2]> {
    if a.facing.axis != b.facing.axis || a.facing.up || !b.facing.up {
        return None;
    }
    let apart_m = b.line_m - a.line_m;
    let common = [a.from_m.max(b.from_m), a.to_m.min(b.to_m)];
    let common_m = common[1] - common[0];
    let shorter_m = (a.to_m - a.from_m).min(b.to_m - b.from_m);
    let is_one = (-REVERSED_M..NEAR_M).contains(&apart_m) && common_m >= (COMMON * shorter_m).max(SHORTEST_M);
    is_one.then_some(common)
}

/// Moves the faces of walls between two rooms of the map apart that no clip saw up to the ceiling: such a wall may be one row of
/// cells. Both faces move, since neither was measured better.
fn separate_between_rooms(faces: &mut [Face], evidence: &Evidence) {
    let mut moved: Vec<Option<f64>> = vec![None; faces.len()];
    for (low, a) in faces.iter().enumerate() {
        for (high, b) in faces.iter().enumerate() {
            if common(a, b).is_some_and(|common| divides_rooms(a, b, common, evidence)) {
                let middle_m = (a.line_m + b.line_m) / 2.0;
                moved[low].get_or_insert(middle_m - THINNEST_M / 2.0);
                moved[high].get_or_insert(middle_m + THINNEST_M / 2.0);
            }
        }
    }
    for (face, line_m) in faces.iter_mut().zip(moved) {
        face.line_m = line_m.unwrap_or(face.line_m);
    }
}

/// Returns whether two faces of one line have different rooms of the map before them, where both were seen, and no top of
/// furniture between them.
fn divides_rooms(a: &Face, b: &Face, [from_m, to_m]: [f64; 2], evidence: &Evidence) -> bool {
    let axis = a.facing.axis;
    let line_m = (a.line_m + b.line_m) / 2.0;
    let (mut seen, mut dividing) = (0usize, 0usize);
    for step in 0..((to_m - from_m) / STEP_M) as usize {
        let along_m = from_m + (step as f64 + 0.5) * STEP_M;
        let place = |off_m: f64| Point2::from(axes::place(axis, line_m + off_m, along_m));
        let is_furniture = evidence.is_level(&place(0.0)) && !evidence.is_floor_of_clips(&place(0.0));
        if [a, b].iter().any(|face| face.at(along_m) < SURE) || is_furniture {
            continue;
        }
        seen += 1;
        // The wall between rooms that people merged stands.
        let room = |at: Point2| evidence.found_room(&at).unwrap_or_else(|| evidence.room(&at));
        let rooms = [-BESIDE_M, BESIDE_M].map(|off_m| room(place(off_m)));
        dividing += usize::from(rooms[0] != rooms[1] && !rooms.contains(&0));
    }
    seen as f64 * STEP_M > LEAF_M && dividing as f64 >= DIVIDING * seen as f64
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
