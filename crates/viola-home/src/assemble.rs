//! Builds a home's map from the set of its clips.
//!
//! [`assemble`] is a function of the set: clips are sorted by their content, not by their arrival, and the
//! last map serves only as a cache.

mod agreement;
mod belief;
mod cache;
mod candidates;
mod clip_matches;
mod content;
mod floor_correction;
mod fold;
mod footprint;
mod joint;
mod labelled;
mod load;
mod looked;
mod members;
mod neighbours;
mod overlap;
mod pose_graph;
mod poses;
pub(super) mod sight;
mod surface;
mod tile;
mod tiles;
mod varint;
mod voxels;
mod window;

pub use agreement::Agreement;
pub use candidates::{KnownClip, Marginal};
pub use clip_matches::{ClipMatch, Motion, Surfaces};
pub use floor_correction::FloorCorrection;
pub use footprint::Footprint;
pub use joint::Comparison;
pub use labelled::LabelledMap;
pub use load::LoadClips;
pub use looked::LookedThrough;
pub use members::{Extent, Member, Mode, PlacedBy, PlacedClip, Verdict};
pub use overlap::{Overlap, disagreement};
pub use tile::{CLIP_AT, POINT_BYTES, Tile, TileBytes, TileInfo, TileKey, point_bytes, read_point};

pub(super) use voxels::Voxels;

use cache::Cache;
use poses::Placed;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use viola_geometry::progress::{Cancelled, Progress};
use viola_geometry::{LevelName, Pose2};

/// Summary of a map without its points; input of the next merge.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// The clips in the map, in the canonical order.
    pub clips: Vec<PlacedClip>,
    /// Relative poses of clips and the neighbours that they are registered to.
    pub pairs: Vec<Pair>,
    /// All clips with a possible pose, even those that are not in the map.
    #[serde(default)]
    pub known: Vec<KnownClip>,
    /// Agreement of the clips at their possible poses.
    #[serde(default)]
    pub comparisons: Vec<Comparison>,
    /// Matches between the clips in `known`.
    #[serde(rename = "ties", default)]
    pub clip_matches: Vec<ClipMatch>,
    pub tiles: Vec<(TileKey, TileInfo)>,
    /// Version of the labels of the tiles; empty if they are to be computed again.
    #[serde(default)]
    pub labelled_by: String,
}

/// A clip `b` and one of the clips before it that it is registered to, named by their contributions, at their poses before joint refinement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Pair {
    pub a: String,
    pub b: String,
    pub map_from_a: Pose2,
    pub map_from_b: Pose2,
    /// Heights of the origins of their frames above the floor there.
    #[serde(default, skip_serializing_if = "viola_geometry::is_zero")]
    pub rise_of_a_m: f64,
    #[serde(default, skip_serializing_if = "viola_geometry::is_zero")]
    pub rise_of_b_m: f64,
    /// None if the clips do not overlap.
    pub overlap: Option<Overlap>,
}

/// The next map before its labels: its manifest and the changed tiles; none for tiles that became empty.
#[derive(Debug, Clone, PartialEq)]
pub struct Assembly {
    pub manifest: Manifest,
    pub changed: BTreeMap<TileKey, Option<Tile>>,
    /// Sums of the first clips of rebuilt tiles, which the next merge of the map begins with: the same map
    /// results without them. None for those that are to be removed.
    pub sums: BTreeMap<TileKey, Option<Vec<u8>>>,
    /// Space looked through in the rebuilt tiles, by level; even in rebuilt tiles without a change.
    pub looked: BTreeMap<LevelName, LookedThrough>,
    /// The tiles of the last map.
    last: BTreeMap<TileKey, TileInfo>,
}

/// Builds the map of `members` from the last manifest; `load` returns a clip's contribution. Ends soon after `progress` is
/// cancelled.
pub fn assemble<E: From<Cancelled>>(
    last: &Manifest,
    mut members: Vec<Member>,
    load: &mut dyn LoadClips<E>,
    progress: &dyn Progress,
) -> Result<Assembly, E> {
    members.sort_by(|a, b| a.order().cmp(&b.order()));
    let mut cache = Cache::new(load, progress);
    let mut placed = poses::place(last, &members, &mut cache)?;
    let tiles::Rebuilt { clips, changed, sums, looked } =
        tiles::rebuild(last, std::mem::take(&mut placed.clips), placed.resting, &mut cache)?;
    let infos: BTreeMap<TileKey, TileInfo> = last.tiles.iter().cloned().collect();
    let (changed, tiles) = changes(&infos, changed);
    let tiles = tiles.into_iter().collect();
    let Placed { pairs, known, comparisons, clip_matches, .. } = placed;
    let labelled_by = last.labelled_by.clone();
    let manifest = Manifest { clips, pairs, known, comparisons, clip_matches, tiles, labelled_by };
    Ok(Assembly { manifest, changed, sums, looked, last: infos })
}

/// Returns the changed tiles, and the summaries of all tiles.
fn changes(
    last: &BTreeMap<TileKey, TileInfo>,
    mut made: tiles::ChangedTiles,
) -> (tiles::ChangedTiles, BTreeMap<TileKey, TileInfo>) {
    let mut infos = last.clone();
    made.retain(|key, tile| {
        let info = tile.as_ref().map(|tile| tile.info(key));
        let is_same = last.get(key).map(|last| last.content) == info.as_ref().map(|info| info.content);
        match info {
            _ if is_same => {}
            Some(info) => drop(infos.insert(*key, info)),
            None => drop(infos.remove(key)),
        }
        !is_same
    });
    (made, infos)
}

/// Compares the clips of `members` at all their possible poses, as [`assemble`] does.
pub fn compare<E: From<Cancelled>>(
    mut members: Vec<Member>,
    load: &mut dyn LoadClips<E>,
    progress: &dyn Progress,
) -> Result<Vec<Comparison>, E> {
    members.sort_by(|a, b| a.order().cmp(&b.order()));
    let mut cache = Cache::new(load, progress);
    let candidates = candidates::candidates(&[], &members, &mut cache)?;
    joint::compare((&[], &[]), &candidates, &mut cache)
}

/// Returns the clips of `members` with their likeliest poses, as [`assemble`] places them, without a map.
pub fn likeliest<E: From<Cancelled>>(
    mut members: Vec<Member>,
    load: &mut dyn LoadClips<E>,
    progress: &dyn Progress,
) -> Result<Vec<KnownClip>, E> {
    members.sort_by(|a, b| a.order().cmp(&b.order()));
    Ok(poses::likeliest(&Manifest::default(), &members, &mut Cache::new(load, progress))?.known)
}

#[cfg(test)]
mod tests;
