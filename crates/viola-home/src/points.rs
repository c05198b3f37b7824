//! Export of a home's points: filtered tile by tile, so that memory does not grow with the map.

mod filter;
mod glb;
mod ply;

pub use filter::PointFilter;
pub use glb::Glb;
pub use ply::Ply;

use super::assemble::{Tile, TileBytes};
use super::map_point::MapPoint;
use rustc_hash::FxHashMap;
use uuid::Uuid;

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

    fn of_tile(&self, tile: &TileBytes) -> Vec<u16> {
        self.of_clips(&tile.clips)
    }
}
