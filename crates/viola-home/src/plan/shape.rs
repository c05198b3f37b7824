//! Polygons and walls of the rooms' cells.

use super::axes::{place, slots};
use super::cells::Cells;
use super::gaps::Gap;
use super::model::{Opening, OpeningKind, Wall};
use super::spaces::Spaces;
use crate::rooms::bands::Bands;
use crate::rooms::outline::{Outline, trace};
use std::ops::Range;
use viola_geometry::{Grid, GridFrame};

/// Walls between rooms are at most this thick.
pub(super) const THICKEST_M: f64 = 0.5;
/// Thickness of walls whose other face was not seen.
pub(super) const USUAL_M: f64 = 0.2;
/// Sides of cells this near a room's outline are sides of the room.
const DRAWN_M: f64 = 0.001;
/// Walls in one line with less between them are one wall.
const JOIN_M: f64 = 0.55;
/// Narrower slots between walls are walls.
const SLOT_M: f64 = 0.35;
const SAME_LINE_M: f64 = 0.03;

/// Returns the polygon of each room.
pub(super) fn outlines(cells: &Cells, spaces: &Spaces) -> Vec<Outline> {
    let boxes = boxes(cells, spaces);
    (1..)
        .zip(boxes)
        .map(|(room, [columns, rows])| {
            let lines = [(0, &columns), (1, &rows)]
                .map(|(axis, range)| cells.lines[axis].get(range.start..=range.end).unwrap_or_default());
            // A doorway within the room is a part of it.
            let is_of = |at: usize| spaces.of_cell[at] == room || spaces.joins[at] == room;
            let mask = rows.flat_map(|y| columns.clone().map(move |x| [x, y]));
            let mut outlines = traced(lines, mask.map(|place| is_of(cells.index(place))).collect());
            outlines.sort_by(|a, b| b.outer_area_m2().total_cmp(&a.outer_area_m2()));
            outlines.into_iter().next().unwrap_or(Outline { ring_m: Vec::new(), holes_m: Vec::new() })
        })
        .collect()
}

/// Returns the columns and the rows of the box around each room: a large map has thousands of small rooms.
fn boxes(cells: &Cells, spaces: &Spaces) -> Vec<[Range<usize>; 2]> {
    let mut boxes: Vec<[Range<usize>; 2]> = vec![[0..0, 0..0]; spaces.owners.len()];
    for (at, (of, joins)) in spaces.of_cell.iter().zip(&spaces.joins).enumerate() {
        for room in [*of, *joins] {
            let room = (room as usize).checked_sub(1).and_then(|room| boxes.get_mut(room));
            for (range, at) in room.into_iter().flatten().zip(cells.place(at)) {
                let from = if range.end == 0 { at } else { range.start.min(at) };
                *range = from..range.end.max(at + 1);
            }
        }
    }
    boxes
}

/// Returns the polygons of the set cells between lines.
fn traced(lines: [&[f64]; 2], mask: Vec<bool>) -> Vec<Outline> {
    let [width, height] = lines.map(|lines| lines.len() - 1);
    let frame = GridFrame { origin_m: [0.0; 2], cell_m: 1.0, width, height };
    let place = |corner: &[f64; 2]| [0, 1].map(|axis| lines[axis][corner[axis].round() as usize]);
    let ring = |ring: &Vec<[f64; 2]>| ring.iter().map(place).collect();
    let outlines = trace(&Grid { frame, cells: mask });
    let placed = outlines.iter().map(|outline| Outline {
        ring_m: ring(&outline.ring_m),
        holes_m: outline.holes_m.iter().map(ring).collect(),
    });
    placed.collect()
}

/// Returns the openings of the gaps, in their order.
pub(super) fn doors(gaps: &[Gap]) -> Vec<Opening> {
    let door = |(number, gap): (usize, &Gap)| {
        let kind = if gap.is_door() { OpeningKind::Door } else { OpeningKind::Passage };
        Opening { id: format!("door-{number}"), ..Opening::new(kind, gap.ends_m, gap.thickness_m) }
    };
    (1..).zip(gaps).map(door).collect()
}

/// A stretch of wall beside a room.
struct Stretch {
    axis: usize,
    faces_m: [f64; 2],
    from_m: f64,
    to_m: f64,
    is_measured: bool,
    rooms: Vec<usize>,
}

