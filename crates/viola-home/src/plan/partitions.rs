//! Borders between two rooms of the robot's software where no wall stands: straight lines across the opening, at the place where
//! the robot divides it.

use super::cells::Cells;
use super::evidence::Evidence;
use super::gaps::DOOR_M;
use super::model::{Opening, OpeningKind};
use super::passages::{Meeting, THICKNESS_M, borders, shortest_chord};
use viola_geometry::{Point2, Vector2};

/// Fewer places are no border.
const MIN_MEETINGS: usize = 5;
/// Sine of the largest angle to an axis of the plan at which a border is parallel to it: the robot's cells are stairs.
const ALONG_AXIS: f64 = 0.17;
/// Most places of a straight border are this near its line.
const STRAIGHT_M: f64 = 0.2;
const STRAIGHT_FRACTION: f64 = 0.8;
/// The line is moved by at most this, to where walls end: the step, the number of steps in each direction, and how much
/// narrower the opening must be there.
const STEP_M: f64 = 0.05;
const OFF_STEPS: i32 = 8;
const NARROWER_M: f64 = 0.15;
/// Lines of the same width.
const SAME_WIDTH_M: f64 = 0.03;
/// A doorway is this much narrower than the line through the border that leads past it.
const DOORWAY_FRACTION: f64 = 0.8;
/// Step and reach of the way from the middle of a line to its ends.
const RAY_STEP_M: f64 = 0.02;
const RAY_STEPS: u32 = 250;
/// Distances from the line at which the robot's rooms lie on both sides.
const BESIDE_M: [f64; 3] = [0.1, 0.2, 0.35];
/// Cells this near the line belong to the room on their side.
const OWN_M: f64 = 0.5;
/// Distance between the lines of cells at an oblique border.
const STAIR_M: f64 = 0.1;
/// Space is this far beyond the end of a doorway, beside a wall that ends there: less than a wall is thick, and at these
/// distances from the line.
const STUB_M: f64 = 0.04;
const JAMB_M: [f64; 3] = [0.15, 0.3, 0.45];

/// A line between two rooms of the robot.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Partition {
    ends_m: [[f64; 2]; 2],
    /// Numbers from 1 of the given rooms on its left and on its right.
    given: [u32; 2],
    is_doorway: bool,
}

/// A straight border between two rooms of the plan.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct RoomBorder {
    pub ends_m: [[f64; 2]; 2],
    /// Places of the rooms on its left and on its right.
    pub rooms: [usize; 2],
    is_doorway: bool,
}

/// Returns the straight borders between rooms that are in one piece. `pieces` has the piece of each cell; 0 for none.
pub(super) fn partitions(cells: &Cells, pieces: &[u32], evidence: &Evidence) -> Vec<Partition> {
    let borders = borders(cells, pieces, evidence);
    borders.iter().filter_map(|border| partition(cells, border, evidence)).collect()
}

fn partition(cells: &Cells, border: &[Meeting], evidence: &Evidence) -> Option<Partition> {
    let line = Line::along(border, evidence)?;
    let chord = line.chord(cells, evidence)?;
    let doorway = shortest_chord(cells, border, evidence).map(|passage| passage.ends_m.map(Point2::from));
    let is_doorway = |ends: &[Point2; 2]| {
        length_m(ends) <= DOOR_M[1] && length_m(ends) < DOORWAY_FRACTION * length_m(&chord)
    };
    let [mut from, mut to] = doorway.filter(is_doorway).unwrap_or(chord);
    if (to - from).dot(&line.along) < 0.0 {
        (from, to) = (to, from);
    }
    let is_narrow = length_m(&[from, to]) <= DOOR_M[1];
    Some(Partition {
        ends_m: [from, to].map(|end| [end.x, end.y]),
        given: line.given,
        is_doorway: is_narrow && (has_jamb(cells, &from, &to) || has_jamb(cells, &to, &from)),
    })
}

fn length_m([from, to]: &[Point2; 2]) -> f64 {
    (to - from).norm()
}

/// Returns the left normal of a way, with length 1.
fn left(along: &Vector2) -> Vector2 {
    Vector2::new(-along.y, along.x).try_normalize(1e-9).unwrap_or_default()
}

/// Returns whether a wall ends at one end of a line, as at a doorway: space goes on beside it.
fn has_jamb(cells: &Cells, end: &Point2, other: &Point2) -> bool {
    let Some(beyond) = (end - other).try_normalize(1e-9) else { return false };
    let across = left(&beyond);
    JAMB_M.iter().flat_map(|off_m| [*off_m, -off_m]).any(|off_m| {
        let at = end + beyond * STUB_M + across * off_m;
        cells.is_inside([at.x, at.y])
    })
}

/// The line through a border.
struct Line {
    middle: Point2,
    along: Vector2,
    /// The robot's rooms on its left and on its right.
    given: [u32; 2],
    /// The border's first and last place along the line, from its middle.
    span_m: [f64; 2],
}

