//! Oblique walls: the stairs that cells make of them become straight sides.

use super::axes::span;
use super::masonry::common_m2;
use super::model::{Wall, direction, length_m};
use super::oblique::Oblique;
use super::shape::{THICKEST_M, USUAL_M};
use crate::rooms::outline::{Outline, signed_area_m2};
use viola_geometry::Point2;

/// Longest side of a stair.
const STEP_M: f64 = 0.5;
/// Stairs reach this far beyond the evidence of their face.
const BEYOND_M: f64 = 0.15;
/// Corners and the middle of each side of a stair are this near the face.
const CORNER_M: f64 = 0.14;
const MIDDLE_M: f64 = 0.1;
/// Shortest stair that becomes a side.
const SIDE_M: f64 = 0.35;
/// A corner moves at most this far; else it stays, and the side begins beside it.
const MOVE_M: f64 = 0.3;
/// Sine of the largest angle between the two faces of a wall.
const PARALLEL: f64 = 0.2;

/// Rooms with a larger common area overlap.
const MAX_COMMON_M2: f64 = 1e-4;

/// A bound on work: rings with more corners keep their stairs.
const MAX_CORNERS: usize = 2000;

/// A straight side of a room at an oblique face.
#[derive(Debug, Clone)]
pub(super) struct Side {
    pub room: usize,
    /// Place of the face.
    face: usize,
    /// Its ends; the room is on the left.
    pub ends_m: [[f64; 2]; 2],
}

/// Puts the stairs of all rooms on their faces, and returns the new sides. Rooms do not overlap afterwards.
pub(super) fn straighten(outlines: &mut [Outline], faces: &[Oblique]) -> Vec<Side> {
    let mut sides = Vec::new();
    let before = outlines.to_vec();
    // A large map has very many rooms, and few are at a side.
    let boxes: Vec<[[f64; 2]; 2]> = before.iter().map(|outline| span(&outline.ring_m)).collect();
    for (room, outline) in outlines.iter_mut().enumerate() {
        let is_shared = |side: [[f64; 2]; 2]| {
            let others = before.iter().zip(&boxes).enumerate().filter(|(other, _)| *other != room);
            let near =
                others.filter(|(_, (_, own))| meet_spans(own, &span(side))).map(|(_, (other, _))| other);
            near.flat_map(rings_of).any(|ring| has_part_of(ring, side))
        };
        let rings = std::iter::once(&mut outline.ring_m).chain(&mut outline.holes_m);
        for ring in rings {
            if let Some((straight, new)) = straight(ring, faces, &is_shared) {
                *ring = straight;
                sides.extend(new.into_iter().map(|(face, ends_m)| Side { room, face, ends_m }));
            }
        }
    }
    restore_overlapping(outlines, &before, &mut sides);
    sides
}

/// Returns whether two spans have a common point.
fn meet_spans(a: &[[f64; 2]; 2], b: &[[f64; 2]; 2]) -> bool {
    (0..2).all(|axis| a[axis][0] <= b[axis][1] && b[axis][0] <= a[axis][1])
}

fn rings_of(outline: &Outline) -> impl Iterator<Item = &Vec<[f64; 2]>> {
    std::iter::once(&outline.ring_m).chain(&outline.holes_m)
}

/// Returns whether a ring has a part of a side, both along the axes.
fn has_part_of(ring: &[[f64; 2]], [from_m, to_m]: [[f64; 2]; 2]) -> bool {
    let span = |a: f64, b: f64| [a.min(b), a.max(b)];
    let is_part = |(a, b): (&[f64; 2], &[f64; 2])| {
        (0..2).any(|axis| {
            let is_on_line = [a, b, &to_m].iter().all(|end| end[axis] == from_m[axis]);
            let own = span(from_m[1 - axis], to_m[1 - axis]);
            let other = span(a[1 - axis], b[1 - axis]);
            is_on_line && own[0].max(other[0]) < own[1].min(other[1])
        })
    };
    ring.iter().zip(ring.iter().cycle().skip(1)).any(is_part)
}

/// Gives rooms that overlap their stairs back, which overlap nothing.
fn restore_overlapping(outlines: &mut [Outline], before: &[Outline], sides: &mut Vec<Side>) {
    loop {
        let is_straight = |room: usize| outlines[room] != before[room];
        let overlaps = |room: usize| {
            let mut others = (0..outlines.len()).filter(|other| *other != room);
            others.any(|other| common_m2(&outlines[room], &outlines[other]) > MAX_COMMON_M2)
        };
        let found: Vec<usize> =
            (0..outlines.len()).filter(|room| is_straight(*room) && overlaps(*room)).collect();
        if found.is_empty() {
            return;
        }
        for room in found {
            outlines[room].clone_from(&before[room]);
            sides.retain(|side| side.room != room);
        }
    }
}

