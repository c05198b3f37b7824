//! Where an object is: at which walls, and whether inside the home.

use super::cells::Cells;
use super::fit::{UprightBox, middle};
use super::prior::at_wall_share;
use crate::rooms::Room;
use rustc_hash::FxHashSet;
use viola_geometry::Point2;
use viola_geometry::taxonomy::Class;

/// Columns of cells that hold wall, seen from above.
pub struct Walls {
    side_m: f64,
    columns: FxHashSet<[i32; 2]>,
}

/// Minimum cells of a column: label noise on furniture is lower than a wall.
const MIN_HEIGHT_CELLS: u32 = 5;
/// Furniture stands up to this far from its wall: skirting, cables, and an unseen back.
const BEHIND_M: f64 = 0.2;
/// A side is moved to a wall that is at most this far outside or inside it.
const SNAP_M: [f64; 2] = [-0.06, 0.12];
/// Fraction of a side that needs wall behind it to be moved there.
const SNAP_SHARE: f64 = 0.5;

impl Walls {
    pub fn new(cells: &Cells, labels: &[Option<(Class, f32)>]) -> Walls {
        let mut counts: rustc_hash::FxHashMap<[i32; 2], u32> = rustc_hash::FxHashMap::default();
        for (cell, label) in labels.iter().enumerate() {
            let is_wall = label.is_some_and(|(class, _)| {
                matches!(class, Class::Wall | Class::Window | Class::Door | Class::Curtain)
            });
            let is_upright = cells.normal(cell).is_some_and(|normal| normal[2].abs() < 0.5);
            if is_wall && is_upright {
                let [x, y, _] = cells.centre(cell);
                *counts.entry([x, y].map(|c| (c / cells.side_m).floor() as i32)).or_default() += 1;
            }
        }
        let high = counts.into_iter().filter(|(_, count)| *count >= MIN_HEIGHT_CELLS);
        Walls { side_m: cells.side_m, columns: high.map(|(at, _)| at).collect() }
    }

    fn is_wall(&self, [x, y]: [f64; 2]) -> bool {
        self.columns.contains(&[x, y].map(|c| (c / self.side_m).floor() as i32))
    }

    /// Returns the distances from a side to the wall outside it, along the side; none where there is no wall
    /// from `from_m` to `to_m`. Sides are numbered as the corners at which they begin.
    fn behind(&self, bounds: &UprightBox, side: usize, [from_m, to_m]: [f64; 2]) -> Vec<Option<f64>> {
        let corners = bounds.corners();
        let (a, b) = (corners[side], corners[(side + 1) % 4]);
        let along = [b[0] - a[0], b[1] - a[1]];
        let length_m = along[0].hypot(along[1]).max(1e-6);
        // The corners are counter-clockwise.
        let outward = [along[1] / length_m, -along[0] / length_m];
        let count = (length_m / self.side_m).ceil().max(1.0) as usize;
        let steps = ((to_m - from_m) / (0.5 * self.side_m)).ceil() as usize;
        let wall_at = |i: usize| {
            let t = (i as f64 + 0.5) / count as f64;
            (0..=steps)
                .map(|k| from_m + k as f64 * 0.5 * self.side_m)
                .find(|m| self.is_wall([0, 1].map(|axis| a[axis] + t * along[axis] + m * outward[axis])))
        };
        (0..count).map(wall_at).collect()
    }

    /// Returns the largest fraction of a side that has a wall behind it, 0 to 1.
    pub fn contact(&self, bounds: &UprightBox) -> f64 {
        let share = |side: usize| {
            let behind = self.behind(bounds, side, [-self.side_m, BEHIND_M]);
            behind.iter().flatten().count() as f64 / behind.len() as f64
        };
        (0..4).map(share).fold(0.0, f64::max)
    }

