//! Narrow passages between computed rooms, for doorways whose walls were not seen well enough to end in a gap.
//!
//! The robot's free floor is narrow there (`rooms::partition`), and so is the plan's inside: the shortest chord from wall to
//! wall between the two rooms is closed.

use super::cells::Cells;
use super::evidence::Evidence;
use super::gaps::{DOOR_M, Gap};
use crate::rooms::outline::beside;
use crate::rooms::partition::DOOR_HALF_M;
use rustc_hash::FxHashMap;
use std::collections::BTreeMap;
use std::f64::consts::PI;
use viola_geometry::{Point2, Vector2, cell_of, cells_around};

/// Step of the raster in which rooms meet, and of the rays to the walls.
const STEP_M: f64 = 0.05;
const RAY_STEP_M: f64 = 0.02;
/// Rooms meet across a door's leaf that stands open in the doorway.
const ACROSS_STEPS: usize = 10;
/// A room has a part of a piece if it has this much of it.
pub(super) const MIN_PART_M2: f64 = 1.2;
/// Places of one border are this near each other.
const TOGETHER_M: f64 = 0.3;
/// Chords are tried at this many angles, this far from the middle of the border.
const ANGLES: usize = 24;
const OFF_STEPS: i32 = 8;
/// Width of a passage, and of the open floor in it: furniture may stand beside a door.
const WIDTH_M: [f64; 2] = [DOOR_M[0], 2.0];
const WIDEST_FLOOR_M: f64 = 2.0 * DOOR_HALF_M;
/// Thickness of a wall that was not seen.
const THICKNESS_M: f64 = 0.1;
/// Chords that lean less are straight across.
const LEAN_M: f64 = 0.08;
/// Distance of the lines beside a slanted chord.
const LINES_M: f64 = 0.1;

/// A chord of the inside between two rooms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Passage {
    pub ends_m: [[f64; 2]; 2],
}

/// A place where two rooms meet: a point of each.
type Meeting = [Point2; 2];

/// Returns the passages between computed rooms that are one piece. `pieces` has the piece of each cell; 0 for none.
pub(super) fn passages(cells: &Cells, pieces: &[u32], evidence: &Evidence) -> Vec<Passage> {
    let mut found = Vec::new();
    for border in borders(cells, pieces, evidence) {
        found.extend(shortest_chord(cells, &border, evidence));
    }
    found
}

/// Returns the places where two rooms of one piece meet, border by border.
fn borders(cells: &Cells, pieces: &[u32], evidence: &Evidence) -> Vec<Vec<Meeting>> {
    let count = |axis: usize| {
        ((evidence.high_m[axis] - evidence.low_m[axis]) / STEP_M).clamp(0.0, 2000.0) as usize + 1
    };
    let place = |i: usize, j: usize| {
        Point2::new(evidence.low_m[0] + i as f64 * STEP_M, evidence.low_m[1] + j as f64 * STEP_M)
    };
    let piece = |p: &Point2| cells.at([p.x, p.y]).map_or(0, |at| pieces[at]);
    let (width, height) = (count(0), count(1));
    let rooms: Vec<u32> = (0..width * height).map(|k| evidence.room(&place(k % width, k / width))).collect();
    let mut areas: BTreeMap<(u32, u32), usize> = BTreeMap::new();
    for (k, room) in rooms.iter().enumerate() {
        *areas.entry((piece(&place(k % width, k / width)), *room)).or_default() += 1;
    }
    let is_large = |piece: u32, room: u32| {
        let steps = areas.get(&(piece, room)).copied().unwrap_or(0);
        steps as f64 * STEP_M * STEP_M >= MIN_PART_M2
    };
    let mut meetings: BTreeMap<(u32, u32), Vec<Meeting>> = BTreeMap::new();
    for (k, room) in rooms.iter().enumerate().filter(|(_, room)| **room != 0) {
        let (i, j) = (k % width, k / width);
        for axis in 0..2 {
            let beyond = |step: usize| if axis == 0 { (i + step, j) } else { (i, j + step) };
            // The way to the other room leads through the inside.
            let next = (1..=ACROSS_STEPS)
                .map(beyond)
                .take_while(|(i, j)| *i < width && *j < height && piece(&place(*i, *j)) != 0)
                .map(|(i, j)| (rooms[j * width + i], place(i, j)))
                .find(|(other, _)| *other != 0);
            let here = place(i, j);
            if let Some((other, there)) = next.filter(|(other, _)| other != room)
                && piece(&here) == piece(&there)
                && [*room, other].iter().all(|room| is_large(piece(&here), *room))
            {
                let meeting = if room < &other { [here, there] } else { [there, here] };
                meetings.entry((*room.min(&other), *room.max(&other))).or_default().push(meeting);
            }
        }
    }
    meetings.into_values().flat_map(|places| apart(&places)).collect()
}

