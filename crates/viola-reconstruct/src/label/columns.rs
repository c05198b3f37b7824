//! Input of the surface network: columns of 5 cm voxels above the floor. `models/train/voxels.py` makes the
//! same for training; both must agree.

use nalgebra::{Rotation2, Vector2};
use rayon::prelude::*;
use rustc_hash::FxHashMap;
use viola_geometry::{Point3, Vector3};

/// Side of a voxel.
pub(super) const CELL_M: f64 = 0.05;
/// Lower side of the lowest slice. The floor is in the middle of the second.
const LOW_M: f64 = -0.075;
/// Slices of a column: up to 2.925 m.
pub(super) const SLICES: usize = 60;
/// Upper side of the highest slice.
pub(super) const TOP_M: f64 = LOW_M + SLICES as f64 * CELL_M;
/// Slices above and below a voxel that its head sees.
const WINDOW: i64 = 10;
/// The columns around a column, as steps along y and x.
const AROUND: [[i64; 2]; 8] = [[-1, -1], [-1, 0], [-1, 1], [0, -1], [0, 1], [1, -1], [1, 0], [1, 1]];
/// Planes of the grid: of each slice occupied and the mean normal's z, of each two slices the half sum of its x and of
/// its y.
pub(super) const PLANES: usize = 3 * SLICES;
/// Numbers of a voxel: occupied and the normal's z for each slice of its window, the voxels around it, its own normal's
/// x and y, and those of the planes beside it.
pub(super) const VOXEL_NUMBERS: usize =
    2 * (2 * WINDOW as usize + 1) + 3 * AROUND.len() + 2 + 2 * AROUND.len();
/// The network halves the grid four times.
const STRIDE: usize = 16;
/// Maximum side of the grid, 25.6 m; the rest of a larger surface has no labels from the network. The network
/// takes half a gigabyte on the largest grid; four times as many columns take 2 GB.
const MAX_SIDE: usize = 512;

/// Placement of a surface in the grid. A home that is mirrored or turned is as likely a home, and the grid's origin is
/// nowhere in particular.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct View {
    /// The x axis of the grid is negated.
    pub mirrored: bool,
    /// Then its x and y axes are exchanged.
    pub transposed: bool,
    /// Then the surface moves by half a voxel along both.
    pub between: bool,
}

impl View {
    fn direction(&self, v: Vector2<f64>) -> Vector2<f64> {
        let v = if self.mirrored { Vector2::new(-v.x, v.y) } else { v };
        if self.transposed { v.yx() } else { v }
    }

    fn undo(&self, v: Vector2<f64>) -> Vector2<f64> {
        let v = if self.transposed { v.yx() } else { v };
        if self.mirrored { Vector2::new(-v.x, v.y) } else { v }
    }

    fn place(&self, v: Vector2<f64>) -> Vector2<f64> {
        let shift_m = if self.between { CELL_M / 2.0 } else { 0.0 };
        self.direction(v).add_scalar(shift_m)
    }
}

/// The occupied voxels of a surface, and the columns that hold them. Their grid lies along most of the walls.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Columns {
    pub height: usize,
    pub width: usize,
    /// [`PLANES`] planes of `height` rows.
    pub grid: Vec<f32>,
    /// Index of each voxel's column of 10 cm, in rows of half of `width`.
    pub column: Vec<i64>,
    /// Four times each voxel's slice, and its quarter in its column of 10 cm.
    pub place: Vec<i64>,
    /// [`VOXEL_NUMBERS`] for each voxel.
    pub own: Vec<f32>,
    /// The voxel of each site, if it is inside the grid.
    pub of_site: Vec<Option<u32>>,
}

