//! Chooses the views that complete missing parts (paper III-D): they begin at the end of the seen part and
//! move in small steps over the part that was not seen at the vacuum's height.

use super::view::View;
use crate::observe::Observation;
use geo::{ConcaveHull, MultiPoint};
use rustc_hash::{FxHashMap, FxHashSet};
use serde::{Deserialize, Serialize};
use std::ops::Range;
use viola_geometry::{Pinhole, Point2, Point3, Vector2, cell_of, cells_around, voxels_around};
use viola_reconstruct::PointCloud;

/// Strategy for choosing views.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ViewStrategy {
    /// The paper's: from the boundary of the seen part, back, and around over the frontier.
    Frontier,
    /// The paper's first baseline: the clip's own cameras, half a metre back.
    StepBack,
    /// The paper's second baseline: the clip's own cameras at the vacuum's height, level.
    VacuumHeight,
}

/// Parameters of the strategies.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewParams {
    pub strategy: ViewStrategy,
    pub vacuum_height_m: f64,
    /// Maximum number of views.
    pub max_views: usize,
}

const STEP_BACK_M: f64 = 0.2;
const RIVAL_STEP_BACK_M: f64 = 0.5;
const MAX_STEPS_BACK: usize = 10;
const TURN_RAD: f64 = 10.0 / 180.0 * std::f64::consts::PI;
const MAX_TURNS: usize = 3;
/// Maximum length of the frontier from the boundary.
const FRONTIER_M: f64 = 2.0;
const FRONTIER_STEP_M: f64 = 0.1;
/// Radius of a point's vicinity on the plan.
const VICINITY_M: f64 = 0.3;
/// Side of the cells in which points of the plan are thinned.
const CELL_M: f64 = 0.06;

/// The point sets of the paper, on the plan at the vacuum's height.
#[derive(Debug, Clone, Default)]
pub struct PointSets {
    /// Seen at the vacuum's height.
    pub hits_m: Vec<Point2>,
    /// Upright surface at any height, projected down.
    pub down_projected_m: Vec<Point2>,
    /// Projected points without a hit in their vicinity.
    pub missing_m: Vec<Point2>,
    /// Boundary between the seen part and the missing one.
    pub boundary_m: Option<Point2>,
    /// Points without hits along the outline of everything seen, from the boundary on.
    pub frontier_m: Vec<Point2>,
}

/// Returns the views in the order of their completion, and the point sets. `observation` has its floor at 0.
pub fn views(observation: &Observation, camera: &Pinhole, params: &ViewParams) -> (Vec<View>, PointSets) {
    let Some(clip_from_world) = &observation.clip_from_world else { return Default::default() };
    let own: Vec<View> = observation.keys.iter().map(|key| View::of(key, clip_from_world)).collect();
    let sets = PointSets::of(observation);
    let evenly = |views: Vec<View>| -> Vec<View> {
        let stride = views.len().div_ceil(params.max_views).max(1);
        views.into_iter().step_by(stride).collect()
    };
    let views = match params.strategy {
        ViewStrategy::StepBack => evenly(own).iter().map(|view| view.back(RIVAL_STEP_BACK_M)).collect(),
        ViewStrategy::VacuumHeight => {
            let lower = |view: &View| View {
                eye_m: [view.eye_m[0], view.eye_m[1], params.vacuum_height_m],
                pitch_rad: 0.0,
                ..*view
            };
            evenly(own).iter().map(lower).collect()
        }
        ViewStrategy::Frontier => frontier_views(observation, &own, &sets, camera, params),
    };
    (views, sets)
}

impl PointSets {
    fn of(observation: &Observation) -> PointSets {
        let seen = observation.scan.hits.iter().filter(|hit| hit.at_vacuum_height);
        let hits_m: Vec<Point2> = seen.map(|hit| hit.point_m).collect();
        // The floor is left out: where it was seen, nothing is missing.
        let down_projected_m = plan(&observation.cloud_in_clip, 0.2..2.2);
        let near_hits = Vicinity::of(&hits_m);
        let missing_m: Vec<Point2> = down_projected_m.iter().filter(|p| !near_hits.has(p)).copied().collect();
        let mut sets = PointSets { hits_m, down_projected_m, missing_m, ..PointSets::default() };
        sets.boundary_m = sets.boundary();
        if let Some(boundary) = sets.boundary_m {
            sets.frontier_m = frontier(&outline(&observation.cloud_in_clip), &boundary, &near_hits);
        }
        sets
    }

