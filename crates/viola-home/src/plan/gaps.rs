//! Gaps in walls between two spaces, through which people walk.

mod slanted;

use super::axes::place;
use super::cells::{Cells, on_line};
use super::evidence::{Evidence, Facing};
use super::faces::Face;
use super::model::length_m;
use super::oblique::Oblique;

/// Thickness of walls between rooms.
const THICKNESS_M: [f64; 2] = [0.04, 0.5];
/// Width of doorways; wider gaps are open plan.
pub(super) const DOOR_M: [f64; 2] = [0.45, 1.35];
const WIDEST_M: f64 = 4.5;
/// A wall continues beside a gap if there is space this far beyond the gap's end: less than a wall is thick.
const STUB_M: f64 = 0.05;
/// Minimum fraction of a gap's width with wall above it.
const LINTEL_FRACTION: f64 = 0.5;
/// Widest column with wall at one face only.
const THIN_M: f64 = 0.12;
/// Minimum wall with both faces at a side of a gap: at one side of a door, at both of a wider gap.
const BACKING_M: f64 = 0.12;

/// A gap in a wall.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Gap {
    pub cells: Vec<usize>,
    /// Cells before it, on the side of smaller and of larger coordinates; of an oblique wall, on both sides.
    pub beside: [Vec<usize>; 2],
    /// Ends of its centre line, and thickness of its wall.
    pub ends_m: [[f64; 2]; 2],
    pub thickness_m: f64,
    /// Wall was seen above it.
    pub has_lintel: bool,
    /// The wall continues at its ends.
    pub stubs: [bool; 2],
    /// Computed rooms meet in it.
    pub is_passage: bool,
}

impl Gap {
    /// Returns whether walls on both sides go straight past it: a corridor between two rows of rooms.
    fn is_crossing(&self) -> bool {
        !self.has_lintel && self.stubs == [false, false]
    }

    /// Returns whether it divides two spaces whatever they are: a wide opening in a wall that was seen.
    pub fn is_in_wall(&self) -> bool {
        self.has_lintel || self.stubs == [true, true]
    }

    pub fn is_door(&self) -> bool {
        self.width_m() <= DOOR_M[1]
    }

    pub fn width_m(&self) -> f64 {
        length_m(self.ends_m[0], self.ends_m[1])
    }

    /// Returns whether its width is that of a doorway or of an open plan.
    pub fn is_plausible(&self) -> bool {
        (DOOR_M[0]..WIDEST_M).contains(&self.width_m())
    }
}

/// The cells between two lines across `axis`, from step `from` to step `to` along it.
#[derive(Clone, Copy)]
struct Span {
    axis: usize,
    /// Lines of the wall's faces.
    lines: [usize; 2],
    from: usize,
    to: usize,
}

impl Span {
    fn cells(&self, cells: &Cells) -> Vec<usize> {
        let across = self.lines[0]..self.lines[1];
        across.flat_map(|i| (self.from..self.to).map(move |k| self.at(cells, i, k))).collect()
    }

    fn beside(&self, cells: &Cells, up: bool) -> Vec<usize> {
        let across = if up { self.lines[1] } else { self.lines[0] - 1 };
        (self.from..self.to).map(|k| self.at(cells, across, k)).collect()
    }

    fn at(&self, cells: &Cells, across: usize, along: usize) -> usize {
        cells.index(place(self.axis, across, along))
    }

    fn gap(&self, cells: &Cells, evidence: &Evidence) -> Gap {
        let across = self.lines.map(|line| cells.lines[self.axis][line]);
        let ends_m = [self.from, self.to]
            .map(|step| place(self.axis, (across[0] + across[1]) / 2.0, cells.lines[1 - self.axis][step]));
        Gap {
            cells: self.cells(cells),
            beside: [false, true].map(|up| self.beside(cells, up)),
            ends_m,
            thickness_m: across[1] - across[0],
            has_lintel: self.has_lintel(cells, evidence),
            stubs: [self.has_stub(cells, false), self.has_stub(cells, true)],
            is_passage: false,
        }
    }

    /// Returns whether wall above the gap was seen, from either side.
    fn has_lintel(&self, cells: &Cells, evidence: &Evidence) -> bool {
        let span_m = [self.from, self.to].map(|step| cells.lines[1 - self.axis][step]);
        [false, true].iter().any(|up| {
            let line_m = cells.lines[self.axis][self.lines[usize::from(*up)]];
            evidence.lintel_fraction(Facing { axis: self.axis, up: *up }, line_m, span_m) >= LINTEL_FRACTION
        })
    }

    /// Returns whether the wall continues beside the gap, as seen from either side.
    fn has_stub(&self, cells: &Cells, at_end: bool) -> bool {
        let (step, beyond_m) = if at_end { (self.to, STUB_M) } else { (self.from, -STUB_M) };
        let across = self.lines.map(|line| cells.lines[self.axis][line]);
        let along_m = cells.lines[1 - self.axis][step] + beyond_m;
        [across[0] - STUB_M, across[1] + STUB_M]
            .iter()
            .any(|across_m| cells.is_inside(place(self.axis, *across_m, along_m)))
    }
}

