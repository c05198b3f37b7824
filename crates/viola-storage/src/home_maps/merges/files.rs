//! Files of a new revision of a home's map.

use super::rows::Written;
use super::{NewRevision, map_file};
use crate::columns::to_json;
use crate::{Storage, StorageError};
use futures::stream::{self, StreamExt};
use uuid::Uuid;
use viola_geometry::LevelName;

/// Blobs that are written at a time: a store far away, or a disk that flushes each file, waits more than it works.
const AT_A_TIME: usize = 8;

impl Storage {
    /// Writes the files of a revision. `keys` receives the keys of the blobs, also of those that could not be written.
    pub(super) async fn write_files(
        &self,
        new: &NewRevision,
        keys: &mut Vec<String>,
    ) -> Result<Vec<Written>, StorageError> {
        let manifest = to_json(&new.manifest).into_bytes();
        let tiles =
            new.tiles.iter().map(|(key, bytes)| (key.level, map_file::TILE, Some(*key), bytes.as_deref()));
        let sums =
            new.sums.iter().map(|(key, bytes)| (key.level, map_file::SUMS, Some(*key), bytes.as_deref()));
        let files =
            new.files.iter().map(|(level, name, bytes)| (*level, *name, None, Some(bytes.as_slice())));
        let manifest = (LevelName::MAIN, map_file::MANIFEST, None, Some(manifest.as_slice()));
        // The mesh of a level that changed is made later; another name of an object or a room changes no mesh.
        let scenes = new.files.iter().filter(|(_, name, _)| *name == map_file::SCENE);
        let keeps_mesh = |level: &LevelName| {
            new.same_mesh_parts.contains(level) && !new.tiles.iter().any(|(key, _)| key.level == *level)
        };
        let changed = scenes.filter(|(level, ..)| !keeps_mesh(level));
        let meshes = changed.map(|(level, ..)| (*level, map_file::MESH, None, None));
        let (mut written, mut puts) = (Vec::new(), Vec::new());
        for (level, name, tile, bytes) in tiles.chain(sums).chain(files).chain([manifest]).chain(meshes) {
            // Every attempt has its own keys, as with the results of clips.
            let key = bytes.map(|_| format!("home-maps/{}", Uuid::now_v7()));
            if let (Some(key), Some(bytes)) = (key.clone(), bytes) {
                keys.push(key.clone());
                puts.push(async move { self.blobs.put(&key, bytes.to_vec()).await });
            }
            let size_bytes = bytes.map_or(0, <[u8]>::len) as u64;
            written.push(Written { level, name, tile, key, size_bytes });
        }
        // All of them end before a failure is told: what is still being written could not be removed.
        let ended: Vec<Result<(), StorageError>> =
            stream::iter(puts).buffer_unordered(AT_A_TIME).collect().await;
        ended.into_iter().collect::<Result<(), StorageError>>()?;
        Ok(written)
    }
}