    /// Returns the point of the largest cluster of hits that is nearest to the missing points. The fallback
    /// without hits is the missing point nearest to the first camera.
    fn boundary(&self) -> Option<Point2> {
        let cluster = largest_cluster(&self.hits_m);
        if cluster.is_empty() {
            return nearest(&Point2::origin(), &self.missing_m);
        }
        // One in 20 cm: the distances need not be exact.
        let mut seen = FxHashSet::default();
        let missing: Vec<&Point2> = self.missing_m.iter().filter(|p| seen.insert(cell_of(p, 0.2))).collect();
        let gap = |from: &&Point2| {
            missing.iter().map(|p| (*p - *from).norm_squared()).fold(f64::INFINITY, f64::min)
        };
        cluster.iter().min_by(|a, b| gap(a).total_cmp(&gap(b))).copied()
    }
}

fn nearest(to: &Point2, of: &[Point2]) -> Option<Point2> {
    of.iter().min_by(|a, b| (*a - to).norm_squared().total_cmp(&(*b - to).norm_squared())).copied()
}

type Cells = FxHashMap<[i32; 2], Vec<Point2>>;

/// Returns the points of each cell.
fn by_cell(points: &[Point2], side_m: f64) -> Cells {
    let mut cells = Cells::default();
    for point in points {
        cells.entry(cell_of(point, side_m)).or_default().push(*point);
    }
    cells
}

/// An index of points that finds whether one is near.
struct Vicinity(Cells);

impl Vicinity {
    fn of(points: &[Point2]) -> Vicinity {
        Vicinity(by_cell(points, VICINITY_M))
    }

    fn has(&self, at: &Point2) -> bool {
        cells_around(cell_of(at, VICINITY_M))
            .filter_map(|key| self.0.get(&key))
            .flatten()
            .any(|p| (p - at).norm_squared() < VICINITY_M * VICINITY_M)
    }
}

/// Returns one point for each cell of the plan with surface at these heights.
fn plan(cloud: &PointCloud, heights_m: Range<f64>) -> Vec<Point2> {
    let mut seen = FxHashSet::default();
    let at_height = cloud.points.iter().filter(|p| heights_m.contains(&f64::from(p.position_m[2])));
    at_height.map(|p| p.position().xy()).filter(|at| seen.insert(cell_of(at, CELL_M))).collect()
}

/// Returns the largest connected cluster of points; a gap of more than 20 cm separates clusters.
fn largest_cluster(points: &[Point2]) -> Vec<Point2> {
    const GAP_M: f64 = 0.2;
    let mut cells = by_cell(points, GAP_M);
    let mut largest = Vec::new();
    for point in points {
        let Some(first) = cells.remove(&cell_of(point, GAP_M)) else { continue };
        let (mut open, mut cluster) = (vec![cell_of(point, GAP_M)], first);
        while let Some(at) = open.pop() {
            for near in cells_around(at) {
                if let Some(more) = cells.remove(&near) {
                    open.push(near);
                    cluster.extend(more);
                }
            }
        }
        if cluster.len() > largest.len() {
            largest = cluster;
        }
    }
    largest
}

/// Returns the concave hull of everything seen (Park and Oh, 2012), as points at most one step of the
/// frontier apart.
fn outline(cloud: &PointCloud) -> Vec<Point2> {
    let points: MultiPoint<f64> =
        plan(cloud, f64::NEG_INFINITY..2.2).iter().map(|p| geo::Point::new(p.x, p.y)).collect();
    if points.0.len() < 3 {
        return Vec::new();
    }
    let hull = points.concave_hull();
    let mut outline = Vec::new();
    for line in hull.exterior().lines() {
        let (a, b) = (Point2::new(line.start.x, line.start.y), Point2::new(line.end.x, line.end.y));
        let steps = ((b - a).norm() / FRONTIER_STEP_M).ceil().max(1.0);
        outline.extend((0..steps as usize).map(|step| a + (b - a) * (step as f64 / steps)));
    }
    outline
}

/// Returns the points without hits along the outline, from the point nearest to the boundary, in the
/// direction with fewer hits.
fn frontier(outline: &[Point2], boundary: &Point2, hits: &Vicinity) -> Vec<Point2> {
    let gap = |i: &usize| (outline[*i] - boundary).norm_squared();
    let Some(begin) = (0..outline.len()).min_by(|a, b| gap(a).total_cmp(&gap(b))) else { return Vec::new() };
    let walk = |forward: bool| -> Vec<Point2> {
        let mut points = vec![outline[begin]];
        let mut length_m = 0.0;
        for step in 1..outline.len() {
            let at = if forward { begin + step } else { begin + outline.len() - step } % outline.len();
            length_m += (outline[at] - points[points.len() - 1]).norm();
            if length_m > FRONTIER_M {
                break;
            }
            points.push(outline[at]);
        }
        points
    };
    let seen = |points: &[Point2]| points.iter().filter(|p| hits.has(p)).count();
    let [forward, backward] = [walk(true), walk(false)];
    let chosen = if seen(&forward) <= seen(&backward) { forward } else { backward };
    chosen.into_iter().filter(|p| !hits.has(p)).collect()
}

