//! A clip's thinned surface in a cell grid, for nearest-point search.

use rustc_hash::{FxHashMap, FxHashSet};
use std::ops::Range;
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
    /// Cells and numbers of the points, row by row: by z, y, x.
    sorted: Vec<([i32; 3], u32)>,
    /// The part of `sorted` that is in each row, by z and y.
    rows: FxHashMap<[i32; 2], Range<u32>>,
}

/// Returns the cell of a point in a grid whose origin is a corner of cell `[0, 0, 0]`.
pub(super) fn cell(position: &Point3, side_m: f64) -> [i32; 3] {
    [position.x, position.y, position.z].map(|c| (c / side_m).floor() as i32)
}

impl Surface {
    pub fn new(cloud: &PointCloud) -> Surface {
        let mut seen = FxHashSet::default();
        let mut surface = Surface::default();
        for point in &cloud.points {
            let position = point.position();
            if seen.insert(cell(&position, THIN_M)) {
                let [x, y, z] = cell(&position, REACH_M);
                surface.sorted.push(([z, y, x], surface.points.len() as u32));
                surface.points.push(SurfacePoint { position, normal: point.normal(), color: point.color });
            }
        }
        surface.sorted.sort_unstable();
        let mut from = 0;
        for row in
            surface.sorted.chunk_by(|([z, y, _], _), ([other_z, other_y, _], _)| (z, y) == (other_z, other_y))
        {
            let [z, y, _] = row[0].0;
            let to = from + row.len() as u32;
            surface.rows.insert([z, y], from..to);
            from = to;
        }
        surface
    }

    /// Returns the nearest point within [`REACH_M`] with a similar normal; of equally near ones the first.
    pub fn nearest(&self, position: &Point3, normal: &Vector3) -> Option<&SurfacePoint> {
        const SAME_WAY: f64 = 0.7;
        let [x, y, z] = cell(position, REACH_M);
        let mut best: Option<(f64, u32)> = None;
        for [z, y] in (-1..=1).flat_map(|dz| (-1..=1).map(move |dy| [z + dz, y + dy])) {
            let Some(row) = self.rows.get(&[z, y]) else { continue };
            let row = &self.sorted[row.start as usize..row.end as usize];
            let from = row.partition_point(|([.., at], _)| *at < x - 1);
            for (_, number) in row[from..].iter().take_while(|([.., at], _)| *at <= x + 1) {
                let point = &self.points[*number as usize];
                let squared = (point.position - position).norm_squared();
                let nearer = best.is_none_or(|(d, n)| (squared, *number) < (d, n));
                if squared < REACH_M * REACH_M && nearer && point.normal.dot(normal) > SAME_WAY {
                    best = Some((squared, *number));
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use viola_reconstruct::{CloudPoint, Label};

    proptest! {
        /// Against a search of all points.
        #[test]
        fn the_nearest_point_is_found(
            places in prop::collection::vec(prop::array::uniform3(-0.5..0.5f32), 1..200),
            from in prop::array::uniform3(-0.6..0.6f64),
        ) {
            let point = |(number, position_m): (usize, &[f32; 3])| CloudPoint {
                position_m: *position_m,
                normal: if number.is_multiple_of(3) { [1.0, 0.0, 0.0] } else { [0.0, 0.0, 1.0] },
                color: [number as u8; 3],
                label: Label::NONE,
                weight: 1,
            };
            let points = places.iter().enumerate().map(point).collect();
            let surface = Surface::new(&PointCloud { points, voxel_m: 0.03 });
            let (from, up) = (Point3::from(from), Vector3::z());
            let near = surface.points.iter().filter(|point| point.normal == up);
            let distance = |point: &SurfacePoint| (point.position - from).norm();
            let nearest = near.filter(|point| distance(point) < REACH_M).min_by(|a, b| distance(a).total_cmp(&distance(b)));
            let found = surface.nearest(&from, &up);
            prop_assert_eq!(found.map(|point| point.position), nearest.map(|point| point.position));
        }
    }
}
