//! Checksums of a tile's content by blocks: a merge labels the surface again only around blocks that changed.

use super::tile::{POINT_BYTES, Tile, TileKey, label_bytes, point_bytes};
use crate::MapPoint;
use serde::{Deserialize, Serialize};
use uuid::Uuid;
use viola_geometry::LevelName;
use viola_reconstruct::{CloudPoint, Label};

/// Blocks along a tile's side: 0.8 m.
pub(super) const SIDE: i32 = 3;
const COUNT: usize = (SIDE * SIDE) as usize;

/// Checksum of the points in each block of a tile, with the labels of their clips and without those of the map. The
/// default is that of no tile.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Content([u64; COUNT]);

/// A block of a level's map, in units of its side.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Block {
    pub level: LevelName,
    pub x: i32,
    pub y: i32,
}

impl Content {
    pub(super) fn of(key: &TileKey, tile: &Tile) -> Content {
        let mut content = Content([FIRST; COUNT]);
        for (point, label) in tile.points.iter().zip(&tile.of_clips) {
            let block = Block::of(key, point);
            let sum = &mut content.0[number(&block)];
            let clip = tile.clips.get(usize::from(point.clip)).unwrap_or(&Uuid::nil()).as_u128();
            let bytes = unlabelled(point, label.views);
            let words = bytes.as_chunks::<8>().0.iter().map(|word| u64::from_le_bytes(*word));
            let label = u64::from_le_bytes(label_bytes(label));
            words.chain([label, clip as u64, (clip >> 64) as u64]).for_each(|word| add(sum, word));
        }
        content
    }

    /// Returns the blocks of the tile in which the points or the labels of their clips differ.
    pub(super) fn differing(&self, other: &Content, key: &TileKey) -> Vec<Block> {
        let blocks = (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| [x, y]));
        let block = |[x, y]: [i32; 2]| Block { level: key.level, x: SIDE * key.x + x, y: SIDE * key.y + y };
        blocks.map(block).filter(|block| self.0[number(block)] != other.0[number(block)]).collect()
    }
}

/// Returns the bytes of a point without its clip number, which depends on the tile, and without its class and
/// probability in the map.
fn unlabelled(point: &MapPoint, views: u16) -> [u8; 40] {
    let label = Label::new(Label::NONE.class, 0.0, views);
    let mut bytes = [0; 40];
    let point = MapPoint { point: CloudPoint { label, ..point.point }, clip: 0 };
    bytes[..POINT_BYTES].copy_from_slice(&point_bytes(&point));
    bytes
}

impl Block {
    /// Returns the block of a tile's point. Means may lie a hair outside of their tile.
    pub fn of(key: &TileKey, point: &MapPoint) -> Block {
        let at = |tile: i32, axis: usize| {
            let within_m = f64::from(point.point.position_m[axis]) - f64::from(tile) * TileKey::side_m();
            let block = (within_m / TileKey::side_m() * f64::from(SIDE)).floor() as i32;
            SIDE * tile + block.clamp(0, SIDE - 1)
        };
        Block { level: key.level, x: at(key.x, 0), y: at(key.y, 1) }
    }
}

/// Returns the number of a block in its tile.
fn number(block: &Block) -> usize {
    (block.y.rem_euclid(SIDE) * SIDE + block.x.rem_euclid(SIDE)) as usize
}

/// FNV-1a, by words of 64 bits.
const FIRST: u64 = 0xcbf2_9ce4_8422_2325;
const PRIME: u64 = 0x0000_0100_0000_01b3;

fn add(sum: &mut u64, word: u64) {
    *sum = (*sum ^ word).wrapping_mul(PRIME);
    // A product carries upwards only.
    *sum ^= *sum >> 32;
}