/// Returns the face of which a side of a ring is a step; the room is on the side's left.
fn face_of(faces: &[Oblique], from_m: [f64; 2], to_m: [f64; 2]) -> Option<usize> {
    let (a, b) = (Point2::from(from_m), Point2::from(to_m));
    let side = b - a;
    let off_m = |face: &Oblique| face.within(&nalgebra::center(&a, &b))[1].abs();
    let is_step = |face: &Oblique| {
        let looks = -side.y * face.normal.x + side.x * face.normal.y > 0.0;
        let is_near = [a, b].iter().all(|end| {
            let [along_m, off_m] = face.within(end);
            (-BEYOND_M..=face.length_m + BEYOND_M).contains(&along_m) && off_m.abs() <= CORNER_M
        });
        looks && is_near && off_m(face) <= MIDDLE_M
    };
    if side.norm() > STEP_M {
        return None;
    }
    (0..faces.len())
        .filter(|face| is_step(&faces[*face]))
        .min_by(|a, b| off_m(&faces[*a]).total_cmp(&off_m(&faces[*b])))
}

/// A line of a ring: sides along an axis, or the steps of a face.
struct Line {
    face: Option<usize>,
    from_m: [f64; 2],
    to_m: [f64; 2],
}

type NewSides = Vec<(usize, [[f64; 2]; 2])>;

/// Returns a ring with straight sides for its stairs; `None` if it has none. A side that `is_shared` lies at another room, without
/// a wall between, and stays.
fn straight(
    ring: &[[f64; 2]],
    faces: &[Oblique],
    is_shared: &impl Fn([[f64; 2]; 2]) -> bool,
) -> Option<(Vec<[f64; 2]>, NewSides)> {
    if ring.len() > MAX_CORNERS {
        return None;
    }
    let lines = lines(ring, faces, is_shared);
    if lines.iter().all(|line| line.face.is_none()) || lines.len() < 3 {
        return None;
    }
    let mut corners: Vec<[f64; 2]> = Vec::new();
    // Corners at the end of each line: one, or two if the lines meet too far away.
    let mut ends: Vec<[[f64; 2]; 2]> = Vec::new();
    for (at, line) in lines.iter().enumerate() {
        let next = &lines[(at + 1) % lines.len()];
        let corner = line.to_m;
        let met = meet(line, next, faces).filter(|met| length_m(*met, corner) <= MOVE_M);
        ends.push(match met {
            Some(met) => [met, met],
            None => [projected(line, faces, corner), projected(next, faces, corner)],
        });
    }
    let mut sides = Vec::new();
    for (at, line) in lines.iter().enumerate() {
        let begin = ends[(at + lines.len() - 1) % lines.len()][1];
        let end = ends[at];
        if let Some(face) = line.face {
            sides.push((face, [begin, end[0]]));
        }
        corners.push(end[0]);
        if end[1] != end[0] {
            corners.push(end[1]);
        }
    }
    corners.dedup_by(|a, b| length_m(*a, *b) < 1e-6);
    is_simple(&corners).then_some((corners, sides))
}

/// Joins the steps of each face; short stairs stay.
fn lines(ring: &[[f64; 2]], faces: &[Oblique], is_shared: &impl Fn([[f64; 2]; 2]) -> bool) -> Vec<Line> {
    let count = ring.len();
    let corner = |i: usize| ring[i % count];
    let label = |i: usize| {
        let side = [corner(i), corner(i + 1)];
        face_of(faces, side[0], side[1]).filter(|_| !is_shared(side))
    };
    let mut labels: Vec<Option<usize>> = (0..count).map(label).collect();
    for [from, to] in runs(&labels) {
        if length_m(corner(from), corner(to)) < SIDE_M {
            (from..to).for_each(|i| labels[i % count] = None);
        }
    }
    let line =
        |[from, to]: [usize; 2]| Line { face: labels[from % count], from_m: corner(from), to_m: corner(to) };
    runs(&labels).into_iter().map(line).collect()
}

/// Returns the runs of equal labels of a ring; sides without a label are runs of their own.
fn runs(labels: &[Option<usize>]) -> Vec<[usize; 2]> {
    let count = labels.len();
    let label = |i: usize| labels[i % count];
    // The first run begins where a label ends.
    let start = (1..count).find(|i| label(*i).is_none() || label(*i) != label(i - 1)).unwrap_or(0);
    let mut runs: Vec<[usize; 2]> = Vec::new();
    for i in start..start + count {
        match runs.last_mut() {
            Some(run) if label(i).is_some() && label(i) == label(i - 1) => run[1] = i + 1,
            _ => runs.push([i, i + 1]),
        }
    }
    runs
}

