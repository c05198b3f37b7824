//! A drawn floor plan of a simulated home against the true one: walls, openings, areas of rooms.

use crate::simulate::{Plan as Truth, RoomShape, TrueOpening};
use serde::Serialize;
use viola_geometry::{Point2, Pose2, Vector2};
use viola_home::{Opening, OpeningKind, Plan};

/// A face is right if it is this near a true one, and within this angle of it.
const NEAR_M: f64 = 0.1;
const ANGLE_RAD: f64 = 3.0 * std::f64::consts::PI / 180.0;
/// Distance of points on drawn faces.
const STEP_M: f64 = 0.05;
/// An opening is found if a drawn one of its kind overlaps it by this IoU along the wall, this near its line.
const OPENING_IOU: f64 = 0.5;
const OPENING_OFF_M: f64 = 0.25;
/// A room's area is right within this fraction.
const AREA: f64 = 0.05;
/// Raster on which rooms are tested for overlaps.
const RASTER_M: f64 = 0.1;

/// The true plan of a simulated home.
#[derive(Debug, Clone)]
pub struct TruePlan {
    map_from_home: Pose2,
    rooms: Vec<RoomShape>,
    openings: Vec<TrueOpening>,
    /// Openings of the same indices that somebody saw: the others need not be found.
    is_seen: Vec<bool>,
}

impl TruePlan {
    pub fn new(plan: &Truth, map_from_home: Pose2, is_seen: impl Fn(&TrueOpening) -> bool) -> TruePlan {
        let openings = plan.true_openings();
        let is_seen = openings.iter().map(is_seen).collect();
        TruePlan { map_from_home, rooms: plan.shapes(), openings, is_seen }
    }
}

/// Sums over homes.
#[derive(Debug, Clone, Default, Serialize)]
pub struct PlanScore {
    /// Points on true faces, and those with a drawn face.
    pub true_faces: usize,
    pub found_faces: usize,
    /// Points on drawn faces, and those on a true face.
    pub drawn_faces: usize,
    pub right_faces: usize,
    /// Sides of the true rooms.
    pub sides: usize,
    /// Errors of the lengths of the nearest drawn sides, in metres, of the true sides that have one.
    pub length_errors_m: Vec<f64>,
    pub doors: usize,
    pub found_doors: usize,
    pub windows: usize,
    pub found_windows: usize,
    pub drawn_openings: usize,
    pub right_openings: usize,
    pub rooms: usize,
    /// Relative errors of the areas of rooms.
    pub area_errors: Vec<f64>,
    /// Rooms without an area, and places in two rooms.
    pub broken_rooms: usize,
    pub overlaps: usize,
}

/// A side of a drawn room, in the home's frame.
struct Side {
    ends: [Point2; 2],
}

impl Side {
    fn direction(&self) -> Vector2 {
        (self.ends[1] - self.ends[0]).normalize()
    }

    fn length_m(&self) -> f64 {
        (self.ends[1] - self.ends[0]).norm()
    }

    fn distance_m(&self, p: &Point2) -> f64 {
        let along = (p - self.ends[0]).dot(&self.direction()).clamp(0.0, self.length_m());
        (p - (self.ends[0] + self.direction() * along)).norm()
    }

    fn is_along(&self, direction: &Vector2) -> bool {
        self.direction().perp(direction).abs() <= ANGLE_RAD.sin()
    }
}

/// Adds the score of a drawn plan.
pub fn score_plan(truth: &TruePlan, plan: &Plan, score: &mut PlanScore) {
    let home_from_plan = truth.map_from_home.inverse().compose(&plan.map_from_plan);
    let in_home = |p: &[f64; 2]| home_from_plan.apply(&Point2::new(p[0], p[1]));
    let sides: Vec<Side> = plan
        .rooms
        .iter()
        .flat_map(|room| std::iter::once(&room.outline.ring_m).chain(&room.outline.holes_m))
        .flat_map(|ring| ring.iter().zip(ring.iter().cycle().skip(1)))
        .map(|(a, b)| Side { ends: [in_home(a), in_home(b)] })
        .filter(|side| side.length_m() > 1e-6)
        .collect();
    score_faces(truth, &sides, score);
    score_openings(truth, plan, &home_from_plan, score);
    score_rooms(truth, plan, &home_from_plan, score);
}

