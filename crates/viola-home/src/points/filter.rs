//! Selection of a map's points.

use super::ClipNumbers;
use crate::assemble::{CLIP_AT, POINT_BYTES, TileBytes, Voxels, point_bytes, read_point};
use crate::ply::UnknownFileFormat;
use std::borrow::Cow;
use viola_geometry::taxonomy::{CLASSES, Class};

/// Selects all points by default.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PointFilter {
    /// Only these classes.
    pub classes: Option<Vec<Class>>,
    /// Only points between these corners, in the LiDAR map's frame.
    pub box_m: Option<([f32; 3], [f32; 3])>,
    /// Only points between these heights.
    pub z_m: Option<(f32, f32)>,
    /// Side of thinning voxels: one mean point per voxel. Voxels do not span tiles.
    pub voxel_m: Option<f64>,
}

impl PointFilter {
    pub fn is_everything(&self) -> bool {
        *self == PointFilter::default()
    }

    /// Returns the selected points of a tile, [`POINT_BYTES`] each, with the map's clip numbers.
    pub fn of_tile(&self, tile: &TileBytes, clips: &ClipNumbers) -> Result<Vec<u8>, UnknownFileFormat> {
        let numbers = clips.of_clips(&tile.clips);
        let mut points = self.chosen(tile).into_owned();
        for point in points.chunks_exact_mut(POINT_BYTES) {
            let local = u16::from_le_bytes([point[CLIP_AT], point[CLIP_AT + 1]]);
            let number = numbers.get(usize::from(local)).ok_or(UnknownFileFormat)?;
            point[CLIP_AT..CLIP_AT + 2].copy_from_slice(&number.to_le_bytes());
        }
        match self.voxel_m {
            Some(voxel_m) => thinned(&points, voxel_m),
            None => Ok(points),
        }
    }

    fn chosen<'a>(&self, tile: &TileBytes<'a>) -> Cow<'a, [u8]> {
        if self.classes.is_none() && self.box_m.is_none() && self.z_m.is_none() {
            return Cow::Borrowed(tile.points);
        }
        let mut wanted = [self.classes.is_none(); CLASSES];
        for class in self.classes.iter().flatten() {
            wanted[usize::from(class.id())] = true;
        }
        let everywhere = ([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]);
        let (mut min_m, mut max_m) = self.box_m.unwrap_or(everywhere);
        if let Some((low_m, high_m)) = self.z_m {
            min_m[2] = min_m[2].max(low_m);
            max_m[2] = max_m[2].min(high_m);
        }
        let mut chosen = Vec::new();
        for point in tile.points.chunks_exact(POINT_BYTES) {
            let c = |axis: usize| f32::from_le_bytes(point.as_chunks::<4>().0[axis]);
            let inside = |axis: usize| (min_m[axis]..=max_m[axis]).contains(&c(axis));
            if wanted.get(usize::from(point[27])).copied().unwrap_or(false) && (0..3).all(inside) {
                chosen.extend_from_slice(point);
            }
        }
        Cow::Owned(chosen)
    }
}

fn thinned(points: &[u8], voxel_m: f64) -> Result<Vec<u8>, UnknownFileFormat> {
    let mut points: Vec<_> =
        points.chunks_exact(POINT_BYTES).map(read_point).collect::<Result<Vec<_>, UnknownFileFormat>>()?;
    // Voxels expect one clip after the other.
    points.sort_by_key(|point| point.clip);
    let mut voxels = Voxels::new(voxel_m);
    points.iter().for_each(|point| voxels.add(&point.point, point.clip));
    Ok(voxels.into_points().iter().flat_map(point_bytes).collect())
}
