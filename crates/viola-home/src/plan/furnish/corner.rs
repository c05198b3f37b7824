//! Recesses of corner sofas, by the points of their seats.

use crate::objects::UprightBox;

/// Side of the cells in which seats are seen; boxes of people may be very large, and have larger cells.
const CELL_M: f64 = 0.1;
const MAX_CELLS: f64 = 64.0;
/// Minimum sides of a recess, minimum fraction of the box, and minimum depth of both legs. Other sofas are less deep than a leg
/// and a recess.
const RECESS_M: f64 = 0.5;
const RECESS_FRACTION: f64 = 0.15;
const LEG_M: f64 = 0.6;
/// Maximum fraction of a recess with points, and minimum fraction of each leg: a corner that nobody saw is no recess.
const NOISE: f64 = 0.1;
const SEEN: f64 = 0.5;
/// A recess ends before a row of cells of which more than one in this number have points.
const EDGE: f64 = 4.0;

/// A sofa along two sides of its box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Corner {
    /// The side of one of its backs, in quarter turns of its own frame from -y; the other one is at the first end of that side.
    pub back: u8,
    /// Fractions of this back and of the side across it that the recess has.
    pub recess: [f64; 2],
}

/// Returns the recess of a corner sofa of which points are given; none for other sofas.
pub(super) fn corner(places: &[[f64; 3]], bounds: &UprightBox) -> Option<Corner> {
    let mut size_m = [bounds.size_m[0], bounds.size_m[1]];
    let mut parts: Vec<[f64; 2]> = places
        .iter()
        .map(|[x, y, _]| {
            let local = bounds.local(*x, *y);
            [0, 1].map(|axis| local[axis] / size_m[axis] + 0.5)
        })
        .collect();
    let mut best: Option<(f64, Corner)> = None;
    for back in 0..4 {
        if let Some((score, recess)) = largest(&parts, size_m)
            && best.is_none_or(|(most, _)| score > most)
        {
            best = Some((score, Corner { back, recess }));
        }
        // The next side becomes the back.
        parts.iter_mut().for_each(|[u, v]| (*u, *v) = (*v, 1.0 - *u));
        size_m.swap(0, 1);
    }
    best.map(|(_, corner)| corner)
}

