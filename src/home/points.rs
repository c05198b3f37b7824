//! The points of a home's map for other programs: filtered, tile by tile, so that memory does not grow with the map.

mod filter;
mod glb;
mod ply;

pub use filter::PointFilter;
pub use glb::Glb;
pub use ply::Ply;

use super::assemble::TileBytes;
use rustc_hash::FxHashMap;
use uuid::Uuid;

/// From the clips of a tile to their places in the map's list.
pub struct ClipNumbers(FxHashMap<Uuid, u16>);

impl ClipNumbers {
    pub fn new<'a>(clips: impl Iterator<Item = &'a Uuid>) -> ClipNumbers {
        ClipNumbers(clips.enumerate().map(|(number, clip)| (*clip, number as u16)).collect())
    }

    fn of_tile(&self, tile: &TileBytes) -> Vec<u16> {
        tile.clips.iter().map(|clip| self.0.get(clip).copied().unwrap_or_default()).collect()
    }
}
