//! A polygon's sides by their height, for maps where very many points are compared with rooms of very many sides.

use super::outline::{crosses, edges, to_segment_m};
use viola_geometry::Point2;

/// Height of a band.
const BAND_M: f64 = 0.25;
/// Largest number of bands: higher polygons have higher bands.
const MAX_BANDS: f64 = 4096.0;
/// Bands of a side on average, beside the two in which it ends: polygons of long sides have higher bands, so that the memory
/// is bounded by the number of sides.
const MEAN_BANDS: f64 = 4.0;
/// Sides this much beyond a distance are compared, so that rounding loses none.
const ROUNDING_M: f64 = 1e-6;

/// A side of a ring, with the ring's number: 0 for the outer one.
struct Side {
    ring: usize,
    ends: [[f64; 2]; 2],
}

/// A polygon whose sides are listed by horizontal bands. It answers as the functions of [`super::outline`] do, and compares a
/// point with the sides of its band only.
pub struct Bands {
    low_m: f64,
    band_m: f64,
    bands: Vec<Vec<Side>>,
}

impl Bands {
    pub fn new(ring: &[[f64; 2]], holes: &[Vec<[f64; 2]>]) -> Bands {
        let rings = || std::iter::once(ring).chain(holes.iter().map(Vec::as_slice));
        let heights = || rings().flatten().map(|corner| corner[1]);
        let low_m = heights().fold(f64::INFINITY, f64::min);
        let height_m = (heights().fold(f64::NEG_INFINITY, f64::max) - low_m).max(0.0);
        let sides = || rings().flat_map(edges);
        let mean_m = sides().map(|(a, b)| (b[1] - a[1]).abs()).sum::<f64>() / sides().count().max(1) as f64;
        let band_m = BAND_M.max(height_m / MAX_BANDS).max(mean_m / MEAN_BANDS);
        let count = (height_m / band_m) as usize + 1;
        let mut bands = Bands { low_m, band_m, bands: (0..count).map(|_| Vec::new()).collect() };
        for (ring, corners) in rings().enumerate() {
            for (a, b) in edges(corners) {
                let [from, to] = [a[1].min(b[1]), a[1].max(b[1])].map(|height| bands.band(height));
                bands.bands[from..=to].iter_mut().for_each(|band| band.push(Side { ring, ends: [a, b] }));
            }
        }
        bands
    }

    /// Returns the band of a height: the first or the last one beyond the polygon.
    fn band(&self, height_m: f64) -> usize {
        (((height_m - self.low_m) / self.band_m).max(0.0) as usize).min(self.bands.len() - 1)
    }

    /// Returns whether the polygon contains a point, which is in none of its holes.
    pub fn contains(&self, point: &Point2) -> bool {
        let mut is_around = false;
        for of_ring in self.bands[self.band(point.y)].chunk_by(|a, b| a.ring == b.ring) {
            let is_outer = of_ring[0].ring == 0;
            if is_odd(of_ring, point) != is_outer {
                return false;
            }
            is_around |= is_outer;
        }
        is_around
    }

    /// Returns whether the outer ring contains a point.
    pub fn surrounds(&self, point: &Point2) -> bool {
        let band = &self.bands[self.band(point.y)];
        is_odd(&band[..band.partition_point(|side| side.ring == 0)], point)
    }

    /// Returns whether the outer ring is within a distance of a point.
    pub fn is_outer_near(&self, point: &Point2, reach_m: f64) -> bool {
        self.near(point, reach_m).any(|side| side.ring == 0 && off_m(side, point) <= reach_m)
    }

    /// Returns whether a ring is within a distance of a point.
    pub fn is_near(&self, point: &Point2, reach_m: f64) -> bool {
        self.near(point, reach_m).any(|side| off_m(side, point) <= reach_m)
    }

    /// Returns the distance from a point to the nearest ring, if it is at most `reach_m`; else a larger number.
    pub fn off_m(&self, point: &Point2, reach_m: f64) -> f64 {
        self.near(point, reach_m).map(|side| off_m(side, point)).fold(f64::INFINITY, f64::min)
    }

