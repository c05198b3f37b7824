//! Windows and closed doors, by the labelled points in the walls, and the leaves of open doors.

mod front;

use super::model::{Opening, OpeningKind, Plan, Swing, Wall};
use crate::map_point::MapPoint;
use front::fronts;
use viola_geometry::Point2;
use viola_geometry::taxonomy::Class;

/// Step along a wall.
const STEP_M: f64 = 0.05;
/// Points this far outside a wall's faces belong to it: frames, sills, blinds; doors are flush.
const WINDOW_OFF_M: f64 = 0.15;
const DOOR_OFF_M: f64 = 0.08;
/// Curtains hang this far before the wall.
const CURTAIN_OFF_M: f64 = 0.25;
/// Windows of outer walls lie deeper than the usual thickness.
const RECESS_M: f64 = 0.2;
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
/// A leaf reaches this part of the doorway's width; it is seen in this part of its length.
const LEAF_FRACTION: f64 = 0.7;
const LEAF_STEPS: usize = 10;

/// A point of the plan, its height and its class.
type Labelled = (Point2, f64, Class);

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
        self.window.count_ones() >= WINDOW_BINS || (self.curtain & PANE).count_ones() >= CURTAIN_BINS
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
    let plan_from_map = plan.map_from_plan.inverse();
    let (piers, labelled): (Vec<Labelled>, Vec<Labelled>) = points
        .iter()
        .filter(|point| {
            matches!(point.point.label.class, Class::Window | Class::Door | Class::Curtain | Class::Wall)
        })
        .map(|point| {
            let [x, y, z] = point.point.position_m.map(f64::from);
            (plan_from_map.apply(&Point2::new(x, y)), z, point.point.label.class)
        })
        .filter(|(_, z, _)| (HEIGHTS_M[0]..HEIGHTS_M[1]).contains(z))
        .partition(|(_, _, class)| *class == Class::Wall);
    let mut found: Vec<Opening> = Vec::new();
    for wall in &plan.walls {
        let steps = steps(wall, labelled.iter());
        let doors = runs(&steps, Step::shows_door, Step::shows_pier, CLOSED_DOOR_M);
        let doors = doors.into_iter().filter(|run| !is_before_window(&steps[run[0]..=run[1]]));
        found.extend(doors.map(|run| opening(wall, run, OpeningKind::Door, &labelled)));
    }
    // A window of a wall between rooms is a mirror or a picture, as a rule.
    for front in fronts(&plan.walls) {
        let steps = steps(&front.line, labelled.iter().chain(&piers));
        let on_line =
            windows(&steps).into_iter().map(|run| opening(&front.line, run, OpeningKind::Window, &labelled));
        found.extend(on_line.filter_map(|opening| front.on_wall(opening)));
    }
    for mut opening in found {
        if !plan.openings.iter().any(|other| meet(other, &opening)) {
            let word = if opening.kind == OpeningKind::Window { "window" } else { "door" };
            let number = 1 + plan.openings.iter().filter(|other| other.id.starts_with(word)).count();
            opening.id = format!("{word}-{number}");
            plan.openings.push(opening);
        }
    }
    for opening in plan.openings.iter_mut().filter(|opening| opening.kind == OpeningKind::Door) {
        opening.swing = swing(opening, &labelled);
    }
}

/// Returns coordinates of a point in a wall's own frame: along it from its first end, and across it.
fn within(from_m: [f64; 2], to_m: [f64; 2], p: &Point2) -> [f64; 2] {
    let length_m = (to_m[0] - from_m[0]).hypot(to_m[1] - from_m[1]).max(1e-9);
    let along = [(to_m[0] - from_m[0]) / length_m, (to_m[1] - from_m[1]) / length_m];
    let off = [p.x - from_m[0], p.y - from_m[1]];
    [off[0] * along[0] + off[1] * along[1], off[1] * along[0] - off[0] * along[1]]
}

