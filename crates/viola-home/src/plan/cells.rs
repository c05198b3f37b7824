//! The plan's plane, divided by the lines of all wall faces into cells; each is inside or outside the rooms.

mod lines;
mod refine;

use super::axes::place;
use super::cut::Graph;
use super::evidence::{Evidence, Facing};
use super::faces::Face;
use super::islands;
use super::oblique::{self, Oblique};
use crate::rooms::Room;
use lines::{SAME_LINE_M, WALL, lines};
use std::ops::Range;
use viola_geometry::{GridFrame, Point2};

/// Cells this near an oblique face are right behind or before it.
const BESIDE_M: f64 = 0.15;
/// Wall up to the ceiling has another face this far behind the seen one, which counts as if this much of it was seen.
const BACK_M: std::ops::RangeInclusive<f64> = 0.04..=0.3;
const BACK: f64 = 0.6;
/// Minimum fraction of a face that shows wall up to the ceiling.
pub(super) const TALL_FRACTION: f64 = 0.5;
/// Distance of the samples of a cell, and their maximum number along a side.
const SAMPLE_M: f64 = 0.04;
const MAX_SAMPLES: usize = 40;

/// Costs in millimetres of wall without evidence, for each square metre: open floor outside, ...
const OPEN_IN_ROOM: f64 = 6000.0;
const LEVEL_ELSEWHERE: f64 = 2500.0;
const OPEN_ELSEWHERE: f64 = 800.0;
const ROOM_NOT_OPEN: f64 = 1200.0;
/// floor below standing furniture outside, which is surer than a level surface: that may be seen through a window,
const BELOW_FURNITURE: f64 = 4000.0;
/// and space of which nothing is known inside.
const UNKNOWN: f64 = 200.0;
/// Cost of a millimetre of any wall: simple outlines are likelier.
const ANY_WALL: f64 = 0.03;
/// Costs of a millimetre of a face that was seen: inside right behind it, and outside right before it. Wall up to
/// the ceiling hides its other face sooner than it is furniture, so inside costs more than that face.
const BEHIND_FACE: f64 = 0.6;
const BEHIND_TALL: f64 = 1.1;
const BEFORE_FACE: f64 = 0.3;

/// Cells between neighbouring lines. Cell `(i, j)` reaches from `lines[0][i]` to `lines[0][i + 1]`, and from
/// `lines[1][j]` to `lines[1][j + 1]`.
#[derive(Clone)]
pub(super) struct Cells {
    pub lines: [Vec<f64>; 2],
    pub inside: Vec<bool>,
    /// Cells of pillars.
    pub pillars: Vec<bool>,
    /// Area of each given room in each cell, by its number from 1; 0 for none.
    pub owners: Vec<Vec<(u32, f64)>>,
}

impl Cells {
    pub fn new(evidence: &Evidence, faces: &[Face], oblique: &[Oblique], rooms: &[Room]) -> Cells {
        let lines = [0, 1].map(|axis| lines(axis, evidence, faces, oblique, rooms));
        let mut cells = Cells::of(lines);
        let count = cells.inside.len();
        let mut graph = Graph::new(count);
        for at in 0..count {
            cells.weigh(at, evidence, &mut graph);
            cells.weigh_beside(at, oblique, &mut graph);
        }
        for axis in 0..2 {
            cells.add_borders(axis, evidence, faces, oblique, &mut graph);
        }
        cells.inside = graph.inside();
        islands::close_slits(&mut cells, oblique);
        islands::fill(&mut cells, evidence);
        islands::cut_spurs(&mut cells, evidence);
        cells
    }

    /// Cells of which nothing is known: all are outside.
    pub fn of(lines: [Vec<f64>; 2]) -> Cells {
        let count = (lines[0].len() - 1) * (lines[1].len() - 1);
        let owners = vec![Vec::new(); count];
        Cells { lines, inside: vec![false; count], pillars: vec![false; count], owners }
    }

