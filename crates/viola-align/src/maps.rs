//! Registers an earlier LiDAR map of a level to a later one: a robot that maps a home again may choose another frame.

use crate::refine;
use crate::scan::Hit;
use crate::score::is_different;
use crate::search::{Modes, Search, SearchLimits, SearchParams};
use crate::target::{THINNED_CELL_M, Target};
use rayon::prelude::*;
use rustc_hash::FxHashMap;
use viola_formats::lidar::LidarMap;
use viola_geometry::progress::Silent;
use viola_geometry::{Point2, Pose2, Vector2, cell_of};

/// A point of one map has a counterpart this near in the other: two cells and the noise of both.
const NEAR_M: f64 = 0.12;
/// Minimum fraction of the points with a counterpart, of the map that lies more inside the other one.
const MIN_AGREEMENT: f64 = 0.7;
/// Minimum length of the walls with a counterpart: less is found in any home.
const MIN_WALL_M: f64 = 10.0;
/// Side of the squares of the floor plan in which walls count up to the diagonal, however thick they are.
const SQUARE_M: f64 = 0.25;
/// A different pose with as many counterparts, up to this fraction, is as good.
const MARGIN: f64 = 0.05;
/// Longest side of a map: 60 m hold a home. Larger ones would take as much memory as a clip's job.
const MAX_SIDE_M: f64 = 60.0;
/// Maximum points of a map: the walls of such a home have a tenth.
const MAX_POINTS: usize = 200_000;
/// Hits of the search, and of the refinement.
const HITS: usize = 256;
const REFINED_HITS: usize = 2000;
/// Limits of the search: furniture that moved costs the right pose some of its score.
const LIMITS: SearchLimits = SearchLimits { modes: 40, min_score_ratio: 0.7 };

/// Returns the transform into the frame of `later` from that of `earlier`; `None` if the maps do not tell it, because
/// they differ too much or because the home looks alike from several sides.
///
/// The frame that stayed is preferred: among poses that explain the maps equally well it is the one without a change.
pub fn later_from_earlier(earlier: &LidarMap, later: &LidarMap) -> Option<Pose2> {
    if !is_home(earlier) || !is_home(later) {
        return None;
    }
    let (from, to) = (Target::new(earlier)?, Target::new(later)?);
    // Poses of the middle: the frame's origin may lie tens of metres away, where small turns move it far.
    let middle = middle(&from.thinned_m);
    let points = from.thinned_m.iter().zip(&from.thinned_fractions);
    let every = from.thinned_m.len().div_ceil(REFINED_HITS).max(1);
    let hits: Vec<Hit> = points.step_by(every).map(|point| hit(point, &middle)).collect();
    let params = SearchParams { hits: HITS, first: LIMITS, resumed: LIMITS, ..SearchParams::default() };
    let found = Search::new(&hits, &to, &params).run(&LIMITS, &Silent).ok()?;
    let stayed = Pose2::new(middle.x, middle.y, 0.0);
    let starts: Vec<Pose2> =
        std::iter::once(stayed).chain(found.modes.iter().map(|mode| mode.map_from_clip)).collect();
    let refined = refine::refine(&starts, &hits, &to);
    let poses: Vec<Pose2> = refined.iter().map(|refined| refined.map_from_clip).collect();
    let from_earlier = |pose: &Pose2| pose.compose(&Pose2::new(-middle.x, -middle.y, 0.0));
    let agreement = |pose: &Pose2| Agreement::of(&from_earlier(pose), &from, &to);
    let agreements: Vec<Agreement> = poses.par_iter().map(agreement).collect();
    let ranked = || poses.iter().zip(&agreements);
    let (best, most) = ranked().max_by(|a, b| a.1.mean().total_cmp(&b.1.mean()))?;
    let as_good = |agreement: &Agreement| agreement.mean() > most.mean() - MARGIN;
    let is_enough = |pose: &Pose2, agreement: &Agreement| {
        agreement.is_enough() && wall_m(&from, &from_earlier(pose), &to) >= MIN_WALL_M
    };
    let is_told = !may_lack_one_as_good(&found)
        && !ranked().any(|(pose, agreement)| as_good(agreement) && is_different(pose, best));
    if is_told {
        return is_enough(best, most).then(|| from_earlier(best));
    }
    // The first start is the frame that stayed.
    let (pose, agreement) = ranked().next()?;
    let stays = as_good(agreement) && !is_different(pose, &stayed);
    (stays && is_enough(pose, agreement)).then(|| from_earlier(pose))
}

/// Returns whether the search ended at its budget, and an unlisted pose may score nearly as high as the best one.
fn may_lack_one_as_good(found: &Modes) -> bool {
    let best = found.modes.first().map_or(0.0, |mode| mode.score);
    !found.complete && found.open_bound >= (1.0 - MARGIN) * best
}

/// Returns whether a map is as large as a home and not more: the work is then bounded.
fn is_home(map: &LidarMap) -> bool {
    map.occupied_m.len() <= MAX_POINTS
        && [0, 1].iter().all(|&axis| map.info.max_m[axis] - map.info.min_m[axis] <= MAX_SIDE_M)
}

