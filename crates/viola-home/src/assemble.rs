//! A home's map out of the set of its clips.
//!
//! [`assemble`] is a function of the set: the clips are brought into an order that depends on what they are and not on
//! when they came, and everything that is kept from the last map is only there so as not to be computed again.

mod cache;
mod level;
mod members;
mod neighbours;
mod overlap;
mod poses;
mod settle;
mod sight;
mod surface;
mod tile;
mod tiles;
mod voxels;

pub use level::Level;
pub use members::{Extent, Member, PlacedBy, PlacedClip, Verdict};
pub use neighbours::Agreement;
pub use overlap::{Overlap, disagreement};
pub use tile::{CLIP_AT, POINT_BYTES, Tile, TileBytes, TileInfo, TileKey, point_bytes, read_point};

pub(super) use voxels::Voxels;

use super::contribution::ClipContribution;
use cache::Cache;
use poses::Placed;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use viola_geometry::Pose2;

/// What is known of a map without its points. The next one starts from it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// The clips in the map, in the canonical order.
    pub clips: Vec<PlacedClip>,
    /// How clips that may overlap lie to each other.
    pub pairs: Vec<Pair>,
    /// What placed clips said of the alternatives of ambiguous ones.
    pub opinions: Vec<Opinion>,
    pub tiles: Vec<(TileKey, TileInfo)>,
}

/// Two clips whose boxes meet, named by their shares, at the poses that they had by themselves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Pair {
    pub a: String,
    pub b: String,
    pub map_from_a: Pose2,
    pub map_from_b: Pose2,
    /// None when they did not see the same thing.
    pub overlap: Option<Overlap>,
}

/// What a clip that has a place says of one alternative of one that has none, both named by their shares.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Opinion {
    pub asked: String,
    pub alternative: usize,
    pub neighbour: String,
    pub map_from_neighbour: Pose2,
    pub said: Agreement,
}

/// The next map: what is known of it, and the tiles that are not as they were; none for those that are empty now.
#[derive(Debug, Clone, PartialEq)]
pub struct Assembly {
    pub manifest: Manifest,
    pub changed: BTreeMap<TileKey, Option<Tile>>,
}

/// Makes the map of `members` from the last one and what `load` gives of each clip.
pub fn assemble<E>(
    last: &Manifest,
    mut members: Vec<Member>,
    load: &mut dyn FnMut(&Member) -> Result<ClipContribution, E>,
) -> Result<Assembly, E> {
    members.sort_by(|a, b| a.order().cmp(&b.order()));
    let mut cache = Cache::new(load);
    let mut placed = poses::place(last, &members, &mut cache)?;
    let (clips, changed) = tiles::rebuild(last, std::mem::take(&mut placed.clips), &mut cache)?;
    let mut known: BTreeMap<TileKey, TileInfo> = last.tiles.iter().cloned().collect();
    for (key, tile) in &changed {
        match tile {
            Some(tile) => known.insert(*key, tile.info()),
            None => known.remove(key),
        };
    }
    let Placed { pairs, opinions, .. } = placed;
    let manifest = Manifest { clips, pairs, opinions, tiles: known.into_iter().collect() };
    Ok(Assembly { manifest, changed })
}

#[cfg(test)]
mod tests;
