//! Connected pieces of a map's points: a long wall is better evidence than one stray cell.

use rustc_hash::FxHashMap;
use viola_geometry::{Point2, cell_of, cells_around};

/// Minimum side of the cells that connect points; points in touching cells are one piece.
const JOIN_M: f64 = 0.1;
/// The same in cells of the map, so that neighbours of a coarse map touch.
const JOIN_CELLS: f64 = 1.5;
/// Minimum extent of a piece that counts fully. Legs of chairs and tables, echoes of mirrors and stray cells are
/// shorter; a door jamb with its wall is longer.
const LONG_M: f64 = 0.6;

type Key = [i32; 2];

/// Fractions of the pieces by cell.
#[derive(Debug, Clone)]
pub(super) struct Pieces {
    join_m: f64,
    fraction_by_cell: FxHashMap<Key, f64>,
}

impl Pieces {
    /// Finds the pieces of a map's points. `cell_m` is the side of the map's cells, if it has any.
    pub fn new(points_m: &[Point2], cell_m: Option<f64>) -> Pieces {
        let join_m = JOIN_M.max(JOIN_CELLS * cell_m.unwrap_or(0.0));
        let mut bounds: FxHashMap<Key, [Point2; 2]> = FxHashMap::default();
        for point in points_m {
            let cell = bounds.entry(cell_of(point, join_m)).or_insert([*point; 2]);
            *cell = [cell[0].inf(point), cell[1].sup(point)];
        }
        let mut fraction_by_cell = FxHashMap::default();
        for &start in bounds.keys() {
            if fraction_by_cell.contains_key(&start) {
                continue;
            }
            let (piece, extent_m) = connected(start, &bounds);
            let fraction = (extent_m / LONG_M).min(1.0);
            fraction_by_cell.extend(piece.into_iter().map(|cell| (cell, fraction)));
        }
        Pieces { join_m, fraction_by_cell }
    }

    /// Returns how much the piece at a point counts, 0..1: its extent as a fraction of a long piece's. Points
    /// without a piece count fully.
    pub fn fraction(&self, point: &Point2) -> f64 {
        let cells = cells_around(cell_of(point, self.join_m));
        let near = cells.filter_map(|cell| self.fraction_by_cell.get(&cell).copied());
        near.reduce(f64::max).unwrap_or(1.0)
    }
}

/// Returns the cells of the piece that contains `start`, and the diagonal of their bounding box.
fn connected(start: Key, bounds: &FxHashMap<Key, [Point2; 2]>) -> (Vec<Key>, f64) {
    let mut piece = vec![start];
    let mut known: rustc_hash::FxHashSet<Key> = [start].into_iter().collect();
    let mut next = 0;
    while let Some(&cell) = piece.get(next) {
        next += 1;
        piece.extend(cells_around(cell).filter(|near| bounds.contains_key(near) && known.insert(*near)));
    }
    let boxes = piece.iter().filter_map(|cell| bounds.get(cell).copied());
    let all = boxes.reduce(|a, b| [a[0].inf(&b[0]), a[1].sup(&b[1])]);
    let extent_m = all.map_or(0.0, |[low, high]| (high - low).norm());
    (piece, extent_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns points every 5 cm from `from` along x.
    fn row(from: [f64; 2], count: i32) -> Vec<Point2> {
        (0..count).map(|i| Point2::new(from[0] + 0.05 * f64::from(i), from[1])).collect()
    }

    #[test]
    fn a_short_piece_counts_as_its_extent() {
        // A wall of 1 m, a piece of 0.3 m and a single cell, each more than 20 cm from the others.
        let points = [row([0.0, 0.0], 21), row([2.0, 0.0], 7), row([4.0, 0.0], 1)].concat();
        let pieces = Pieces::new(&points, None);
        for (at, want) in [(0.5, 1.0), (2.1, 0.5), (4.0, 0.0), (3.2, 1.0)] {
            let fraction = pieces.fraction(&Point2::new(at, 0.01));
            assert!((fraction - want).abs() < 1e-9, "{at} {fraction}");
        }
    }

    #[test]
    fn a_wall_of_a_coarse_map_is_one_piece() {
        for cell_m in [0.1, 0.12, 0.15, 0.2, 0.25, 1.0] {
            let wall: Vec<Point2> =
                (0..200).map(|i| Point2::new(cell_m * f64::from(i) - 10.05, 0.3)).collect();
            let pieces = Pieces::new(&wall, Some(cell_m));
            assert!(wall.iter().all(|at| pieces.fraction(at) == 1.0), "{cell_m}");
        }
    }

    #[test]
    fn touching_pieces_are_one() {
        let points = [row([0.0, 0.0], 7), row([0.3, 0.1], 9)].concat();
        assert_eq!(Pieces::new(&points, Some(0.05)).fraction(&Point2::new(0.0, 0.0)), 1.0);
    }
}
