//! Rebuilds the tiles that a change affects, from the clips in them.

use super::Manifest;
use super::cache::{AT_A_TIME, Cache, Loaded};
use super::fold::{Fold, Part};
use super::looked::LookedThrough;
use super::members::{Member, PlacedClip};
use super::tile::{TILE_VOXELS, Tile, TileKey};
use super::voxels::tile_of;
use crate::carved::{BLOCK_CELLS, CELL_VOXELS};
use rayon::prelude::*;
use rustc_hash::FxHashMap;
use std::collections::{BTreeMap, BTreeSet};
use viola_geometry::progress::Cancelled;
use viola_geometry::taxonomy::Class;
use viola_geometry::{LevelName, Pose3};
use viola_reconstruct::CloudPoint;

/// Changed tiles; none for tiles that became empty.
pub(super) type ChangedTiles = BTreeMap<TileKey, Option<Tile>>;

/// Tiles under construction at a time: the voxels of one take about 4 MB.
const TILES_AT_ONCE: usize = 16;
/// Minimum number of clips whose sums in a tile are kept: fewer are read as quickly as their sums.
const MIN_KEPT_CLIPS: usize = 8;

/// The clips with the tiles that they affect, and the rebuilt tiles.
pub(super) struct Rebuilt {
    pub clips: Vec<PlacedClip>,
    pub changed: ChangedTiles,
    /// The sums of the tiles that the next merge begins with.
    pub sums: BTreeMap<TileKey, Option<Vec<u8>>>,
    pub looked: BTreeMap<LevelName, LookedThrough>,
}

/// A tile that is rebuilt.
struct Underway<'a> {
    key: TileKey,
    /// The clips that touch it, with their numbers in the map.
    clips: Vec<(usize, &'a PlacedClip)>,
    fold: Fold,
    /// The number of clips whose sums are kept.
    kept: usize,
    sums: Option<Vec<u8>>,
}