/// Divides places into groups that are far from each other. A place is compared with those in the squares around it: two rooms
/// may meet at very many.
fn apart(all: &[Meeting]) -> Vec<Vec<Meeting>> {
    // Larger than the distance, so that rounding loses none.
    let square = |meeting: &Meeting| cell_of(&meeting[0], 1.01 * TOGETHER_M);
    let mut left: FxHashMap<[i32; 2], Vec<usize>> = FxHashMap::default();
    for (at, meeting) in all.iter().enumerate() {
        left.entry(square(meeting)).or_default().push(at);
    }
    let mut is_taken = vec![false; all.len()];
    let mut groups = Vec::new();
    for first in (0..all.len()).rev() {
        if is_taken[first] {
            continue;
        }
        is_taken[first] = true;
        let mut group = vec![first];
        let mut next = 0;
        while let Some(from) = group.get(next).map(|at| &all[*at]) {
            let mut near = Vec::new();
            for there in cells_around(square(from)) {
                let Some(places) = left.get_mut(&there) else { continue };
                places.retain(|at| {
                    let is_near = (all[*at][0] - from[0]).norm() <= TOGETHER_M;
                    if is_near && !is_taken[*at] {
                        near.push(*at);
                    }
                    !is_near
                });
            }
            near.sort_unstable();
            near.iter().for_each(|at| is_taken[*at] = true);
            group.append(&mut near);
            next += 1;
        }
        groups.push(group.into_iter().map(|at| all[at]).collect());
    }
    groups
}

fn mean(points: impl Iterator<Item = Point2>) -> Point2 {
    let (sum, count) = points.fold((Vector2::zeros(), 0.0), |(sum, n), p| (sum + p.coords, n + 1.0));
    Point2::from(sum / f64::max(count, 1.0))
}

/// Returns the shortest chord from wall to wall that divides the two rooms.
fn shortest_chord(cells: &Cells, border: &[Meeting], evidence: &Evidence) -> Option<Passage> {
    let [one, other] = [0, 1].map(|side| mean(border.iter().map(|meeting| meeting[side])));
    let middle = mean([one, other].into_iter());
    let mut best: Option<(f64, Passage)> = None;
    for angle in 0..ANGLES {
        let (s, c) = (PI * angle as f64 / ANGLES as f64).sin_cos();
        let (along, across) = (Vector2::new(c, s), Vector2::new(-s, c));
        for off in -OFF_STEPS..=OFF_STEPS {
            let from = middle + across * (f64::from(off) * STEP_M);
            let side = |p: &Point2| (p - from).dot(&across);
            if side(&one) * side(&other) >= 0.0 {
                continue;
            }
            let Some(ends) = to_walls(cells, &from, &along) else { continue };
            let width_m = (ends[1] - ends[0]).norm();
            if width_m >= WIDTH_M[0]
                && floor_m(evidence, &ends) <= WIDEST_FLOOR_M
                && best.as_ref().is_none_or(|(least, _)| width_m < *least - 1e-9)
            {
                best = Some((width_m, Passage { ends_m: ends.map(|end| [end.x, end.y]) }));
            }
        }
    }
    best.map(|(_, passage)| passage.straightened())
}

/// Returns the length of a chord over open floor.
fn floor_m(evidence: &Evidence, [from, to]: &[Point2; 2]) -> f64 {
    let length_m = (to - from).norm();
    let count = (length_m / RAY_STEP_M).ceil().max(1.0) as usize;
    let open =
        (0..count).filter(|i| evidence.is_open(&(from + (to - from) * ((*i as f64 + 0.5) / count as f64))));
    length_m * open.count() as f64 / count as f64
}

