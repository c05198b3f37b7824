//! Windows and closed doors, by the labelled points in the walls, and the leaves of open doors.

mod along;
mod front;
mod leaf;
mod near;
mod opening;

use super::axes::span;
use super::model::{Opening, OpeningKind, Plan, PlanRoom, Wall};
use crate::map_point::MapPoint;
use along::{place, within};
use front::fronts;
use leaf::Leaf;
use near::Near;
use opening::{door, is_between_rooms, window};
use std::cmp::Ordering;
use viola_geometry::taxonomy::Class;
use viola_geometry::{Point2, Pose2, Vector2};

/// Step along a wall.
const STEP_M: f64 = 0.05;
/// Points this far outside a wall's faces belong to it: frames, sills, blinds; doors are flush.
const WINDOW_OFF_M: f64 = 0.15;
const DOOR_OFF_M: f64 = 0.08;
/// Curtains hang this far before the wall.
const CURTAIN_OFF_M: f64 = 0.25;
/// Windows and doors of outer walls lie deeper than the usual thickness.
const RECESS_M: f64 = 0.2;
/// No point tells of a wall from farther outside its faces.
const MOST_OFF_M: f64 = CURTAIN_OFF_M + RECESS_M;
/// Heights in which points count, in bins of `BIN_M`. The frames of French windows begin at the floor.
const HEIGHTS_M: [f64; 2] = [0.05, 2.6];
const BIN_M: f64 = 0.15;
/// Minimum bins of a step with a window, whose panes nobody sees: two bars of its frame; and with a door.
const WINDOW_BINS: u32 = 2;
const DOOR_BINS: u32 = 5;
/// The bins of a door: not beside the floor nor above it.
const DOOR: u32 = 0xfffe;
/// Minimum bins from 1.1 m on of a step with a curtain, which hides its window.
const CURTAIN_BINS: u32 = 4;
const PANE: u32 = !0 << 7;
/// Minimum bins of a step with wall at the height of panes, and minimum number of such steps between two windows. A curtain
/// may hang before the wall.
const PIER_BINS: u32 = 5;
const PIER_STEPS: usize = 2;
/// Minimum fraction of the steps of a window with a part of its frame, for the frame to tell where the window ends, and not
/// its curtains.
const FRAMED: f64 = 0.5;
/// From this width on, curtains between two parts of a frame divide it.
const WIDE_M: f64 = 2.6;
/// Minimum width of a window of which one bar of the frame is seen, in metres.
const ONE_BAR_M: f64 = 0.55;
/// Gaps in the labels of one opening.
const GAP_M: f64 = 0.4;
/// Fraction of its steps that show it.
const SEEN_FRACTION: f64 = 0.5;
const WINDOW_M: [f64; 2] = [0.35, 6.0];
const CLOSED_DOOR_M: [f64; 2] = [0.55, 1.3];
/// A thin wall within a room, with a free end and at most this long, may be an open leaf.
const LEAF_M: f64 = 1.05;
/// Its room continues this far beyond the free end.
const BEYOND_END_M: f64 = 0.1;
/// Shortest front with a window: shorter ones are sides of recesses and of pillars, which see the frame beside them from its
/// end.
const FRONT_M: f64 = 0.55;
/// Minimum cosine of the angle between a point's normal and its wall's.
const FACES_WALL: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// A labelled point of the plan.
struct Labelled {
    at: Point2,
    z: f64,
    class: Class,
    /// Level part of its normal, with length 1; none for level surfaces.
    normal: Option<Vector2>,
}

/// Heights of the labels in a step of a wall, as bits.
#[derive(Default, Clone, Copy)]
struct Step {
    window: u32,
    door: u32,
    curtain: u32,
    wall: u32,
}

impl Step {
    fn shows_door(&self) -> bool {
        (self.door & DOOR).count_ones() >= DOOR_BINS
    }

    fn shows_window(&self) -> bool {
        self.window.count_ones() >= WINDOW_BINS || self.shows_curtain()
    }

