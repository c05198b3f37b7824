//! Areas covered by rectangles along the axes: robots clean rectangles.

use crate::rooms::Room;
use viola_geometry::{Grid, GridFrame};

/// Maximum number of rectangles of an area: Roborock's robots take five zones at a time
/// (Hypfer/Valetudo, `RoborockZoneCleaningCapability.js`).
pub const MAX_RECTANGLES: usize = 5;
/// Side of the cells; larger areas get larger cells.
const CELL_M: f64 = 0.05;
const MAX_CELLS: f64 = 1e6;
/// Minimum side of a rectangle: about the width of a robot.
const MIN_SIDE_M: f64 = 0.3;
/// Covered fraction at which no further rectangle is added.
const ENOUGH: f64 = 0.98;

/// A rectangle along the axes, in metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rectangle {
    pub low_m: [f64; 2],
    pub high_m: [f64; 2],
}

/// Rectangles in an area, and the fraction of the area that they cover.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Cover {
    pub rectangles: Vec<Rectangle>,
    pub covered: f64,
}

/// Returns the border and the holes of an area.
pub fn rings<'a>(border_m: &'a [[f64; 2]], holes_m: &'a [Vec<[f64; 2]>]) -> Vec<&'a [[f64; 2]]> {
    std::iter::once(border_m).chain(holes_m.iter().map(Vec::as_slice)).collect()
}

/// Returns the lower and the upper corner of the box around points.
pub fn box_around(points_m: &[[f64; 2]]) -> [[f64; 2]; 2] {
    let extreme = |pick: fn(f64, f64) -> f64, start: f64| {
        [0, 1].map(|axis| points_m.iter().map(|point| point[axis]).fold(start, pick))
    };
    [extreme(f64::min, f64::INFINITY), extreme(f64::max, f64::NEG_INFINITY)]
}

/// Returns where the edges of rings cross the height `y`, in ascending order. A point is inside if an odd number of
/// crossings lies left of it.
fn crossings(rings: &[&[[f64; 2]]], y: f64) -> Vec<f64> {
    let mut at = Vec::new();
    for ring in rings {
        for (a, b) in ring.iter().zip(ring.iter().cycle().skip(1)) {
            if (a[1] > y) != (b[1] > y) {
                at.push(a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]));
            }
        }
    }
    at.sort_by(f64::total_cmp);
    at
}

/// Calls `each` with the index of every cell whose centre is inside of rings.
pub fn for_cells(frame: &GridFrame, rings: &[&[[f64; 2]]], mut each: impl FnMut(usize)) {
    let heights = || rings.iter().flat_map(|ring| ring.iter().map(|corner| corner[1]));
    // The first cell whose centre is beyond a coordinate; casts saturate.
    let cell =
        |axis: usize, m: f64| ((m - frame.origin_m[axis]) / frame.cell_m - 0.5).ceil().max(0.0) as usize;
    let first = cell(1, heights().fold(f64::INFINITY, f64::min));
    let last = cell(1, heights().fold(f64::NEG_INFINITY, f64::max));
    for y in first..last.min(frame.height) {
        for pair in crossings(rings, frame.centre(0, y).y).chunks_exact(2) {
            for x in cell(0, pair[0])..cell(0, pair[1]).min(frame.width) {
                each(y * frame.width + x);
            }
        }
    }
}

/// Returns whether the crossings leave the stretch from `low` to `high` inside.
fn is_inside(crossings: &[f64], low: f64, high: f64) -> bool {
    let left = crossings.partition_point(|x| *x <= low);
    left % 2 == 1 && crossings.get(left).is_some_and(|x| *x >= high)
}

/// Returns for each cell of a frame the number of the room that holds its centre: 1 for the first, 0 for none.
pub fn owners(frame: GridFrame, rooms: &[Room]) -> Grid<u16> {
    let mut owners = Grid::filled(frame, 0u16);
    for (number, room) in (1..).zip(rooms) {
        for_cells(&frame, &rings(&room.polygon_m, &room.holes_m), |index| owners.cells[index] = number);
    }
    owners
}

