//! Export of a home's points: filtered tile by tile, so that memory does not grow with the map.

mod e57;
mod filter;
mod glb;
mod laz;
mod ply;

pub use e57::write_e57;
pub use filter::PointFilter;
pub use glb::Glb;
pub use laz::write_laz;
pub use ply::Ply;

use super::assemble::Tile;
use super::map_point::MapPoint;
use rustc_hash::FxHashMap;
use uuid::Uuid;
use viola_geometry::taxonomy::Class;

/// Index of each clip in the map's list.
pub struct ClipNumbers(FxHashMap<Uuid, u16>);

impl ClipNumbers {
    pub fn new<'a>(clips: impl Iterator<Item = &'a Uuid>) -> ClipNumbers {
        ClipNumbers(clips.enumerate().map(|(number, clip)| (*clip, number as u16)).collect())
    }

    /// Returns a tile's points with the map's clip numbers.
    pub fn in_map<'a>(&self, tile: &'a Tile) -> impl Iterator<Item = MapPoint> + use<'a> {
        let numbers = self.of_clips(&tile.clips);
        let number = move |local: u16| numbers.get(usize::from(local)).copied().unwrap_or_default();
        tile.points.iter().map(move |point| MapPoint { clip: number(point.clip), ..*point })
    }

    fn of_clips(&self, clips: &[Uuid]) -> Vec<u16> {
        clips.iter().map(|clip| self.0.get(clip).copied().unwrap_or_default()).collect()
    }
}

/// Returns the ids and names of all classes, for people who open a file.
pub(crate) fn class_list() -> String {
    let classes = Class::ALL.iter().map(|class| format!("{} {}", class.id(), class.name()));
    classes.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
pub(crate) mod tests {
    use crate::MapPoint;
    use std::io::{self, Cursor, Read, Seek, SeekFrom, Write};
    use viola_geometry::taxonomy::{CLASSES, Class};
    use viola_reconstruct::{CloudPoint, Label};

    /// Returns points of all classes along a line.
    pub fn points(count: u32) -> Vec<MapPoint> {
        let point = |i: u32| MapPoint {
            point: CloudPoint {
                position_m: [i as f32 * 0.0123, -1.5, 0.25 + (i % 7) as f32],
                normal: [0.0, 0.6, -0.8],
                color: [i as u8, 2, 255],
                label: Label::new(Class::ALL[i as usize % CLASSES], 0.4, 5),
                weight: 3,
            },
            clip: (i % 3) as u16,
        };
        (0..count).map(point).collect()
    }

    /// A file on a disk that is full after some bytes.
    pub struct Full {
        file: Cursor<Vec<u8>>,
        left: usize,
    }

    impl Full {
        pub fn after(bytes: usize) -> Full {
            Full { file: Cursor::default(), left: bytes }
        }
    }

    impl Write for Full {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.left = self.left.checked_sub(bytes.len()).ok_or(io::ErrorKind::StorageFull)?;
            self.file.write(bytes)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    impl Read for Full {
        fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
            self.file.read(bytes)
        }
    }

    impl Seek for Full {
        fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
            self.file.seek(to)
        }
    }
}
