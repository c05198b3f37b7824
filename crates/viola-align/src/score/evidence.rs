//! Evidence for and against a pose: the distance of the hits, and free space on both sides.

use crate::rooms::NamedRooms;
use crate::scan::{FREE_CELL_M, Hit, Landmark, VirtualScan};
use crate::target::Target;
use nalgebra::Rotation2;
use rustc_hash::FxHashSet;
use serde::{Deserialize, Serialize};
use viola_formats::lidar::Cell;
use viola_geometry::{Point2, Pose2, cell_of, cells_around};

/// Maximum distance that counts: a hit without a counterpart is clutter, however far it is.
const TRUNCATION_M: f64 = 0.2;
/// Maximum distance to the map of a hit with a counterpart.
pub const INLIER_M: f64 = 0.1;
/// Minimum distance before its hit at which the map blocks a ray.
const SHORT_OF_HIT_M: f64 = 0.25;
/// Minimum distance from the map's points at which a hit on free floor contradicts the map.
const OFF_WALL_M: f64 = 0.15;
/// Distance before a hit, along its normal, of space that the camera saw free: the robot should know it.
const BEFORE_WALL_M: f64 = 0.2;

/// The evidence on one pose. Fractions are of the hits' weight unless stated otherwise, 0..1.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Evidence {
    /// Mean truncated distance of the hits to the map.
    pub distance_m: f64,
    pub inliers: f64,
    /// Hits whose ray meets the map well before the hit; short pieces of the map count less.
    pub blocked_rays: f64,
    /// Hits on free floor of the map.
    pub hits_on_floor: f64,
    /// Hits with a counterpart, but on a side that the robot never saw.
    pub unseen_sides: f64,
    /// Walls of the map where the clip saw free floor, as a fraction of these walls and the clip's hits; short
    /// pieces of the map count less.
    pub walls_on_floor: f64,
    /// Objects in pictures that do not belong in the named room of the map, as a fraction of everything that
    /// stands in pictures.
    pub misplaced: f64,
}

/// Computes the evidence on poses of one clip.
pub struct PoseScorer<'a> {
    hits: &'a [Hit],
    weight: f64,
    /// Cells that the clip saw free together with all their neighbours.
    free: FxHashSet<[i32; 2]>,
    /// Maximum distance of a free cell from the clip's origin.
    free_reach_m: f64,
    landmarks: &'a [Landmark],
    unknown_fraction: f64,
    use_cells: bool,
}

fn free_cell(point: &Point2) -> [i32; 2] {
    cell_of(point, FREE_CELL_M)
}

fn weight(hits: &[Hit]) -> f64 {
    hits.iter().map(|hit| hit.weight).sum::<f64>().max(f64::MIN_POSITIVE)
}

impl<'a> PoseScorer<'a> {
    pub fn new(hits: &'a [Hit], scan: &'a VirtualScan, unknown_fraction: f64) -> PoseScorer<'a> {
        let seen: FxHashSet<[i32; 2]> = scan.free_m.iter().map(free_cell).collect();
        // One cell in from the edge: the edge itself is where walls stand.
        let inner = |cell: &[i32; 2]| cells_around(*cell).all(|near| seen.contains(&near));
        PoseScorer {
            hits,
            weight: weight(hits),
            free: seen.iter().filter(|c| inner(c)).copied().collect(),
            free_reach_m: scan.free_m.iter().map(|p| p.coords.norm()).fold(0.0, f64::max) + FREE_CELL_M,
            landmarks: &scan.landmarks,
            unknown_fraction,
            use_cells: true,
        }
    }

    /// Returns the scorer for a comparison of poses in these maps. The states of cells count only if all of the maps have
    /// cells: the same hits have a smaller loss in a map of bare points.
    pub(crate) fn comparing<'t>(self, mut maps: impl Iterator<Item = &'t Target>) -> PoseScorer<'a> {
        PoseScorer { use_cells: maps.all(|target| target.cells.is_some()), ..self }
    }

    /// Returns the scorer of the same scan for other hits.
    pub(crate) fn with_hits<'b>(self, hits: &'b [Hit]) -> PoseScorer<'b>
    where
        'a: 'b,
    {
        PoseScorer { hits, weight: weight(hits), ..self }
    }

    /// Returns the evidence on one pose. A hit without a counterpart costs the truncation, or a fraction of
    /// `unknown_fraction` of it in unknown cells of the map.
    pub fn evidence(&self, map_from_clip: &Pose2, target: &Target) -> Evidence {
        let mut evidence = Evidence::default();
        let turn = Rotation2::new(map_from_clip.yaw_rad);
        let use_cells = self.use_cells && target.cells.is_some();
        for hit in self.hits {
            let at = map_from_clip.apply(&hit.point_m);
            let distance_m = target.field.value(&at);
            let state = if use_cells { target.cell_at(&at) } else { Cell::Unknown };
            let cut_m = match state {
                Cell::Unknown => TRUNCATION_M * self.unknown_fraction,
                _ => TRUNCATION_M,
            };
            let on_floor = state == Cell::Free && distance_m > OFF_WALL_M;
            evidence.distance_m += hit.weight * distance_m.min(cut_m);
            evidence.inliers += hit.weight * indicator(distance_m < INLIER_M);
            evidence.hits_on_floor += hit.weight * indicator(on_floor);
            if distance_m < INLIER_M && use_cells {
                let before = at + turn * hit.normal * BEFORE_WALL_M;
                evidence.unseen_sides += hit.weight * indicator(target.cell_at(&before) == Cell::Unknown);
            }
            // Completed hits were not seen, so they have no ray.
            if !hit.completed {
                evidence.blocked_rays += hit.weight * blocked(map_from_clip, hit, target);
            }
        }
        evidence.distance_m /= self.weight;
        evidence.inliers /= self.weight;
        evidence.hits_on_floor /= self.weight;
        evidence.unseen_sides /= self.weight;
        evidence.blocked_rays /= self.weight;
        evidence.walls_on_floor = self.walls_on_floor(map_from_clip, target);
        evidence.misplaced = target.rooms.as_ref().map_or(0.0, |rooms| self.misplaced(map_from_clip, rooms));
        evidence
    }

    fn walls_on_floor(&self, map_from_clip: &Pose2, target: &Target) -> f64 {
        let clip_from_map = map_from_clip.inverse();
        let reach2 = self.free_reach_m * self.free_reach_m;
        let origin = Point2::new(map_from_clip.x_m, map_from_clip.y_m);
        let contradicted = target
            .thinned_m
            .iter()
            .zip(&target.thinned_fractions)
            .filter(|(p, _)| (*p - origin).norm_squared() < reach2)
            .filter(|(p, _)| self.free.contains(&free_cell(&clip_from_map.apply(p))))
            .map(|(_, fraction)| fraction)
            .sum::<f64>();
        contradicted / (contradicted + self.hits.len() as f64).max(1.0)
    }

    fn misplaced(&self, map_from_clip: &Pose2, rooms: &NamedRooms) -> f64 {
        let is_misplaced = |thing: &&Landmark| {
            let (at, from) = (map_from_clip.apply(&thing.point_m), map_from_clip.apply(&thing.from_m));
            rooms.around(&at, &from).suit(thing.class) == Some(false)
        };
        // The sum of nothing is -0.0, which JSON would show.
        0.0 + self.landmarks.iter().filter(is_misplaced).map(|thing| thing.fraction).sum::<f64>()
    }
}