/// Returns the walls along the axes around and between the rooms, by axis and place.
pub(super) fn walls(cells: &Cells, spaces: &Spaces, outlines: &[Outline]) -> Vec<Wall> {
    let outlines: Vec<Bands> =
        outlines.iter().map(|outline| Bands::new(&outline.ring_m, &outline.holes_m)).collect();
    let mut all: Vec<Stretch> = Vec::new();
    for axis in 0..2 {
        for line in 1..cells.lines[axis].len() - 1 {
            for step in 0..cells.count(1 - axis) {
                let is_drawn = |up: &bool| is_drawn(cells, spaces, &outlines, [axis, line, step], *up);
                let ups = [false, true].into_iter().filter(is_drawn);
                all.extend(ups.filter_map(|up| stretch(cells, spaces, axis, line, step, up)));
            }
        }
    }
    let mut walls: Vec<Stretch> = Vec::new();
    for next in all {
        // They are in the order of their lines, and none begins further from its line than it is usually thick.
        let is_near = |wall: &&mut Stretch| {
            wall.axis == next.axis && wall.faces_m[0] + USUAL_M + 2.0 * SAME_LINE_M > next.faces_m[0]
        };
        let continued = walls.iter_mut().rev().take_while(is_near).find(|wall| {
            let off = |i: usize| (wall.faces_m[i] - next.faces_m[i]).abs();
            wall.is_measured == next.is_measured
                && off(0) < SAME_LINE_M
                && off(1) < SAME_LINE_M
                && next.from_m - wall.to_m < JOIN_M
                && next.from_m > wall.to_m - 1e-9
        });
        match continued {
            Some(wall) => {
                wall.to_m = next.to_m;
                wall.rooms.extend(next.rooms);
            }
            None => walls.push(next),
        }
    }
    walls
        .into_iter()
        .map(|mut wall| {
            wall.rooms.sort_unstable();
            wall.rooms.dedup();
            let point = |along_m: f64| place(wall.axis, (wall.faces_m[0] + wall.faces_m[1]) / 2.0, along_m);
            let thickness_m = wall.faces_m[1] - wall.faces_m[0];
            Wall {
                is_measured: wall.is_measured,
                rooms: wall.rooms,
                ..Wall::new([point(wall.from_m), point(wall.to_m)], thickness_m)
            }
        })
        .collect()
}

/// Returns whether the side of a room's cell below (`up`) or above a line is on the room's outline; steps of
/// oblique walls are not.
fn is_drawn(
    cells: &Cells,
    spaces: &Spaces,
    outlines: &[Bands],
    [axis, line, step]: [usize; 3],
    up: bool,
) -> bool {
    let (own, other) = if up { (line - 1, line) } else { (line, line - 1) };
    let [own, other] = [own, other].map(|across| cells.index(place(axis, across, step)));
    let room = spaces.of_cell[own];
    // Openings do not interrupt walls, and neither do doorways within a room.
    if room != 0 && spaces.joins[other] == room {
        return true;
    }
    let [from_m, to_m] = [step, step + 1].map(|step| cells.lines[1 - axis][step]);
    let Some(outline) = (room as usize).checked_sub(1).and_then(|room| outlines.get(room)) else {
        return false;
    };
    // Two points: an oblique side may cross a step at one.
    [0.25, 0.75].iter().all(|part| {
        let p = place(axis, cells.lines[axis][line], from_m + part * (to_m - from_m));
        outline.is_near(&p.into(), DRAWN_M)
    })
}

/// Returns the wall that a room's cell below (`up`) or above a line has at the line. A wall between two rooms
/// is returned for the lower one only.
fn stretch(
    cells: &Cells,
    spaces: &Spaces,
    axis: usize,
    line: usize,
    step: usize,
    up: bool,
) -> Option<Stretch> {
    let room = |across: usize| spaces.of_cell[cells.index(place(axis, across, step))];
    let own = room(if up { line - 1 } else { line });
    let mut other = if up { line } else { line - 1 };
    if own == 0 || room(other) != 0 {
        return None;
    }
    let [from_m, to_m] = [step, step + 1].map(|step| cells.lines[1 - axis][step]);
    let of = |faces_m: [f64; 2], is_measured: bool, rooms: Vec<usize>| Stretch {
        axis,
        faces_m,
        from_m,
        to_m,
        is_measured,
        rooms,
    };
    let lines = &cells.lines[axis];
    let far_m = |other: usize| if up { lines[other + 1] - lines[line] } else { lines[line] - lines[other] };
    while far_m(other) <= THICKEST_M {
        // The map may end within the wall.
        let next = if up { Some(other + 1) } else { other.checked_sub(1) };
        let Some(next) = next.filter(|next| *next < cells.count(axis)) else { break };
        if room(next) != 0 {
            let faces_m = [lines[line], lines[next]];
            let rooms = vec![own as usize - 1, room(next) as usize - 1];
            return up.then(|| of(faces_m, true, rooms));
        }
        other = next;
    }
    let faces_m =
        if up { [lines[line], lines[line] + USUAL_M] } else { [lines[line] - USUAL_M, lines[line]] };
    Some(of(faces_m, false, vec![own as usize - 1]))
}

