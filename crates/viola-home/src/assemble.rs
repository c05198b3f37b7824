//! Builds a home's map from the set of its clips.
//!
//! [`assemble`] is a function of the set: clips are sorted by their content, not by their arrival, and the
//! last map serves only as a cache.

mod cache;
mod level;
mod members;
mod neighbours;
mod overlap;
mod poses;
mod settle;
pub(super) mod sight;
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

/// Summary of a map without its points; input of the next merge.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// The clips in the map, in the canonical order.
    pub clips: Vec<PlacedClip>,
    /// Relative poses of clips that may overlap.
    pub pairs: Vec<Pair>,
    /// Agreement of placed clips with the alternatives of ambiguous ones.
    pub opinions: Vec<Opinion>,
    pub tiles: Vec<(TileKey, TileInfo)>,
}

/// Two clips whose boxes meet, named by their contributions, at their poses before joint refinement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Pair {
    pub a: String,
    pub b: String,
    pub map_from_a: Pose2,
    pub map_from_b: Pose2,
    /// None if the clips do not overlap.
    pub overlap: Option<Overlap>,
}

/// Agreement of a placed clip with one alternative of an ambiguous one, both named by their contributions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Opinion {
    pub asked: String,
    pub alternative: usize,
    pub neighbour: String,
    pub map_from_neighbour: Pose2,
    pub said: Agreement,
}

/// The next map: its manifest and the changed tiles; none for tiles that became empty.
#[derive(Debug, Clone, PartialEq)]
pub struct Assembly {
    pub manifest: Manifest,
    pub changed: BTreeMap<TileKey, Option<Tile>>,
}

/// Builds the map of `members` from the last manifest; `load` returns a clip's contribution.
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
