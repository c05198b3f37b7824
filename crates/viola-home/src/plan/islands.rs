//! Small pieces of the cut: islands and slits.

use super::axes::{place, sample, slots};
use super::cells::{Cells, TALL_FRACTION};
use super::evidence::{Evidence, Facing};
use super::oblique::Oblique;
use crate::rooms::outline::pieces;
use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use viola_geometry::{Grid, Point2};

/// Widest passage that nobody fits through.
const SLIT_M: f64 = 0.15;
/// Maximum thickness and length of a spur, and the distances from it at which clips saw the floor.
const SPUR_M: f64 = 0.08;
const LEAF_M: f64 = 1.05;
const BESIDE_SPUR_M: [f64; 2] = [0.15, 0.3];
/// Smallest solid island in a room.
const ISLAND_M2: f64 = 0.3;
/// Largest footprint of furniture in a corner or away from walls: a larger thing may be a closet.
pub(super) const MOST_FURNITURE_M2: f64 = 2.2;
/// Smallest width of furniture: recesses of windows are less deep.
pub(super) const SHORTEST_FURNITURE_M: f64 = 0.35;
/// Largest thickness of a pier between two doors, minimum length by its thickness, and minimum fraction of both its faces with
/// wall. Furniture like a wall is thicker, as a rule.
const PIER_M: f64 = 0.25;
const PIER_RATIO: f64 = 2.0;
/// Largest thickness of an inner wall.
const PARTITION_M: f64 = 0.15;
/// Minimum thickness of one between rooms, and minimum fraction of its border at the second of them.
const DIVIDING_M: f64 = 0.03;
const SECOND_ROOM: f64 = 0.3;
const PIER_FRACTION: f64 = 0.6;
/// Minimum fraction of a small island with wall up to the ceiling: a piece of a thin wall.
const WALL_FRACTION: f64 = 0.5;

/// Makes passages beside oblique faces that nobody fits through a part of their walls: those have holes between cells.
pub(super) fn close_slits(cells: &mut Cells, oblique: &[Oblique]) {
    for axis in 0..2 {
        let lines = [&*cells.lines[0], &cells.lines[1]];
        let slits = slots(lines, axis, SLIT_M, |place| !cells.inside[cells.index(place)]);
        for at in slits.into_iter().map(|place| cells.index(place)).collect::<Vec<usize>>() {
            cells.inside[at] &= !is_beside(cells, oblique, at);
        }
    }
}

/// Makes thin spurs a part of their room, where clips saw the floor on both sides and no wall up to the ceiling: open
/// leaves of doors, sides of furniture.
pub(super) fn cut_spurs(cells: &mut Cells, evidence: &Evidence) {
    for axis in 0..2 {
        // Runs of thin pieces across the axis, by the rows that they reach over: first cell, end, first row, end.
        let mut spurs: Vec<[usize; 4]> = Vec::new();
        // The last run of each piece.
        let mut last: BTreeMap<[usize; 2], usize> = BTreeMap::new();
        for row in 0..cells.count(1 - axis) {
            for [from, to] in thin_pieces(cells, axis, row) {
                let open = last.get(&[from, to]).and_then(|at| spurs.get_mut(*at));
                if let Some(spur) = open.filter(|spur| spur[3] == row) {
                    spur[3] = row + 1;
                } else {
                    last.insert([from, to], spurs.len());
                    spurs.push([from, to, row, row + 1]);
                }
            }
        }
        for spur in spurs {
            if is_spur(cells, evidence, axis, spur) {
                for (across, row) in (spur[0]..spur[1]).flat_map(|i| (spur[2]..spur[3]).map(move |j| (i, j)))
                {
                    let at = cells.index(place(axis, across, row));
                    cells.inside[at] = true;
                }
            }
        }
    }
}

/// Returns the pieces of a row of cells along an axis that are thin walls between inside and inside.
fn thin_pieces(cells: &Cells, axis: usize, row: usize) -> Vec<[usize; 2]> {
    let is_inside = |i: usize| cells.inside[cells.index(place(axis, i, row))];
    let mut pieces = Vec::new();
    let mut from: Option<usize> = None;
    for i in 1..cells.count(axis) {
        match (is_inside(i - 1), is_inside(i), from) {
            (true, false, _) => from = Some(i),
            (false, true, Some(first)) => {
                if cells.lines[axis][i] - cells.lines[axis][first] <= SPUR_M {
                    pieces.push([first, i]);
                }
                from = None;
            }
            _ => {}
        }
    }
    pieces
}

