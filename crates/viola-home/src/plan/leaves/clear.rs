//! Cells of open leaves.

use super::OpenLeaf;
use crate::plan::cells::Cells;
use crate::plan::evidence::Evidence;
use crate::plan::faces::Face;
use viola_geometry::{Point2, Vector2};

/// Cells this near the middle of a leaf, and this far beyond its end, are its own.
const OWN_M: f64 = 0.07;
const BEYOND_END_M: f64 = 0.05;
/// Distance of the wall behind an open leaf.
const WALL_BEHIND_M: [f64; 2] = [0.03, 0.4];
/// Its evidence may end this far beside the leaf, which hides it.
const HIDDEN_WALL_M: f64 = 0.3;
/// Minimum cosine of the angle between the leaf's normal and that wall's.
const ALONG_WALL: f64 = 0.9;
/// Samples along each side of a cell, and minimum part of them that is in a leaf, or between a leaf and its wall.
const SAMPLES: usize = 4;
const COVERED_FRACTION: f64 = 0.6;

impl OpenLeaf {
    /// Makes its cells, and those between it and the wall behind it, a part of their room.
    pub fn clear(&self, cells: &mut Cells, faces: &[Face], evidence: &Evidence) {
        let Some(along) = (self.end - self.hinge).try_normalize(1e-9) else { return };
        let across = Vector2::new(-along.y, along.x);
        let length_m = self.length_m();
        let behind = [across, -across].map(|towards| self.wall_behind(faces, &towards));
        let is_covered = |p: &Point2| {
            let off = p - self.hinge;
            let (along_m, across_m) = (off.dot(&along), off.dot(&across));
            let wall = behind[usize::from(across_m < 0.0)];
            let is_before = |face: &Face| (face_coordinate(face, p) - face.line_m) * face.facing.sign() > 0.0;
            (0.0..=length_m + BEYOND_END_M).contains(&along_m)
                && (across_m.abs() <= OWN_M
                    || across_m.abs() <= WALL_BEHIND_M[1] && wall.is_some_and(is_before))
        };
        for at in 0..cells.inside.len() {
            let centre = Point2::from(cells.centre(at));
            let is_near = (centre - self.hinge).norm() <= length_m + WALL_BEHIND_M[1];
            if !cells.inside[at] && is_near && !evidence.is_wall(&centre) {
                let covered = samples(cells, at).filter(|p| is_covered(p)).count();
                if covered as f64 >= COVERED_FRACTION * (SAMPLES * SAMPLES) as f64 {
                    cells.inside[at] = true;
                    cells.pillars[at] = false;
                }
            }
        }
    }

    /// Returns the face of the wall right behind the leaf, which is on the side `towards` of it.
    fn wall_behind<'a>(&self, faces: &'a [Face], towards: &Vector2) -> Option<&'a Face> {
        let middle = nalgebra::center(&self.hinge, &self.end);
        let off_m = |face: &Face| (face_coordinate(face, &middle) - face.line_m) * face.facing.sign();
        let is_behind = |face: &&Face| {
            let along = [self.hinge, self.end].map(|end| [end.x, end.y][1 - face.facing.axis]);
            let (low_m, high_m) = (along[0].min(along[1]), along[0].max(along[1]));
            face.facing.normal().dot(towards) <= -ALONG_WALL
                && (WALL_BEHIND_M[0]..=WALL_BEHIND_M[1]).contains(&off_m(face))
                && face.from_m <= high_m + HIDDEN_WALL_M
                && face.to_m >= low_m - HIDDEN_WALL_M
        };
        faces.iter().filter(is_behind).min_by(|a, b| off_m(a).total_cmp(&off_m(b)))
    }
}

/// Returns evenly spread points of a cell.
fn samples(cells: &Cells, at: usize) -> impl Iterator<Item = Point2> + '_ {
    let place = cells.place(at);
    (0..SAMPLES * SAMPLES).map(move |sample| {
        let metres = |axis: usize, step: usize| {
            let part = (step as f64 + 0.5) / SAMPLES as f64;
            cells.lines[axis][place[axis]] + part * cells.size_m(axis, place[axis])
        };
        Point2::new(metres(0, sample % SAMPLES), metres(1, sample / SAMPLES))
    })
}

/// Returns the coordinate of a point across a face.
fn face_coordinate(face: &Face, p: &Point2) -> f64 {
    [p.x, p.y][face.facing.axis]
}