fn score_faces(truth: &TruePlan, sides: &[Side], score: &mut PlanScore) {
    for face in truth.rooms.iter().flat_map(|room| &room.faces) {
        score.true_faces += 1;
        let is_found = |side: &Side| side.is_along(&face.along) && side.distance_m(&face.at) <= NEAR_M;
        score.found_faces += usize::from(sides.iter().any(is_found));
    }
    for side in sides {
        let count = (side.length_m() / STEP_M).round() as usize;
        for i in 0..count {
            let p = side.ends[0] + side.direction() * ((i as f64 + 0.5) * STEP_M).min(side.length_m());
            let mut all = truth.rooms.iter().flat_map(|room| &room.faces);
            score.drawn_faces += 1;
            score.right_faces += usize::from(
                all.any(|face| side.is_along(&face.along) && (face.at - p).norm() <= NEAR_M + STEP_M / 2.0),
            );
        }
    }
    for [a, b] in truth.rooms.iter().flat_map(|room| &room.sides) {
        let whole = Side { ends: [*a, *b] };
        let middle = a + (b - a) * 0.5;
        let near = sides.iter().filter(|side| {
            side.is_along(&whole.direction()) && side.distance_m(&middle) <= NEAR_M + 0.3 * whole.length_m()
        });
        let on_line = near.filter(|side| {
            let normal = Vector2::new(-whole.direction().y, whole.direction().x);
            (side.ends[0] - a).dot(&normal).abs() <= NEAR_M
        });
        let nearest = on_line.min_by(|a, b| a.distance_m(&middle).total_cmp(&b.distance_m(&middle)));
        score.sides += 1;
        score.length_errors_m.extend(nearest.map(|side| (side.length_m() - whole.length_m()).abs()));
    }
}

fn score_openings(truth: &TruePlan, plan: &Plan, home_from_plan: &Pose2, score: &mut PlanScore) {
    let matches = |truth: &TrueOpening, drawn: &Opening| {
        if truth.is_window != (drawn.kind == OpeningKind::Window) {
            return false;
        }
        let wall = Side { ends: truth.ends };
        let ends = [drawn.from_m, drawn.to_m].map(|p| home_from_plan.apply(&Point2::new(p[0], p[1])));
        let along = ends.map(|p| (p - wall.ends[0]).dot(&wall.direction()));
        let (low, high) = (along[0].min(along[1]), along[0].max(along[1]));
        let both = high.min(wall.length_m()) - low.max(0.0);
        let either = high.max(wall.length_m()) - low.min(0.0);
        let normal = Vector2::new(-wall.direction().y, wall.direction().x);
        let is_near = ends.iter().all(|p| (p - wall.ends[0]).dot(&normal).abs() <= OPENING_OFF_M);
        is_near && both / either >= OPENING_IOU
    };
    let seen = truth.openings.iter().zip(&truth.is_seen).filter(|(_, is_seen)| **is_seen);
    for (opening, _) in seen {
        let is_found = usize::from(plan.openings.iter().any(|drawn| matches(opening, drawn)));
        if opening.is_window {
            (score.windows, score.found_windows) = (score.windows + 1, score.found_windows + is_found);
        } else {
            (score.doors, score.found_doors) = (score.doors + 1, score.found_doors + is_found);
        }
    }
    for drawn in &plan.openings {
        score.drawn_openings += 1;
        score.right_openings += usize::from(truth.openings.iter().any(|opening| matches(opening, drawn)));
    }
}