/// Returns where a line through a place meets the walls; `None` if they are too far apart.
fn to_walls(cells: &Cells, from: &Point2, along: &Vector2) -> Option<[Point2; 2]> {
    let most = (WIDTH_M[1] / RAY_STEP_M) as i32;
    let is_inside = |step: i32| {
        let p = from + along * (f64::from(step) * RAY_STEP_M);
        cells.is_inside([p.x, p.y])
    };
    let up = (0..=most).find(|step| !is_inside(*step)).filter(|step| *step > 0)?;
    let down = (0..=most - up).find(|step| !is_inside(-*step))?;
    Some([-down, up].map(|step| from + along * (f64::from(step) * RAY_STEP_M)))
}

impl Passage {
    /// Returns it along an axis if it hardly leans.
    fn straightened(mut self) -> Passage {
        for axis in 0..2 {
            let [a, b] = self.ends_m.map(|end| end[axis]);
            if (a - b).abs() <= LEAN_M {
                self.ends_m.iter_mut().for_each(|end| end[axis] = (a + b) / 2.0);
            }
        }
        self
    }

    /// Adds the lines to the plan that a gap needs, so that it takes little of the rooms.
    pub fn refine(&self, cells: &mut Cells) {
        for axis in 0..2 {
            let [a, b] = self.ends_m.map(|end| end[axis]);
            if a == b {
                cells.refine(axis, a - THICKNESS_M / 2.0);
                cells.refine(axis, a + THICKNESS_M / 2.0);
                continue;
            }
            if self.ends_m[0][1 - axis] != self.ends_m[1][1 - axis] {
                let count = ((a - b).abs() / LINES_M).ceil() as usize;
                (0..=count).for_each(|i| cells.refine(axis, a + (b - a) * i as f64 / count as f64));
            }
        }
    }

    /// Returns the cells that it crosses as a gap.
    pub fn gap(&self, cells: &Cells) -> Gap {
        let [from, to] = self.ends_m.map(Point2::from);
        let count = ((to - from).norm() / (RAY_STEP_M / 2.0)).ceil().max(1.0) as usize;
        let crossed = (0..=count).filter_map(|i| {
            let p = from + (to - from) * (i as f64 / count as f64);
            cells.at([p.x, p.y]).filter(|at| cells.inside[*at])
        });
        let mut own: Vec<usize> = crossed.collect();
        own.sort_unstable();
        own.dedup();
        let mut sides = [Vec::new(), Vec::new()];
        for next in own.iter().flat_map(|at| beside(*at, cells.count(0), cells.count(1))).flatten() {
            if cells.inside[next] && own.binary_search(&next).is_err() {
                let is_left = (to - from).perp(&(Point2::from(cells.centre(next)) - from)) > 0.0;
                sides[usize::from(is_left)].push(next);
            }
        }
        for side in &mut sides {
            side.sort_unstable();
            side.dedup();
        }
        Gap {
            cells: own,
            beside: sides,
            ends_m: self.ends_m,
            thickness_m: THICKNESS_M,
            has_lintel: false,
            stubs: [true; 2],
            is_passage: true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn meeting([x, y]: [f64; 2]) -> Meeting {
        [Point2::new(x, y), Point2::new(x + 1.0, y)]
    }

    /// Compares each place with all others.
    fn apart_of_all(mut left: Vec<Meeting>) -> Vec<Vec<Meeting>> {
        let mut groups = Vec::new();
        while let Some(first) = left.pop() {
            let mut group = vec![first];
            let mut next = 0;
            while next < group.len() {
                let from: Point2 = group[next][0];
                let is_near = |meeting: &Meeting| (meeting[0] - from).norm() <= TOGETHER_M;
                let (near, far): (Vec<Meeting>, Vec<Meeting>) = left.into_iter().partition(is_near);
                group.extend(near);
                left = far;
                next += 1;
            }
            groups.push(group);
        }
        groups
    }

    proptest! {
        #[test]
        fn groups_are_those_of_all_places(places in prop::collection::vec((-30i32..30, -9i32..9), 0..60)) {
            let place = |(x, y): (i32, i32)| meeting([x, y].map(|step| f64::from(step) * STEP_M));
            let all: Vec<Meeting> = places.into_iter().map(place).collect();
            prop_assert_eq!(apart(&all), apart_of_all(all));
        }
    }

    #[test]
    fn very_many_places_are_divided_soon() {
        const COUNT: usize = 100_000;
        let all: Vec<Meeting> = (0..COUNT).map(|at| meeting([at as f64 * 0.4, 0.0])).collect();
        assert_eq!(apart(&all).len(), COUNT);
    }
}