    /// Moves the sides of a box to the walls that they nearly touch.
    pub fn snap(&self, bounds: &mut UprightBox) {
        for side in 0..4 {
            let behind = self.behind(bounds, side, SNAP_M);
            let mut seen: Vec<f64> = behind.iter().flatten().copied().collect();
            if (seen.len() as f64) < SNAP_SHARE * behind.len() as f64 {
                continue;
            }
            let middle = seen.len() / 2;
            let by_m = *seen.select_nth_unstable_by(middle, f64::total_cmp).1;
            // A thin box at a wall stays as thick as it was seen.
            if bounds.size_m[1 - side % 2] > 4.0 * by_m.abs() {
                move_side(bounds, side, by_m);
            }
        }
    }
}

/// Moves one side of a box outwards. Sides 0 and 2 bound its width, 1 and 3 its length.
pub fn move_side(bounds: &mut UprightBox, side: usize, by_m: f64) {
    let axis = 1 - side % 2;
    let by_m = by_m.max(0.01 - bounds.size_m[axis]);
    let sign = if side == 1 || side == 2 { 1.0 } else { -1.0 };
    let (s, c) = bounds.yaw_rad.sin_cos();
    let outward = if axis == 0 { [c, s] } else { [-s, c] };
    bounds.size_m[axis] += by_m;
    for (centre, outward) in bounds.centre_m.iter_mut().zip(outward) {
        *centre += sign * outward * by_m / 2.0;
    }
}

/// Returns the logarithm of how likely a class has this contact with walls.
pub fn contact_likelihood(class: Class, contact: f64) -> f64 {
    // A wall may be hidden, and clutter may be taken for one.
    let seen = 0.15 + 0.7 * contact;
    let share = at_wall_share(class);
    (seen * share + (1.0 - seen) * (1.0 - share)).ln()
}

/// Returns how far a box is outside all rooms, in metres: the distance of its nearest corner, or of its middle if
/// that is less; 0 without rooms. The robot does not drive under a bed or into a wardrobe, so that outlines of rooms
/// may end before them.
pub fn outside_m(bounds: &UprightBox, rooms: &[Room]) -> f64 {
    let corners = bounds.corners().map(Point2::from);
    let to_room = |room: &Room| {
        corners.iter().map(|at| room.distance_m(at)).fold(room.distance_m(&middle(bounds)), f64::min)
    };
    let nearest = rooms.iter().map(to_room).fold(f64::INFINITY, f64::min);
    if nearest.is_finite() { nearest } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    fn walls(along_x_at_m: f64) -> Walls {
        let row = (along_x_at_m / 0.06).floor() as i32;
        Walls { side_m: 0.06, columns: (-50..50).map(|x| [x, row]).collect() }
    }

    #[test]
    fn a_side_near_a_wall_moves_to_it() {
        for (yaw_rad, size_m, gap_m, moves) in [
            (0.0, [1.6, 0.5, 0.8], 0.08, true),
            (FRAC_PI_2, [1.6, 0.5, 0.8], 0.08, true),
            (0.0, [1.6, 0.5, 0.8], -0.04, true),
            (0.0, [1.6, 0.5, 0.8], 0.4, false),
        ] {
            let depth_m = if yaw_rad == 0.0 { size_m[1] } else { size_m[0] };
            let before = UprightBox { centre_m: [0.0, 1.2 - gap_m - depth_m / 2.0, 0.4], size_m, yaw_rad };
            let mut after = before;
            walls(1.2).snap(&mut after);
            let top = |b: &UprightBox| b.corners().iter().map(|c| c[1]).fold(f64::MIN, f64::max);
            let low = |b: &UprightBox| b.corners().iter().map(|c| c[1]).fold(f64::MAX, f64::min);
            assert_eq!((top(&after) - 1.2).abs() < 0.05, moves, "{gap_m}: {after:?}");
            assert_eq!(after == before, !moves);
            // The other sides stay.
            assert!((low(&after) - low(&before)).abs() < 1e-9, "{after:?}");
            assert_eq!(walls(1.2).contact(&before) > 0.9, moves);
        }
    }

    #[test]
    fn a_refrigerator_stands_at_a_wall_sooner_than_a_chair() {
        let odds = |contact| {
            contact_likelihood(Class::Refrigerator, contact) - contact_likelihood(Class::Chair, contact)
        };
        assert!(odds(1.0) > 0.5 && odds(0.0) < -0.5);
    }
}
