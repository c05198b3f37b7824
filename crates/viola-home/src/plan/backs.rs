//! Faces of walls that furniture hides. The other face of such a wall was seen from the next room.

use super::evidence::{Evidence, Facing};
use super::faces::Face;
use super::standing::is_evidence;
use crate::objects::Object;
use std::f64::consts::FRAC_PI_2;
use viola_geometry::Point2;

/// Sine of the largest angle between furniture and the wall at its back.
const ALONG_WALL: f64 = 0.17;
/// Clips see the wall above lower furniture.
const TALL_M: f64 = 1.6;
/// Distance of furniture's back from the other face of the wall; boxes are noisy. A nearer face is that of the back itself.
const THICKNESS_M: std::ops::RangeInclusive<f64> = 0.03..=0.35;
/// Usual thickness of an inner wall.
const USUAL_M: f64 = 0.1;
/// Faces this near the back of furniture are the hidden one, beside the furniture.
const SAME_LINE_M: f64 = 0.12;
/// Minimum part of the furniture's length with the other face behind it, and minimum length.
const COMMON: f64 = 0.5;
const SHORTEST_M: f64 = 0.4;
/// Distance before the front of furniture at which it shows open floor.
const BEFORE_M: f64 = 0.15;
/// Evidence of a hidden face: that of one that the LiDAR saw.
const HIDDEN_FRACTION: f32 = 0.8;

/// Adds the faces that furniture hides.
pub(super) fn add(faces: &mut Vec<Face>, evidence: &Evidence, objects: &[Object]) {
    let standing = objects.iter().filter(|object| is_evidence(object) && object.bounds().top_m() >= TALL_M);
    let hidden: Vec<Face> = standing.flat_map(|object| of_object(object, faces, evidence)).collect();
    faces.extend(hidden);
}

/// Returns the faces that an object hides.
fn of_object(object: &Object, faces: &[Face], evidence: &Evidence) -> Vec<Face> {
    let bounds = object.bounds();
    let yaw_rad = bounds.yaw_rad + evidence.plan_from_map.yaw_rad;
    let turns = (yaw_rad / FRAC_PI_2).round();
    if (yaw_rad - turns * FRAC_PI_2).sin().abs() > ALONG_WALL {
        return Vec::new();
    }
    let mut half_m = [bounds.size_m[0] / 2.0, bounds.size_m[1] / 2.0];
    if turns as i64 % 2 != 0 {
        half_m.swap(0, 1);
    }
    let centre = evidence.plan_from_map.apply(&Point2::new(bounds.centre_m[0], bounds.centre_m[1]));
    let hidden = |facing: &Facing| {
        let (axis, along, sign) = (facing.axis, 1 - facing.axis, facing.sign());
        let mut before = centre;
        before[axis] += sign * (half_m[axis] + BEFORE_M);
        if !evidence.is_open(&before) {
            return None;
        }
        let back_m = centre[axis] - sign * half_m[axis];
        let span_m = [centre[along] - half_m[along], centre[along] + half_m[along]];
        let common = |face: &&Face| [face.from_m.max(span_m[0]), face.to_m.min(span_m[1])];
        let length_m = |face: &&Face| common(face)[1] - common(face)[0];
        let opposite = Facing { up: !facing.up, ..*facing };
        let is_other = |face: &&Face| {
            face.facing == opposite
                && THICKNESS_M.contains(&(sign * (back_m - face.line_m)))
                && length_m(face) >= SHORTEST_M.max(COMMON * 2.0 * half_m[along])
        };
        let other = faces.iter().filter(is_other).max_by(|a, b| length_m(a).total_cmp(&length_m(b)))?;
        let near = faces.iter().filter(|face| {
            face.facing == *facing
                && (face.line_m - back_m).abs() <= SAME_LINE_M
                && sign * (face.line_m - other.line_m) > 0.0
        });
        let off_m = |face: &&Face| (face.line_m - back_m).abs();
        let near = near.min_by(|a, b| off_m(a).total_cmp(&off_m(b)));
        let line_m = near.map_or(other.line_m + sign * USUAL_M, |face| face.line_m);
        let [from_m, to_m] = common(&other);
        let count = ((to_m - from_m) / other.along_m).ceil().max(1.0) as usize;
        Some(Face {
            facing: *facing,
            line_m,
            from_m,
            to_m,
            cover: vec![HIDDEN_FRACTION; count],
            along_m: other.along_m,
            weight: 0.0,
        })
    };
    Facing::ALL.iter().filter_map(hidden).collect()
}
