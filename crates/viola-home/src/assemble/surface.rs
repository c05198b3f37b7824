//! A clip's thinned surface in a cell grid, for nearest-point search.

use rustc_hash::{FxHashMap, FxHashSet};
use viola_geometry::{Point3, Vector3};
use viola_reconstruct::PointCloud;

/// Side of the cells, and the search radius.
pub(super) const REACH_M: f64 = 0.15;
/// Side of the thinning cells: two voxels of the clouds.
const THIN_M: f64 = 0.06;

#[derive(Debug, Clone, Copy)]
pub(super) struct SurfacePoint {
    pub position: Point3,
    pub normal: Vector3,
    pub color: [u8; 3],
}

impl SurfacePoint {
    /// Returns whether it is upright: flat surfaces (floors, ceilings) do not constrain the planar pose.
    pub fn is_upright(&self) -> bool {
        const FLAT: f64 = 0.8;
        self.normal.z.abs() < FLAT
    }
}

/// A clip's thinned cloud, in the clip's frame.
#[derive(Debug, Clone, Default)]
pub(super) struct Surface {
    pub points: Vec<SurfacePoint>,
    cells: FxHashMap<[i32; 3], Vec<u32>>,
}

fn cell(position: &Point3, side_m: f64) -> [i32; 3] {
    [position.x, position.y, position.z].map(|c| (c / side_m).floor() as i32)
}

impl Surface {
    pub fn new(cloud: &PointCloud) -> Surface {
        let mut seen = FxHashSet::default();
        let mut surface = Surface::default();
        for point in &cloud.points {
            let position = point.position();
            if seen.insert(cell(&position, THIN_M)) {
                let number = surface.points.len() as u32;
                surface.cells.entry(cell(&position, REACH_M)).or_default().push(number);
                surface.points.push(SurfacePoint { position, normal: point.normal(), color: point.color });
            }
        }
        surface
    }

    /// Returns the nearest point within [`REACH_M`] with a similar normal; of equally near ones the first.
    pub fn nearest(&self, position: &Point3, normal: &Vector3) -> Option<&SurfacePoint> {
        const SAME_WAY: f64 = 0.7;
        let [x, y, z] = cell(position, REACH_M);
        let mut best: Option<(f64, u32)> = None;
        for key in (-1..=1)
            .flat_map(|dz| (-1..=1).flat_map(move |dy| (-1..=1).map(move |dx| [x + dx, y + dy, z + dz])))
        {
            for &number in self.cells.get(&key).into_iter().flatten() {
                let point = &self.points[number as usize];
                let squared = (point.position - position).norm_squared();
                let nearer = best.is_none_or(|(d, n)| (squared, number) < (d, n));
                if squared < REACH_M * REACH_M && nearer && point.normal.dot(normal) > SAME_WAY {
                    best = Some((squared, number));
                }
            }
        }
        best.map(|(_, number)| &self.points[number as usize])
    }

    /// Returns about `count` of its points, evenly spread.
    pub fn some(&self, count: usize) -> impl Iterator<Item = &SurfacePoint> {
        self.points.iter().step_by(self.points.len().div_ceil(count.max(1)).max(1))
    }
}
