//! Columns of upright surface of any direction.

use viola_geometry::{Point2, Vector2};

/// Side of the cells in which points become one column.
const CELL_M: f64 = 0.03;
/// Maximum number of columns: larger homes get larger cells.
const MAX_COLUMNS: usize = 30_000;

/// A column of upright surface, or an occupied cell of the LiDAR map.
#[derive(Debug, Clone)]
pub(super) struct Upright {
    pub at: Point2,
    /// As in the columns of the evidence.
    pub bits: u32,
    /// Mean normal; zero for a cell of the LiDAR map.
    pub normal: Vector2,
}

/// Returns points as columns: the two sides of a thin wall stay apart, and so do cells of the LiDAR map.
pub(super) fn columns(points: Vec<Upright>) -> Vec<Upright> {
    let mut cell_m = CELL_M;
    let mut columns = thinned(&points, cell_m);
    while columns.len() > MAX_COLUMNS {
        cell_m *= 1.5;
        columns = thinned(&points, cell_m);
    }
    columns
}

fn thinned(points: &[Upright], cell_m: f64) -> Vec<Upright> {
    let key = |point: &Upright| {
        let side = if point.normal == Vector2::zeros() {
            8
        } else {
            // Eighths of a turn.
            ((point.normal.y.atan2(point.normal.x) / std::f64::consts::FRAC_PI_4).floor() as i64)
                .rem_euclid(8)
        };
        ((point.at.x / cell_m).floor() as i64, (point.at.y / cell_m).floor() as i64, side)
    };
    let mut keyed: Vec<_> = points.iter().map(|point| (key(point), point)).collect();
    keyed.sort_by_key(|(key, _)| *key);
    let merged = keyed.chunk_by(|a, b| a.0 == b.0).map(|same| {
        let count = same.len() as f64;
        let at = same.iter().fold(Vector2::zeros(), |sum, (_, point)| sum + point.at.coords) / count;
        let normal = same.iter().fold(Vector2::zeros(), |sum, (_, point)| sum + point.normal);
        Upright {
            at: Point2::from(at),
            bits: same.iter().fold(0, |bits, (_, point)| bits | point.bits),
            normal: normal.try_normalize(1e-9).unwrap_or_default(),
        }
    });
    merged.collect()
}