/// Returns how much the map blocks the ray of a hit, 0..1, by sphere tracing on the distance field: the fraction
/// of the longest piece that the ray meets.
fn blocked(map_from_clip: &Pose2, hit: &Hit, target: &Target) -> f64 {
    let cell_m = target.field.frame().cell_m;
    let wall_m = f64::max(0.5 * cell_m, 0.02);
    let (from, to) = (map_from_clip.apply(&hit.from_m), map_from_clip.apply(&hit.point_m));
    let range_m = (to - from).norm();
    let direction = (to - from) / range_m.max(1e-9);
    let (mut along_m, mut blocked) = (0.0, 0.0);
    while along_m < range_m - SHORT_OF_HIT_M && blocked < 1.0 {
        let at = from + direction * along_m;
        let distance_m = target.field.value(&at);
        if distance_m < wall_m {
            blocked = f64::max(blocked, target.wall_fraction(&at));
        }
        along_m += f64::max(distance_m - wall_m, 0.5 * cell_m);
    }
    blocked
}

fn indicator(of: bool) -> f64 {
    f64::from(u8::from(of))
}

#[cfg(test)]
mod tests {
    use super::*;
    use viola_geometry::{Grid, GridFrame, Vector2};

    /// Returns a wall along x = 2 m that the robot saw only from smaller x.
    fn target(known: bool) -> Target {
        let frame = GridFrame::covering([0.0, 0.0], [4.0, 4.0], 0.0, 0.05);
        let mut cells = Grid::filled(frame, Cell::Unknown);
        let mut points = Vec::new();
        for y in 0..frame.height {
            for x in 0..frame.width {
                let at = frame.centre(x, y);
                if (at.x - 2.0).abs() < 0.04 {
                    cells.set(x, y, Cell::Occupied);
                    points.push(at);
                } else if at.x < 2.0 {
                    cells.set(x, y, Cell::Free);
                }
            }
        }
        Target::from_points(points, Some(0.05), known.then_some(cells)).unwrap()
    }

    fn hit(y_m: f64) -> Hit {
        Hit::standing(Point2::new(1.0, y_m), Vector2::new(-1.0, 0.0))
    }

    #[test]
    fn a_wall_that_is_seen_from_where_the_robot_never_was_contradicts() {
        use std::f64::consts::PI;
        let hits: Vec<Hit> = (0..10).map(|i| hit(0.1 * f64::from(i))).collect();
        let (scan, unknown_fraction) = (VirtualScan::default(), 0.6);
        let scorer = PoseScorer::new(&hits, &scan, unknown_fraction);
        let (front, behind, off) =
            (Pose2::new(1.0, 1.0, 0.0), Pose2::new(3.0, 3.0, PI), Pose2::new(1.5, 1.0, 0.0));
        for (known, pose, want) in [
            (true, front, 0.0),
            (true, behind, 1.0),
            (true, off, 0.0),
            (false, front, 0.0),
            (false, behind, 0.0),
        ] {
            let evidence = scorer.evidence(&pose, &target(known));
            assert_eq!(evidence.unseen_sides, want, "{known} {pose:?} {evidence:?}");
        }
    }
}
