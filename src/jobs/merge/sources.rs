//! The stored state from which a merge begins, and the answers to the questions of its work.

use super::describing::{Earlier, LeftMap, loses_objects, removed_levels};
use super::error::MergeError;
use super::revision::Level;
use super::work::{Answer, Files, Request};
use crate::jobs::LevelFile;
use futures::stream::{self, StreamExt, TryStreamExt};
use std::collections::{BTreeMap, BTreeSet};
use uuid::Uuid;
use viola_geometry::{LevelName, Pose2};
use viola_home::{Manifest, TileKey};
use viola_storage::{
    LidarMapRevision, MapFile, MapScene, MergeClaim, NewRevision, Storage, StorageError, result_file,
};

/// Files that are read at a time: a store far away waits more than it works.
const FILES_AT_A_TIME: usize = 8;

pub(super) struct Sources<'a> {
    storage: &'a Storage,
    claim: &'a MergeClaim,
    last: &'a Manifest,
    scenes: BTreeMap<LevelName, MapScene>,
    tiles: BTreeMap<TileKey, MapFile>,
    sums: BTreeMap<TileKey, MapFile>,
}

impl<'a> Sources<'a> {
    pub async fn read(
        storage: &'a Storage,
        claim: &'a MergeClaim,
        last: &'a Manifest,
    ) -> Result<Sources<'a>, StorageError> {
        let by_tile = |files: Vec<MapFile>| files.into_iter().filter_map(|file| Some((file.tile?, file)));
        // A map that is made again from its clips does not take the sums of a damaged one.
        let is_again = *last == Manifest::default();
        let sums = if is_again { Vec::new() } else { storage.last_sums(claim).await? };
        Ok(Sources {
            storage,
            claim,
            last,
            scenes: storage.last_scenes(claim).await?,
            tiles: by_tile(storage.last_tiles(claim).await?).collect(),
            sums: by_tile(sums).collect(),
        })
    }

    pub async fn answer(&self, request: Request) -> Result<Answer, MergeError> {
        Ok(match request {
            Request::Contributions(clips) => {
                Answer::Files(self.of_clips(&clips, &[result_file::CLOUD, result_file::VIEWS]).await?)
            }
            Request::Features(clips) => Answer::Files(self.of_clips(&clips, &[result_file::FEATURES]).await?),
            Request::Sums(tiles) => Answer::Files(self.of_tiles(&self.sums, tiles).await?),
            Request::Tiles(tiles) => Answer::Files(self.of_tiles(&self.tiles, tiles).await?),
            Request::Levels(next) => Answer::Levels(match self.is_made(&next) {
                true => None,
                false => Some(self.levels().await?),
            }),
        })
    }

    /// Returns the files of each clip, by their names.
    async fn of_clips(&self, clips: &[Uuid], names: &[&str]) -> Result<Files, MergeError> {
        let mut reads = Vec::new();
        for clip in clips {
            let member = self.claim.members.iter().find(|member| member.clip == *clip);
            let member = member.ok_or(MergeError::DamagedClip { clip: *clip })?;
            reads.extend(names.iter().map(|name| self.storage.member_file(member, name)));
        }
        Ok(stream::iter(reads).buffered(FILES_AT_A_TIME).try_collect().await?)
    }

    async fn of_tiles(
        &self,
        files: &BTreeMap<TileKey, MapFile>,
        tiles: Vec<TileKey>,
    ) -> Result<Files, MergeError> {
        let read = |tile: TileKey| {
            let file = files.get(&tile);
            async move {
                match file {
                    Some(file) => self.storage.map_file_bytes(file).await,
                    None => Ok(None),
                }
            }
        };
        let reads: Vec<_> = tiles.into_iter().map(read).collect();
        Ok(stream::iter(reads).buffered(FILES_AT_A_TIME).try_collect().await?)
    }

    /// Returns whether the last revision is what the next one would be, whose manifest is `next`.
    fn is_made(&self, next: &Manifest) -> bool {
        let claim = self.claim;
        let described = (claim.corrections.version, claim.home_name.as_deref());
        let is_described = |level: &LevelName| {
            self.scenes.get(level).is_some_and(|scene| (scene.corrections(), scene.home_name()) == described)
        };
        claim.last_revision > 0
            && !claim.has_new_lidar_map()
            && next == self.last
            && claim.lidar_maps.iter().all(|map| is_described(&map.level))
            // A map whose manifest was left out has more tiles than that.
            && self.tiles.len() == self.last.tiles.len()
    }

    fn is_level(&self, level: LevelName) -> bool {
        self.claim.lidar_maps.iter().any(|map| map.level == level)
    }

    /// Returns the levels with a LiDAR map.
    async fn levels(&self) -> Result<Vec<Level>, MergeError> {
        let removed = removed_levels(&self.scenes, |level| self.is_level(level));
        let mut levels = Vec::new();
        for map in &self.claim.lidar_maps {
            let clips = self.last.clips.iter().filter(|clip| clip.level == map.level).cloned().collect();
            let last = Earlier {
                clips,
                scene: self.scenes.get(&map.level).cloned(),
                corrections: self.claim.corrections.on_level(map.level),
                home_name: self.claim.home_name.clone(),
                left: self.left_map(map).await?,
                removed_levels: removed.clone(),
            };
            let bytes = self.storage.lidar_map_file(map.id()).await?;
            levels.push(Level { file: LevelFile { level: map.level, bytes }, last, is_same: false });
        }
        Ok(levels)
    }

    /// Returns a level's LiDAR map of the last revision, if the level has another one now.
    async fn left_map(&self, now: &LidarMapRevision) -> Result<Option<LeftMap>, MergeError> {
        let Some(revision) = self.claim.left_lidar_map(now) else { return Ok(None) };
        let (mut now_from_map, mut map) = (Pose2::IDENTITY, Some(now.clone()));
        while let Some(step) = map.and_then(|map| map.from_earlier) {
            now_from_map = now_from_map.compose(&step.map_from_earlier);
            if step.revision == revision {
                return Ok(Some(LeftMap { revision, now_from_left: Some(now_from_map) }));
            }
            map = self.storage.lidar_map_revision(&self.claim.home, now.level, step.revision).await?;
        }
        Ok(Some(LeftMap { revision, now_from_left: None }))
    }

    /// Adds to a new revision what its work does not know: the lost objects of removed levels, and the tiles of the last
    /// revision that a map made from the clips alone lacks.
    pub fn complete(&self, new: &mut NewRevision) {
        new.has_object_changes |= loses_objects(&self.scenes, |level| self.is_level(level));
        let there: BTreeSet<TileKey> = new.manifest.tiles.iter().map(|(key, _)| *key).collect();
        let told: BTreeSet<TileKey> = new.tiles.iter().map(|(key, _)| *key).collect();
        let others = self.tiles.keys().filter(|key| !there.contains(key) && !told.contains(key));
        new.tiles.extend(others.map(|key| (*key, None)));
    }
}