/// Returns whether a thin wall, given by its first cell, its end, its first row and its end, is a spur.
fn is_spur(cells: &Cells, evidence: &Evidence, axis: usize, [from, to, first, end]: [usize; 4]) -> bool {
    let lines = &cells.lines[1 - axis];
    let length_m = lines[end] - lines[first];
    // Open beyond one end, for its whole thickness.
    let is_open = |row: usize| (from..to).all(|across| cells.inside[cells.index(place(axis, across, row))]);
    let has_end = (first > 0 && is_open(first - 1)) || (end < cells.count(1 - axis) && is_open(end));
    if !has_end || !(2.0 * SPUR_M..=LEAF_M).contains(&length_m) {
        return false;
    }
    let steps = (length_m / 0.05).ceil().max(1.0) as usize;
    let fraction = |is: &dyn Fn(f64) -> bool| {
        let along_m = |step: usize| lines[first] + (step as f64 + 0.5) / steps as f64 * length_m;
        (0..steps).filter(|step| is(along_m(*step))).count() as f64 / steps as f64
    };
    let at = |across_m: f64, along_m: f64| Point2::from(place(axis, across_m, along_m));
    let faces_m = [cells.lines[axis][from], cells.lines[axis][to]];
    let sees_floor = |line_m: f64, sign: f64| {
        let is_floor = |along_m: f64| {
            BESIDE_SPUR_M.iter().any(|off| evidence.is_floor_of_clips(&at(line_m + sign * off, along_m)))
        };
        fraction(&is_floor) >= 0.5
    };
    let middle_m = (faces_m[0] + faces_m[1]) / 2.0;
    let is_wall = |along_m: f64| {
        [-SPUR_M / 2.0, 0.0, SPUR_M / 2.0].iter().any(|off| evidence.is_wall(&at(middle_m + off, along_m)))
    };
    sees_floor(faces_m[0], -1.0) && sees_floor(faces_m[1], 1.0) && fraction(&is_wall) < WALL_FRACTION
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
    /// Length of its border, and of the part that shows wall at many heights.
    border_m: f64,
    upright_m: f64,
    /// Length of the part that clips or the LiDAR saw.
    lidar_m: f64,
    /// Length of the parts at each room of the map, by its number from 1.
    by_room_m: BTreeMap<u32, f64>,
    /// Its first line and its last one, by axis.
    bounds: [[usize; 2]; 2],
}

/// Makes small solid islands and furniture that no clip saw a part of their room, except pillars and thin walls: furniture like walls
/// is frequent. Doors end at piers, but not at pillars.
pub(super) fn fill(cells: &mut Cells, evidence: &Evidence) {
    let solid = Grid { frame: cells.frame(), cells: cells.inside.iter().map(|inside| !inside).collect() };
    let (piece, count) = pieces(&solid);
    let none = Island {
        area_m2: 0.0,
        wall_m2: 0.0,
        border_m: 0.0,
        upright_m: 0.0,
        lidar_m: 0.0,
        by_room_m: BTreeMap::new(),
        bounds: [[usize::MAX, 0]; 2],
    };
    let mut islands = vec![none; count + 1];
    for (at, piece) in piece.iter().enumerate().filter(|(_, piece)| **piece != 0) {
        let island = &mut islands[*piece as usize];
        let place = cells.place(at);
        island.area_m2 += cells.area_m2(at);
        island.wall_m2 += cells.area_m2(at) * wall_fraction(cells, evidence, place);
        for ([length_m, upright, lidar], room) in sides(cells, evidence, at) {
            *island.by_room_m.entry(room).or_default() += length_m;
            island.border_m += length_m;
            island.upright_m += length_m * upright;
            island.lidar_m += length_m * upright.max(lidar);
        }
        for (axis, [low, high]) in island.bounds.iter_mut().enumerate() {
            (*low, *high) = ((*low).min(place[axis]), (*high).max(place[axis] + 1));
        }
    }
    for (at, piece) in piece.iter().enumerate().filter(|(_, piece)| **piece != 0) {
        let island = &islands[*piece as usize];
        let stays = is_long_wall(island) || is_pier(cells, evidence, island.bounds);
        if island.area_m2 < ISLAND_M2 && !stays || is_unfilmed_furniture(island) {
            let is_wall = island.wall_m2 >= WALL_FRACTION * island.area_m2;
            cells.pillars[at] = is_wall || is_pillar(cells, evidence, island.bounds);
            cells.inside[at] = !cells.pillars[at];
        }
    }
}

/// Returns the fraction of a cell with wall up to the ceiling.
fn wall_fraction(cells: &Cells, evidence: &Evidence, place: [usize; 2]) -> f64 {
    /// Samples along each side.
    const STEPS: usize = 4;
    let span = [0, 1].map(|axis| [place[axis], place[axis] + 1].map(|line| cells.lines[axis][line]));
    let is_wall = |i: &usize| evidence.is_wall(&Point2::from(sample(span, STEPS, *i)));
    (0..STEPS * STEPS).filter(is_wall).count() as f64 / (STEPS * STEPS) as f64
}