fn middle(points_m: &[Point2]) -> Point2 {
    let sum: Vector2 = points_m.iter().map(|point| point.coords).sum();
    Point2::from(sum / points_m.len().max(1) as f64)
}

/// Returns a point of the map as a hit, from `middle`. Search and refinement use its place and weight only.
fn hit((point_m, fraction): (&Point2, &f64), middle: &Point2) -> Hit {
    Hit { weight: *fraction, ..Hit::standing(Point2::from(point_m - middle), Vector2::x()) }
}

/// Fractions of the points of each map that have a counterpart in the other.
struct Agreement {
    earlier: f64,
    later: f64,
}

impl Agreement {
    fn of(later_from_earlier: &Pose2, earlier: &Target, later: &Target) -> Agreement {
        let (near, all) = counterparts(earlier, later_from_earlier, later);
        let (near_later, all_later) = counterparts(later, &later_from_earlier.inverse(), earlier);
        let fraction = |near: f64, all: f64| if all > 0.0 { near / all } else { 0.0 };
        Agreement { earlier: fraction(near, all), later: fraction(near_later, all_later) }
    }

    fn mean(&self) -> f64 {
        0.5 * (self.earlier + self.later)
    }

    /// A map of a part of the home lies inside that of all of it.
    fn is_enough(&self) -> bool {
        self.earlier.max(self.later) >= MIN_AGREEMENT
    }
}

/// Returns the number of a map's points with a counterpart in another map, and of all its points, each counted as a wall.
fn counterparts(of: &Target, there_from_here: &Pose2, there: &Target) -> (f64, f64) {
    let (mut near, mut all) = (0.0, 0.0);
    for (point, weight) in of.thinned_m.iter().zip(&of.thinned_fractions) {
        all += weight;
        if has_counterpart(point, there_from_here, there) {
            near += weight;
        }
    }
    (near, all)
}

fn has_counterpart(point: &Point2, there_from_here: &Pose2, there: &Target) -> bool {
    there.field.value(&there_from_here.apply(point)) < NEAR_M
}

