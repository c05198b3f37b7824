//! Rebuilds the tiles that a change affects, from the clips in them.

use super::Manifest;
use super::cache::{Cache, Loaded};
use super::members::{Member, PlacedClip};
use super::sight::{Sights, is_gone};
use super::tile::{Tile, TileKey};
use super::voxels::{Voxels, tile_of};
use crate::MAP_VOXEL_M;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use uuid::Uuid;
use viola_geometry::{Point3, Pose3};
use viola_reconstruct::CloudPoint;

/// Changed tiles; none for tiles that became empty.
pub(super) type ChangedTiles = BTreeMap<TileKey, Option<Tile>>;

/// Returns the clips with the tiles that they affect, and the changed tiles.
pub(super) fn rebuild<E>(
    last: &Manifest,
    mut clips: Vec<(&Member, PlacedClip)>,
    cache: &mut Cache<E>,
) -> Result<(Vec<PlacedClip>, ChangedTiles), E> {
    let mut dirty: BTreeSet<TileKey> = BTreeSet::new();
    for (member, clip) in &mut clips {
        let old = last.clips.iter().find(|old| old.share == clip.share);
        let moved = old
            .is_none_or(|old| old.in_space() != clip.in_space() || old.recorded_at_ms != clip.recorded_at_ms);
        if let Some(old) = old.filter(|_| !moved) {
            clip.tiles.clone_from(&old.tiles);
            continue;
        }
        clip.tiles = touched(&*cache.get(member)?, &clip.in_space(), clip.recorded_at_ms.is_some());
        dirty.extend(&clip.tiles);
        dirty.extend(old.iter().flat_map(|old| &old.tiles));
    }
    let gone = last.clips.iter().filter(|old| !clips.iter().any(|(_, clip)| clip.share == old.share));
    dirty.extend(gone.flat_map(|old| &old.tiles));

    let mut voxels: Vec<(TileKey, Voxels)> =
        dirty.iter().map(|key| (*key, Voxels::new(MAP_VOXEL_M))).collect();
    for (number, (member, clip)) in clips.iter().enumerate() {
        if clip.tiles.iter().any(|key| dirty.contains(key)) {
            let points = placed_points(&*cache.get(member)?, &clip.in_space(), &dirty);
            let points = without_what_is_gone(points, clip, &clips, cache)?;
            let mut of_tile: BTreeMap<TileKey, Vec<CloudPoint>> = BTreeMap::new();
            for (key, point) in points {
                of_tile.entry(key).or_default().push(point);
            }
            voxels.par_iter_mut().for_each(|(key, voxels)| {
                let points = of_tile.get(key).map(Vec::as_slice).unwrap_or_default();
                points.iter().for_each(|point| voxels.add(point, number as u16));
            });
        }
    }
    let clips: Vec<PlacedClip> = clips.into_iter().map(|(_, clip)| clip).collect();
    let tiles = voxels.into_par_iter().map(|(key, voxels)| (key, tile(voxels, &clips)));
    Ok((clips.clone(), tiles.collect::<Vec<_>>().into_iter().collect()))
}

/// Builds a tile with its own clip numbers; none without points.
fn tile(voxels: Voxels, clips: &[PlacedClip]) -> Option<Tile> {
    let mut points = voxels.into_points();
    let numbers: BTreeSet<u16> = points.iter().map(|point| point.clip).collect();
    let numbers: Vec<u16> = numbers.into_iter().collect();
    for point in &mut points {
        point.clip = numbers.binary_search(&point.clip).unwrap_or_default() as u16;
    }
    let ids: Vec<Uuid> = numbers.iter().map(|number| clips[usize::from(*number)].clip).collect();
    (!points.is_empty()).then_some(Tile { clips: ids, points })
}

/// Returns the tiles of a clip's points. Clips with a known time add the tiles that their views looked into,
/// because they may remove points there.
fn touched(loaded: &Loaded, map_from_clip: &Pose3, timed: bool) -> Vec<TileKey> {
    let points = &loaded.share.cloud_in_clip.points;
    let mut tiles: BTreeSet<TileKey> =
        points.iter().map(|point| tile_of(&placed(point, map_from_clip).position_m)).collect();
    let views = loaded.share.views.iter().filter(|_| timed);
    for view in views {
        let map_from_camera = map_from_clip * view.clip_from_camera;
        let eye = map_from_camera.translation.vector;
        // Rays are centimetres apart and tiles metres wide: a sample of the rays is enough.
        for hit in view.readings.points_in_camera().step_by(16) {
            let reach = (map_from_camera * hit).coords - eye;
            let steps = (reach.xy().norm() / (TileKey::side_m() / 4.0)).ceil().max(1.0);
            for step in 0..=steps as u32 {
                let at = eye + reach * (f64::from(step) / steps);
                tiles.insert(TileKey::at(at.x, at.y));
            }
        }
    }
    tiles.into_iter().collect()
}

fn placed(point: &CloudPoint, map_from_clip: &Pose3) -> CloudPoint {
    let (position, normal) = (map_from_clip * point.position(), map_from_clip * point.normal());
    CloudPoint {
        position_m: [position.x as f32, position.y as f32, position.z as f32],
        normal: [normal.x as f32, normal.y as f32, normal.z as f32],
        ..*point
    }
}

/// Returns a clip's points in the map's frame that lie in tiles to rebuild.
fn placed_points(
    loaded: &Loaded,
    map_from_clip: &Pose3,
    dirty: &BTreeSet<TileKey>,
) -> Vec<(TileKey, CloudPoint)> {
    let points = loaded.share.cloud_in_clip.points.par_iter().map(|point| {
        let point = placed(point, map_from_clip);
        (tile_of(&point.position_m), point)
    });
    points.filter(|(key, _)| dirty.contains(key)).collect()
}

/// Removes points that a later clip looked through: the world changed there.
fn without_what_is_gone<E>(
    mut points: Vec<(TileKey, CloudPoint)>,
    clip: &PlacedClip,
    clips: &[(&Member, PlacedClip)],
    cache: &mut Cache<E>,
) -> Result<Vec<(TileKey, CloudPoint)>, E> {
    let Some(recorded_at_ms) = clip.recorded_at_ms else { return Ok(points) };
    let is_later = |other: &PlacedClip| other.recorded_at_ms.is_some_and(|at| at > recorded_at_ms);
    for (member, other) in clips.iter().filter(|(_, other)| is_later(other)) {
        let tiles: BTreeSet<&TileKey> = other.tiles.iter().collect();
        if !points.iter().any(|(key, _)| tiles.contains(key)) {
            continue;
        }
        let later: Arc<Loaded> = cache.get(member)?;
        let sights = Sights::new(&later.share.views, &other.in_space());
        points = points
            .into_par_iter()
            .filter(|(key, point)| {
                let at: Point3 = point.position();
                !tiles.contains(key) || !is_gone(&sights, &at)
            })
            .collect();
    }
    Ok(points)
}