    fn shows_curtain(&self) -> bool {
        (self.curtain & PANE).count_ones() >= CURTAIN_BINS
    }

    fn shows_frame(&self) -> bool {
        self.window != 0
    }

    fn shows_pier(&self) -> bool {
        (self.wall & PANE).count_ones() >= PIER_BINS && self.window.count_ones() < WINDOW_BINS
    }

    fn shows_no_frame(&self) -> bool {
        ((self.wall | self.curtain) & PANE).count_ones() >= PIER_BINS && self.window == 0
    }
}

/// Adds windows and closed doors to a plan's openings, and leaves to its doors.
pub(super) fn add(plan: &mut Plan, points: &[MapPoint]) {
    let (piers, mut labelled): (Vec<Labelled>, Vec<Labelled>) =
        labelled(points, plan.map_from_plan.inverse()).partition(|point| point.class == Class::Wall);
    if labelled.is_empty() {
        return;
    }
    // An open leaf is no closed door of the wall beside it.
    let leaves = add_leaves(plan, &labelled);
    labelled.retain(|point| point.class != Class::Door || !leaves.iter().any(|leaf| leaf.has(&point.at)));
    let [near, near_piers] = [&labelled, &piers].map(|points| Near::new(points, |point: &Labelled| point.at));
    let mut found: Vec<Opening> = Vec::new();
    for wall in plan.walls.iter().filter(|wall| !is_leaf(wall, &plan.rooms)) {
        let steps = steps(wall, room_side(wall, &plan.rooms), near.wall(wall, MOST_OFF_M));
        let doors = runs(&steps, Step::shows_door, Step::shows_pier, CLOSED_DOOR_M);
        let doors = doors.into_iter().filter(|run| !is_before_window(&steps[run[0]..=run[1]]));
        found.extend(doors.map(|run| door(wall, run, &labelled)));
    }
    // A window of a wall between rooms is a mirror or a picture, as a rule.
    for front in fronts(&plan.walls).iter().filter(|front| front.line.length_m() >= FRONT_M) {
        let line = &front.line;
        let steps = steps(line, None, near.wall(line, MOST_OFF_M).chain(near_piers.wall(line, MOST_OFF_M)));
        let on_line = windows(&steps).into_iter().filter_map(|run| {
            let is_curtained = is_most(&steps[run[0]..=run[1]], Step::shows_curtain);
            window(&front.line, run, is_curtained, &labelled)
        });
        let on_wall = on_line.filter_map(|opening| front.on_wall(opening));
        found.extend(on_wall.filter(|opening| !is_between_rooms(opening, &plan.rooms)));
    }
    for mut opening in found {
        if !plan.openings.iter().any(|other| meet(other, &opening)) {
            let word = if opening.kind == OpeningKind::Window { "window" } else { "door" };
            let number = 1 + plan.openings.iter().filter(|other| other.id.starts_with(word)).count();
            opening.id = format!("{word}-{number}");
            plan.openings.push(opening);
        }
    }
    add_leaves(plan, &labelled);
}

/// Returns the points that tell of openings, and those of walls.
fn labelled(points: &[MapPoint], plan_from_map: Pose2) -> impl Iterator<Item = Labelled> {
    points
        .iter()
        .map(|point| (&point.point, point.point.label.class))
        .filter(|(_, class)| matches!(class, Class::Window | Class::Door | Class::Curtain | Class::Wall))
        .map(move |(point, class)| {
            let [x, y, z] = point.position_m.map(f64::from);
            let normal = point.normal.map(f64::from);
            let level = plan_from_map.rotate(&Vector2::new(normal[0], normal[1]));
            let at = plan_from_map.apply(&Point2::new(x, y));
            Labelled { at, z, class, normal: level.try_normalize(0.5) }
        })
        .filter(|point| (HEIGHTS_M[0]..HEIGHTS_M[1]).contains(&point.z))
}

