//! The descriptions that a merge starts from.

use super::{KEPT_REVISIONS, MapFile, MapLevel, MergeClaim, map_file};
use crate::{MapHistory, MapScene, Page, Storage, StorageError};
use std::collections::BTreeMap;
use tracing::warn;
use viola_geometry::LevelName;

/// Version of the corrections in a scene of an earlier revision: its level is described again.
const OUTDATED: i64 = -1;

impl Storage {
    /// Returns the scenes of the revision that a claim starts from, by level. If one is lost or damaged, it returns that of
    /// an earlier revision in the same frame, so that rooms and objects keep their ids.
    pub async fn last_scenes(
        &self,
        claim: &MergeClaim,
    ) -> Result<BTreeMap<LevelName, MapScene>, StorageError> {
        let mut scenes = BTreeMap::new();
        for file in self.last_files(claim, map_file::SCENE).await? {
            let scene = match self.whole_scene(claim, &file).await? {
                None => self.earlier_scene(claim, file.level).await?,
                scene => scene,
            };
            scenes.extend(scene.map(|scene| (file.level, scene)));
        }
        Ok(scenes)
    }

    /// Returns the newest scene of a level in the revisions before the last one.
    async fn earlier_scene(
        &self,
        claim: &MergeClaim,
        level: LevelName,
    ) -> Result<Option<MapScene>, StorageError> {
        let frame = |levels: &[MapLevel]| {
            levels.iter().find(|known| known.level == level).map(|known| known.lidar_map_revision)
        };
        let earlier = Page { limit: KEPT_REVISIONS as u32, after: Some(claim.last_revision) };
        for map in self.home_map_revisions(&claim.home, &earlier).await? {
            if frame(&map.levels) != frame(&claim.last_levels) {
                break;
            }
            for file in self.home_map_files(&claim.home, map.revision, level, map_file::SCENE).await? {
                if let Some(mut scene) = self.whole_scene(claim, &file).await? {
                    scene.history = Some(MapHistory { corrections: OUTDATED, ..scene.history() });
                    return Ok(Some(scene));
                }
            }
        }
        Ok(None)
    }

    /// Returns a scene; `None` if its file is lost or damaged.
    async fn whole_scene(
        &self,
        claim: &MergeClaim,
        file: &MapFile,
    ) -> Result<Option<MapScene>, StorageError> {
        let damage = match self.map_scene(file).await {
            Ok(Some(scene)) => return Ok(Some(scene)),
            Ok(None) => "its file is lost".to_owned(),
            Err(damage @ StorageError::Column { .. }) => damage.to_string(),
            Err(error) => return Err(error),
        };
        warn!(home = %claim.home, map_level = %file.level, %damage, "a description of the map is left out");
        Ok(None)
    }
}
