//! Oblique walls: stairs of short sides, which are what cells make of them, become one straight side.

use super::model::{Plan, Wall};
use super::shape::USUAL_M;
use crate::rooms::outline::{Outline, signed_area_m2};

/// Longest side of a stair.
const STEP_M: f64 = 0.7;
/// Corners of the wall are this near the straight side.
const OFF_M: f64 = 0.1;
/// Angle of the side to the axes, at least.
const ANGLE_DEG: f64 = 15.0;
/// Area that a straight side may take from its room.
const MOST_M2: f64 = 0.8;

/// A straight side that replaces corners of a ring.
struct Bevel {
    /// First and last replaced corner, by their places after `ring` was turned.
    from: usize,
    to: usize,
    ends_m: [[f64; 2]; 2],
}

/// Replaces stairs in the outlines of rooms; the walls grow by what the rooms lose.
pub(super) fn bevel(plan: &mut Plan) {
    for room in 0..plan.rooms.len() {
        while let Some((ring, bevel)) = find(&plan.rooms[room].outline.ring_m) {
            let [a, b] = bevel.ends_m;
            let cut: Vec<[f64; 2]> =
                std::iter::once(a).chain(ring[bevel.from..=bevel.to].iter().copied()).chain([b]).collect();
            let mut left = ring[..bevel.from].to_vec();
            left.extend([a, b]);
            left.extend(&ring[bevel.to + 1..]);
            plan.masonry.push(oriented(cut));
            plan.rooms[room].outline.ring_m = left;
            plan.rooms[room].area_m2 = plan.rooms[room].outline.area_m2();
            plan.walls.push(wall(plan.walls.len() + 1, a, b, room));
        }
    }
}

/// Returns an outline that runs counter-clockwise.
fn oriented(mut ring_m: Vec<[f64; 2]>) -> Outline {
    if signed_area_m2(&ring_m) < 0.0 {
        ring_m.reverse();
    }
    Outline { ring_m, holes_m: Vec::new() }
}

/// Returns the wall behind a side; the room is on its left.
fn wall(number: usize, from_m: [f64; 2], to_m: [f64; 2], room: usize) -> Wall {
    let along = [to_m[0] - from_m[0], to_m[1] - from_m[1]];
    let length_m = along[0].hypot(along[1]);
    let right = [along[1] / length_m * USUAL_M / 2.0, -along[0] / length_m * USUAL_M / 2.0];
    Wall {
        id: format!("wall-{number}"),
        from_m: [from_m[0] + right[0], from_m[1] + right[1]],
        to_m: [to_m[0] + right[0], to_m[1] + right[1]],
        thickness_m: USUAL_M,
        is_measured: false,
        rooms: vec![room],
    }
}

/// Returns a stair of a ring, which is turned so that the stair does not cross its ends.
fn find(ring: &[[f64; 2]]) -> Option<(Vec<[f64; 2]>, Bevel)> {
    let count = ring.len();
    if count < 8 {
        return None;
    }
    for start in 0..count {
        let turned: Vec<[f64; 2]> = (0..count).map(|i| ring[(start + i) % count]).collect();
        // The first side is a long one; the stair begins at its end.
        if length_m(turned[0], turned[1]) < STEP_M / 2.0 {
            continue;
        }
        if let Some(bevel) = stair(&turned) {
            return Some((turned, bevel));
        }
    }
    None
}

/// Returns the stair that begins at the second corner.
fn stair(ring: &[[f64; 2]]) -> Option<Bevel> {
    let is_reflex = |i: usize| {
        let [a, b, c] = [ring[i - 1], ring[i], ring[(i + 1) % ring.len()]];
        (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0]) < 0.0
    };
    // Corners turn left and right by turns, left first and last, with short sides between.
    let mut to = 1;
    while to + 1 < ring.len() - 1
        && length_m(ring[to], ring[to + 1]) < STEP_M
        && is_reflex(to) != is_reflex(to + 1)
    {
        to += 1;
    }
    if is_reflex(1) {
        return None;
    }
    if is_reflex(to) {
        to -= 1;
    }
    // At least two corners of the wall show its direction.
    if to < 5 {
        return None;
    }
    let (first, last) = (ring[2], ring[to - 1]);
    let along = [last[0] - first[0], last[1] - first[1]];
    let slope_deg = along[1].abs().atan2(along[0].abs()).to_degrees();
    if !(ANGLE_DEG..=90.0 - ANGLE_DEG).contains(&slope_deg) {
        return None;
    }
    let off_m = |p: [f64; 2]| {
        ((p[0] - first[0]) * along[1] - (p[1] - first[1]) * along[0]).abs() / along[0].hypot(along[1])
    };
    if (2..to).step_by(2).any(|i| off_m(ring[i]) > OFF_M) {
        return None;
    }
    let after = (to + 1) % ring.len();
    let a = meet(first, along, ring[0], ring[1])?;
    let b = meet(first, along, ring[to], ring[after])?;
    let cut: Vec<[f64; 2]> = std::iter::once(a).chain(ring[1..=to].iter().copied()).chain([b]).collect();
    (signed_area_m2(&cut).abs() <= MOST_M2).then_some(Bevel { from: 1, to, ends_m: [a, b] })
}

fn length_m(a: [f64; 2], b: [f64; 2]) -> f64 {
    (b[0] - a[0]).hypot(b[1] - a[1])
}

/// Returns where a line meets a side, if it does.
fn meet(on: [f64; 2], along: [f64; 2], a: [f64; 2], b: [f64; 2]) -> Option<[f64; 2]> {
    let side = [b[0] - a[0], b[1] - a[1]];
    let cross = along[0] * side[1] - along[1] * side[0];
    let part = ((on[0] - a[0]) * along[1] - (on[1] - a[1]) * along[0]) / -cross;
    (cross.abs() > 1e-9 && (0.0..1.0).contains(&part)).then(|| [a[0] + part * side[0], a[1] + part * side[1]])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stair_becomes_one_side() {
        // A room of 4 m with its upper right corner cut in three steps.
        let ring = vec![
            [0.0, 0.0],
            [4.0, 0.0],
            [4.0, 3.0],
            [3.7, 3.0],
            [3.7, 3.3],
            [3.4, 3.3],
            [3.4, 3.6],
            [3.1, 3.6],
            [3.1, 4.0],
            [0.0, 4.0],
        ];
        let (turned, bevel) = find(&ring).unwrap();
        let [a, b] = bevel.ends_m;
        assert_eq!(turned[bevel.from..=bevel.to].len(), 7);
        let near = |p: [f64; 2], q: [f64; 2]| length_m(p, q) < 1e-9;
        assert!(near(a, [4.0, 2.7]) && near(b, [2.7, 4.0]), "{a:?} {b:?}");
        assert!(find(&[[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]]).is_none());
    }
}