fn score_rooms(truth: &TruePlan, plan: &Plan, home_from_plan: &Pose2, score: &mut PlanScore) {
    let plan_from_home = home_from_plan.inverse();
    let holds = |room: &viola_home::PlanRoom, p: &Point2| room.contains([p.x, p.y]);
    for shape in &truth.rooms {
        let centre = plan_from_home.apply(&shape.centre);
        score.rooms += 1;
        let drawn = plan.rooms.iter().find(|room| holds(room, &centre));
        score.area_errors.push(drawn.map_or(1.0, |room| (room.area_m2 / shape.area_m2 - 1.0).abs()));
    }
    score.broken_rooms +=
        plan.rooms.iter().filter(|room| room.outline.ring_m.len() < 4 || room.area_m2 <= 0.0).count();
    let (low, high) = plan.bounds_m();
    let count = |axis: usize| ((high[axis] - low[axis]) / RASTER_M) as usize;
    for (i, j) in (0..count(0)).flat_map(|i| (0..count(1)).map(move |j| (i, j))) {
        let p = Point2::new(low[0] + (i as f64 + 0.37) * RASTER_M, low[1] + (j as f64 + 0.41) * RASTER_M);
        score.overlaps += usize::from(plan.rooms.iter().filter(|room| holds(room, &p)).count() > 1);
    }
}

impl PlanScore {
    /// Returns the fraction of the true faces that are drawn, and of the drawn ones that are true.
    pub fn recall(&self) -> f64 {
        self.found_faces as f64 / self.true_faces.max(1) as f64
    }

    pub fn precision(&self) -> f64 {
        self.right_faces as f64 / self.drawn_faces.max(1) as f64
    }

    pub fn markdown(&self) -> String {
        let percent =
            |part: usize, of: usize| format!("{:.1} % of {of}", 100.0 * part as f64 / of.max(1) as f64);
        let median = |values: &[f64]| {
            let mut values = values.to_vec();
            values.sort_by(f64::total_cmp);
            values.get(values.len() / 2).copied().unwrap_or(0.0)
        };
        let right = self.area_errors.iter().filter(|error| **error <= AREA).count();
        format!(
            "| wall faces: recall | precision | length error, median | doors and passages | windows | drawn openings right | \
             rooms' areas within 5 % | median area error | overlaps and broken rooms |\n|---|---|---|---|---|---|---|---|---|\n\
             | {:.1} % | {:.1} % | {:.1} cm, {} of {} sides | {} | {} | {} | {} | {:.1} % | {} |\n",
            100.0 * self.recall(),
            100.0 * self.precision(),
            100.0 * median(&self.length_errors_m),
            self.length_errors_m.len(),
            self.sides,
            percent(self.found_doors, self.doors),
            percent(self.found_windows, self.windows),
            percent(self.right_openings, self.drawn_openings),
            percent(right, self.rooms),
            100.0 * median(&self.area_errors),
            self.overlaps + self.broken_rooms
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A true side of 4 m. A drawn one of 3 m covers its middle, and one of 4 m its end.
    #[test]
    fn the_length_is_that_of_the_nearest_side() {
        let room = RoomShape {
            centre: Point2::new(2.0, 1.0),
            area_m2: 8.0,
            sides: vec![
                [Point2::new(0.0, 0.0), Point2::new(4.0, 0.0)],
                [Point2::new(0.0, 2.0), Point2::new(4.0, 2.0)],
            ],
            faces: Vec::new(),
        };
        let truth = TruePlan {
            map_from_home: Pose2::IDENTITY,
            rooms: vec![room],
            openings: Vec::new(),
            is_seen: Vec::new(),
        };
        let side =
            |from_m: f64, to_m: f64| Side { ends: [Point2::new(from_m, 0.02), Point2::new(to_m, 0.02)] };
        let mut score = PlanScore::default();
        score_faces(&truth, &[side(3.2, 7.2), side(0.5, 3.5)], &mut score);
        assert_eq!(score.length_errors_m.len(), 1);
        assert!((score.length_errors_m[0] - 1.0).abs() < 1e-9, "{score:?}");
        assert!(score.markdown().contains("| 100.0 cm, 1 of 2 sides |"), "{}", score.markdown());
    }
}
