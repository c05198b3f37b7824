//! The maps that a fuzzed input may write as cells: a wide one only takes time.
//!
//! The writer of the seeds (tests/readers/fuzz_seeds.rs) includes this file, so that every map among them is written.

use viola_formats::lidar::LidarMap;

/// A home of 250 m2 in cells of 5 cm.
const MAX_CELLS: f64 = 1e5;
/// Side of the cells that points become.
const CELL_M: f64 = 0.05;

/// Returns whether a map has few cells as it is written: its own, or those of its points.
pub fn is_small(map: &LidarMap) -> bool {
    let cell_m = map.info.cell_m.unwrap_or(CELL_M).min(CELL_M);
    // A cell may begin before the box, and another one end behind it.
    let cells = |axis: usize| (map.info.max_m[axis] - map.info.min_m[axis]) / cell_m + 2.0;
    cells(0) * cells(1) <= MAX_CELLS
}