/// Returns the largest recess at the end of the back and at the front, as fractions of a box, and its score. `parts` are places as
/// fractions along the back and from the back to the front.
fn largest(parts: &[[f64; 2]], size_m: [f64; 2]) -> Option<(f64, [f64; 2])> {
    let count = size_m.map(|side_m| (side_m / CELL_M).round().clamp(1.0, MAX_CELLS) as usize);
    // Number of cells with points from a place to the end and to the front, or at the place until it is summed.
    let mut seen = vec![vec![0u32; count[0] + 1]; count[1] + 1];
    for part in parts {
        let [u, v] =
            [0, 1].map(|axis| ((part[axis].max(0.0) * count[axis] as f64) as usize).min(count[axis] - 1));
        seen[v][u] = 1;
    }
    for v in (0..count[1]).rev() {
        for u in (0..count[0]).rev() {
            seen[v][u] += seen[v + 1][u] + seen[v][u + 1] - seen[v + 1][u + 1];
        }
    }
    let all = seen[0][0];
    let places = (1..count[1]).flat_map(|v| (1..count[0]).map(move |u| [u, v]));
    let scored = places.filter_map(|[u, v]| {
        let leg_m = [0, 1].map(|axis| [u, v][axis] as f64 / count[axis] as f64 * size_m[axis]);
        let is_large = (0..2).all(|axis| leg_m[axis] >= LEG_M && size_m[axis] - leg_m[axis] >= RECESS_M);
        let cells = ((count[0] - u) * (count[1] - v)) as f64;
        let within = f64::from(seen[v][u]);
        let is_part = |seen: u32, cells: usize| f64::from(seen) >= SEEN * cells as f64;
        let is_recess = is_large
            && cells >= RECESS_FRACTION * (count[0] * count[1]) as f64
            && within <= NOISE * cells
            && is_part(all - seen[v][0], count[0] * v)
            && is_part(all - seen[0][u], count[1] * u);
        let recess = [(count[0] - u) as f64 / count[0] as f64, (count[1] - v) as f64 / count[1] as f64];
        is_recess.then_some((cells - EDGE * within, recess))
    });
    scored.max_by(|a, b| a.0.total_cmp(&b.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns points 5 cm apart of a sofa around a recess at its front right corner, as seen from its back.
    fn places(size_m: [f64; 2], recess_m: [f64; 2], turn_rad: f64) -> (Vec<[f64; 3]>, UprightBox) {
        const STEP_M: f64 = 0.05;
        let bounds =
            UprightBox { centre_m: [3.0, -1.0, 0.4], size_m: [size_m[0], size_m[1], 0.8], yaw_rad: turn_rad };
        let (sin, cos) = turn_rad.sin_cos();
        let count = size_m.map(|side_m| (side_m / STEP_M).round() as usize);
        let all = (0..count[0]).flat_map(|i| (0..count[1]).map(move |j| [i, j]));
        let local = all.map(|at| [0, 1].map(|axis: usize| (at[axis] as f64 + 0.5) * STEP_M));
        let seats = local.filter(|at| (0..2).any(|axis| at[axis] < size_m[axis] - recess_m[axis]));
        let places = seats.map(|at| {
            let [x, y] = [0, 1].map(|axis| at[axis] - size_m[axis] / 2.0);
            [3.0 + cos * x - sin * y, -1.0 + sin * x + cos * y, 0.4]
        });
        (places.collect(), bounds)
    }

    #[test]
    fn a_recess_is_found_in_any_corner() {
        for (size_m, recess_m) in
            [([2.6, 1.8], [1.7, 0.9]), ([2.2, 1.5], [1.4, 0.6]), ([3.0, 3.0], [2.1, 2.0])]
        {
            for turn_rad in [0.0, 0.3] {
                let (places, bounds) = places(size_m, recess_m, turn_rad);
                // The same sofa in boxes whose axes are turned.
                for quarter in 0..4u8 {
                    let mut turned = bounds;
                    turned.yaw_rad += f64::from(quarter) * std::f64::consts::FRAC_PI_2;
                    if quarter % 2 == 1 {
                        turned.size_m.swap(0, 1);
                    }
                    let found = corner(&places, &turned).unwrap();
                    assert_eq!(found.back, (4 - quarter) % 4, "{size_m:?} {turn_rad}");
                    for axis in 0..2 {
                        let found_m = found.recess[axis] * size_m[axis];
                        assert!((found_m - recess_m[axis]).abs() < 0.11, "{size_m:?} {found:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn other_sofas_have_no_recess() {
        for (name, size_m, hidden_m) in [
            ("a sofa", [2.2, 0.95], [0.0; 2]),
            ("a sofa of which nobody saw a corner", [2.2, 0.95], [1.0, 0.6]),
            ("a sofa that is unfolded", [2.0, 1.6], [0.0; 2]),
            ("a sofa with a notch", [2.0, 1.6], [0.5, 0.4]),
            ("the front of a sofa", [2.4, 1.6], [2.2, 1.4]),
        ] {
            let (places, bounds) = places(size_m, hidden_m, 0.0);
            assert_eq!(corner(&places, &bounds), None, "{name}");
        }
        let (_, bounds) = places([2.4, 1.6], [1.5, 0.7], 0.0);
        assert_eq!(corner(&[], &bounds), None);
    }

    #[test]
    fn noise_in_a_recess_and_gaps_in_the_seats_are_allowed() {
        let (mut places, bounds) = places([2.6, 1.8], [1.7, 0.9], 0.0);
        // Every third square of 10 cm.
        places.retain(|[x, y, _]| ((x * 10.0).floor() + (y * 10.0).floor()) as i64 % 3 != 0);
        places.extend([[3.6, -0.6, 0.4], [3.9, -0.4, 0.4], [4.1, -0.7, 0.4]]);
        let found = corner(&places, &bounds).unwrap();
        assert!(found.back == 0 && (found.recess[0] - 1.7 / 2.6).abs() < 0.04, "{found:?}");
    }
}
