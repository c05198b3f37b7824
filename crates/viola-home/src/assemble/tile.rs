//! Square tiles of the map: a local change rewrites only its own tiles.

use super::content::Content;
use crate::ply::{HEAD_BYTES, UnknownFileFormat, class_of, head_bytes, read_head};
use crate::{MAP_VOXEL_M, MapPoint};
use serde::{Deserialize, Serialize};
use uuid::Uuid;
use viola_geometry::LevelName;
use viola_geometry::taxonomy::{CLASSES, Class};
use viola_reconstruct::Label;
use viola_reconstruct::cloud::OTHER_CLASSES;

/// Voxels along a tile's side (2.4 m): a room has a few tiles, and a clip touches about ten.
pub const TILE_VOXELS: i32 = 80;

/// Index of a tile: its level, and its place in units of a tile's side in the level's LiDAR map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct TileKey {
    #[serde(default, skip_serializing_if = "LevelName::is_main")]
    pub level: LevelName,
    pub x: i32,
    pub y: i32,
}

impl TileKey {
    pub fn side_m() -> f64 {
        f64::from(TILE_VOXELS) * MAP_VOXEL_M
    }

    /// Returns the tile that contains a point of a level's map.
    pub fn at(level: LevelName, x_m: f64, y_m: f64) -> TileKey {
        TileKey { level, x: (x_m / Self::side_m()).floor() as i32, y: (y_m / Self::side_m()).floor() as i32 }
    }

    pub(super) fn of_voxel(level: LevelName, voxel: &[i32; 3]) -> TileKey {
        TileKey { level, x: voxel[0].div_euclid(TILE_VOXELS), y: voxel[1].div_euclid(TILE_VOXELS) }
    }
}

/// Points of one tile, one per voxel, in voxel order. A point's `clip` is an index into `clips`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Tile {
    /// Source clips of its points, in the map's canonical order.
    pub clips: Vec<Uuid>,
    /// With the labels of the map.
    pub points: Vec<MapPoint>,
    /// The labels of the points by their clips alone, from which those of the map are made.
    pub of_clips: Vec<Label>,
}

/// Summary of a tile.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TileInfo {
    pub points: usize,
    pub min_m: [f32; 3],
    pub max_m: [f32; 3],
    /// Points by class id.
    pub classes: Vec<usize>,
    #[serde(default)]
    pub content: Content,
}

const MAGIC: &[u8; 8] = b"violat02";
/// Files of the previous version lack the labels by the clips alone.
const MAGIC_01: &[u8; 8] = b"violat01";
/// Bytes of a label by the clips: pairs of class and fraction.
const LABEL_BYTES: usize = 2 * (1 + OTHER_CLASSES);
/// Bytes of a point in tiles and in a map's PLY.
pub const POINT_BYTES: usize = HEAD_BYTES + 4;
/// Byte offset of the clip number in a point.
pub const CLIP_AT: usize = HEAD_BYTES;

impl Tile {
    pub fn info(&self, key: &TileKey) -> TileInfo {
        let mut info = TileInfo {
            points: self.points.len(),
            min_m: [f32::INFINITY; 3],
            max_m: [f32::NEG_INFINITY; 3],
            classes: vec![0; CLASSES],
            content: Content::of(key, self),
        };
        for MapPoint { point, .. } in &self.points {
            info.classes[usize::from(point.label.class.id())] += 1;
            for axis in 0..3 {
                info.min_m[axis] = info.min_m[axis].min(point.position_m[axis]);
                info.max_m[axis] = info.max_m[axis].max(point.position_m[axis]);
            }
        }
        info
    }