/// Adds the leaves of doors that have none yet, and returns the new ones.
fn add_leaves(plan: &mut Plan, labelled: &[Labelled]) -> Vec<Leaf> {
    let doors = labelled.iter().filter(|point| point.class == Class::Door);
    let points: Vec<(Point2, f64)> = doors.map(|point| (point.at, point.z)).collect();
    let mut leaves = Vec::new();
    for door in plan.openings.iter_mut().filter(|opening| opening.kind == OpeningKind::Door) {
        if door.swing.is_none()
            && let Some(leaf) = Leaf::of_door(door, &points)
        {
            door.swing = Some(leaf.swing);
            leaves.push(leaf);
        }
    }
    leaves
}

/// Returns whether a point is in one of the rooms beside a wall.
fn is_in_its_rooms(wall: &Wall, rooms: &[PlanRoom], p: [f64; 2]) -> bool {
    wall.rooms.iter().filter_map(|room| rooms.get(*room)).any(|room| room.contains(p))
}

/// Returns whether a wall is an open leaf: it stands within a room and has a free end.
fn is_leaf(wall: &Wall, rooms: &[PlanRoom]) -> bool {
    let length_m = wall.length_m();
    let has_free_end = || {
        let ends = [-BEYOND_END_M, length_m + BEYOND_END_M];
        ends.iter()
            .any(|along_m| is_in_its_rooms(wall, rooms, place(wall.from_m, wall.to_m, [*along_m, 0.0])))
    };
    wall.is_measured && wall.rooms.len() == 1 && length_m <= LEAF_M && has_free_end()
}

/// Returns the sign of the coordinate across a wall on the side of its room, if the room is on one side only.
fn room_side(wall: &Wall, rooms: &[PlanRoom]) -> Option<f64> {
    /// Samples along the wall, which may pass several rooms.
    const SAMPLES: usize = 8;
    let count = |sign: f64| {
        let across_m = sign * (wall.thickness_m / 2.0 + DOOR_OFF_M);
        let along_m = |sample: usize| (sample as f64 + 0.5) / SAMPLES as f64 * wall.length_m();
        let is_in_room = |sample: &usize| {
            is_in_its_rooms(wall, rooms, place(wall.from_m, wall.to_m, [along_m(*sample), across_m]))
        };
        (0..SAMPLES).filter(is_in_room).count()
    };
    match count(1.0).cmp(&count(-1.0)) {
        Ordering::Greater => Some(1.0),
        Ordering::Less => Some(-1.0),
        Ordering::Equal => None,
    }
}

/// Returns what the points show in each step of a wall. Doors lie deeper in an outer wall, but not before its face:
/// `room_side` is the sign across the wall on which its room is.
fn steps<'a>(wall: &Wall, room_side: Option<f64>, labelled: impl Iterator<Item = &'a Labelled>) -> Vec<Step> {
    let count = ((wall.length_m() / STEP_M).ceil() as usize).max(1);
    let mut steps = vec![Step::default(); count];
    let half_m = wall.thickness_m / 2.0;
    let recess_m = if wall.is_measured { 0.0 } else { RECESS_M };
    let [from, to] = [wall.from_m, wall.to_m].map(Point2::from);
    let across_wall = Vector2::new(from.y - to.y, to.x - from.x) / wall.length_m().max(1e-9);
    for point in labelled {
        let [along, across] = within(wall.from_m, wall.to_m, &point.at);
        let faces_wall = point.normal.is_none_or(|normal| normal.dot(&across_wall).abs() >= FACES_WALL);
        if along < 0.0 || along >= wall.length_m() || !faces_wall {
            continue;
        }
        let is_in_room = room_side.is_some_and(|sign| sign * across > 0.0);
        let door_m = half_m + DOOR_OFF_M + if is_in_room { 0.0 } else { recess_m };
        let bit = 1u32 << ((point.z - HEIGHTS_M[0]) / BIN_M) as u32;
        let step = &mut steps[((along / STEP_M) as usize).min(count - 1)];
        match point.class {
            Class::Window if across.abs() < half_m + WINDOW_OFF_M + recess_m => step.window |= bit,
            Class::Curtain if across.abs() < half_m + CURTAIN_OFF_M + recess_m => step.curtain |= bit,
            Class::Door if across.abs() < door_m => step.door |= bit,
            Class::Wall if across.abs() < half_m + DOOR_OFF_M + recess_m => step.wall |= bit,
            _ => {}
        }
    }
    steps
}