/// Returns the gaps of all walls that two faces bound, the narrowest first.
pub(super) fn gaps(cells: &Cells, evidence: &Evidence, faces: &[Face], oblique: &[Oblique]) -> Vec<Gap> {
    let mut gaps = slanted::gaps(cells, oblique);
    gaps.extend(straight(cells, evidence, faces).into_iter().filter(Gap::is_plausible));
    let size_m2 = |gap: &Gap| gap.cells.iter().map(|at| cells.area_m2(*at)).sum::<f64>();
    gaps.sort_by(|a, b| size_m2(a).total_cmp(&size_m2(b)).then_with(|| a.cells.cmp(&b.cells)));
    gaps
}

/// Makes gaps through which nobody walks a part of their wall.
pub(super) fn close_seams(cells: &mut Cells, evidence: &Evidence, faces: &[Face]) {
    for seam in straight(cells, evidence, faces).iter().filter(|gap| gap.width_m() < DOOR_M[0]) {
        seam.cells.iter().for_each(|at| cells.inside[*at] = false);
    }
}

/// Returns the gaps of any width between faces along the axes.
fn straight(cells: &Cells, evidence: &Evidence, faces: &[Face]) -> Vec<Gap> {
    let mut gaps = Vec::new();
    for axis in 0..2 {
        let facing = |up: bool| Facing { axis, up };
        let lines_of = |up: bool| -> Vec<usize> {
            let on = faces.iter().filter(|face| face.facing == facing(up));
            let mut lines: Vec<usize> = on.filter_map(|face| cells.line(axis, face.line_m)).collect();
            lines.sort_unstable();
            lines.dedup();
            lines
        };
        let uppers = lines_of(true);
        for low in lines_of(false) {
            for high in uppers.iter().copied().filter(|high| *high > low) {
                let thickness_m = cells.lines[axis][high] - cells.lines[axis][low];
                if (THICKNESS_M[0]..THICKNESS_M[1]).contains(&thickness_m) {
                    let backs: Vec<&Face> = on_line(faces, cells, facing(false), low)
                        .chain(on_line(faces, cells, facing(true), high))
                        .collect();
                    gaps.extend(of_wall(cells, evidence, axis, [low, high], &backs));
                }
            }
        }
    }
    gaps
}

/// Returns the gaps between two lines that stand for the faces of one wall.
fn of_wall(cells: &Cells, evidence: &Evidence, axis: usize, lines: [usize; 2], backs: &[&Face]) -> Vec<Gap> {
    let along = 1 - axis;
    let span = |from: usize, to: usize| Span { axis, lines, from, to };
    let is_solid =
        |k: usize| span(k, k + 1).cells(cells).iter().all(|at| !cells.inside[*at] && !cells.pillars[*at]);
    // Wall that both faces show, within reach of a gap's end.
    let backing_m = |from: usize, to: usize| {
        let of_face = |up: bool| {
            let solid = (from..to).filter(|k| is_solid(*k));
            let seen = solid.map(|k| {
                let [from_m, to_m] = [k, k + 1].map(|i| cells.lines[along][i]);
                let faces = backs.iter().filter(|face| face.facing.up == up);
                faces.map(|face| face.fraction(from_m, to_m)).fold(0.0, f64::max) * (to_m - from_m)
            });
            seen.sum::<f64>()
        };
        of_face(false).min(of_face(true))
    };
    // A thin column with wall at one face only is the end of a wall.
    let is_end = |k: usize| {
        let is_thin = cells.size_m(along, k) <= THIN_M;
        is_solid(k) || (is_thin && span(k, k + 1).cells(cells).iter().any(|at| !cells.inside[*at]))
    };
    let is_open = |k: usize| span(k, k + 1).cells(cells).iter().all(|at| cells.inside[*at]);
    let mut found = Vec::new();
    let mut from = None;
    for k in 1..cells.count(along) {
        match (is_open(k), from) {
            (true, None) => from = is_end(k - 1).then_some(k),
            (false, Some(start)) => {
                from = None;
                if !is_end(k) {
                    continue;
                }
                let gap = span(start, k).gap(cells, evidence);
                let reach = |k: usize, up: bool| {
                    let end_m = cells.lines[along][k] + if up { 1.0 } else { -1.0 };
                    cells.lines[along].partition_point(|line| *line < end_m).clamp(1, cells.count(along))
                };
                let backing = [backing_m(reach(start, false) - 1, start), backing_m(k, reach(k, true))];
                let is_backed = if gap.is_door() {
                    backing.iter().any(|m| *m >= BACKING_M)
                } else {
                    backing.iter().all(|m| *m >= BACKING_M)
                };
                let leads = gap.beside.iter().all(|open| open.iter().any(|at| cells.inside[*at]));
                if is_backed && leads && !gap.is_crossing() {
                    found.push(gap);
                }
            }
            _ => {}
        }
    }
    found
}