/// A line across the opening, at a distance from the border's own line.
struct Chord {
    step: i32,
    ends: [Point2; 2],
    /// Both ends are at walls.
    is_closed: bool,
}

impl Line {
    /// Returns the line through a border. None if that is not straight.
    fn along(border: &[Meeting], evidence: &Evidence) -> Option<Line> {
        if border.len() < MIN_MEETINGS {
            return None;
        }
        // Places beside each other along an axis show the part of the border that is across it.
        let sum = border.iter().fold(Vector2::zeros(), |sum, [one, other]| {
            sum + (other - one).try_normalize(1e-9).unwrap_or_default()
        });
        let mut across = sum.try_normalize(1e-9)?;
        for axis in 0..2 {
            if across[axis].abs() <= ALONG_AXIS {
                across[axis] = 0.0;
                across[1 - axis] = across[1 - axis].signum();
            }
        }
        // The other room is on the left.
        let along = Vector2::new(across.y, -across.x);
        let places: Vec<Vector2> =
            border.iter().map(|[one, other]| nalgebra::center(one, other).coords).collect();
        let sorted = |axis: &Vector2| {
            let mut metres: Vec<f64> = places.iter().map(|place| place.dot(axis)).collect();
            metres.sort_by(f64::total_cmp);
            metres
        };
        let (alongs_m, offs_m) = (sorted(&along), sorted(&across));
        let quantile =
            |metres: &[f64], part: f64| metres[(part * (metres.len() - 1) as f64).round() as usize];
        let [from_m, to_m] = [0.05, 0.95].map(|part| quantile(&alongs_m, part));
        let (along_m, off_m) = ((from_m + to_m) / 2.0, quantile(&offs_m, 0.5));
        let near = offs_m.iter().filter(|metres| (*metres - off_m).abs() <= STRAIGHT_M);
        (near.count() as f64 >= STRAIGHT_FRACTION * offs_m.len() as f64).then(|| Line {
            middle: Point2::from(along * along_m + across * off_m),
            along,
            given: [1, 0].map(|side: usize| evidence.room(&border[0][side])),
            span_m: [from_m - along_m, to_m - along_m],
        })
    }

    /// Returns the ends of the line. It moves to walls that end near it, if the opening is narrower there.
    fn chord(&self, cells: &Cells, evidence: &Evidence) -> Option<[Point2; 2]> {
        let all: Vec<Chord> =
            (-OFF_STEPS..=OFF_STEPS).filter_map(|step| self.chord_at(step, cells, evidence)).collect();
        let own = all.iter().min_by_key(|chord| chord.step.abs())?;
        let closed = || all.iter().filter(|chord| chord.is_closed);
        let least_m = closed().map(|chord| length_m(&chord.ends)).fold(f64::INFINITY, f64::min);
        if least_m > length_m(&own.ends) - NARROWER_M {
            return Some(own.ends);
        }
        let narrow: Vec<&Chord> =
            closed().filter(|chord| length_m(&chord.ends) <= least_m + SAME_WIDTH_M).collect();
        // The middle of the nearest wall's thickness.
        let runs = narrow.chunk_by(|a, b| b.step == a.step + 1);
        let nearest = runs.min_by_key(|run| run.iter().map(|chord| chord.step.abs()).min())?;
        Some(nearest[nearest.len() / 2].ends)
    }

    fn chord_at(&self, step: i32, cells: &Cells, evidence: &Evidence) -> Option<Chord> {
        let from = self.middle + left(&self.along) * (f64::from(step) * STEP_M);
        if !cells.is_inside([from.x, from.y]) {
            return None;
        }
        let ends = [-1.0, 1.0].map(|sign| self.end(&from, sign, cells, evidence));
        Some(Chord {
            step,
            ends: ends.map(|(end, _)| end),
            is_closed: ends.iter().all(|(_, at_wall)| *at_wall),
        })
    }

    /// Returns where a line from a place ends, and whether that is at a wall. It may also end where the border does.
    fn end(&self, from: &Point2, sign: f64, cells: &Cells, evidence: &Evidence) -> (Point2, bool) {
        let span_m = self.span_m[usize::from(sign > 0.0)].abs();
        let place = |metres: f64| from + self.along * (sign * metres);
        let is_inside = |metres: f64| {
            let at = place(metres);
            cells.is_inside([at.x, at.y])
        };
        let mut last_m = 0.0;
        for step in 1..=RAY_STEPS {
            let next_m = f64::from(step) * RAY_STEP_M;
            if !is_inside(next_m) {
                let mut outside_m = next_m;
                for _ in 0..6 {
                    let middle_m = (last_m + outside_m) / 2.0;
                    if is_inside(middle_m) { last_m = middle_m } else { outside_m = middle_m }
                }
                return (place(outside_m), true);
            }
            if next_m > span_m && !self.is_between(&place(next_m), evidence) {
                break;
            }
            last_m = next_m;
        }
        (place(last_m), false)
    }