impl<'a> Underway<'a> {
    fn new(key: TileKey, placed: &[(&Member, &'a PlacedClip)], resting: usize) -> Underway<'a> {
        let touches = |clip: &PlacedClip| clip.tiles.binary_search(&key).is_ok();
        let clips = placed.iter().map(|(_, clip)| *clip).enumerate().filter(|(_, clip)| touches(clip));
        let clips: Vec<(usize, &PlacedClip)> = clips.collect();
        let mut kept = clips.partition_point(|(number, _)| *number < resting);
        // Clips of one time do not look through each other: they stay together.
        let time_ms = |at: usize| clips.get(at).and_then(|(_, clip)| clip.recorded_at_ms);
        while kept > 0 && time_ms(kept).is_some() && time_ms(kept - 1) == time_ms(kept) {
            kept -= 1;
        }
        Underway { key, clips, fold: Fold::new(), kept, sums: None }
    }

    /// Begins with the sums of the last map, if they are of the first clips of the tile.
    fn begin_with(&mut self, sums: &[u8]) {
        if let Ok(fold) = Fold::read(sums, &self.clips) {
            self.fold = fold;
        }
    }

    fn lacks(&self, number: usize) -> bool {
        self.clips[self.fold.len()..].binary_search_by_key(&number, |(number, _)| *number).is_ok()
    }

    /// Adds the next clip, if it touches the tile.
    fn add(&mut self, number: usize, part: Option<&Part>) {
        if !self.lacks(number) {
            return;
        }
        let (_, clip) = self.clips[self.fold.len()];
        self.fold.add(part.unwrap_or(&Part::default()), clip);
        if self.fold.len() == self.kept && self.kept >= MIN_KEPT_CLIPS {
            self.sums = Some(self.fold.to_bytes());
        }
    }
}

/// Rebuilds the tiles that `clips` change. The poses of the first `resting` clips do not depend on later clips.
pub(super) fn rebuild<E: From<Cancelled>>(
    last: &Manifest,
    mut clips: Vec<(&Member, PlacedClip)>,
    resting: usize,
    cache: &mut Cache<E>,
) -> Result<Rebuilt, E> {
    cache.forget_surfaces();
    let dirty: Vec<TileKey> = dirty(last, &mut clips, cache)?.into_iter().collect();
    let placed: Vec<(&Member, &PlacedClip)> = clips.iter().map(|(member, clip)| (*member, clip)).collect();
    let (mut changed, mut new_sums, mut looked_in) = (ChangedTiles::new(), BTreeMap::new(), Vec::new());
    for keys in dirty.chunks(TILES_AT_ONCE) {
        let mut tiles: Vec<Underway> = keys.iter().map(|key| Underway::new(*key, &placed, resting)).collect();
        let may_have_sums = |tile: &&mut Underway| tile.clips.len() >= MIN_KEPT_CLIPS;
        let mut with_sums: Vec<&mut Underway> = tiles.iter_mut().filter(may_have_sums).collect();
        let sums = cache.sums(&with_sums.iter().map(|tile| tile.key).collect::<Vec<_>>())?;
        with_sums.par_iter_mut().zip(sums).for_each(|(tile, sums)| {
            if let Some(sums) = sums {
                tile.begin_with(&sums);
            }
        });
        let missing: Vec<usize> =
            (0..placed.len()).filter(|number| tiles.iter().any(|tile| tile.lacks(*number))).collect();
        for numbers in missing.chunks(AT_A_TIME) {
            let loaded = cache.get_all(&numbers.iter().map(|at| placed[*at].0).collect::<Vec<_>>())?;
            let parts: Vec<(usize, BTreeMap<TileKey, Part>)> = numbers
                .par_iter()
                .zip(loaded)
                .map(|(at, loaded)| {
                    let lacking = tiles.iter().filter(|tile| tile.lacks(*at)).map(|tile| tile.key);
                    (*at, parts(&loaded, placed[*at].1, &lacking.collect::<Vec<_>>()))
                })
                .collect();
            tiles.par_iter_mut().for_each(|tile| {
                parts.iter().for_each(|(at, parts)| tile.add(*at, parts.get(&tile.key)));
            });
        }
        let finished = tiles.into_par_iter().map(|tile| {
            let (made, cells) = tile.fold.finish(&tile.clips);
            // Earlier sums may be of clips that are deleted.
            let sums = (tile.sums.is_some() || tile.kept < MIN_KEPT_CLIPS).then_some(tile.sums);
            (tile.key, made, cells, sums)
        });
        for (key, tile, cells, kept) in finished.collect::<Vec<_>>() {
            if let Some(kept) = kept.or(tile.is_none().then_some(None)) {
                new_sums.insert(key, kept);
            }
            changed.insert(key, tile);
            looked_in.push((key, cells));
        }
    }
    let clips: Vec<PlacedClip> = clips.into_iter().map(|(_, clip)| clip).collect();
    let mut looked: BTreeMap<LevelName, LookedThrough> = BTreeMap::new();
    for (key, cells) in looked_in {
        looked.entry(key.level).or_insert_with(|| LookedThrough::of(key.level, &clips)).add(key, cells);
    }
    Ok(Rebuilt { clips, changed, sums: new_sums, looked })
}

/// Sets the tiles of the clips, and returns those that change.
fn dirty<E: From<Cancelled>>(
    last: &Manifest,
    clips: &mut [(&Member, PlacedClip)],
    cache: &mut Cache<E>,
) -> Result<BTreeSet<TileKey>, E> {
    let before: FxHashMap<&str, &PlacedClip> =
        last.clips.iter().map(|clip| (&*clip.contribution, clip)).collect();
    let mut dirty: BTreeSet<TileKey> = BTreeSet::new();
    let mut moved = Vec::new();
    for (at, (_, clip)) in clips.iter_mut().enumerate() {
        let old = before.get(&*clip.contribution);
        let same = |old: &&&PlacedClip| {
            old.level == clip.level
                && old.pose_in_space() == clip.pose_in_space()
                && old.recorded_at_ms == clip.recorded_at_ms
        };
        match old.filter(same) {
            Some(old) => clip.tiles.clone_from(&old.tiles),
            None => {
                dirty.extend(old.iter().flat_map(|old| &old.tiles));
                moved.push(at);
            }
        }
    }
    for numbers in moved.chunks(AT_A_TIME) {
        let loaded = cache.get_all(&numbers.iter().map(|at| clips[*at].0).collect::<Vec<_>>())?;
        let tiles: Vec<Vec<TileKey>> =
            numbers.par_iter().zip(loaded).map(|(at, loaded)| touched(&loaded, &clips[*at].1)).collect();
        for (at, tiles) in numbers.iter().zip(tiles) {
            dirty.extend(&tiles);
            clips[*at].1.tiles = tiles;
        }
    }
    let there: BTreeSet<&str> = clips.iter().map(|(_, clip)| &*clip.contribution).collect();
    let gone = last.clips.iter().filter(|old| !there.contains(&*old.contribution));
    dirty.extend(gone.flat_map(|old| &old.tiles));
    Ok(dirty)
}

/// Returns the tiles of a clip's points. Clips with a known time add the tiles that they looked through,
/// because they may remove points there.
fn touched(loaded: &Loaded, clip: &PlacedClip) -> Vec<TileKey> {
    let map_from_clip = clip.pose_in_space();
    let mut tiles: BTreeSet<TileKey> = BTreeSet::new();
    let mut last = None;
    for point in lasting_points(loaded) {
        let key = tile_of(clip.level, &placed(point, &map_from_clip).position_m);
        if last != Some(key) {
            tiles.insert(key);
            last = Some(key);
        }
    }
    if clip.recorded_at_ms.is_some() {
        tiles.extend(
            loaded
                .contribution
                .carved()
                .placed(&map_from_clip, |block| Some(tile_of_block(clip.level, block)))
                .keys(),
        );
    }
    tiles.into_iter().collect()
}

/// Returns the points of a clip without those of people and animals: they are not part of a home.
fn lasting_points(loaded: &Loaded) -> impl Iterator<Item = &CloudPoint> {
    let moves = |class: Class| matches!(class, Class::Person | Class::Animal);
    loaded.contribution.cloud_in_clip.points.iter().filter(move |point| !moves(point.label.class))
}

fn placed(point: &CloudPoint, map_from_clip: &Pose3) -> CloudPoint {
    let (position, normal) = (map_from_clip * point.position(), map_from_clip * point.normal());
    CloudPoint {
        position_m: [position.x as f32, position.y as f32, position.z as f32],
        normal: [normal.x as f32, normal.y as f32, normal.z as f32],
        ..*point
    }
}

/// Returns the tile that contains a block of carved cells.
fn tile_of_block(level: LevelName, block: [i32; 3]) -> TileKey {
    TileKey::of_voxel(level, &block.map(|c| c * BLOCK_CELLS * CELL_VOXELS))
}

/// Splits a clip by tiles; only `keys`, which are sorted.
fn parts(loaded: &Loaded, clip: &PlacedClip, keys: &[TileKey]) -> BTreeMap<TileKey, Part> {
    let map_from_clip = clip.pose_in_space();
    let mut parts: BTreeMap<TileKey, Part> = BTreeMap::new();
    // Neighbours in the cloud are neighbours in space: few points need a search.
    let mut points: Vec<CloudPoint> = Vec::new();
    let mut last: Option<TileKey> = None;
    let mut flush = |key: Option<TileKey>, points: &mut Vec<CloudPoint>| {
        if let Some(key) = key.filter(|key| keys.binary_search(key).is_ok()) {
            parts.entry(key).or_default().points.append(points);
        }
        points.clear();
    };
    for point in lasting_points(loaded) {
        let point = placed(point, &map_from_clip);
        let key = tile_of(clip.level, &point.position_m);
        if last != Some(key) {
            flush(last, &mut points);
            last = Some(key);
        }
        points.push(point);
    }
    flush(last, &mut points);
    if clip.recorded_at_ms.is_some() {
        let wanted =
            |block| Some(tile_of_block(clip.level, block)).filter(|key| keys.binary_search(key).is_ok());
        for (key, carved) in loaded.contribution.carved().placed(&map_from_clip, wanted) {
            parts.entry(key).or_default().carved = carved;
        }
    }
    parts
}

// A block never spans tiles.
const _: () = assert!(TILE_VOXELS % (BLOCK_CELLS * CELL_VOXELS) == 0);