    /// Returns the evidence of wall up to the ceiling whose other face is at a side of a cell.
    fn tall_opposite(
        &self,
        [axis, line, step]: [usize; 3],
        up: bool,
        faces: &[Vec<&Face>],
        evidence: &Evidence,
    ) -> f64 {
        let span_m = [step, step + 1].map(|i| self.lines[1 - axis][i]);
        let facing = Facing { axis, up: !up };
        let behind_m = |other: usize| {
            let off_m = self.lines[axis][line] - self.lines[axis][other];
            if up { off_m } else { -off_m }
        };
        let near = (0..faces.len()).filter(|other| BACK_M.contains(&behind_m(*other)));
        let fraction = |other: usize| {
            let own = faces[other].iter().filter(|face| face.facing == facing);
            let seen = own.map(|face| face.fraction(span_m[0], span_m[1])).fold(0.0, f64::max);
            let is_tall = seen > 0.0
                && evidence.tall_fraction(facing, self.lines[axis][other], span_m) >= TALL_FRACTION;
            if is_tall { seen } else { 0.0 }
        };
        near.map(fraction).fold(0.0, f64::max)
    }

    /// Returns a raster with a cell for each cell.
    pub fn frame(&self) -> GridFrame {
        GridFrame { origin_m: [0.0; 2], cell_m: 1.0, width: self.count(0), height: self.count(1) }
    }

    /// Returns the cell at a place.
    pub fn at(&self, p: [f64; 2]) -> Option<usize> {
        let place = [0, 1].map(|axis| self.lines[axis].partition_point(|line| *line <= p[axis]));
        let is_within = (0..2).all(|axis| (1..=self.count(axis)).contains(&place[axis]));
        is_within.then(|| self.index(place.map(|i| i - 1)))
    }

    /// Returns whether the cell at a place is inside.
    pub fn is_inside(&self, p: [f64; 2]) -> bool {
        self.at(p).is_some_and(|at| self.inside[at])
    }

    /// Returns the number of cells along an axis.
    pub fn count(&self, axis: usize) -> usize {
        self.lines[axis].len() - 1
    }

    pub fn index(&self, place: [usize; 2]) -> usize {
        place[1] * self.count(0) + place[0]
    }

    pub fn place(&self, at: usize) -> [usize; 2] {
        [at % self.count(0), at / self.count(0)]
    }

    pub fn size_m(&self, axis: usize, place: usize) -> f64 {
        self.lines[axis][place + 1] - self.lines[axis][place]
    }

    /// Returns the centre of a cell.
    pub fn centre(&self, at: usize) -> [f64; 2] {
        let place = self.place(at);
        [0, 1].map(|axis| self.lines[axis][place[axis]] + self.size_m(axis, place[axis]) / 2.0)
    }

    pub fn area_m2(&self, at: usize) -> f64 {
        let place = self.place(at);
        self.size_m(0, place[0]) * self.size_m(1, place[1])
    }

    /// Returns the index of the line at a coordinate, if there is one.
    pub fn line(&self, axis: usize, metres: f64) -> Option<usize> {
        let after = self.lines[axis].partition_point(|line| *line < metres);
        let near = [after.checked_sub(1), Some(after)].into_iter().flatten();
        let off = |line: &usize| (self.lines[axis][*line] - metres).abs();
        near.filter(|line| *line < self.lines[axis].len())
            .filter(|line| off(line) <= SAME_LINE_M)
            .min_by(|a, b| off(a).total_cmp(&off(b)))
    }

