//! Files of a new revision of a home's map.

use super::rows::Written;
use super::{NewRevision, map_file};
use crate::storage::columns::to_json;
use crate::storage::{Storage, StorageError};
use futures::stream::{self, StreamExt, TryStreamExt};
use uuid::Uuid;
use viola_geometry::LevelName;
use viola_home::TileKey;

/// Blobs that are written at a time: a store far away, or a disk that flushes each file, waits more than it works.
const AT_A_TIME: usize = 8;

impl Storage {
    /// Writes the files of a revision. `keys` receives the keys of the blobs, also of those that could not be written.
    pub(super) async fn write_files(
        &self,
        new: &NewRevision,
        keys: &mut Vec<String>,
    ) -> Result<Vec<Written>, StorageError> {
        let tile = |(key, bytes): &(TileKey, Option<Vec<u8>>)| {
            (key.level, map_file::TILE, Some(*key), bytes.clone())
        };
        let sums = |(key, bytes): &(TileKey, Option<Vec<u8>>)| {
            (key.level, map_file::SUMS, Some(*key), bytes.clone())
        };
        let file = |(level, name, bytes): &(LevelName, &'static str, Vec<u8>)| {
            (*level, *name, None, Some(bytes.clone()))
        };
        let manifest = to_json(&new.manifest).into_bytes();
        let manifest = (LevelName::MAIN, map_file::MANIFEST, None, Some(manifest));
        // The mesh of a level that changed is made later.
        let is_scene = |(_, name, _): &&(LevelName, &'static str, Vec<u8>)| *name == map_file::SCENE;
        let meshes =
            new.files.iter().filter(is_scene).map(|(level, ..)| (*level, map_file::MESH, None, None));
        let tiles = new.tiles.iter().map(tile).chain(new.sums.iter().map(sums));
        let all = tiles.chain(new.files.iter().map(file)).chain([manifest]).chain(meshes);
        let (mut written, mut puts) = (Vec::new(), Vec::new());
        for (level, name, tile, bytes) in all {
            let size_bytes = bytes.as_ref().map_or(0, Vec::len) as u64;
            let key = bytes.map(|bytes| {
                // Every attempt has its own keys, as with the results of clips.
                let key = format!("home-maps/{}", Uuid::now_v7());
                puts.push((key.clone(), bytes));
                key
            });
            written.push(Written { level, name, tile, key, size_bytes });
        }
        keys.extend(puts.iter().map(|(key, _)| key.clone()));
        let put = |(key, bytes): (String, Vec<u8>)| async move { self.blobs.put(&key, bytes).await };
        let puts: Vec<_> = puts.into_iter().map(put).collect();
        stream::iter(puts).buffer_unordered(AT_A_TIME).try_collect::<()>().await?;
        Ok(written)
    }
}
