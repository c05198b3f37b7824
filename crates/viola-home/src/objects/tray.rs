//! Showers by their trays. Glass is not measured, and a label network calls a tray floor.

use super::fit::UprightBox;
use super::{Found, Object};
use crate::map_point::MapPoint;
use std::collections::{BTreeMap, BTreeSet};
use viola_geometry::taxonomy::Class;

/// Side of the cells.
const CELL_M: f64 = 0.05;
/// Minimum vertical part of a tray's normals.
const LEVEL: f32 = 0.85;
/// Heights of trays and of the floor around them. Rugs are lower.
const LOWEST_M: f64 = -0.1;
const TRAY_M: [f64; 2] = [0.03, 0.16];
/// Minimum height above the floor around it.
const STEP_M: f64 = 0.03;
/// Cells from its border to the floor that is compared.
const RING: std::ops::RangeInclusive<usize> = 2..=3;
/// Sides of trays, the least area, and the least fraction of the rectangle.
const SIDES_M: std::ops::RangeInclusive<f64> = 0.6..=1.3;
const MIN_AREA_M2: f64 = 0.3;
const FILLED: f64 = 0.6;
/// Usual height of a shower's space.
const SHOWER_M: f64 = 2.0;
/// Another object has the place with this fraction of the tray.
const TAKEN: f64 = 0.3;
/// Of 16 simulated homes 6 of 9 filmed trays were found, and nothing else.
const CONFIDENCE: f64 = 0.7;

type Place = [i32; 2];

/// Level surface of a cell.
#[derive(Default)]
struct Cell {
    sum_m: f64,
    members: Vec<u32>,
}

impl Cell {
    fn height_m(&self) -> f64 {
        self.sum_m / self.members.len().max(1) as f64
    }
}

/// Returns the showers whose trays stand where no other object does. Their sides have the home's direction.
pub(super) fn showers(points: &[MapPoint], found: &[Found], wall_yaw_rad: Option<f64>) -> Vec<Found> {
    let yaw_rad = wall_yaw_rad.unwrap_or(0.0);
    let (sin, cos) = yaw_rad.sin_cos();
    let mut cells: BTreeMap<Place, Cell> = BTreeMap::new();
    for (at, point) in (0..).zip(points) {
        let [x, y, z] = point.point.position_m.map(f64::from);
        if point.point.normal[2] > LEVEL && (LOWEST_M..TRAY_M[1]).contains(&z) {
            let own = [cos * x + sin * y, cos * y - sin * x].map(|m| (m / CELL_M).floor() as i32);
            let cell = cells.entry(own).or_default();
            cell.sum_m += z;
            cell.members.push(at);
        }
    }
    let raised = cells.iter().filter(|(_, cell)| cell.height_m() > TRAY_M[0]).map(|(place, _)| *place);
    // Holes are closed, then what is thin is left out.
    let raised: BTreeSet<Place> = raised.collect();
    let whole = grown(&shrunk(&shrunk(&grown(&raised))));
    let free = |bounds: &UprightBox| {
        let takes = |other: &UprightBox| {
            other.bottom_m() < SHOWER_M / 2.0 && bounds.shared_m2(other) > TAKEN * bounds.area_m2()
        };
        !found.iter().any(|found| takes(&found.object.bounds()))
    };
    let shower = |piece: BTreeSet<Place>| {
        let (mut bounds, members) = tray(&piece, &cells)?;
        let [u, v, z] = bounds.centre_m;
        bounds.centre_m = [cos * u - sin * v, sin * u + cos * v, z];
        bounds.yaw_rad = yaw_rad;
        bounds.normalise();
        let object = Object::new(Class::Shower, CONFIDENCE, &bounds, members.len());
        free(&bounds).then_some(Found { object, members })
    };
    pieces(whole).into_iter().filter_map(shower).collect()
}