/// Returns the length of each side of a solid cell that looks into a room, the fraction that shows wall at many heights, and the one
/// that the LiDAR saw; and the room of the map beside it, 0 for none.
fn sides(cells: &Cells, evidence: &Evidence, at: usize) -> Vec<([f64; 3], u32)> {
    let place = cells.place(at);
    let side = |facing: &Facing| {
        let (axis, along) = (facing.axis, 1 - facing.axis);
        let mut beside = place;
        beside[axis] = if facing.up { place[axis] + 1 } else { place[axis].checked_sub(1)? };
        if beside[axis] >= cells.count(axis) || !cells.inside[cells.index(beside)] {
            return None;
        }
        let line_m = cells.lines[axis][place[axis] + usize::from(facing.up)];
        let span_m = [0, 1].map(|end| cells.lines[along][place[along] + end]);
        let upright = evidence.upright_fraction(*facing, line_m, span_m);
        let lidar = evidence.lidar_fraction(*facing, line_m, span_m);
        let beside = cells.index(beside);
        // The wall between rooms that people merged stands.
        let found = evidence.found_room(&Point2::from(cells.centre(beside)));
        let room = found.or_else(|| cells.owners[beside].first().map(|(room, _)| *room)).unwrap_or_default();
        Some(([span_m[1] - span_m[0], upright, lidar], room))
    };
    Facing::ALL.iter().filter_map(side).collect()
}

/// Returns whether an island of any shape is as thin as a wall, is longer than the leaf of a door, and shows wall at many
/// heights nearly all around. One as thick as inner walls may be by the LiDAR alone: furniture is thicker, its outline thinner.
/// One between two rooms may be thinner: the faces of two rows of cells are in the middle of the cells.
fn is_long_wall(island: &Island) -> bool {
    let length_m = island.border_m / 2.0;
    let is_as_thick = |thickness_m: RangeInclusive<f64>| thickness_m.contains(&(island.area_m2 / length_m));
    let is_seen = |seen_m: f64| seen_m >= PIER_FRACTION * island.border_m;
    length_m >= LEAF_M
        && (is_as_thick(0.0..=PIER_M) && is_seen(island.upright_m)
            || is_as_thick(SPUR_M..=PARTITION_M) && is_seen(island.lidar_m)
            || is_as_thick(DIVIDING_M..=SPUR_M) && is_seen(island.lidar_m) && is_between_rooms(island))
}

/// Returns whether two rooms of the map have much of an island's border each.
fn is_between_rooms(island: &Island) -> bool {
    let mut rooms_m: Vec<f64> =
        island.by_room_m.iter().filter(|(room, _)| **room != 0).map(|(_, length_m)| *length_m).collect();
    rooms_m.sort_by(|a, b| b.total_cmp(a));
    rooms_m.get(1).is_some_and(|second_m| *second_m >= SECOND_ROOM * island.border_m)
}

/// Returns whether the LiDAR saw most of an outline, and clips saw wall at many heights at little of it.
pub(super) fn is_unfilmed(length_m: f64, upright_m: f64, lidar_m: f64) -> bool {
    const UPRIGHT_FRACTION: f64 = 0.2;
    const LIDAR_FRACTION: f64 = 0.5;
    upright_m <= UPRIGHT_FRACTION * length_m && lidar_m >= LIDAR_FRACTION * length_m
}

/// Returns whether an island is as large as furniture, and has an outline that the LiDAR saw and no clip.
fn is_unfilmed_furniture(island: &Island) -> bool {
    // Its width is its area by half of its border. A map without an inside has no borders.
    island.border_m > 0.0
        && island.area_m2 <= MOST_FURNITURE_M2
        && island.area_m2 >= SHORTEST_FURNITURE_M * island.border_m / 2.0
        && is_unfilmed(island.border_m, island.upright_m, island.lidar_m)
}

/// Returns whether an island is a piece of wall, of which clips saw both faces at many heights; they seldom see the ceiling.
/// Thinner pieces may be open leaves of doors.
fn is_pier(cells: &Cells, evidence: &Evidence, bounds: [[usize; 2]; 2]) -> bool {
    let metres = |axis: usize| bounds[axis].map(|line| cells.lines[axis][line]);
    (0..2).any(|axis| {
        let (faces_m, span_m) = (metres(axis), metres(1 - axis));
        let thickness_m = faces_m[1] - faces_m[0];
        let shows = |up: bool| {
            let line_m = faces_m[usize::from(up)];
            evidence.upright_fraction(Facing { axis, up }, line_m, span_m) >= PIER_FRACTION
        };
        (SPUR_M..=PIER_M).contains(&thickness_m)
            && span_m[1] - span_m[0] >= PIER_RATIO * thickness_m
            && shows(false)
            && shows(true)
    })
}

/// Returns whether three sides of an island show wall up to the ceiling.
fn is_pillar(cells: &Cells, evidence: &Evidence, bounds: [[usize; 2]; 2]) -> bool {
    let metres = |axis: usize, end: usize| cells.lines[axis][bounds[axis][end]];
    let shows = |facing: &Facing| {
        let (axis, along) = (facing.axis, 1 - facing.axis);
        let line_m = metres(axis, usize::from(facing.up));
        evidence.tall_fraction(*facing, line_m, [metres(along, 0), metres(along, 1)]) >= TALL_FRACTION
    };
    Facing::ALL.iter().filter(|facing| shows(facing)).count() >= 3
}