/// Returns whether a door is the open leaf of another one, which stands before a window.
fn is_before_window(door: &[Step]) -> bool {
    is_most(door, |step| step.window.count_ones() >= WINDOW_BINS)
}

/// Returns whether at least half of some steps show something.
fn is_most(steps: &[Step], shows: impl Fn(&Step) -> bool) -> bool {
    steps.iter().filter(|step| shows(step)).count() as f64 >= FRAMED * steps.len() as f64
}

/// Returns the windows of a wall: first and last step.
fn windows(steps: &[Step]) -> Vec<[usize; 2]> {
    let meet = |a: &[usize; 2], b: &[usize; 2]| a[0] <= b[1] && b[0] <= a[1];
    let width_m = |run: &[usize; 2]| (run[1] - run[0] + 1) as f64 * STEP_M;
    let frames = runs(steps, Step::shows_frame, Step::shows_pier, WINDOW_M);
    let mut found: Vec<[usize; 2]> = Vec::new();
    for run in runs(steps, Step::shows_window, Step::shows_pier, WINDOW_M) {
        let by_frame: Vec<[usize; 2]> = frames.iter().copied().filter(|frame| meet(frame, &run)).collect();
        if by_frame.is_empty() || !is_most(&steps[run[0]..=run[1]], Step::shows_frame) {
            found.push(run);
        } else {
            found.extend(by_frame);
        }
    }
    found.dedup();
    let apart = frames.into_iter().filter(|frame| width_m(frame) >= ONE_BAR_M);
    let more: Vec<[usize; 2]> = apart.filter(|frame| !found.iter().any(|run| meet(frame, run))).collect();
    found.extend(more);
    let parts = |run: [usize; 2]| {
        let parts = runs(&steps[run[0]..=run[1]], Step::shows_frame, Step::shows_no_frame, WINDOW_M);
        if width_m(&run) < WIDE_M || parts.len() < 2 {
            vec![run]
        } else {
            parts.into_iter().map(|part| part.map(|step| run[0] + step)).collect()
        }
    };
    found.into_iter().flat_map(parts).collect()
}

/// Returns the runs of steps that show an opening of a plausible width: first and last step. Some steps that show a `pier`
/// divide them.
fn runs(
    steps: &[Step],
    shows: impl Fn(&Step) -> bool,
    pier: impl Fn(&Step) -> bool,
    width_m: [f64; 2],
) -> Vec<[usize; 2]> {
    let gap = (GAP_M / STEP_M) as usize;
    let is_pier = |between: &[Step]| between.windows(PIER_STEPS).any(|steps| steps.iter().all(&pier));
    let mut runs: Vec<([usize; 2], usize)> = Vec::new();
    for at in (0..steps.len()).filter(|at| shows(&steps[*at])) {
        match runs.last_mut() {
            Some((run, count)) if at - run[1] <= gap && !is_pier(&steps[run[1] + 1..at]) => {
                (run[1], *count) = (at, *count + 1)
            }
            _ => runs.push(([at, at], 1)),
        }
    }
    let is_opening = |(run, count): &([usize; 2], usize)| {
        let length = run[1] - run[0] + 1;
        let is_seen = *count as f64 >= SEEN_FRACTION * length as f64;
        is_seen && (width_m[0]..width_m[1]).contains(&(length as f64 * STEP_M))
    };
    runs.into_iter().filter(is_opening).map(|(run, _)| run).collect()
}

/// Returns whether two openings meet.
fn meet(a: &Opening, b: &Opening) -> bool {
    let [a, b] = [a, b].map(|opening| span(opening.corners_m()));
    (0..2).all(|axis| a[axis][0] < b[axis][1] - 0.02 && b[axis][0] < a[axis][1] - 0.02)
}

#[cfg(test)]
mod tests;