fn steps<'a>(wall: &Wall, labelled: impl Iterator<Item = &'a Labelled>) -> Vec<Step> {
    let count = ((wall.length_m() / STEP_M).ceil() as usize).max(1);
    let mut steps = vec![Step::default(); count];
    let half_m = wall.thickness_m / 2.0;
    let recess_m = if wall.is_measured { 0.0 } else { RECESS_M };
    for (p, z, class) in labelled {
        let [along, across] = within(wall.from_m, wall.to_m, p);
        if along < 0.0 || along >= wall.length_m() {
            continue;
        }
        let bit = 1u32 << ((z - HEIGHTS_M[0]) / BIN_M) as u32;
        let step = &mut steps[((along / STEP_M) as usize).min(count - 1)];
        match class {
            Class::Window if across.abs() < half_m + WINDOW_OFF_M + recess_m => step.window |= bit,
            Class::Curtain if across.abs() < half_m + CURTAIN_OFF_M + recess_m => step.curtain |= bit,
            Class::Door if across.abs() < half_m + DOOR_OFF_M + recess_m => step.door |= bit,
            Class::Wall if across.abs() < half_m + DOOR_OFF_M + recess_m => step.wall |= bit,
            _ => {}
        }
    }
    steps
}

/// Returns whether a door is the open leaf of another one, which stands before a window.
fn is_before_window(door: &[Step]) -> bool {
    let framed = door.iter().filter(|step| step.window.count_ones() >= WINDOW_BINS).count();
    framed as f64 >= FRAMED * door.len() as f64
}