/// Covers the part of a box in a room; the whole box without a room. No rectangle leaves the room.
pub fn cover(low_m: [f64; 2], high_m: [f64; 2], room: Option<&Room>) -> Cover {
    let Some(room) = room else {
        return Cover { rectangles: vec![Rectangle { low_m, high_m }], covered: 1.0 };
    };
    let [room_low_m, room_high_m] = box_around(&room.polygon_m);
    let low = [0, 1].map(|axis| low_m[axis].max(room_low_m[axis]));
    let high = [0, 1].map(|axis| high_m[axis].min(room_high_m[axis]));
    let size = [0, 1].map(|axis| high[axis] - low[axis]);
    // Also false for a room without corners.
    if !(size[0] > 0.0 && size[1] > 0.0) {
        return Cover::default();
    }
    let cell_m = CELL_M.max((size[0] * size[1] / MAX_CELLS).sqrt());
    let [width, height] = size.map(|side| (side / cell_m - 1e-9).ceil().max(1.0) as usize);
    let frame = GridFrame { origin_m: low, cell_m, width, height };
    let mut inside = inside(&frame, high, &rings(&room.polygon_m, &room.holes_m));
    let all = inside.cells.iter().filter(|cell| **cell).count();
    let mut cover = Cover::default();
    let mut covered = 0;
    let least = (MIN_SIDE_M / cell_m).ceil().max(1.0) as usize;
    while cover.rectangles.len() < MAX_RECTANGLES && (covered as f64) < ENOUGH * all as f64 {
        let Some([x, y, w, h]) = largest(&inside, least.min(width).min(height)) else { break };
        for row in y..y + h {
            inside.cells[row * width + x..][..w].fill(false);
        }
        covered += w * h;
        let edge = |axis: usize, cells: usize| (low[axis] + cells as f64 * cell_m).min(high[axis]);
        cover
            .rectangles
            .push(Rectangle { low_m: [edge(0, x), edge(1, y)], high_m: [edge(0, x + w), edge(1, y + h)] });
    }
    cover.covered = if all > 0 { covered as f64 / all as f64 } else { 0.0 };
    cover
}

/// Returns the cells that lie inside as a whole; those at the upper borders end at `high`.
fn inside(frame: &GridFrame, high: [f64; 2], rings: &[&[[f64; 2]]]) -> Grid<bool> {
    // Edges along the border of a cell do not cut it.
    const EDGE_M: f64 = 1e-6;
    let mut inside = Grid::filled(*frame, false);
    for y in 0..frame.height {
        let from = frame.origin_m[1] + y as f64 * frame.cell_m;
        let rows = [from + EDGE_M, (from + frame.cell_m).min(high[1]) - EDGE_M].map(|y| crossings(rings, y));
        for x in 0..frame.width {
            let from = frame.origin_m[0] + x as f64 * frame.cell_m;
            let to = (from + frame.cell_m).min(high[0]) - EDGE_M;
            inside.set(x, y, rows.iter().all(|row| is_inside(row, from + EDGE_M, to)));
        }
    }
    inside
}