    /// Returns whether no other rooms than those of the border are on its sides at a place.
    fn is_between(&self, place: &Point2, evidence: &Evidence) -> bool {
        let across = left(&self.along);
        BESIDE_M.iter().any(|off_m| {
            let sides = [place + across * *off_m, place - across * *off_m].map(|at| evidence.room(&at));
            sides.iter().zip(self.given).all(|(room, given)| *room == 0 || *room == given)
        })
    }
}

impl Partition {
    /// Makes lines of cells at it, and gives the cells beside it to the room on their side.
    pub fn divide(&mut self, cells: &mut Cells) {
        self.refine(cells);
        let [from, to] = self.ends_m.map(Point2::from);
        let across = left(&(to - from));
        let length_m = (to - from).norm();
        for at in 0..cells.inside.len() {
            let off = Point2::from(cells.centre(at)) - from;
            let (along_m, off_m) = (off.dot(&(to - from)) / length_m.max(1e-9), off.dot(&across));
            if cells.inside[at] && off_m.abs() <= OWN_M && (0.0..=length_m).contains(&along_m) {
                let room = self.given[usize::from(off_m < 0.0)];
                give(&mut cells.owners[at], self.given, room);
            }
        }
    }

    fn refine(&mut self, cells: &mut Cells) {
        for axis in 0..2 {
            let [a, b] = self.ends_m.map(|end| end[axis]);
            let count = ((a - b).abs() / STAIR_M).ceil() as usize;
            let is_oblique = self.ends_m[0][1 - axis] != self.ends_m[1][1 - axis];
            let inner = if is_oblique { count } else { count.min(1) };
            (0..=inner).for_each(|i| cells.refine(axis, a + (b - a) * i as f64 / inner.max(1) as f64));
            // A line of cells may be there already.
            if a == b
                && let Some(line) = cells.line(axis, a)
            {
                self.ends_m.iter_mut().for_each(|end| end[axis] = cells.lines[axis][line]);
            }
        }
    }

    /// Returns the border of the plan's rooms that it is. `of_cell` has the room of each cell, from 1; 0 for none. None if a gap is
    /// there, or one room.
    pub fn border(&self, cells: &Cells, of_cell: &[u32]) -> Option<RoomBorder> {
        const PARTS: [f64; 3] = [0.5, 0.25, 0.75];
        const AT_LINE_M: f64 = 0.005;
        const NEAR_M: [f64; 3] = [AT_LINE_M, 0.06, 0.12];
        let [from, to] = self.ends_m.map(Point2::from);
        let across = left(&(to - from));
        let room = |at: Point2| cells.at([at.x, at.y]).map_or(0, |at| of_cell[at] as usize);
        let sides = |part: f64, off_m: f64| {
            let at = from + (to - from) * part;
            [room(at + across * off_m), room(at - across * off_m)]
        };
        let is_open = |part: &f64| sides(*part, AT_LINE_M).iter().all(|room| *room != 0);
        let all = PARTS.into_iter().filter(is_open).flat_map(|part| NEAR_M.map(|off_m| sides(part, off_m)));
        let rooms = all.into_iter().find(|[left, right]| *left != 0 && *right != 0 && left != right)?;
        let rooms = rooms.map(|room| room - 1);
        Some(RoomBorder { ends_m: self.ends_m, rooms, is_doorway: self.is_doorway })
    }
}

/// Gives the area of both rooms in a cell to one of them.
fn give(owners: &mut Vec<(u32, f64)>, rooms: [u32; 2], room: u32) {
    /// Unknown floor at a border belongs to a room, too.
    const LEAST_M2: f64 = 1e-6;
    let both = owners.iter().filter(|(owner, _)| rooms.contains(owner));
    let area_m2 = both.map(|(_, area_m2)| area_m2).sum::<f64>().max(LEAST_M2);
    owners.retain(|(owner, _)| !rooms.contains(owner));
    owners.push((room, area_m2));
    owners.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
}

impl RoomBorder {
    #[cfg(test)]
    pub fn between(ends_m: [[f64; 2]; 2], rooms: [usize; 2]) -> RoomBorder {
        RoomBorder { ends_m, rooms, is_doorway: false }
    }

    /// Returns its opening, if people fit through it.
    pub fn opening(&self) -> Option<Opening> {
        let [from_m, to_m] = self.ends_m;
        let opening = Opening {
            id: String::new(),
            kind: if self.is_doorway { OpeningKind::Door } else { OpeningKind::Passage },
            from_m,
            to_m,
            thickness_m: THICKNESS_M,
            sill_m: None,
            head_m: None,
            swing: None,
        };
        (opening.width_m() >= DOOR_M[0]).then_some(opening)
    }
}