    /// Returns the cells along an axis whose centres may be between the lowest and the highest of some coordinates.
    pub fn between(&self, axis: usize, metres: impl Iterator<Item = f64>) -> Range<usize> {
        /// Centres this much beyond them are compared, so that rounding loses none.
        const ROUNDING_M: f64 = 1e-6;
        let (low, high) =
            metres.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), m| (low.min(m), high.max(m)));
        let after = |metres: f64| self.lines[axis].partition_point(|line| *line <= metres);
        after(low - ROUNDING_M).saturating_sub(1)..after(high + ROUNDING_M).min(self.count(axis))
    }

    /// Adds the costs of a cell by what was seen in it.
    fn weigh(&mut self, at: usize, evidence: &Evidence, graph: &mut Graph) {
        let place = self.place(at);
        if (0..2).any(|axis| place[axis] == 0 || place[axis] + 1 == self.count(axis)) {
            graph.add_node(at, 0, i64::from(i32::MAX));
            return;
        }
        let samples = [0, 1]
            .map(|axis| ((self.size_m(axis, place[axis]) / SAMPLE_M).ceil() as usize).clamp(1, MAX_SAMPLES));
        let area_m2 = self.area_m2(at) / (samples[0] * samples[1]) as f64;
        let (mut if_outside, mut if_inside) = (0.0, 0.0);
        let mut owners: Vec<(u32, f64)> = Vec::new();
        for i in 0..samples[0] {
            for j in 0..samples[1] {
                let [x, y] = [(0, i), (1, j)].map(|(axis, i)| {
                    let part = (i as f64 + 0.5) / samples[axis] as f64;
                    self.lines[axis][place[axis]] + part * self.size_m(axis, place[axis])
                });
                let point = Point2::new(x, y);
                let (open, room) = (evidence.is_open(&point), evidence.room(&point));
                match (open, room != 0) {
                    (true, true) => if_outside += OPEN_IN_ROOM * area_m2,
                    (true, false) if evidence.is_level(&point) => if_outside += LEVEL_ELSEWHERE * area_m2,
                    (true, false) => if_outside += OPEN_ELSEWHERE * area_m2,
                    (false, _) if evidence.is_below_furniture(&point) => {
                        if_outside += BELOW_FURNITURE * area_m2;
                    }
                    (false, true) => if_outside += ROOM_NOT_OPEN * area_m2,
                    (false, false) => if_inside += UNKNOWN * area_m2,
                }
                match owners.iter_mut().find(|(owner, _)| *owner == room) {
                    Some((_, area)) => *area += area_m2,
                    None => owners.push((room, area_m2)),
                }
            }
        }
        owners.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        self.owners[at] = owners;
        graph.add_node(at, if_outside.round() as i64, if_inside.round() as i64);
    }

    /// Adds the costs of a cell right behind or before an oblique face.
    fn weigh_beside(&self, at: usize, oblique: &[Oblique], graph: &mut Graph) {
        let centre = self.centre(at);
        for face in oblique {
            let [along_m, before_m] = face.within(&Point2::from(centre));
            if !(oblique::OFF_M / 2.0..BESIDE_M).contains(&before_m.abs()) {
                continue;
            }
            // Before the other face of a thin wall.
            let is_beyond = || {
                oblique.iter().any(|other| {
                    let [along_m, off_m] = other.within(&Point2::from(centre));
                    other.normal.dot(&face.normal) < 0.0
                        && (0.0..BESIDE_M).contains(&off_m)
                        && other.fraction(along_m) > f64::from(WALL)
                })
            };
            if before_m < 0.0 && is_beyond() {
                continue;
            }
            let part = if before_m > 0.0 { BEFORE_FACE } else { BEHIND_FACE };
            let metres = self.area_m2(at) / (BESIDE_M - oblique::OFF_M / 2.0) * face.fraction(along_m);
            let cost = (metres * 1e3 * part).round() as i64;
            let (if_outside, if_inside) = if before_m > 0.0 { (cost, 0) } else { (0, cost) };
            graph.add_node(at, if_outside, if_inside);
        }
    }

    /// Adds the costs of walls without evidence along all lines of an axis.
    fn add_borders(
        &self,
        axis: usize,
        evidence: &Evidence,
        faces: &[Face],
        oblique: &[Oblique],
        graph: &mut Graph,
    ) {
        let along = 1 - axis;
        let mut of_lines: Vec<Vec<&Face>> = vec![Vec::new(); self.lines[axis].len()];
        for face in faces.iter().filter(|face| face.facing.axis == axis) {
            if let Some(line) = self.line(axis, face.line_m) {
                of_lines[line].push(face);
            }
        }
        let inner = self.lines[axis].len().saturating_sub(2);
        for (line, of_line) in of_lines.iter().enumerate().skip(1).take(inner) {
            for step in 0..self.count(along) {
                let [from_m, to_m] = [step, step + 1].map(|i| self.lines[along][i]);
                let straight = [false, true].map(|up| {
                    let facing = of_line.iter().filter(|face| face.facing.up == up);
                    facing.map(|face| face.fraction(from_m, to_m)).fold(0.0, f64::max)
                });
                let ends =
                    [from_m, to_m].map(|along_m| Point2::from(place(axis, self.lines[axis][line], along_m)));
                let seen = [false, true].map(|up| {
                    let steps = oblique.iter().map(|face| face.step_fraction(axis, up, ends));
                    steps.fold(straight[usize::from(up)], f64::max)
                });
                let seen = [false, true].map(|up| {
                    let opposite = self.tall_opposite([axis, line, step], up, &of_lines, evidence);
                    seen[usize::from(up)].max(BACK * opposite)
                });
                let cost = |part: f64| ((to_m - from_m) * 1e3 * part).round() as i64;
                let [low, high] = [line - 1, line].map(|across| self.index(place(axis, across, step)));
                // A face that looks up has its room above it.
                let [down, up] = seen.map(|seen| 1.0 - seen + ANY_WALL);
                graph.add_border(high, low, cost(up), cost(down));
                let behind = [false, true].map(|up| {
                    let is_tall = straight[usize::from(up)] > 0.0 && {
                        let facing = Facing { axis, up };
                        evidence.tall_fraction(facing, self.lines[axis][line], [from_m, to_m])
                            >= TALL_FRACTION
                    };
                    let wall = if is_tall { BEHIND_TALL } else { BEHIND_FACE };
                    // The front of furniture is no wall.
                    straight[usize::from(up)] * wall * (1.0 - furnished(axis, up, ends, evidence))
                });
                graph.add_node(low, cost(BEFORE_FACE * straight[0]), cost(behind[1]));
                graph.add_node(high, cost(BEFORE_FACE * straight[1]), cost(behind[0]));
            }
        }
    }
}

