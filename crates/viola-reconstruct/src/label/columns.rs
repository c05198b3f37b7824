//! Input of the surface network: columns of 5 cm voxels above the floor. `models/train/surfaces.py` makes the
//! same for training; both must agree.

use rustc_hash::FxHashMap;
use viola_geometry::{Point3, Vector3};

/// Side of a voxel.
pub(super) const CELL_M: f64 = 0.05;
/// Slices of a column: 2.6 m.
pub(super) const SLICES: usize = 52;
/// Slices above and below a voxel that its head sees.
const WINDOW: usize = 10;
/// Numbers of a voxel's window: occupied and normal for each slice.
pub(super) const WINDOW_NUMBERS: usize = 2 * (2 * WINDOW + 1);
/// The network halves the grid four times.
const STRIDE: usize = 16;
/// Maximum side of the grid, 51.2 m; the rest of a larger surface has no labels from the network.
const MAX_SIDE: usize = 1024;

/// The occupied voxels of a surface, and the columns that hold them.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Columns {
    pub height: usize,
    pub width: usize,
    /// `2 * SLICES` planes of `height` rows: occupied, then the mean normal's z.
    pub grid: Vec<f32>,
    /// Index of each voxel's column in a plane.
    pub column: Vec<i64>,
    pub slice: Vec<i64>,
    /// [`WINDOW_NUMBERS`] for each voxel.
    pub window: Vec<f32>,
    /// The voxel of each site, if it is inside the grid.
    pub of_site: Vec<Option<u32>>,
}

impl Columns {
    /// Returns the columns of sites in the clip frame; none if no site is inside the slices.
    pub fn new(positions_m: &[Point3], normals: &[Vector3]) -> Option<Columns> {
        let cells: Vec<[i64; 3]> =
            positions_m.iter().map(|p| [p.x, p.y, p.z].map(|c| (c / CELL_M).floor() as i64)).collect();
        let is_inside = |cell: &[i64; 3]| (0..SLICES as i64).contains(&cell[2]);
        let inside = || cells.iter().filter(|cell| is_inside(cell));
        let low = [0, 1].map(|axis| inside().map(|cell| cell[axis]).min());
        let high = [0, 1].map(|axis| inside().map(|cell| cell[axis]).max());
        let (low, high) = ([low[0]?, low[1]?], [high[0]?, high[1]?]);
        let side = |axis: usize| {
            let cells = (high[axis] - low[axis] + 1).clamp(1, MAX_SIDE as i64) as usize;
            cells.next_multiple_of(STRIDE).min(MAX_SIDE)
        };
        let (width, height) = (side(0), side(1));
        let plane = width * height;
        let mut voxels: FxHashMap<(i64, i64), u32> = FxHashMap::default();
        let (mut column, mut slice, mut sums) = (Vec::new(), Vec::new(), Vec::<(f64, u32)>::new());
        let of_site = cells.iter().zip(normals).map(|(cell, normal)| {
            let (x, y) = (cell[0] - low[0], cell[1] - low[1]);
            if !is_inside(cell) || x >= width as i64 || y >= height as i64 {
                return None;
            }
            let at = (y * width as i64 + x, cell[2]);
            let voxel = *voxels.entry(at).or_insert_with(|| {
                column.push(at.0);
                slice.push(at.1);
                sums.push((0.0, 0));
                sums.len() as u32 - 1
            });
            let (sum, count) = &mut sums[voxel as usize];
            *sum += normal.z;
            *count += 1;
            Some(voxel)
        });
        let of_site = of_site.collect();
        let mut grid = vec![0f32; 2 * SLICES * plane];
        for ((column, slice), (sum, count)) in column.iter().zip(&slice).zip(&sums) {
            let at = *slice as usize * plane + *column as usize;
            grid[at] = 1.0;
            grid[SLICES * plane + at] = (sum / f64::from(*count)) as f32;
        }
        let mut window = Vec::with_capacity(column.len() * WINDOW_NUMBERS);
        for (column, slice) in column.iter().zip(&slice) {
            for planes in [0, SLICES] {
                for step in 0..=2 * WINDOW as i64 {
                    let slice = slice + step - WINDOW as i64;
                    let is_there = (0..SLICES as i64).contains(&slice);
                    let at = || (planes + slice as usize) * plane + *column as usize;
                    window.push(if is_there { grid[at()] } else { 0.0 });
                }
            }
        }
        Some(Columns { height, width, grid, column, slice, window, of_site })
    }
}