    /// Returns all sides that may be within a distance of a point, and others.
    fn near(&self, point: &Point2, reach_m: f64) -> impl Iterator<Item = &Side> {
        let [from, to] =
            [-reach_m - ROUNDING_M, reach_m + ROUNDING_M].map(|off_m| self.band(point.y + off_m));
        self.bands[from..=to].iter().flatten()
    }
}

/// Returns whether an odd number of a ring's sides are right of a point.
fn is_odd(sides: &[Side], point: &Point2) -> bool {
    sides.iter().filter(|side| crosses(&side.ends, point)).count() % 2 == 1
}

fn off_m(side: &Side, point: &Point2) -> f64 {
    to_segment_m(&[point.x, point.y], &side.ends[0], &side.ends[1])
}

#[cfg(test)]
mod tests {
    use super::super::outline::{contains, distance_m};
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn bands_answer_as_all_sides_do(
            rings in prop::collection::vec(prop::collection::vec((-9i32..10, -9i32..10), 0..9), 1..4),
            point in (-25i32..26, -25i32..26),
            reach in 0..9,
        ) {
            // Many points lie on corners and sides.
            let metres = |of: i32| f64::from(of) / 8.0;
            let ring = |ring: &Vec<(i32, i32)>| ring.iter().map(|(x, y)| [metres(*x), metres(*y)]).collect();
            let rings: Vec<Vec<[f64; 2]>> = rings.iter().map(ring).collect();
            let (point, reach_m) = (Point2::new(metres(point.0) / 2.0, metres(point.1) / 2.0), metres(reach));
            let [outer, holes @ ..] = rings.as_slice() else { unreachable!() };
            let bands = Bands::new(outer, holes);
            let is_in_hole = holes.iter().any(|hole| contains(hole, &point));
            prop_assert_eq!(bands.contains(&point), contains(outer, &point) && !is_in_hole);
            prop_assert_eq!(bands.surrounds(&point), contains(outer, &point));
            prop_assert_eq!(bands.is_outer_near(&point, reach_m), distance_m(outer, &point) <= reach_m);
            let is_near = rings.iter().any(|ring| distance_m(ring, &point) <= reach_m);
            prop_assert_eq!(bands.is_near(&point, reach_m), is_near);
            let off_m = rings.iter().map(|ring| distance_m(ring, &point)).fold(f64::INFINITY, f64::min);
            let found_m = bands.off_m(&point, reach_m);
            let as_near = if off_m <= reach_m { found_m == off_m } else { found_m >= off_m };
            prop_assert!(as_near, "{found_m} {off_m}");
        }
    }

    /// A comb of 40 000 sides, as a noisy map has.
    #[test]
    fn a_point_is_compared_with_few_sides() {
        let teeth = (0..10_000).flat_map(|at| {
            let x = 100.0 - f64::from(at % 100);
            let y = f64::from(at / 100);
            [[x, y], [x - 0.5, y], [x - 0.5, y + 0.5], [x - 1.0, y + 0.5]]
        });
        let ring: Vec<[f64; 2]> = teeth.collect();
        let bands = Bands::new(&ring, &[]);
        let most = bands.bands.iter().map(Vec::len).max().unwrap();
        assert!((1..=600).contains(&most), "{most} of {} sides", ring.len());
        let listed: usize = bands.bands.iter().map(Vec::len).sum();
        assert!(listed <= 4 * ring.len(), "{listed}");
        assert!(bands.near(&Point2::new(50.0, 50.0), 0.4).count() <= 5 * most);
    }

    /// A comb of a thousand teeth of 100 m.
    #[test]
    fn long_sides_are_in_few_bands() {
        let teeth = (0..1_000).map(|at| 2.0 * f64::from(at));
        let ring: Vec<[f64; 2]> =
            teeth.flat_map(|x| [[x, 0.0], [x, 100.0], [x + 1.0, 100.0], [x + 1.0, 0.0]]).collect();
        let listed: usize = Bands::new(&ring, &[]).bands.iter().map(Vec::len).sum();
        assert!((ring.len()..=6 * ring.len()).contains(&listed), "{listed}");
    }
}