/// Returns the fraction of the ground right behind a side of a cell that is below standing furniture. Furniture with open floor
/// at its other side has its back to this one, and a wall is between.
fn furnished(axis: usize, up: bool, ends: [Point2; 2], evidence: &Evidence) -> f64 {
    const BEHIND_M: [f64; 3] = [0.05, 0.1, 0.15];
    const ALONG: [f64; 3] = [0.2, 0.5, 0.8];
    /// Step through furniture, and a bound on the steps: no furniture is deeper.
    const STEP_M: f64 = 0.05;
    const STEPS: usize = 24;
    let behind = |part: f64, behind_m: f64| {
        let mut place = ends[0] + (ends[1] - ends[0]) * part;
        place[axis] += if up { -behind_m } else { behind_m };
        place
    };
    let is_front = |part: f64| {
        let deep = (BEHIND_M.len()..STEPS).map(|step| behind(part, (step + 1) as f64 * STEP_M));
        let beyond = deep.into_iter().find(|place| !evidence.is_below_furniture(place));
        beyond.is_none_or(|place| !evidence.is_open(&place))
    };
    let is_furnished = |(part, behind_m): (f64, f64)| evidence.is_below_furniture(&behind(part, behind_m));
    let fronts = ALONG.into_iter().filter(|part| is_front(*part));
    let places = fronts.flat_map(|part| BEHIND_M.map(|behind_m| (part, behind_m)));
    places.filter(|place| is_furnished(*place)).count() as f64 / (ALONG.len() * BEHIND_M.len()) as f64
}

/// Returns the faces that look in a direction and stand on a line of cells.
pub(super) fn on_line<'a>(
    faces: &'a [Face],
    cells: &'a Cells,
    facing: Facing,
    line: usize,
) -> impl Iterator<Item = &'a Face> {
    faces
        .iter()
        .filter(move |face| face.facing == facing && cells.line(facing.axis, face.line_m) == Some(line))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn centres_between_coordinates_are_found_by_the_lines() {
        let lines = [vec![0.0, 1.0, 1.2, 3.0, 3.1, 5.0], vec![0.0, 1.0]];
        let cells = Cells::of(lines);
        for (from, to) in (-10..62).flat_map(|from| (from..62).map(move |to| (from, to))) {
            let [low, high] = [from, to].map(|tenths| f64::from(tenths) / 10.0);
            let found = cells.between(0, [high, low].into_iter());
            let is_between = |at: &usize| (low..=high).contains(&cells.centre(*at)[0]);
            assert!((0..5).filter(is_between).all(|at| found.contains(&at)), "{low} {high}: {found:?}");
            // At most one more at each end.
            assert!(found.len() <= (0..5).filter(is_between).count() + 2, "{low} {high}: {found:?}");
        }
    }
}