    pub fn to_bytes(&self) -> Vec<u8> {
        let of_point = POINT_BYTES + LABEL_BYTES;
        let mut out = Vec::with_capacity(16 + self.clips.len() * 16 + self.points.len() * of_point);
        out.extend_from_slice(MAGIC);
        out.extend_from_slice(&(self.clips.len() as u32).to_le_bytes());
        out.extend_from_slice(&(self.points.len() as u32).to_le_bytes());
        self.clips.iter().for_each(|clip| out.extend_from_slice(clip.as_bytes()));
        self.points.iter().for_each(|point| out.extend_from_slice(&point_bytes(point)));
        self.of_clips.iter().for_each(|label| out.extend_from_slice(&label_bytes(label)));
        out
    }

    pub fn read(bytes: &[u8]) -> Result<Tile, UnknownFileFormat> {
        let TileBytes { clips, points, of_clips } = TileBytes::read(bytes)?;
        let points: Result<Vec<MapPoint>, UnknownFileFormat> =
            points.chunks_exact(POINT_BYTES).map(read_point).collect();
        let points = points?;
        if points.iter().any(|point| usize::from(point.clip) >= clips.len()) {
            return Err(UnknownFileFormat);
        }
        let label = |(point, bytes): (&MapPoint, &[u8])| read_label(bytes, point.point.label.views);
        let of_clips = match of_clips {
            Some(bytes) => points.iter().zip(bytes.chunks_exact(LABEL_BYTES)).map(label).collect(),
            None => Ok(points.iter().map(|point| point.point.label).collect()),
        };
        Ok(Tile { clips, points, of_clips: of_clips? })
    }
}

/// A tile with packed points.
pub struct TileBytes<'a> {
    pub clips: Vec<Uuid>,
    /// [`POINT_BYTES`] each.
    pub points: &'a [u8],
    /// [`LABEL_BYTES`] for each point; `None` in files of the previous version.
    of_clips: Option<&'a [u8]>,
}

impl<'a> TileBytes<'a> {
    pub fn read(bytes: &'a [u8]) -> Result<TileBytes<'a>, UnknownFileFormat> {
        let (magic, rest) = bytes.split_at_checked(MAGIC.len()).ok_or(UnknownFileFormat)?;
        if magic != MAGIC && magic != MAGIC_01 {
            return Err(UnknownFileFormat);
        }
        let (head, rest) = rest.split_at_checked(8).ok_or(UnknownFileFormat)?;
        let count =
            |at: usize| u32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]) as usize;
        let part = |rest: &'a [u8], count: usize, bytes: usize| {
            rest.split_at_checked(count.checked_mul(bytes).ok_or(UnknownFileFormat)?).ok_or(UnknownFileFormat)
        };
        let (clips, rest) = part(rest, count(0), 16)?;
        let (points, rest) = part(rest, count(4), POINT_BYTES)?;
        let (of_clips, rest) =
            if magic == MAGIC { part(rest, count(4), LABEL_BYTES)? } else { (&rest[..0], rest) };
        if !rest.is_empty() {
            return Err(UnknownFileFormat);
        }
        let clips: Result<Vec<Uuid>, _> = clips.chunks_exact(16).map(Uuid::from_slice).collect();
        let of_clips = (magic == MAGIC).then_some(of_clips);
        Ok(TileBytes { clips: clips.map_err(|_| UnknownFileFormat)?, points, of_clips })
    }
}

pub(super) fn label_bytes(label: &Label) -> [u8; LABEL_BYTES] {
    let mut bytes = [0; LABEL_BYTES];
    for (pair, (class, fraction)) in bytes.chunks_exact_mut(2).zip(label.fractions()) {
        pair.copy_from_slice(&[class.id() as u8, fraction]);
    }
    bytes
}

/// Inverse of [`label_bytes`]; the number of views is that of the point.
fn read_label(bytes: &[u8], views: u16) -> Result<Label, UnknownFileFormat> {
    let mut fractions = [(Class::Other, 0); 1 + OTHER_CLASSES];
    for (place, [class, fraction]) in fractions.iter_mut().zip(bytes.as_chunks::<2>().0) {
        *place = (class_of(*class)?, *fraction);
    }
    let [(class, fraction), others @ ..] = fractions;
    Ok(Label::new(class, f32::from(fraction) / 255.0, views).with_fractions(others))
}