fn frontier_views(
    observation: &Observation,
    own: &[View],
    sets: &PointSets,
    camera: &Pinhole,
    params: &ViewParams,
) -> Vec<View> {
    let Some(boundary) = sets.boundary_m else { return Vec::new() };
    let at_height = |p: &Point2| Point3::new(p.x, p.y, params.vacuum_height_m);
    let frontier: Vec<Point3> = sets.frontier_m.iter().map(at_height).collect();
    let Some(first) = first_camera(observation, own, &at_height(&boundary), camera) else {
        return Vec::new();
    };
    let seen = |view: &View| frontier.iter().filter(|p| view.sees(p, camera)).count();
    let room = Room::of(&observation.cloud_in_clip);
    let mut views = vec![first];
    let mut last = first;
    for _ in 0..MAX_STEPS_BACK {
        let next = last.back(STEP_BACK_M);
        if 2 * seen(&last) >= frontier.len() || !room.is_free(&next.eye()) {
            break;
        }
        views.push(next);
        last = next;
    }
    for _ in 0..MAX_TURNS {
        if seen(&last) == frontier.len() {
            break;
        }
        let turn = TURN_RAD * side_of_unseen(&last, &frontier, camera);
        last = last.turned(turn);
        views.push(last);
    }
    // Keeps the last `max_views`, which reach furthest; the first views mostly show known surface.
    views.split_off(views.len().saturating_sub(params.max_views))
}

/// Returns the camera that looks down most steeply of those that see the boundary. The fallback is the one
/// that looks most towards it, turned and tilted just enough to bring it into the picture.
fn first_camera(
    observation: &Observation,
    own: &[View],
    boundary: &Point3,
    camera: &Pinhole,
) -> Option<View> {
    /// A surface further than this before the boundary hides it.
    const HIDDEN_M: f64 = 0.3;
    let clip_from_world = observation.clip_from_world?;
    let unhidden = |(key, view): &(&viola_reconstruct::KeyFrame, &View)| {
        if !view.sees(boundary, camera) {
            return false;
        }
        let in_camera = (clip_from_world * key.world_from_camera).inverse() * boundary;
        let depth_m = key.readings.camera().project(&in_camera).and_then(|p| key.readings.depth_at(p.x, p.y));
        depth_m.is_none_or(|depth_m| depth_m > in_camera.z - HIDDEN_M)
    };
    let steepest = observation.keys.iter().zip(own).filter(unhidden).map(|(_, view)| view);
    if let Some(view) = steepest.max_by(|a, b| a.pitch_rad.total_cmp(&b.pitch_rad)) {
        return Some(*view);
    }
    let towards = |view: &View| (boundary - view.eye()).normalize().dot(&view.forward());
    own.iter().max_by(|a, b| towards(a).total_cmp(&towards(b))).map(|view| view.towards(boundary, camera))
}

/// Returns 1 if the frontier that a view does not see lies to its left, -1 if it lies to its right.
fn side_of_unseen(view: &View, frontier: &[Point3], camera: &Pinhole) -> f64 {
    let unseen = frontier.iter().filter(|p| !view.sees(p, camera));
    let sum: Vector2 = unseen.map(|p| (p - view.eye()).xy()).sum();
    let left = Vector2::new(-view.yaw_rad.sin(), view.yaw_rad.cos());
    if sum.dot(&left) >= 0.0 { 1.0 } else { -1.0 }
}

/// Free positions of a camera: not in a surface, not behind a wall, not above the ceiling.
struct Room(FxHashSet<[i32; 3]>);

const ROOM_CELL_M: f64 = 0.12;

impl Room {
    fn of(cloud: &PointCloud) -> Room {
        Room(cloud.points.iter().map(|p| Room::cell(&p.position())).collect())
    }

    fn cell(p: &Point3) -> [i32; 3] {
        [p.x, p.y, p.z].map(|c| (c / ROOM_CELL_M).floor() as i32)
    }

    fn is_free(&self, at: &Point3) -> bool {
        (0.1..2.3).contains(&at.z) && voxels_around(Room::cell(at)).all(|near| !self.0.contains(&near))
    }
}

#[cfg(test)]
mod tests;