impl Columns {
    /// Returns the columns of sites in the clip frame; none if no site is inside the slices. The network is asked about
    /// the voxels of the first `asked` sites only.
    pub fn new(positions_m: &[Point3], normals: &[Vector3], asked: usize, view: &View) -> Option<Columns> {
        let turn = Rotation2::new(-main_yaw(normals));
        let turned = |v: &Vector3| view.direction(turn * v.xy());
        let cells: Vec<[i64; 3]> = positions_m
            .iter()
            .map(|p| (view.place(turn * p.coords.xy()), p.z - LOW_M))
            .map(|(ground, z)| [ground.x, ground.y, z].map(|c| (c / CELL_M).floor() as i64))
            .collect();
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
        let mut voxels: FxHashMap<[i64; 3], u32> = FxHashMap::default();
        let (mut places, mut sums) = (Vec::<[i64; 3]>::new(), Vec::<(Vector3, u32)>::new());
        let of_site = cells.iter().zip(normals).map(|(cell, normal)| {
            let at = [cell[0] - low[0], cell[1] - low[1], cell[2]];
            if !is_inside(cell) || at[0] >= width as i64 || at[1] >= height as i64 {
                return None;
            }
            let voxel = *voxels.entry(at).or_insert_with(|| {
                places.push(at);
                sums.push((Vector3::zeros(), 0));
                sums.len() as u32 - 1
            });
            let (sum, count) = &mut sums[voxel as usize];
            *sum += normal;
            *count += 1;
            Some(voxel)
        });
        let mut of_site: Vec<Option<u32>> = of_site.collect();
        // Voxels are numbered in the order of their sites.
        of_site[asked..].fill(None);
        let asked = of_site.iter().flatten().max().map_or(0, |last| *last as usize + 1);
        let normals: Vec<Vector3> = sums.iter().map(|(sum, count)| sum / f64::from(*count)).collect();
        let index = |[x, y, slice]: [i64; 3]| slice as usize * plane + y as usize * width + x as usize;
        let level = |part: usize| 2 * SLICES + part * SLICES / 2;
        let mut grid = vec![0f32; PLANES * plane];
        for (at, normal) in places.iter().zip(&normals) {
            grid[index(*at)] = 1.0;
            grid[SLICES * plane + index(*at)] = normal.z as f32;
            let [x, y, slice] = *at;
            for (part, value) in turned(normal).iter().enumerate() {
                grid[level(part) * plane + index([x, y, slice / 2])] += (value / 2.0) as f32;
            }
        }
        let value = |[x, y, slice]: [i64; 3], planes: usize| {
            let is_there = (0..SLICES as i64).contains(&slice)
                && (0..width as i64).contains(&x)
                && (0..height as i64).contains(&y);
            if is_there { grid[planes * plane + index([x, y, slice])] } else { 0.0 }
        };
        let places = &places[..asked];
        let mut own = vec![0f32; places.len() * VOXEL_NUMBERS];
        let voxels = own.par_chunks_exact_mut(VOXEL_NUMBERS).zip(places).zip(&normals);
        voxels.for_each(|((own, &[x, y, slice]), normal)| {
            let value = &value;
            let window = [0, SLICES]
                .into_iter()
                .flat_map(|planes| (-WINDOW..=WINDOW).map(move |step| value([x, y, slice + step], planes)));
            let around = AROUND
                .into_iter()
                .flat_map(|[dy, dx]| [-1, 0, 1].map(|step| value([x + dx, y + dy, slice + step], 0)));
            let beside = AROUND
                .into_iter()
                .flat_map(|[dy, dx]| [0, 1].map(|part| value([x + dx, y + dy, slice / 2], level(part))));
            let facing = <[f64; 2]>::from(turned(normal)).map(|part| part as f32);
            let numbers = window.chain(around).chain(facing).chain(beside);
            own.iter_mut().zip(numbers).for_each(|(own, number)| *own = number);
        });
        let column = places.iter().map(|[x, y, _]| y / 2 * (width as i64 / 2) + x / 2).collect();
        let place = places.iter().map(|[x, y, slice]| 4 * slice + 2 * (y % 2) + x % 2).collect();
        Some(Columns { height, width, grid, column, place, own, of_site })
    }
}

/// Returns how vectors along the axes of the grid are turned to those of a surface with these normals.
pub(super) fn surface_from_grid(normals: &[Vector3], view: &View) -> impl Fn(&Vector3) -> Vector3 {
    let (turn, view) = (Rotation2::new(main_yaw(normals)), *view);
    move |v| {
        let ground = turn * view.undo(v.xy());
        Vector3::new(ground.x, ground.y, v.z)
    }
}

/// Returns the direction of most walls and fronts, in -45..45 degrees: the mean of four times their directions.
fn main_yaw(normals: &[Vector3]) -> f64 {
    let (mut cos4, mut sin4) = (0.0, 0.0);
    for normal in normals {
        let (x, y) = (normal.x, normal.y);
        let level = x * x + y * y;
        // Within 30 degrees of upright.
        if level > 0.75 {
            let (cos2, sin2) = ((x * x - y * y) / level, 2.0 * x * y / level);
            cos4 += cos2 * cos2 - sin2 * sin2;
            sin4 += 2.0 * cos2 * sin2;
        }
    }
    f64::atan2(sin4, cos4) / 4.0
}