/// Returns the windows of a wall: first and last step.
fn windows(steps: &[Step]) -> Vec<[usize; 2]> {
    let meet = |a: &[usize; 2], b: &[usize; 2]| a[0] <= b[1] && b[0] <= a[1];
    let width_m = |run: &[usize; 2]| (run[1] - run[0] + 1) as f64 * STEP_M;
    let frames = runs(steps, Step::shows_frame, Step::shows_pier, WINDOW_M);
    let mut found: Vec<[usize; 2]> = Vec::new();
    for run in runs(steps, Step::shows_window, Step::shows_pier, WINDOW_M) {
        let framed = steps[run[0]..=run[1]].iter().filter(|step| step.shows_frame()).count();
        let by_frame: Vec<[usize; 2]> = frames.iter().copied().filter(|frame| meet(frame, &run)).collect();
        if by_frame.is_empty() || (framed as f64) < FRAMED * (run[1] - run[0] + 1) as f64 {
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

fn opening(wall: &Wall, run: [usize; 2], kind: OpeningKind, labelled: &[Labelled]) -> Opening {
    let class = if kind == OpeningKind::Window { Class::Window } else { Class::Door };
    let span_m = [run[0] as f64 * STEP_M, ((run[1] + 1) as f64 * STEP_M).min(wall.length_m())];
    let mut heights: Vec<f64> = labelled
        .iter()
        .filter(|(p, _, of)| {
            let [along, across] = within(wall.from_m, wall.to_m, p);
            *of == class
                && (span_m[0]..span_m[1]).contains(&along)
                && across.abs() < wall.thickness_m + RECESS_M
        })
        .map(|(_, z, _)| *z)
        .collect();
    heights.sort_by(f64::total_cmp);
    let quantile = |part: f64| heights.get((part * heights.len() as f64) as usize).copied();
    let at = |along: f64| {
        [0, 1].map(|axis| wall.from_m[axis] + along / wall.length_m() * (wall.to_m[axis] - wall.from_m[axis]))
    };
    let is_window = kind == OpeningKind::Window;
    Opening {
        id: String::new(),
        kind,
        from_m: at(span_m[0]),
        to_m: at(span_m[1]),
        thickness_m: wall.thickness_m,
        sill_m: if is_window { quantile(0.03) } else { None },
        head_m: quantile(0.97),
        swing: None,
    }
}

/// Returns whether two openings meet.
fn meet(a: &Opening, b: &Opening) -> bool {
    let bounds = |opening: &Opening, axis: usize| {
        let along = opening.corners_m().map(|corner| corner[axis]);
        (along.into_iter().fold(f64::INFINITY, f64::min), along.into_iter().fold(f64::NEG_INFINITY, f64::max))
    };
    (0..2).all(|axis| {
        let ((a_low, a_high), (b_low, b_high)) = (bounds(a, axis), bounds(b, axis));
        a_low < b_high - 0.02 && b_low < a_high - 0.02
    })
}

/// Returns the open leaf of a door, if points of it stand beside the doorway.
fn swing(opening: &Opening, labelled: &[Labelled]) -> Option<Swing> {
    let width_m = opening.width_m();
    let mut best: Option<(usize, Swing)> = None;
    for (from, to) in [(opening.from_m, opening.to_m), (opening.to_m, opening.from_m)] {
        let along = [0, 1].map(|axis| (to[axis] - from[axis]) / width_m.max(1e-9));
        for side in [-1.0, 1.0] {
            let across = [-along[1] * side, along[0] * side];
            let shifted = |p: [f64; 2], by: f64| [p[0] + by * across[0], p[1] + by * across[1]];
            let half_m = opening.thickness_m / 2.0;
            let (hinge_m, closed_m) = (shifted(from, half_m), shifted(to, half_m));
            // Steps of the leaf's length that were seen, by its angle in steps of 10 degrees.
            let mut seen = [0u16; 18];
            for (p, z, class) in labelled {
                let off = [p.x - hinge_m[0], p.y - hinge_m[1]];
                let reach_m = off[0].hypot(off[1]);
                if *class != Class::Door || !(0.3..1.9).contains(z) || reach_m > width_m {
                    continue;
                }
                let [x, y] = [along, across].map(|axis| off[0] * axis[0] + off[1] * axis[1]);
                let angle_deg = y.atan2(x).to_degrees();
                if (30.0..150.0).contains(&angle_deg) {
                    let step = ((reach_m / width_m * LEAF_STEPS as f64) as usize).min(LEAF_STEPS - 1);
                    seen[(angle_deg / 10.0) as usize] |= 1 << step;
                }
            }
            let most = seen.windows(2).map(|two| (two[0] | two[1]).count_ones() as usize).max().unwrap_or(0);
            let open_m = shifted(hinge_m, width_m);
            if most as f64 >= LEAF_FRACTION * LEAF_STEPS as f64 && best.is_none_or(|(least, _)| most > least)
            {
                best = Some((most, Swing { hinge_m, open_m, closed_m }));
            }
        }
    }
    best.map(|(_, swing)| swing)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patches_of_labels_are_one_window() {
        let step = |window: bool| Step { window: if window { 0b1001 } else { 0 }, ..Step::default() };
        let steps: Vec<Step> =
            (0..60).map(|i| step((10..20).contains(&i) || (25..32).contains(&i))).collect();
        assert_eq!(windows(&steps), [[10, 31]]);
        let mut divided = steps.clone();
        divided[21..24].fill(Step { wall: PANE, ..Step::default() });
        assert_eq!(windows(&divided), [[10, 19], [25, 31]]);
        let speck: Vec<Step> = (0..60).map(|i| step(i == 7)).collect();
        assert!(windows(&speck).is_empty());
    }

    #[test]
    fn the_frame_tells_where_a_window_ends() {
        let frame = Step { window: 0b10, ..Step::default() };
        let curtain = Step { curtain: PANE, ..Step::default() };
        let both = Step { window: 0b10, curtain: PANE, ..Step::default() };
        let of = |parts: &[(usize, Step)]| {
            let steps: Vec<Step> = parts.iter().flat_map(|(count, step)| vec![*step; *count]).collect();
            windows(&steps)
        };
        let none = Step::default();
        // Curtains beyond both ends, and one that hides its window.
        assert_eq!(of(&[(5, none), (5, curtain), (20, both), (5, curtain)]), [[10, 29]]);
        assert_eq!(of(&[(5, none), (30, curtain), (5, none)]), [[5, 34]]);
        // One bar of the frame is seen; a shorter one is a wrong label.
        assert_eq!(of(&[(5, none), (12, frame), (5, none)]), [[5, 16]]);
        assert!(of(&[(5, none), (8, frame), (5, none)]).is_empty());
        // A curtain between two windows, and one before the middle of a window.
        assert_eq!(of(&[(30, frame), (6, curtain), (30, frame)]), [[0, 29], [36, 65]]);
        assert_eq!(of(&[(15, frame), (6, curtain), (15, frame)]), [[0, 35]]);
    }
}
