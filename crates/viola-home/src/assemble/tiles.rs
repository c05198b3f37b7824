//! Rebuilds the tiles that a change affects, from the clips in them.

use super::Manifest;
use super::cache::{Cache, Loaded};
use super::looked::{LookedCells, LookedThrough};
use super::members::{Member, PlacedClip};
use super::tile::{TILE_VOXELS, Tile, TileKey};
use super::voxels::{Voxels, tile_of};
use crate::MAP_VOXEL_M;
use crate::carved::{BLOCK_CELLS, CELL_VOXELS, CarvedSpace};
use rayon::prelude::*;
use rustc_hash::FxHashMap;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use uuid::Uuid;
use viola_geometry::taxonomy::Class;
use viola_geometry::{LevelName, Pose3};
use viola_reconstruct::CloudPoint;

/// Changed tiles; none for tiles that became empty.
pub(super) type ChangedTiles = BTreeMap<TileKey, Option<Tile>>;

/// Tiles under construction at a time: the voxels of one take about 4 MB.
const TILES_AT_ONCE: usize = 32;
/// Clips in use at a time.
const CLIPS_AT_ONCE: usize = 8;

/// The clips with the tiles that they affect, and the changed tiles.
pub(super) struct Rebuilt {
    pub clips: Vec<PlacedClip>,
    pub changed: ChangedTiles,
    pub looked: BTreeMap<LevelName, LookedThrough>,
}

/// Builds the tiles anew that `clips` change.
pub(super) fn rebuild<E>(
    last: &Manifest,
    mut clips: Vec<(&Member, PlacedClip)>,
    cache: &mut Cache<E>,
) -> Result<Rebuilt, E> {
    let dirty: Vec<TileKey> = dirty(last, &mut clips, cache)?.into_iter().collect();
    let (mut changed, mut looked_in) = (ChangedTiles::new(), Vec::new());
    for keys in dirty.chunks(TILES_AT_ONCE) {
        let mut tiles: Vec<(TileKey, UnderConstruction)> =
            keys.iter().map(|key| (*key, UnderConstruction::new())).collect();
        let touches = |clip: &PlacedClip| keys.iter().any(|key| clip.tiles.binary_search(key).is_ok());
        // The latest first: when a clip comes, it is known what later ones looked through.
        let touching: Vec<usize> = (0..clips.len()).rev().filter(|at| touches(&clips[*at].1)).collect();
        for numbers in touching.chunks(CLIPS_AT_ONCE) {
            let loaded: Vec<Arc<Loaded>> =
                numbers.iter().map(|at| cache.get(clips[*at].0)).collect::<Result<_, E>>()?;
            let parts: Vec<(usize, BTreeMap<TileKey, Part>)> = numbers
                .par_iter()
                .zip(loaded)
                .map(|(at, loaded)| (*at, parts(&loaded, &clips[*at].1, keys)))
                .collect();
            tiles.par_iter_mut().for_each(|(key, tile)| {
                for (at, parts) in &parts {
                    if let Some(part) = parts.get(key) {
                        tile.add(part, *at as u16, clips[*at].1.recorded_at_ms);
                    }
                }
            });
        }
        let made: Vec<(TileKey, Option<Tile>, LookedCells)> = tiles
            .into_par_iter()
            .map(|(key, tile)| {
                let (tile, cells) = tile.finish(&clips);
                (key, tile, cells)
            })
            .collect();
        for (key, tile, cells) in made {
            changed.insert(key, tile);
            looked_in.push((key, cells));
        }
    }
    let clips: Vec<PlacedClip> = clips.into_iter().map(|(_, clip)| clip).collect();
    let mut looked: BTreeMap<LevelName, LookedThrough> = BTreeMap::new();
    for (key, cells) in looked_in {
        looked.entry(key.level).or_insert_with(|| LookedThrough::of(key.level, &clips)).add(key, cells);
    }
    Ok(Rebuilt { clips, changed, looked })
}

