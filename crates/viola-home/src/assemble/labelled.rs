//! Labels of the whole map, made anew after each change: an object is often larger than what one clip shows of it.

use super::looked::LookedThrough;
use super::{Assembly, Manifest, Tile, TileKey};
use crate::MAP_VOXEL_M;
use std::collections::{BTreeMap, BTreeSet};
use viola_geometry::LevelName;
use viola_reconstruct::label::{SurfaceNetwork, label_map};
use viola_reconstruct::{CloudPoint, PointCloud};

/// The next map with all its tiles.
#[derive(Debug, Clone, PartialEq)]
pub struct LabelledMap {
    pub manifest: Manifest,
    pub tiles: BTreeMap<TileKey, Tile>,
    /// The tiles that are not as in the last map; those that are not in `tiles` became empty.
    pub changed: BTreeSet<TileKey>,
    /// Of the tiles that the assembly changed, by level.
    pub looked: BTreeMap<LevelName, LookedThrough>,
}

impl Assembly {
    /// Adds the other tiles of the last map, and labels the whole surface of each level. A tile that the assembly kept
    /// changes if the new surface around it changes its labels.
    pub fn label(self, kept: BTreeMap<TileKey, Tile>, network: Option<&SurfaceNetwork>) -> LabelledMap {
        let Assembly { mut manifest, changed, looked } = self;
        let mut tiles = kept;
        let mut changed_keys: BTreeSet<TileKey> = BTreeSet::new();
        for (key, tile) in changed {
            changed_keys.insert(key);
            match tile {
                Some(tile) => tiles.insert(key, tile),
                None => tiles.remove(&key),
            };
        }
        let levels: BTreeSet<LevelName> = tiles.keys().map(|key| key.level).collect();
        for level in levels {
            let of_level = tiles.iter_mut().filter(|(key, _)| key.level == level);
            changed_keys.extend(label_level(of_level.collect(), network));
        }
        for (key, info) in &mut manifest.tiles {
            if let Some(tile) = tiles.get(key).filter(|_| changed_keys.contains(key)) {
                *info = tile.info();
            }
        }
        LabelledMap { manifest, tiles, changed: changed_keys, looked }
    }
}

/// Labels the tiles of a level; returns those with a new label.
fn label_level(mut tiles: Vec<(&TileKey, &mut Tile)>, network: Option<&SurfaceNetwork>) -> Vec<TileKey> {
    let points = tiles.iter().flat_map(|(_, tile)| {
        let labelled = tile.points.iter().zip(&tile.of_clips);
        labelled.map(|(point, label)| CloudPoint { label: *label, ..point.point })
    });
    let map = PointCloud { points: points.collect(), voxel_m: MAP_VOXEL_M };
    let mut labels = label_map(&map, network).into_iter();
    let mut changed = Vec::new();
    for (key, tile) in &mut tiles {
        let mut is_changed = false;
        for (point, label) in tile.points.iter_mut().zip(&mut labels) {
            // A tile keeps only the first class.
            let label = label.with_shares([]);
            is_changed |= point.point.label != label;
            point.point.label = label;
        }
        if is_changed {
            changed.push(**key);
        }
    }
    changed
}
