//! Labels of the map, made of the fused surface: an object is often larger than what one clip shows of it.
//!
//! The map is labelled in windows. The labels of a window are a function of its surface and of the surface close around
//! it, so a merge labels only the windows whose surface changed, and the map is the same as if all were labelled.

use super::content::{Block, Content};
use super::looked::LookedThrough;
use super::window::{Window, WindowLabels};
use super::{Assembly, Manifest, Tile, TileInfo, TileKey};
use crate::ply::UnknownFileFormat;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicUsize, Ordering};
use viola_geometry::LevelName;
use viola_geometry::progress::{self, Cancelled, Progress};
use viola_reconstruct::Label;
use viola_reconstruct::label::{SegmentError, SurfaceNetwork};

/// Windows that are labelled at a time: the network takes about 100 MB for one.
const AT_A_TIME: usize = 2;
/// Version of the labels of a map. A map with other labels is labelled again.
const VERSION: &str = "windows of 4.8 m, furniture that agrees";

/// The next map with all its tiles.
#[derive(Debug, Clone, PartialEq)]
pub struct LabelledMap {
    pub manifest: Manifest,
    pub tiles: BTreeMap<TileKey, Tile>,
    /// The tiles that are not as in the last map; those that are not in `tiles` became empty.
    pub changed: BTreeSet<TileKey>,
    /// As in [`Assembly`].
    pub sums: BTreeMap<TileKey, Option<Vec<u8>>>,
    /// Of the tiles that the assembly rebuilt, by level.
    pub looked: BTreeMap<LevelName, LookedThrough>,
    /// Windows that were labelled.
    pub windows: usize,
    /// Reason why the surface network was not used for a window. The next merge tries it again.
    pub failure: Option<SegmentError>,
}

impl Assembly {
    /// Returns whether the labels of the last map are those of the network.
    pub fn is_labelled_by(&self, network: Option<&SurfaceNetwork>) -> bool {
        self.manifest.labelled_by == version(network)
    }

    /// Returns whether tiles of a level were rebuilt.
    pub fn touches(&self, level: LevelName) -> bool {
        self.looked.contains_key(&level)
    }

    /// Returns the tiles of the last map that stay in the map.
    pub fn kept(&self) -> impl Iterator<Item = &TileKey> {
        self.last.keys().filter(|key| !self.changed.contains_key(key))
    }

    /// Reads a tile that the assembly keeps. Fails if its points are not those of the last map: the file is damaged.
    pub fn read_kept(&self, key: &TileKey, bytes: &[u8]) -> Result<Tile, UnknownFileFormat> {
        let tile = Tile::read(bytes)?;
        // Manifests of earlier versions lack the checksums.
        let content = self.last.get(key).map(|info| info.content).unwrap_or_default();
        let is_whole = content == Content::default() || content == Content::of(key, &tile);
        is_whole.then_some(tile).ok_or(UnknownFileFormat)
    }

    /// Adds the other tiles of the last map, and labels the surface around the changes. A tile that the assembly kept
    /// changes if the new surface around it changes its labels. `kept` may lack the tiles of levels that the assembly does
    /// not touch, if the map [is labelled by](Assembly::is_labelled_by) the network. Ends after the windows that are underway
    /// once `progress` is cancelled.
    pub fn label(
        self,
        kept: BTreeMap<TileKey, Tile>,
        network: Option<&SurfaceNetwork>,
        progress: &dyn Progress,
    ) -> Result<LabelledMap, Cancelled> {
        let Assembly { mut manifest, changed, sums, looked, last } = self;
        let mut tiles = kept;
        let mut changed_keys: BTreeSet<TileKey> = BTreeSet::new();
        for (key, tile) in changed {
            changed_keys.insert(key);
            match tile {
                Some(tile) => tiles.insert(key, tile),
                None => tiles.remove(&key),
            };
        }
        let version = version(network);
        // Manifests of earlier versions lack the checksums.
        for (key, info) in manifest.tiles.iter_mut().filter(|(_, info)| info.content == Content::default()) {
            info.content = tiles.get(key).map(|tile| Content::of(key, tile)).unwrap_or_default();
        }
        let now = manifest.tiles.iter().cloned().collect();
        let is_new = manifest.labelled_by != version;
        let blocks = changed_blocks(&if is_new { BTreeMap::new() } else { last }, &now);
        let windows: BTreeSet<Window> = blocks.iter().flat_map(Window::around).collect();
        let windows: Vec<Window> = windows.into_iter().collect();
        let mut failure = None;
        for window in labelled(&windows, &tiles, network, progress)? {
            failure = failure.or(window.failure);
            for (key, labels) in window.labels {
                let is_changed = tiles.get_mut(&key).is_some_and(|tile| set(tile, labels));
                changed_keys.extend(is_changed.then_some(key));
            }
        }
        manifest.labelled_by = if failure.is_none() { version } else { String::new() };
        for (key, info) in &mut manifest.tiles {
            if let Some(tile) = tiles.get(key).filter(|_| changed_keys.contains(key)) {
                *info = tile.info(key);
            }
        }
        let windows = windows.len();
        Ok(LabelledMap { manifest, tiles, changed: changed_keys, sums, looked, windows, failure })
    }
}

/// Returns the labels of windows, in their order. [`AT_A_TIME`] takers share them, so none waits for another's window.
fn labelled(
    windows: &[Window],
    tiles: &BTreeMap<TileKey, Tile>,
    network: Option<&SurfaceNetwork>,
    progress: &dyn Progress,
) -> Result<Vec<WindowLabels>, Cancelled> {
    let next = AtomicUsize::new(0);
    let take = || windows.get(next.fetch_add(1, Ordering::Relaxed)).filter(|_| !progress.cancelled());
    let taker =
        |_: usize| std::iter::from_fn(take).map(|window| (*window, window.label(tiles, network))).collect();
    let labelled: Vec<Vec<(Window, WindowLabels)>> = (0..AT_A_TIME).into_par_iter().map(taker).collect();
    progress::check(progress)?;
    let labelled: BTreeMap<Window, WindowLabels> = labelled.into_iter().flatten().collect();
    Ok(labelled.into_values().collect())
}

/// Returns the version of the labels by a network.
fn version(network: Option<&SurfaceNetwork>) -> String {
    network.map_or_else(|| VERSION.to_owned(), |network| format!("{VERSION}, {}", network.version()))
}

/// Returns the blocks in which two maps differ.
fn changed_blocks(last: &BTreeMap<TileKey, TileInfo>, now: &BTreeMap<TileKey, TileInfo>) -> BTreeSet<Block> {
    let content = |of: &BTreeMap<TileKey, TileInfo>, key: &TileKey| {
        of.get(key).map(|info| info.content).unwrap_or_default()
    };
    let keys: BTreeSet<&TileKey> = last.keys().chain(now.keys()).collect();
    let contents = keys.into_iter().map(|key| (key, content(last, key), content(now, key)));
    contents.flat_map(|(key, last, now): (_, Content, Content)| now.differing(&last, key)).collect()
}

/// Sets the labels of a tile; returns whether one changed.
fn set(tile: &mut Tile, labels: Vec<Label>) -> bool {
    let mut is_changed = false;
    for ((point, of_clips), label) in tile.points.iter_mut().zip(&tile.of_clips).zip(labels) {
        // A tile keeps only the first class, and the views of the point itself.
        let mut label = label.with_fractions([]);
        label.views = of_clips.views;
        is_changed |= point.point.label != label;
        point.point.label = label;
    }
    is_changed
}