/// Returns the box of a piece in the frame of the cells, with the space above it, and its points; `None` if it is no tray.
fn tray(piece: &BTreeSet<Place>, cells: &BTreeMap<Place, Cell>) -> Option<(UprightBox, Vec<u32>)> {
    let ends = |axis: usize| {
        let along = || piece.iter().map(|place| place[axis]);
        Some([f64::from(along().min()?) * CELL_M, f64::from(along().max()? + 1) * CELL_M])
    };
    let spans = [ends(0)?, ends(1)?];
    let sides = spans.map(|[low, high]| high - low);
    let area_m2 = piece.len() as f64 * CELL_M * CELL_M;
    let is_tray =
        sides.iter().all(|side| SIDES_M.contains(&(side + 1e-9)) || SIDES_M.contains(&(side - 1e-9)))
            && area_m2 >= MIN_AREA_M2
            && area_m2 > FILLED * sides[0] * sides[1];
    if !is_tray {
        return None;
    }
    let own: Vec<&Cell> = piece.iter().filter_map(|place| cells.get(place)).collect();
    let height_m = median(own.iter().map(|cell| cell.height_m()))?;
    let mut inner = piece.clone();
    let mut around = BTreeSet::new();
    for step in 1..=*RING.end() {
        let outer = grown(&inner);
        if RING.contains(&step) {
            around.extend(outer.difference(&inner).copied());
        }
        inner = outer;
    }
    let floor_m = median(around.iter().filter_map(|place| cells.get(place)).map(Cell::height_m))?;
    if height_m - floor_m < STEP_M {
        return None;
    }
    let mut members: Vec<u32> = own.into_iter().flat_map(|cell| cell.members.iter().copied()).collect();
    members.sort_unstable();
    let bounds = UprightBox {
        centre_m: [(spans[0][0] + spans[0][1]) / 2.0, (spans[1][0] + spans[1][1]) / 2.0, SHOWER_M / 2.0],
        size_m: [sides[0], sides[1], SHOWER_M],
        yaw_rad: 0.0,
    };
    Some((bounds, members))
}

fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

fn beside([x, y]: Place) -> [Place; 4] {
    [[x - 1, y], [x + 1, y], [x, y - 1], [x, y + 1]]
}

fn grown(places: &BTreeSet<Place>) -> BTreeSet<Place> {
    places.iter().flat_map(|place| beside(*place)).chain(places.iter().copied()).collect()
}

fn shrunk(places: &BTreeSet<Place>) -> BTreeSet<Place> {
    places.iter().copied().filter(|place| beside(*place).iter().all(|next| places.contains(next))).collect()
}

/// Divides places into connected pieces.
fn pieces(mut left: BTreeSet<Place>) -> Vec<BTreeSet<Place>> {
    let mut pieces = Vec::new();
    while let Some(first) = left.pop_first() {
        let (mut piece, mut open) = (BTreeSet::from([first]), vec![first]);
        while let Some(place) = open.pop() {
            for next in beside(place) {
                if left.remove(&next) {
                    piece.insert(next);
                    open.push(next);
                }
            }
        }
        pieces.push(piece);
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;
    use viola_reconstruct::Label;

    /// A floor of 3 m by 3 m, with a raised rectangle whose lower corner is at (1, 1).
    fn floor(sides_m: [f64; 2], height_m: f64) -> Vec<MapPoint> {
        let point = |x: f64, y: f64| {
            let is_raised = (1.0..1.0 + sides_m[0]).contains(&x) && (1.0..1.0 + sides_m[1]).contains(&y);
            let z = if is_raised { height_m } else { 0.0 };
            MapPoint::new([x, y, z], [0.0, 0.0, 1.0], Label::new(Class::Floor, 0.9, 0))
        };
        (0..120)
            .flat_map(|i| (0..120).map(move |j| [i, j]))
            .map(|[i, j]| {
                let [x, y] = [i, j].map(|step| 0.0125 + 0.025 * f64::from(step));
                point(x, y)
            })
            .collect()
    }

    #[test]
    fn a_tray_is_a_shower_and_a_rug_or_a_step_is_none() {
        for (sides_m, height_m, is_shower) in [
            ([0.9, 0.8], 0.08, true),
            ([1.2, 0.8], 0.05, true),
            // A rug, a book, a platform, a bed.
            ([0.9, 0.8], 0.02, false),
            ([0.4, 0.3], 0.08, false),
            ([2.0, 1.2], 0.08, false),
            ([0.9, 0.8], 0.4, false),
        ] {
            let points = floor(sides_m, height_m);
            let found = showers(&points, &[], Some(0.0));
            assert_eq!(found.len(), usize::from(is_shower), "{sides_m:?} {height_m}");
            let Some(first) = found.first() else { continue };
            for (axis, side_m) in sides_m.into_iter().enumerate() {
                assert!((first.object.size_m[axis] - side_m).abs() < 0.11, "{:?}", first.object);
                assert!((first.object.centre_m[axis] - 1.0 - side_m / 2.0).abs() < 0.06);
            }
            assert!(first.object.bounds().stands());
            // The place is taken.
            assert!(showers(&points, &found, Some(0.0)).is_empty());
        }
    }
}