/// Sets the tiles of the clips, and returns those that change.
fn dirty<E>(
    last: &Manifest,
    clips: &mut [(&Member, PlacedClip)],
    cache: &mut Cache<E>,
) -> Result<BTreeSet<TileKey>, E> {
    let before: FxHashMap<&str, &PlacedClip> = last.clips.iter().map(|clip| (&*clip.share, clip)).collect();
    let mut dirty: BTreeSet<TileKey> = BTreeSet::new();
    let mut moved = Vec::new();
    for (at, (_, clip)) in clips.iter_mut().enumerate() {
        let old = before.get(&*clip.share);
        let same = |old: &&&PlacedClip| {
            old.level_name == clip.level_name
                && old.in_space() == clip.in_space()
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
    for numbers in moved.chunks(CLIPS_AT_ONCE) {
        let loaded: Vec<Arc<Loaded>> =
            numbers.iter().map(|at| cache.get(clips[*at].0)).collect::<Result<_, E>>()?;
        let tiles: Vec<Vec<TileKey>> =
            numbers.par_iter().zip(loaded).map(|(at, loaded)| touched(&loaded, &clips[*at].1)).collect();
        for (at, tiles) in numbers.iter().zip(tiles) {
            dirty.extend(&tiles);
            clips[*at].1.tiles = tiles;
        }
    }
    let there: BTreeSet<&str> = clips.iter().map(|(_, clip)| &*clip.share).collect();
    let gone = last.clips.iter().filter(|old| !there.contains(&*old.share));
    dirty.extend(gone.flat_map(|old| &old.tiles));
    Ok(dirty)
}

/// Returns the tiles of a clip's points. Clips with a known time add the tiles that they looked through,
/// because they may remove points there.
fn touched(loaded: &Loaded, clip: &PlacedClip) -> Vec<TileKey> {
    let map_from_clip = clip.in_space();
    let mut tiles: BTreeSet<TileKey> = BTreeSet::new();
    let mut last = None;
    for point in lasting_points(loaded) {
        let key = tile_of(clip.level_name, &placed(point, &map_from_clip).position_m);
        if last != Some(key) {
            tiles.insert(key);
            last = Some(key);
        }
    }
    if clip.recorded_at_ms.is_some() {
        tiles.extend(
            loaded
                .share
                .carved()
                .placed(&map_from_clip, |block| Some(tile_of_block(clip.level_name, block)))
                .keys(),
        );
    }
    tiles.into_iter().collect()
}

/// Returns the points of a clip without those of people and animals: they are not part of a home.
fn lasting_points(loaded: &Loaded) -> impl Iterator<Item = &CloudPoint> {
    let moves = |class: Class| matches!(class, Class::Person | Class::Animal);
    loaded.share.cloud_in_clip.points.iter().filter(move |point| !moves(point.label.class))
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

/// Points and carved space of a clip in one tile, in the map's frame.
#[derive(Default)]
struct Part {
    points: Vec<CloudPoint>,
    /// Empty if the time of recording is not known.
    carved: CarvedSpace,
}

/// Splits a clip by tiles; only `keys`, which are sorted.
fn parts(loaded: &Loaded, clip: &PlacedClip, keys: &[TileKey]) -> BTreeMap<TileKey, Part> {
    let map_from_clip = clip.in_space();
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
        let key = tile_of(clip.level_name, &point.position_m);
        if last != Some(key) {
            flush(last, &mut points);
            last = Some(key);
        }
        points.push(point);
    }
    flush(last, &mut points);
    if clip.recorded_at_ms.is_some() {
        let wanted =
            |block| Some(tile_of_block(clip.level_name, block)).filter(|key| keys.binary_search(key).is_ok());
        for (key, carved) in loaded.share.carved().placed(&map_from_clip, wanted) {
            parts.entry(key).or_default().carved = carved;
        }
    }
    parts
}

/// A tile to which clips are added, the latest first.
struct UnderConstruction {
    voxels: Voxels,
    /// Space that clips later than `time_ms` looked through.
    gone: CarvedSpace,
    /// Space that the clips of `time_ms` looked through.
    carved: CarvedSpace,
    time_ms: Option<i64>,
    looked: LookedCells,
}

impl UnderConstruction {
    fn new() -> UnderConstruction {
        UnderConstruction {
            voxels: Voxels::new(MAP_VOXEL_M),
            gone: CarvedSpace::default(),
            carved: CarvedSpace::default(),
            time_ms: None,
            looked: LookedCells::default(),
        }
    }

    /// Adds what a clip has in the tile, without the points that a later clip looked through: the world
    /// changed there. Clips without a time lose no points.
    fn add(&mut self, part: &Part, clip: u16, recorded_at_ms: Option<i64>) {
        if recorded_at_ms != self.time_ms {
            self.gone.extend(&std::mem::take(&mut self.carved));
            self.time_ms = recorded_at_ms;
        }
        let timed = recorded_at_ms.is_some();
        for point in &part.points {
            if !timed || !self.gone.contains(point.position_m.map(f64::from)) {
                self.voxels.add(point, clip);
            }
        }
        self.carved.extend(&part.carved);
        self.looked.add(&part.carved, clip);
    }

    /// Returns the tile with its own clip numbers, none without points, and its cells that were looked through.
    fn finish(self, clips: &[(&Member, PlacedClip)]) -> (Option<Tile>, LookedCells) {
        let mut points = self.voxels.into_points();
        let numbers: BTreeSet<u16> = points.iter().map(|point| point.clip).collect();
        let numbers: Vec<u16> = numbers.into_iter().collect();
        for point in &mut points {
            point.clip = numbers.binary_search(&point.clip).unwrap_or_default() as u16;
        }
        let ids: Vec<Uuid> = numbers.iter().map(|number| clips[usize::from(*number)].1.clip).collect();
        let of_clips = points.iter().map(|point| point.point.label).collect();
        ((!points.is_empty()).then_some(Tile { clips: ids, points, of_clips }), self.looked)
    }
}

// A block never spans tiles.
const _: () = assert!(TILE_VOXELS % (BLOCK_CELLS * CELL_VOXELS) == 0);
