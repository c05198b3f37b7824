//! Oblique borders between rooms without a wall: the stairs of cells become straight.

use super::masonry::{pieces, polygon};
use super::model::strip;
use super::partitions::RoomBorder;
use crate::rooms::outline::Outline;
use geo::{BooleanOps, MultiPolygon};

/// Stairs are this near their line.
const STAIRS_M: f64 = 0.2;
/// A corner this near the line between its neighbours is on it.
const SAME_LINE_M: f64 = 1e-6;

/// Puts the stairs between two rooms on the straight border. Rooms do not overlap afterwards.
pub(super) fn straighten(outlines: &mut [Outline], borders: &[RoomBorder]) {
    for border in borders.iter().filter(|border| is_oblique(border)) {
        let [left, right] = border.rooms;
        if let Some([of_left, of_right]) = divided([&outlines[left], &outlines[right]], border.ends_m) {
            outlines[left] = of_left;
            outlines[right] = of_right;
        }
    }
}

fn is_oblique(border: &RoomBorder) -> bool {
    let [from, to] = border.ends_m;
    (0..2).all(|axis| from[axis] != to[axis])
}

/// Returns the rooms on the left and on the right of a line with their border on it. None if a room would be in pieces.
fn divided(rooms: [&Outline; 2], [from_m, to_m]: [[f64; 2]; 2]) -> Option<[Outline; 2]> {
    let length_m = (to_m[0] - from_m[0]).hypot(to_m[1] - from_m[1]).max(1e-9);
    let along = [0, 1].map(|axis| (to_m[axis] - from_m[axis]) / length_m);
    let moved = |p: [f64; 2], along_m: f64, left_m: f64| {
        [p[0] + along_m * along[0] - left_m * along[1], p[1] + along_m * along[1] + left_m * along[0]]
    };
    // Beyond its ends are walls, which may be oblique.
    let side = |left_m: f64| {
        let ends = [moved(from_m, -STAIRS_M, left_m / 2.0), moved(to_m, STAIRS_M, left_m / 2.0)];
        area(&strip(ends[0], ends[1], left_m.abs()))
    };
    let sides = [side(STAIRS_M), side(-STAIRS_M)];
    let near = sides[0].union(&sides[1]);
    let rooms = rooms.map(polygon);
    let at_border = rooms[0].union(&rooms[1]).intersection(&near);
    let mut divided = [0, 1].map(|room: usize| {
        let rest = MultiPolygon(vec![rooms[room].clone()]).difference(&near);
        pieces(&rest.union(&at_border.intersection(&sides[room])))
    });
    let is_whole = divided.iter().all(|pieces| pieces.len() == 1);
    is_whole.then(|| [0, 1].map(|room: usize| without_straight_corners(divided[room].remove(0))))
}

fn area(corners: &[[f64; 2]; 4]) -> MultiPolygon {
    MultiPolygon(vec![polygon(&Outline { ring_m: corners.to_vec(), holes_m: Vec::new() })])
}

/// Removes the corners on a straight side, where the area beside the border ended.
fn without_straight_corners(mut outline: Outline) -> Outline {
    for ring in std::iter::once(&mut outline.ring_m).chain(&mut outline.holes_m) {
        let mut at = 0;
        while at < ring.len() && ring.len() > 3 {
            let [a, b, c] = [ring.len() - 1, 0, 1].map(|step| ring[(at + step) % ring.len()]);
            let [ab, ac] = [b, c].map(|p| [p[0] - a[0], p[1] - a[1]]);
            let off_m = (ab[0] * ac[1] - ab[1] * ac[0]).abs() / ac[0].hypot(ac[1]).max(1e-9);
            if off_m < SAME_LINE_M {
                ring.remove(at);
            } else {
                at += 1;
            }
        }
    }
    outline
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rooms::outline::contains;
    use proptest::prelude::*;
    use viola_geometry::Point2;

    /// Two rooms of 6 m x 4 m together, whose border has stairs of 0.1 m along a line from (2, 0) to (x, 4).
    fn rooms(x: f64) -> [Outline; 2] {
        let count = ((x - 2.0).abs() / 0.1).ceil().max(1.0) as usize;
        let mut stairs = Vec::new();
        for step in 0..count {
            let part = |step: usize| step as f64 / count as f64;
            let middle_m = 2.0 + (x - 2.0) * (part(step) + part(step + 1)) / 2.0;
            stairs.extend([[middle_m, 4.0 * part(step)], [middle_m, 4.0 * part(step + 1)]]);
        }
        let right: Vec<[f64; 2]> =
            [&[[6.0, 4.0], [6.0, 0.0]][..], &stairs].concat().into_iter().rev().collect();
        let left = [&stairs[..], &[[0.0, 4.0], [0.0, 0.0]]].concat();
        [left, right].map(|ring_m| Outline { ring_m, holes_m: Vec::new() })
    }

    proptest! {
        #[test]
        fn rooms_meet_at_the_line(x in 0.6..4.4f64) {
            let mut outlines = rooms(x).to_vec();
            prop_assert!(outlines.iter().all(|outline| outline.area_m2() > 0.0));
            let border = RoomBorder::between([[2.0, 0.0], [x, 4.0]], [0, 1]);
            straighten(&mut outlines, &[border]);
            let left_m2 = 4.0 * (2.0 + x) / 2.0;
            for (outline, area_m2) in outlines.iter().zip([left_m2, 24.0 - left_m2]) {
                prop_assert!((outline.area_m2() - area_m2).abs() < 1e-3, "{outline:?}");
                prop_assert!((x - 2.0).abs() < 0.2 || outline.ring_m.len() <= 6, "{outline:?}");
            }
            // Points beside the line are in the room of their side.
            for part in [0.1, 0.4, 0.7, 0.95] {
                let at = [2.0 + (x - 2.0) * part, 4.0 * part];
                for (room, off_m) in [(0, -0.02), (1, 0.02)] {
                    let place = Point2::new(at[0] + off_m, at[1]);
                    let held = outlines.iter().map(|outline| contains(&outline.ring_m, &place));
                    prop_assert_eq!(held.collect::<Vec<_>>(), [room == 0, room == 1]);
                }
            }
        }
    }
}
