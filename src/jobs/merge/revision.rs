//! The next revision of an assembled map: its labels, its description and its files.

use super::describing::{Described, Earlier, describe};
use super::error::MergeError;
use crate::jobs::LevelFile;
use bytes::Bytes;
use rayon::prelude::*;
use std::collections::BTreeMap;
use viola_align::LevelMap;
use viola_formats::lidar::LidarMap;
use viola_geometry::LevelName;
use viola_geometry::progress::{self, Progress};
use viola_home::{
    Assembly, Coverage, LabelledMap, LookedThrough, PlacedClip, Tile, TileKey, UnknownFileFormat,
};
use viola_reconstruct::label::SurfaceNetwork;
use viola_storage::{LevelCoverage, NewRevision, map_file};

/// A level of the home, as the description needs it.
pub(super) struct Level {
    pub file: LevelFile,
    pub last: Earlier,
    /// True if all of it stays as it was.
    pub is_same: bool,
}

/// Adds the tiles that the next revision keeps, and labels the map where it changed.
pub(super) fn label(
    assembly: Assembly,
    kept: Vec<(TileKey, Bytes)>,
    surface: Option<&SurfaceNetwork>,
    progress: &dyn Progress,
) -> Result<LabelledMap, MergeError> {
    progress::check(progress)?;
    let read = |(key, bytes): (TileKey, Bytes)| Ok((key, assembly.read_kept(&key, &bytes)?));
    let kept = kept.into_par_iter().map(read).collect::<Result<_, UnknownFileFormat>>();
    let kept = kept.map_err(|_| MergeError::DamagedMap)?;
    Ok(assembly.label(kept, surface, progress)?)
}

/// Returns the next revision with all its files.
pub(super) fn revision(
    map: LabelledMap,
    levels: &[Level],
    progress: &dyn Progress,
) -> Result<NewRevision, MergeError> {
    let LabelledMap { manifest, tiles, changed, sums, mut looked, .. } = map;
    let mut new = NewRevision { manifest, ..NewRevision::default() };
    new.sums.extend(sums);
    new.tiles.extend(changed.iter().map(|key| (*key, tiles.get(key).map(Tile::to_bytes))));
    let mut of_levels: BTreeMap<LevelName, Vec<Tile>> = BTreeMap::new();
    for (key, tile) in tiles {
        of_levels.entry(key.level).or_default().push(tile);
    }
    for Level { file: LevelFile { level, bytes }, last, is_same } in levels {
        // Files that are not listed stay as they were.
        if let Some(scene) = last.scene.as_ref().filter(|_| *is_same) {
            new.coverage.push(coverage(*level, &scene.coverage));
            new.objects.extend(scene.objects.iter().cloned());
            continue;
        }
        let tiles = of_levels.remove(level).unwrap_or_default();
        let looked = looked_through(&mut looked, *level, &new.manifest.clips);
        let map = LevelMap { level: *level, lidar: &LidarMap::read(bytes)? };
        let Described { scene, plan, has_object_changes } =
            describe(map, &tiles, &new.manifest.clips, &looked, last, progress)?;
        if last.scene.as_ref().is_some_and(|last| last.mesh_parts() == scene.mesh_parts()) {
            new.same_mesh_parts.push(*level);
        }
        new.files.extend(plan.map(|(name, bytes)| (*level, name, bytes)));
        new.files.push((*level, map_file::SCENE, serde_json::to_vec(&scene).unwrap_or_default()));
        new.coverage.push(coverage(*level, &scene.coverage));
        new.objects.extend(scene.objects);
        new.has_object_changes |= has_object_changes;
    }
    Ok(new)
}

/// Removes and returns the observations of the changed tiles of a level. For a level without a changed tile it returns only
/// the times of the clips: a correction must not erase them from the history of the objects.
fn looked_through(
    looked: &mut BTreeMap<LevelName, LookedThrough>,
    level: LevelName,
    clips: &[PlacedClip],
) -> LookedThrough {
    looked.remove(&level).unwrap_or_else(|| LookedThrough::of(level, clips))
}

fn coverage(level: LevelName, of_level: &Coverage) -> LevelCoverage {
    LevelCoverage { level, seen: of_level.seen, floor_seen: of_level.floor_seen }
}

#[cfg(test)]
mod tests {
    use super::*;
    use uuid::Uuid;
    use viola_geometry::Pose2;
    use viola_home::{Extent, PlacedBy};

    fn clip(recorded_at_ms: Option<i64>) -> PlacedClip {
        PlacedClip {
            clip: Uuid::nil(),
            contribution: String::new(),
            recorded_at_ms,
            by: PlacedBy::Alignment,
            level: LevelName::MAIN,
            probability: None,
            alone: Pose2::IDENTITY,
            rise_m: 0.0,
            map_from_clip: Pose2::IDENTITY,
            floor_correction: viola_home::FloorCorrection::default(),
            with: Vec::new(),
            extent: Extent { min_m: [0.0; 2], max_m: [1.0; 2] },
            tiles: Vec::new(),
            points: 1,
        }
    }

    #[test]
    fn a_level_without_a_changed_tile_has_the_times_of_its_clips() {
        let clips = [clip(Some(7)), clip(None)];
        let looked = looked_through(&mut BTreeMap::new(), LevelName::MAIN, &clips);
        assert_eq!([0, 1, 2].map(|number| looked.time_ms(number)), [Some(7), None, None]);
    }
}
