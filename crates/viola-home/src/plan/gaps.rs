//! Gaps in walls between two spaces, through which people walk.

use super::cells::{Cells, on_line};
use super::evidence::Facing;
use super::faces::Face;

/// Thickness of walls between rooms.
const THICKNESS_M: [f64; 2] = [0.04, 0.5];
/// Width of doorways; wider gaps are open plan.
const DOOR_M: [f64; 2] = [0.45, 1.35];
const WIDEST_M: f64 = 4.5;
/// Minimum wall with both faces at a side of a gap: at one side of a door, at both of a wider gap.
const BACKING_M: f64 = 0.12;

/// A gap in a wall: the cells between two lines across `axis`, from step `from` to step `to` along it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Gap {
    pub axis: usize,
    /// Lines of the wall's faces.
    pub lines: [usize; 2],
    pub from: usize,
    pub to: usize,
    pub width_m: f64,
}

impl Gap {
    pub fn is_door(&self) -> bool {
        self.width_m <= DOOR_M[1]
    }

    /// Returns the cells in the gap.
    pub fn cells(&self, cells: &Cells) -> Vec<usize> {
        let across = self.lines[0]..self.lines[1];
        across.flat_map(|i| (self.from..self.to).map(move |k| self.at(cells, i, k))).collect()
    }

    /// Returns the cells before it, on the side of smaller or of larger coordinates.
    pub fn beside(&self, cells: &Cells, up: bool) -> Vec<usize> {
        let across = if up { self.lines[1] } else { self.lines[0] - 1 };
        (self.from..self.to).map(|k| self.at(cells, across, k)).collect()
    }

    fn at(&self, cells: &Cells, across: usize, along: usize) -> usize {
        let mut place = [along; 2];
        place[self.axis] = across;
        cells.index(place)
    }
}

/// Returns the gaps of all walls that two faces bound, the narrowest first.
pub(super) fn gaps(cells: &Cells, faces: &[Face]) -> Vec<Gap> {
    let mut gaps: Vec<Gap> = Vec::new();
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
                    gaps.extend(of_wall(cells, axis, [low, high], &backs));
                }
            }
        }
    }
    gaps.sort_by(|a, b| {
        let size = |gap: &Gap| gap.cells(cells).iter().map(|at| cells.area_m2(*at)).sum::<f64>();
        size(a).total_cmp(&size(b)).then((a.axis, a.lines, a.from).cmp(&(b.axis, b.lines, b.from)))
    });
    gaps
}

/// Returns the gaps between two lines that stand for the faces of one wall.
fn of_wall(cells: &Cells, axis: usize, lines: [usize; 2], backs: &[&Face]) -> Vec<Gap> {
    let along = 1 - axis;
    let gap = |from: usize, to: usize| Gap {
        axis,
        lines,
        from,
        to,
        width_m: cells.lines[along][to] - cells.lines[along][from],
    };
    let is_solid = |k: usize| gap(k, k + 1).cells(cells).iter().all(|at| !cells.inside[*at]);
    // Wall that both faces show, within reach of a gap's end.
    let backing_m = |from: usize, to: usize| {
        let of_face = |up: bool| {
            let solid = (from..to).filter(|k| is_solid(*k));
            let seen = solid.map(|k| {
                let [from_m, to_m] = [k, k + 1].map(|i| cells.lines[along][i]);
                let faces = backs.iter().filter(|face| face.facing.up == up);
                faces.map(|face| face.share(from_m, to_m)).fold(0.0, f64::max) * (to_m - from_m)
            });
            seen.sum::<f64>()
        };
        of_face(false).min(of_face(true))
    };
    let is_open = |k: usize| gap(k, k + 1).cells(cells).iter().all(|at| cells.inside[*at]);
    let mut found = Vec::new();
    let mut from = None;
    for k in 1..cells.count(along) {
        match (is_open(k), from) {
            (true, None) => from = is_solid(k - 1).then_some(k),
            (false, Some(start)) => {
                from = None;
                if !is_solid(k) {
                    continue;
                }
                let gap = gap(start, k);
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
                let leads = [false, true].iter().all(|up| {
                    let open = gap.beside(cells, *up);
                    open.iter().any(|at| cells.inside[*at])
                });
                if is_backed && leads && (DOOR_M[0]..WIDEST_M).contains(&gap.width_m) {
                    found.push(gap);
                }
            }
            _ => {}
        }
    }
    found
}
