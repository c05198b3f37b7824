//! Small pieces of the cut: islands and slits.

use super::cells::{Cells, TALL_SHARE};
use super::evidence::{Evidence, Facing};
use super::oblique::Oblique;
use crate::rooms::outline::pieces;
use viola_geometry::{Grid, Point2};

/// Widest passage that nobody fits through.
const SLIT_M: f64 = 0.15;
/// Smallest solid island in a room.
const ISLAND_M2: f64 = 0.3;
/// Minimum fraction of a small island with wall up to the ceiling: a piece of a thin wall.
const WALL_SHARE: f64 = 0.5;

/// Makes passages beside oblique faces that nobody fits through a part of their walls: those have holes between cells.
pub(super) fn close_slits(cells: &mut Cells, oblique: &[Oblique]) {
    for axis in 0..2 {
        for row in 0..cells.count(1 - axis) {
            let at = |cells: &Cells, i: usize| cells.index(if axis == 0 { [i, row] } else { [row, i] });
            let mut last: Option<usize> = None;
            for i in 0..cells.count(axis) {
                if cells.inside[at(cells, i)] {
                    continue;
                }
                let width_m = |last: usize| cells.lines[axis][i] - cells.lines[axis][last + 1];
                if let Some(last) = last.filter(|last| width_m(*last) <= SLIT_M) {
                    for between in last + 1..i {
                        let at = at(cells, between);
                        cells.inside[at] &= !is_beside(cells, oblique, at);
                    }
                }
                last = Some(i);
            }
        }
    }
}

/// Returns whether the centre of a cell is at an oblique face, or right beyond its ends.
fn is_beside(cells: &Cells, oblique: &[Oblique], at: usize) -> bool {
    let centre = Point2::from(cells.centre(at));
    oblique.iter().any(|face| {
        let [along_m, off_m] = face.within(&centre);
        off_m.abs() <= SLIT_M && (-SLIT_M..=face.length_m + SLIT_M).contains(&along_m)
    })
}

/// Sums over the cells of an island.
#[derive(Clone)]
struct Island {
    area_m2: f64,
    /// Area with wall up to the ceiling.
    wall_m2: f64,
    /// Its first line and its last one, by axis.
    bounds: [[usize; 2]; 2],
}

/// Makes small solid islands a part of their room, except pillars and thin walls: furniture like walls is frequent.
pub(super) fn fill(cells: &mut Cells, evidence: &Evidence) {
    let solid = Grid { frame: cells.frame(), cells: cells.inside.iter().map(|inside| !inside).collect() };
    let (piece, count) = pieces(&solid);
    let none = Island { area_m2: 0.0, wall_m2: 0.0, bounds: [[usize::MAX, 0]; 2] };
    let mut islands = vec![none; count + 1];
    for (at, piece) in piece.iter().enumerate().filter(|(_, piece)| **piece != 0) {
        let island = &mut islands[*piece as usize];
        let place = cells.place(at);
        island.area_m2 += cells.area_m2(at);
        island.wall_m2 += cells.area_m2(at) * share_of_wall(cells, evidence, place);
        for (axis, [low, high]) in island.bounds.iter_mut().enumerate() {
            (*low, *high) = ((*low).min(place[axis]), (*high).max(place[axis] + 1));
        }
    }
    for (at, piece) in piece.iter().enumerate().filter(|(_, piece)| **piece != 0) {
        let island = &islands[*piece as usize];
        if island.area_m2 < ISLAND_M2 {
            let is_wall = island.wall_m2 >= WALL_SHARE * island.area_m2;
            cells.pillars[at] = is_wall || is_pillar(cells, evidence, island.bounds);
            cells.inside[at] = !cells.pillars[at];
        }
    }
}

/// Returns the fraction of a cell with wall up to the ceiling.
fn share_of_wall(cells: &Cells, evidence: &Evidence, place: [usize; 2]) -> f64 {
    /// Samples along each side.
    const STEPS: usize = 4;
    let is_wall = |i: &usize| {
        let sample = [i % STEPS, i / STEPS];
        let p = [0, 1].map(|axis| {
            let part = (sample[axis] as f64 + 0.5) / STEPS as f64;
            cells.lines[axis][place[axis]] + part * cells.size_m(axis, place[axis])
        });
        evidence.is_wall(&Point2::from(p))
    };
    (0..STEPS * STEPS).filter(is_wall).count() as f64 / (STEPS * STEPS) as f64
}

/// Returns whether three sides of an island show wall up to the ceiling.
fn is_pillar(cells: &Cells, evidence: &Evidence, bounds: [[usize; 2]; 2]) -> bool {
    let metres = |axis: usize, end: usize| cells.lines[axis][bounds[axis][end]];
    let shows = |facing: &Facing| {
        let (axis, along) = (facing.axis, 1 - facing.axis);
        let line_m = metres(axis, usize::from(facing.up));
        evidence.share_of_tall(*facing, line_m, [metres(along, 0), metres(along, 1)]) >= TALL_SHARE
    };
    Facing::ALL.iter().filter(|facing| shows(facing)).count() >= 3
}