/// Returns the length of a map's walls with a counterpart in another map. A point stands for the side of its cell.
fn wall_m(of: &Target, there_from_here: &Pose2, there: &Target) -> f64 {
    let cell_m = THINNED_CELL_M.max(of.field.frame().cell_m);
    let side_m = SQUARE_M.max(cell_m);
    let most_m = side_m * std::f64::consts::SQRT_2;
    let mut by_square: FxHashMap<[i32; 2], f64> = FxHashMap::default();
    for (point, weight) in of.thinned_m.iter().zip(&of.thinned_fractions) {
        if has_counterpart(point, there_from_here, there) {
            *by_square.entry(cell_of(point, side_m)).or_default() += weight * cell_m;
        }
    }
    by_square.values().map(|length_m| length_m.min(most_m)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::Candidate;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Ends of the walls of a home that looks alike from no other side, and a shelf that stands free.
    const HOME: [[f64; 4]; 9] = [
        [0.0, 0.0, 8.0, 0.0],
        [8.0, 0.0, 8.0, 6.0],
        [8.0, 6.0, 0.0, 6.0],
        [0.0, 6.0, 0.0, 0.0],
        [3.0, 0.0, 3.0, 2.5],
        [3.0, 3.4, 3.0, 6.0],
        [3.0, 4.0, 5.2, 4.0],
        [6.1, 4.0, 8.0, 4.0],
        [5.0, 1.0, 6.2, 1.0],
    ];
    const SQUARE: [[f64; 4]; 4] =
        [[0.0, 0.0, 4.0, 0.0], [4.0, 0.0, 4.0, 4.0], [4.0, 4.0, 0.0, 4.0], [0.0, 4.0, 0.0, 0.0]];

    /// The map of walls as a robot would write it, in a frame of its own: noise of 2 cm, a fifth of the points missing, and
    /// only those that `is_seen`.
    fn map(
        walls: &[[f64; 4]],
        map_from_home: &Pose2,
        is_seen: impl Fn(&Point2) -> bool,
        seed: u64,
    ) -> LidarMap {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut csv = "x,y\n".to_owned();
        for [x0, y0, x1, y1] in walls {
            let steps = ((x1 - x0).hypot(y1 - y0) / 0.04) as usize;
            for step in 0..=steps {
                let along = step as f64 / steps as f64;
                let at = Point2::new(x0 + along * (x1 - x0), y0 + along * (y1 - y0));
                let noise = Vector2::new(random.random_range(-0.02..0.02), random.random_range(-0.02..0.02));
                let at_map = map_from_home.apply(&(at + noise));
                if is_seen(&at) && random.random_bool(0.8) {
                    csv += &format!("{},{}\n", at_map.x, at_map.y);
                }
            }
        }
        LidarMap::read(csv.as_bytes()).unwrap()
    }

    fn all(_: &Point2) -> bool {
        true
    }

    #[test]
    fn a_home_that_was_mapped_anew_in_another_frame() {
        let parts = [("all of it", all as fn(&Point2) -> bool), ("a part of it", |at| at.x < 5.5)];
        for (name, is_seen) in parts {
            for (seed, yaw_deg) in [0.0, 90.0, 37.0, 180.0, -121.0].into_iter().enumerate() {
                let moved = Pose2::new(-4.3, 11.0, f64::to_radians(yaw_deg));
                let whole = map(&HOME, &Pose2::IDENTITY, all, 1);
                let anew = map(&HOME, &moved, is_seen, 2 + seed as u64);
                let middle = Point2::new(4.0, 3.0);
                let cases =
                    [(&whole, &anew, moved, middle), (&anew, &whole, moved.inverse(), moved.apply(&middle))];
                for (earlier, later, truth, middle) in cases {
                    let found =
                        later_from_earlier(earlier, later).unwrap_or_else(|| panic!("{name}, {yaw_deg}"));
                    let miss_m = (found.apply(&middle) - truth.apply(&middle)).norm();
                    let turned = viola_geometry::angle_between(found.yaw_rad, truth.yaw_rad).to_degrees();
                    assert!(miss_m < 0.1 && turned < 1.0, "{name}, {yaw_deg}: {miss_m} m, {turned} degrees");
                }
            }
        }
    }

    #[test]
    fn nothing_is_told_of_maps_that_do_not_tell() {
        let home = map(&HOME, &Pose2::IDENTITY, all, 1);
        let other: Vec<[f64; 4]> =
            HOME.iter().map(|[x0, y0, x1, y1]| [x0 * 1.4, y0 * 0.8, x1 * 1.4, y1 * 0.8]).collect();
        let square = map(&SQUARE, &Pose2::IDENTITY, all, 3);
        let far = map(&[[0.0, 0.0, 90.0, 0.0]], &Pose2::IDENTITY, all, 4);
        let cases = [
            ("another home", &home, map(&other, &Pose2::IDENTITY, all, 2)),
            ("a square, moved", &square, map(&SQUARE, &Pose2::new(3.0, 0.0, 0.0), all, 5)),
            ("a map too large for a home", &far, map(&[[0.0, 0.0, 90.0, 0.0]], &Pose2::IDENTITY, all, 6)),
        ];
        for (name, earlier, later) in cases {
            assert_eq!(later_from_earlier(earlier, &later), None, "{name}");
        }
    }

    #[test]
    fn the_length_of_a_wall_hardly_depends_on_the_cells_of_its_map() {
        // Side of the cells in metres, and the wall's thickness in cells.
        for (cell_m, thickness) in [(0.05, 1), (0.05, 3), (0.1, 1), (0.1, 2), (0.2, 1), (0.5, 1)] {
            let cell = |i: i32| (f64::from(i) + 0.5) * cell_m;
            let long = (6.0 / cell_m).round() as i32;
            let wall = (0..long).flat_map(|x| (0..thickness).map(move |y| Point2::new(cell(x), cell(y))));
            let map = Target::from_points(wall.collect(), Some(cell_m), None).unwrap();
            let length_m = wall_m(&map, &Pose2::IDENTITY, &map);
            assert!((5.5..8.6).contains(&length_m), "{cell_m} m, {thickness} cells: {length_m} m");
        }
    }

    #[test]
    fn a_search_that_ended_at_its_budget_may_lack_a_pose_as_good() {
        let mode = Candidate { map_from_clip: Pose2::IDENTITY, score: 0.8 };
        for (complete, open_bound, lacks) in [(false, 0.79, true), (false, 0.7, false), (true, 0.79, false)] {
            let found = Modes { modes: vec![mode], open_bound, nodes: 0, complete };
            assert_eq!(may_lack_one_as_good(&found), lacks, "{found:?}");
        }
    }

    #[test]
    fn a_frame_that_stayed_is_taken_before_one_that_looks_alike() {
        let (earlier, later) =
            (map(&SQUARE, &Pose2::IDENTITY, all, 1), map(&SQUARE, &Pose2::IDENTITY, all, 2));
        let found = later_from_earlier(&earlier, &later).unwrap();
        assert!(!is_different(&found, &Pose2::IDENTITY), "{found:?}");

        // The origin is 36 m from the home, as in the sheets of robots: a turn by 0.8 degrees moves it by 0.5 m.
        let middle = Point2::new(27.6, 27.6);
        let far = Pose2::new(25.6, 25.6, 0.0);
        let turn = Pose2::new(middle.x, middle.y, 0.8f64.to_radians())
            .compose(&Pose2::new(-middle.x, -middle.y, 0.0));
        let later = map(&SQUARE, &turn.compose(&far), all, 2);
        let found = later_from_earlier(&map(&SQUARE, &far, all, 1), &later).unwrap();
        assert!((found.apply(&middle) - middle).norm() < 0.1, "{found:?}");
    }
}