/// Returns a point's bytes as in tiles and PLY files, little endian.
pub fn point_bytes(map_point: &MapPoint) -> [u8; POINT_BYTES] {
    let MapPoint { point, clip } = map_point;
    let mut bytes = [0; POINT_BYTES];
    bytes[..HEAD_BYTES].copy_from_slice(&head_bytes(point));
    bytes[CLIP_AT..CLIP_AT + 2].copy_from_slice(&clip.to_le_bytes());
    bytes[CLIP_AT + 2..].copy_from_slice(&point.weight.to_le_bytes());
    bytes
}

/// Inverse of [`point_bytes`].
pub fn read_point(bytes: &[u8]) -> Result<MapPoint, UnknownFileFormat> {
    let (head, rest) = bytes.split_first_chunk().ok_or(UnknownFileFormat)?;
    let [a, b, c, d] = *rest else { return Err(UnknownFileFormat) };
    let point = read_head(head, u16::from_le_bytes([c, d]))?;
    Ok(MapPoint { point, clip: u16::from_le_bytes([a, b]) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use viola_reconstruct::CloudPoint;

    fn tile() -> Tile {
        let point = |i: u16| MapPoint {
            point: CloudPoint {
                position_m: [f32::from(i) * 0.1, -1.5, 0.25],
                normal: [0.0, 0.6, -0.8],
                color: [i as u8, 2, 3],
                label: Label::new(Class::ALL[usize::from(i) % CLASSES], 0.4, i),
                weight: 3 * i,
            },
            clip: i % 2,
        };
        let points: Vec<MapPoint> = (0..50).map(point).collect();
        let of_clips = |point: &MapPoint| {
            Label::new(Class::Bed, 0.5, point.point.label.views).with_others([(Class::Sofa, 0.3)])
        };
        let of_clips = points.iter().map(of_clips).collect();
        Tile { clips: vec![Uuid::from_u128(7), Uuid::from_u128(9)], points, of_clips }
    }

    #[test]
    fn what_is_written_is_read() {
        assert_eq!(Tile::read(&tile().to_bytes()), Ok(tile()));
        assert_eq!(Tile::read(&Tile::default().to_bytes()), Ok(Tile::default()));
        let info = tile().info(&TileKey { level: LevelName::MAIN, x: 0, y: 0 });
        assert_eq!((info.points, info.classes.iter().sum::<usize>()), (50, 50));
        assert_eq!(info.min_m, [0.0, -1.5, 0.25]);
    }

    #[test]
    fn files_of_the_previous_version_are_read() {
        let now = tile();
        let bytes = now.to_bytes();
        let without = &bytes[MAGIC.len()..bytes.len() - now.points.len() * LABEL_BYTES];
        let of_clips = now.points.iter().map(|point| point.point.label).collect();
        assert_eq!(Tile::read(&[MAGIC_01, without].concat()), Ok(Tile { of_clips, ..now }));
    }

    #[test]
    fn other_bytes_are_refused() {
        let good = tile().to_bytes();
        for length in (0..good.len()).step_by(7) {
            assert_eq!(Tile::read(&good[..length]), Err(UnknownFileFormat), "{length}");
        }
        for at in 0..good.len() {
            let mut bytes = good.clone();
            bytes[at] ^= 0xff;
            // Any change must return, with a value or an error.
            let _ = Tile::read(&bytes);
        }
    }

    #[test]
    fn tiles_meet_without_a_gap() {
        for voxel in -200..200 {
            let centre_m = (f64::from(voxel) + 0.5) * MAP_VOXEL_M;
            assert_eq!(
                TileKey::of_voxel(LevelName::MAIN, &[voxel, 0, 0]).x,
                TileKey::at(LevelName::MAIN, centre_m, 0.0).x
            );
        }
    }
}