/// Returns where two lines meet, unless they are parallel.
fn meet(a: &Line, b: &Line, faces: &[Oblique]) -> Option<[f64; 2]> {
    let ([p, d], [q, e]) = (through(a, faces), through(b, faces));
    let cross = d[0] * e[1] - d[1] * e[0];
    let part = ((q[0] - p[0]) * e[1] - (q[1] - p[1]) * e[0]) / cross;
    (cross.abs() > 1e-6).then(|| [p[0] + part * d[0], p[1] + part * d[1]])
}

/// Returns a point and the direction of a line.
fn through(line: &Line, faces: &[Oblique]) -> [[f64; 2]; 2] {
    match line.face {
        Some(face) => {
            let face = &faces[face];
            [[face.from_m.x, face.from_m.y], [face.along.x, face.along.y]]
        }
        None => [line.from_m, direction(line.from_m, line.to_m)],
    }
}

fn projected(line: &Line, faces: &[Oblique], p: [f64; 2]) -> [f64; 2] {
    let Some(face) = line.face else { return p };
    let at = faces[face].at(faces[face].within(&Point2::from(p))[0]);
    [at.x, at.y]
}

/// Returns whether no two sides of a ring cross, and it has an area.
fn is_simple(ring: &[[f64; 2]]) -> bool {
    let count = ring.len();
    let side = |i: usize| (ring[i], ring[(i + 1) % count]);
    let turn =
        |a: [f64; 2], b: [f64; 2], c: [f64; 2]| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    let cross = |i: usize, j: usize| {
        let ((a, b), (c, d)) = (side(i), side(j));
        turn(a, b, c) * turn(a, b, d) < 0.0 && turn(c, d, a) * turn(c, d, b) < 0.0
    };
    count >= 3
        && signed_area_m2(ring).abs() > 1e-3
        && (0..count).all(|i| (i + 2..count).all(|j| !cross(i, j)))
}

/// Returns the walls at straight sides; a wall between two rooms once.
pub(super) fn walls(sides: &[Side], faces: &[Oblique]) -> Vec<Wall> {
    let mut walls = Vec::new();
    let mut taken = vec![false; sides.len()];
    for at in 0..sides.len() {
        if taken[at] {
            continue;
        }
        let side = &sides[at];
        let other =
            (at + 1..sides.len()).find(|other| !taken[*other] && is_behind(side, &sides[*other], faces));
        let [from_m, to_m] = side.ends_m;
        let face = &faces[side.face];
        let (thickness_m, rooms) = match other {
            Some(other) => {
                taken[other] = true;
                let mut rooms = vec![side.room, sides[other].room];
                rooms.sort_unstable();
                rooms.dedup();
                (behind_m(side, &sides[other], faces), rooms)
            }
            None => (USUAL_M, vec![side.room]),
        };
        let centre = |p: [f64; 2]| [0, 1].map(|axis| p[axis] - face.normal[axis] * thickness_m / 2.0);
        let wall = Wall::new([centre(from_m), centre(to_m)], thickness_m);
        walls.push(Wall { is_measured: other.is_some(), rooms, ..wall });
    }
    walls
}

/// Returns how far behind a side the middle of another one is.
fn behind_m(side: &Side, other: &Side, faces: &[Oblique]) -> f64 {
    let [a, b] = other.ends_m.map(Point2::from);
    -faces[side.face].within(&nalgebra::center(&a, &b))[1]
}

/// Returns whether another side is the other face of the same wall.
fn is_behind(side: &Side, other: &Side, faces: &[Oblique]) -> bool {
    let (face, back) = (&faces[side.face], &faces[other.face]);
    let is_opposite = face.normal.dot(&back.normal) < 0.0 && face.normal.perp(&back.normal).abs() <= PARALLEL;
    let along = |side: &Side| side.ends_m.map(|end| face.within(&Point2::from(end))[0]);
    let ([a, b], [c, d]) = (along(side), along(other));
    let common_m = a.max(b).min(c.max(d)) - a.min(b).max(c.min(d));
    let least_m = 0.5 * (b - a).abs().min((d - c).abs());
    is_opposite && common_m >= least_m && (0.03..=THICKEST_M).contains(&behind_m(side, other, faces))
}

#[cfg(test)]
mod tests;