/// Returns the area of the walls: what is near rooms or between them, without doors and passages.
pub(super) fn masonry(cells: &Cells, spaces: &Spaces) -> Vec<Outline> {
    let lines = [0, 1].map(|axis| {
        let mut lines: Vec<f64> =
            cells.lines[axis].iter().flat_map(|line| [line - USUAL_M, *line, line + USUAL_M]).collect();
        lines.sort_by(f64::total_cmp);
        lines.dedup_by(|a, b| (*a - *b).abs() < 1e-6);
        lines
    });
    let count = [lines[0].len() - 1, lines[1].len() - 1];
    // The cell of each part of the finer raster.
    let of_part = [0, 1].map(|axis| {
        let middle = |i: usize| (lines[axis][i] + lines[axis][i + 1]) / 2.0;
        let cell = |i: usize| cells.lines[axis].partition_point(|line| *line <= middle(i)).checked_sub(1);
        (0..count[axis]).map(|i| cell(i).filter(|cell| *cell < cells.count(axis))).collect::<Vec<_>>()
    });
    let mut is_gap = vec![false; spaces.of_cell.len()];
    spaces.gaps.iter().flat_map(|gap| &gap.cells).for_each(|at| is_gap[*at] = true);
    let cell = |i: usize, j: usize| Some(cells.index([of_part[0][i]?, of_part[1][j]?]));
    let is_room = |i: usize, j: usize| cell(i, j).is_some_and(|at| spaces.of_cell[at] != 0);
    let mut near = vec![false; count[0] * count[1]];
    for j in 0..count[1] {
        for i in (0..count[0]).filter(|i| is_room(*i, j)) {
            let reach = |axis: usize, i: usize| {
                let (low, high) = (lines[axis][i] - USUAL_M - 1e-6, lines[axis][i + 1] + USUAL_M + 1e-6);
                let from = lines[axis].partition_point(|line| *line < low);
                from..lines[axis].partition_point(|line| *line <= high) - 1
            };
            for y in reach(1, j) {
                near[y * count[0]..][reach(0, i)].fill(true);
            }
        }
    }
    let lines = [&*lines[0], &lines[1]];
    for axis in 0..2 {
        for [x, y] in slots(lines, axis, THICKEST_M, |[x, y]| is_room(x, y)) {
            near[y * count[0] + x] = true;
        }
    }
    for axis in 0..2 {
        for [x, y] in slots(lines, axis, SLOT_M, |[x, y]| near[y * count[0] + x]) {
            near[y * count[0] + x] = true;
        }
    }
    let is_open: Vec<bool> = (0..near.len())
        .map(|at| {
            let (i, j) = (at % count[0], at / count[0]);
            is_room(i, j) || cell(i, j).is_some_and(|at| is_gap[at])
        })
        .collect();
    fill_cavities(&mut near, &is_open, count);
    let solid = |at: usize| near[at] && !is_open[at];
    traced(lines, (0..near.len()).map(solid).collect())
}

/// Makes cavities walls: what neither rooms nor the outside reach.
fn fill_cavities(near: &mut [bool], is_open: &[bool], count: [usize; 2]) {
    let mut reached = vec![false; near.len()];
    let at_edge = |at: usize| {
        let (i, j) = (at % count[0], at / count[0]);
        i == 0 || j == 0 || i + 1 == count[0] || j + 1 == count[1]
    };
    let mut open: Vec<usize> =
        (0..near.len()).filter(|at| at_edge(*at) && !near[*at] && !is_open[*at]).collect();
    open.iter().for_each(|at| reached[*at] = true);
    while let Some(at) = open.pop() {
        for next in crate::rooms::outline::beside(at, count[0], count[1]).into_iter().flatten() {
            if !reached[next] && !near[next] && !is_open[next] {
                reached[next] = true;
                open.push(next);
            }
        }
    }
    near.iter_mut().zip(reached).for_each(|(near, reached)| *near |= !reached);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rooms of one cell, each apart from the others: as many as a plan may have.
    #[test]
    fn very_many_rooms_have_their_outlines_and_walls_soon() {
        const SIDE: usize = 240;
        let lines: Vec<f64> = (0..=2 * SIDE).map(|at| at as f64 * 0.6).collect();
        let count = 4 * SIDE * SIDE;
        let cells = Cells { inside: vec![true; count], ..Cells::of([lines.clone(), lines.clone()]) };
        let place = |room: usize| [2 * (room % SIDE), 2 * (room / SIDE)];
        let (mut of_cell, mut joins) = (vec![0; count], vec![0; count]);
        (1..).zip(0..SIDE * SIDE).for_each(|(number, room)| of_cell[cells.index(place(room))] = number);
        // The last one has a doorway.
        joins[count - 1 - 2 * SIDE] = (SIDE * SIDE) as u32;
        let spaces = Spaces { of_cell, owners: vec![0; SIDE * SIDE], joins, gaps: Vec::new() };
        let outlines = outlines(&cells, &spaces);
        assert_eq!(outlines.len(), SIDE * SIDE);
        for (room, outline) in outlines.iter().enumerate() {
            let ([x, y], width) = (place(room), if room + 1 < outlines.len() { 1 } else { 2 });
            let ([left, right], [low, high]) = ([lines[x], lines[x + width]], [lines[y], lines[y + 1]]);
            assert_eq!(outline.ring_m, [[left, low], [right, low], [right, high], [left, high]]);
        }
        // Nothing is beyond the lines at the edges.
        let walls = walls(&cells, &spaces, &outlines);
        assert_eq!(walls.len(), 2 * SIDE * (2 * SIDE - 1));
    }
}
