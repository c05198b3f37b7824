//! Stray cells and points of a map: reflections far away from the rest of the home.

use super::Cell;
use rustc_hash::FxHashMap;
use viola_geometry::{Grid, Point2, cells_around};

/// Side of the squares in which points and free cells are counted. Empty squares separate parts of a map.
const SQUARE_M: f64 = 10.0;
/// A part with less than this fraction of the largest one's count is stray.
const MIN_SIZE_FRACTION: f64 = 0.01;
/// A map with more squares is no home, and is refused by its extent.
const MAX_SQUARES: usize = 10_000;

type Square = [i32; 2];

fn square(point: &Point2) -> Square {
    [point.x, point.y].map(|c| (c / SQUARE_M).floor() as i32)
}

/// Drops the stray points, and makes the stray cells unknown. Returns the number of dropped points.
pub(super) fn drop_strays(occupied_m: &mut Vec<Point2>, cells: Option<&mut Grid<Cell>>) -> usize {
    let free = cells.iter().flat_map(|grid| {
        let frame = grid.frame;
        let free = grid.cells.iter().enumerate().filter(|(_, cell)| **cell == Cell::Free);
        free.map(move |(index, _)| square(&frame.centre(index % frame.width, index / frame.width)))
    });
    let Some(counts) = counted(occupied_m.iter().map(square).chain(free)) else { return 0 };
    let squares = counts.len();
    let home = without_small_parts(counts);
    if home.len() == squares {
        return 0;
    }
    let is_stray = |point: &Point2| !home.contains_key(&square(point));
    let all = occupied_m.len();
    occupied_m.retain(|point| !is_stray(point));
    if let Some(grid) = cells {
        let frame = grid.frame;
        for (index, cell) in grid.cells.iter_mut().enumerate().filter(|(_, cell)| **cell != Cell::Unknown) {
            if is_stray(&frame.centre(index % frame.width, index / frame.width)) {
                *cell = Cell::Unknown;
            }
        }
    }
    all - occupied_m.len()
}

/// Returns the count of each square; `None` if there are none or too many.
fn counted(squares: impl Iterator<Item = Square>) -> Option<FxHashMap<Square, usize>> {
    let mut counts: FxHashMap<Square, usize> = FxHashMap::default();
    let mut run: Option<(Square, usize)> = None;
    // Cells come row by row, in long runs of one square.
    for square in squares {
        match &mut run {
            Some((last, count)) if *last == square => *count += 1,
            _ => {
                let (last, count) = run.replace((square, 1)).unwrap_or((square, 0));
                *counts.entry(last).or_default() += count;
                if counts.len() > MAX_SQUARES {
                    return None;
                }
            }
        }
    }
    let (last, count) = run?;
    *counts.entry(last).or_default() += count;
    Some(counts)
}

/// Returns the squares of the parts that are large enough.
fn without_small_parts(mut counts: FxHashMap<Square, usize>) -> FxHashMap<Square, usize> {
    let mut parts: Vec<Vec<(Square, usize)>> = Vec::new();
    let mut squares: Vec<Square> = counts.keys().copied().collect();
    squares.sort_unstable();
    for first in squares {
        let Some(count) = counts.remove(&first) else { continue };
        let (mut open, mut part) = (vec![first], vec![(first, count)]);
        while let Some(square) = open.pop() {
            for next in cells_around(square) {
                if let Some(count) = counts.remove(&next) {
                    open.push(next);
                    part.push((next, count));
                }
            }
        }
        parts.push(part);
    }
    let size = |part: &Vec<(Square, usize)>| part.iter().map(|(_, count)| count).sum::<usize>();
    let largest = parts.iter().map(size).max().unwrap_or(0);
    parts.retain(|part| size(part) as f64 >= MIN_SIZE_FRACTION * largest as f64);
    parts.into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lidar::LidarMap;
    use viola_geometry::GridFrame;

    /// Returns the outline of a room of 5 by 4 m, every 2 cm.
    fn room() -> Vec<Point2> {
        let along = (0..200).map(|i| f64::from(i) * 0.02);
        along
            .flat_map(|t| [[t, 0.0], [t + 1.0, 4.0], [0.0, t], [5.0, t]])
            .map(|[x, y]| Point2::new(x, y))
            .collect()
    }

    #[test]
    fn a_stray_point_is_dropped_and_told() {
        for stray in [[150.0, 150.0], [-40.0, 2.0], [9e4, -9e4]] {
            let points = room().into_iter().chain([stray.into()]);
            let csv: String = points.map(|p| format!("{},{}\n", p.x, p.y)).collect();
            let map = LidarMap::read(csv.as_bytes()).unwrap();
            assert_eq!((map.info.min_m, map.info.max_m), ([0.0, 0.0], [5.0, 4.0]), "{stray:?}");
            assert!(map.info.notes.iter().any(|note| note.starts_with("1 points")), "{:?}", map.info.notes);
        }
    }

    #[test]
    fn parts_of_a_home_are_kept() {
        // A shed 60 m away, and a mirror's ghost beyond a window.
        let shed = room().into_iter().step_by(8).map(|p| Point2::new(p.x + 60.0, p.y));
        let ghost = Point2::new(-9.0, 2.0);
        let mut points: Vec<Point2> = room().into_iter().chain(shed).chain([ghost]).collect();
        assert_eq!(drop_strays(&mut points, None), 0);
        // Two points are two parts of the same size.
        let mut two = vec![Point2::origin(), Point2::new(1e5, 0.0)];
        assert_eq!((drop_strays(&mut two, None), two.len()), (0, 2));
        assert_eq!(drop_strays(&mut Vec::new(), None), 0);
        let mut everywhere = (0..20_000).map(|i| Point2::new(100.0 * f64::from(i), 0.0)).collect();
        assert_eq!(drop_strays(&mut everywhere, None), 0);
    }

    #[test]
    fn stray_cells_become_unknown() {
        let frame = GridFrame { origin_m: [0.0, 0.0], cell_m: 0.05, width: 1000, height: 100 };
        let mut grid = Grid::filled(frame, Cell::Unknown);
        (0..80).for_each(|y| (0..80).for_each(|x| grid.set(x, y, Cell::Free)));
        grid.set(0, 0, Cell::Occupied);
        grid.set(900, 50, Cell::Occupied);
        grid.set(901, 50, Cell::Free);
        let mut points = vec![frame.centre(0, 0), frame.centre(900, 50)];
        assert_eq!(drop_strays(&mut points, Some(&mut grid)), 1);
        assert_eq!(points, [frame.centre(0, 0)]);
        assert_eq!(grid.cells.iter().filter(|cell| **cell != Cell::Unknown).count(), 80 * 80);
    }
}