/// Returns the largest rectangle of set cells with sides of at least `least` cells, as x, y, width and height.
fn largest(mask: &Grid<bool>, least: usize) -> Option<[usize; 4]> {
    let (width, height) = (mask.frame.width, mask.frame.height);
    let mut best = None;
    let mut best_area = 0;
    let mut heights = vec![0; width];
    for y in 0..height {
        for (x, column) in heights.iter_mut().enumerate() {
            *column = if mask.get(x, y) { *column + 1 } else { 0 };
        }
        // Columns of ascending heights, each with the first x that it reaches back to.
        let mut open: Vec<(usize, usize)> = Vec::new();
        for x in 0..=width {
            let column = heights.get(x).copied().unwrap_or(0);
            let mut start = x;
            while let Some(&(from, tall)) = open.last().filter(|(_, tall)| *tall >= column) {
                open.pop();
                start = from;
                let (w, area) = (x - from, (x - from) * tall);
                if area > best_area && w >= least && tall >= least {
                    best_area = area;
                    best = Some([from, y + 1 - tall, w, tall]);
                }
            }
            open.push((start, column));
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An L of 4 m x 2 m and 2 m x 2 m above its left half, 12 m2.
    fn corner_room() -> Room {
        let polygon_m = vec![[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [2.0, 2.0], [2.0, 4.0], [0.0, 4.0]];
        Room { polygon_m, area_m2: 12.0, ..Room::rectangle("l", [0.0; 2], [4.0; 2]) }
    }

    #[test]
    fn an_l_is_two_rectangles_in_it() {
        let room = corner_room();
        let cover = cover([-9.0; 2], [9.0; 2], Some(&room));
        assert_eq!((cover.rectangles.len(), cover.covered), (2, 1.0));
        let area = |r: &Rectangle| (r.high_m[0] - r.low_m[0]) * (r.high_m[1] - r.low_m[1]);
        let total: f64 = cover.rectangles.iter().map(area).sum();
        assert!((total - 12.0).abs() < 1e-6, "{cover:?}");
    }

    #[test]
    fn a_turned_room_holds_its_rectangles() {
        let polygon_m = vec![[0.0, -3.0], [3.0, 0.0], [0.0, 3.0], [-3.0, 0.0]];
        let room = Room { polygon_m, ..corner_room() };
        let cover = cover([-1.0, -9.0], [9.0; 2], Some(&room));
        assert!(cover.covered > 0.6 && cover.rectangles.len() == MAX_RECTANGLES, "{cover:?}");
        for Rectangle { low_m, high_m } in &cover.rectangles {
            for corner in [*low_m, *high_m, [low_m[0], high_m[1]], [high_m[0], low_m[1]]] {
                assert!(corner[0].abs() + corner[1].abs() <= 3.0 + 1e-6 && corner[0] >= -1.0, "{corner:?}");
            }
        }
    }

    /// A robot that takes fewer zones gets the first ones.
    #[test]
    fn rectangles_come_largest_first() {
        // Columns 3, 1 and 2 m high.
        let steps = vec![
            [0.0, 0.0],
            [6.0, 0.0],
            [6.0, 2.0],
            [4.0, 2.0],
            [4.0, 1.0],
            [3.0, 1.0],
            [3.0, 3.0],
            [0.0, 3.0],
        ];
        let turned = vec![[0.0, -3.0], [3.0, 0.0], [0.0, 3.0], [-3.0, 0.0]];
        for (polygon_m, count) in [(steps, 3), (turned, MAX_RECTANGLES)] {
            let cover = cover([-9.0; 2], [9.0; 2], Some(&Room { polygon_m, ..corner_room() }));
            let area = |r: &Rectangle| (r.high_m[0] - r.low_m[0]) * (r.high_m[1] - r.low_m[1]);
            let areas: Vec<f64> = cover.rectangles.iter().map(area).collect();
            assert_eq!(areas.len(), count, "{areas:?}");
            assert!(areas.windows(2).all(|pair| pair[0] >= pair[1] - 1e-9), "{areas:?}");
        }
    }

    #[test]
    fn boxes_outside_the_room_have_no_rectangles() {
        assert_eq!(cover([5.0; 2], [6.0; 2], Some(&corner_room())), Cover::default());
        assert_eq!(cover([2.5; 2], [3.5; 2], Some(&corner_room())).rectangles, []);
        let empty = Room { polygon_m: vec![], ..corner_room() };
        assert_eq!(cover([0.0; 2], [6.0; 2], Some(&empty)), Cover::default());
    }

    #[test]
    fn cells_belong_to_the_room_that_holds_their_centre() {
        let frame = GridFrame { origin_m: [-0.5, -0.5], cell_m: 1.0, width: 6, height: 6 };
        let hole = vec![[0.5, 0.5], [0.5, 1.5], [1.5, 1.5], [1.5, 0.5]];
        let room = Room { holes_m: vec![hole], ..corner_room() };
        let owners = owners(frame, &[Room::rectangle("a", [4.1, 4.1], [5.4, 5.4]), room.clone()]);
        for y in 0..6 {
            for x in 0..6 {
                let centre = frame.centre(x, y);
                // Centres on an edge belong to either side.
                let is_on_edge = [0.0, 2.0, 4.0].iter().any(|edge| centre.x == *edge || centre.y == *edge);
                if !is_on_edge {
                    let want = if room.contains(&centre) { 2 } else { u16::from(x == 5 && y == 5) };
                    assert_eq!(owners.get(x, y), want, "{centre:?}");
                }
            }
        }
    }
}
