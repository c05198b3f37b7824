//! The mesh of a map's level: the surface that it is made of, and its file, which is added to a revision later.

use super::{HomeMap, MapFile, MapObject, map_file, owner};
use crate::database::query;
use crate::{HomeId, Storage, StorageError, homes, pending_deletes};
use jiff::Timestamp;
use uuid::Uuid;
use viola_geometry::LevelName;
use viola_home::{Mesh, MeshObject, Tile};

/// Maximum number of points of which a mesh is made: it bounds the memory.
pub const MESH_POINTS: usize = 2_000_000;

/// The tiles and the objects of a level, of which its mesh is made.
pub struct LevelSurface {
    tiles: Vec<Tile>,
    objects: Vec<MapObject>,
}

impl LevelSurface {
    /// Makes the mesh with at most `triangles`; each object becomes a part of it.
    pub fn mesh(&self, triangles: usize) -> Mesh {
        let parts: Vec<MeshObject> = self
            .objects
            .iter()
            .map(|object| MeshObject { id: &object.id, class: object.class, bounds: object.bounds() })
            .collect();
        Mesh::new(&self.tiles, &parts, triangles)
    }
}

fn new_key() -> String {
    format!("home-maps/{}", Uuid::now_v7())
}

impl Storage {
    /// Returns the surface of a level of a revision; `None` if the revision was removed meanwhile.
    pub async fn level_surface(
        &self,
        home: &HomeId,
        revision: i64,
        level: LevelName,
    ) -> Result<Option<LevelSurface>, StorageError> {
        let damaged = || StorageError::Column { column: "tile", detail: "it is damaged".to_owned() };
        let mut tiles = Vec::new();
        for file in self.home_map_files(home, revision, level, map_file::TILE).await? {
            let Some(bytes) = self.map_file_bytes(&file).await? else {
                self.check_map_file_removed(&file).await?;
                return Ok(None);
            };
            tiles.push(Tile::read(&bytes).map_err(|_| damaged())?);
        }
        let scene = self.scene_of_level(home, revision, level).await?;
        Ok(scene.map(|scene| LevelSurface { tiles, objects: scene.objects }))
    }

    /// Returns the levels of a map that may have a mesh and have none yet.
    pub async fn levels_without_mesh(
        &self,
        home: &HomeId,
        map: &HomeMap,
    ) -> Result<Vec<LevelName>, StorageError> {
        let mut without = Vec::new();
        for level in map.levels.iter().filter(|level| (1..=MESH_POINTS).contains(&level.info.points)) {
            if self.home_map_files(home, map.revision, level.level, map_file::MESH).await?.is_empty() {
                without.push(level.level);
            }
        }
        Ok(without)
    }

    /// Adds the mesh of a level to a revision. Returns false, and adds nothing, if the revision is not the current one any
    /// more or has a mesh.
    pub async fn add_mesh(
        &self,
        home: &HomeId,
        map: &HomeMap,
        level: LevelName,
        glb: Vec<u8>,
    ) -> Result<bool, StorageError> {
        let (key, size_bytes) = (new_key(), glb.len() as i64);
        let added = match self.blobs.put(&key, glb).await {
            Ok(()) => self.add_mesh_row(home, map, level, &key, size_bytes).await,
            Err(error) => Err(error),
        };
        // A write that failed may have taken effect.
        self.discard_unless(&[key], &added, |is_added| *is_added).await;
        added
    }

    /// Replaces the file of a mesh that the store lost or damaged. Returns false, and changes nothing, if it was replaced or
    /// removed meanwhile.
    pub async fn replace_mesh(
        &self,
        home: &HomeId,
        damaged: &MapFile,
        glb: Vec<u8>,
        now: Timestamp,
    ) -> Result<bool, StorageError> {
        let (key, size_bytes) = (new_key(), glb.len() as i64);
        let replaced = match self.blobs.put(&key, glb).await {
            Ok(()) => self.replace_mesh_row(home, damaged, &key, size_bytes, now).await,
            Err(error) => Err(error),
        };
        if let Ok(true) = replaced {
            self.discard_pending(&owner(home), std::slice::from_ref(&damaged.key)).await;
        }
        self.discard_unless(&[key], &replaced, |is_replaced| *is_replaced).await;
        replaced
    }

    async fn replace_mesh_row(
        &self,
        home: &HomeId,
        damaged: &MapFile,
        key: &str,
        size_bytes: i64,
        now: Timestamp,
    ) -> Result<bool, StorageError> {
        let mut transaction = self.database.begin().await?;
        // Holds the home, as the end of a merge does, which may remove the mesh.
        homes::lock(&mut transaction, home).await?;
        let replaced = query("UPDATE home_map_files SET blob_key = $1, size_bytes = $2 WHERE blob_key = $3");
        let replaced = replaced.bind(key).bind(size_bytes).bind(&damaged.key);
        if replaced.execute(&mut transaction).await? == 0 {
            return Ok(false);
        }
        homes::grow(&mut transaction, home, size_bytes - damaged.size_bytes as i64).await?;
        pending_deletes::add(&mut transaction, &owner(home), std::slice::from_ref(&damaged.key), now).await?;
        transaction.commit().await?;
        Ok(true)
    }

    async fn add_mesh_row(
        &self,
        home: &HomeId,
        map: &HomeMap,
        level: LevelName,
        key: &str,
        size_bytes: i64,
    ) -> Result<bool, StorageError> {
        let mut transaction = self.database.begin().await?;
        // Holds the home, as the end of a merge does, so that no revision comes between the check and the row.
        homes::grow(&mut transaction, home, size_bytes).await?;
        // A home that was removed and made again counts its revisions from 1, so the number alone does not name one.
        let added = query(
            "INSERT INTO home_map_files (blob_key, home_id, name, first_revision, level, size_bytes)
            SELECT $1, $2, $3, $4, $5, $6
            WHERE (SELECT MAX(revision) FROM home_maps WHERE home_id = $2) = $4
                AND EXISTS (SELECT 1 FROM home_maps WHERE home_id = $2 AND revision = $4 AND created_at = $7)
                AND NOT EXISTS (SELECT 1 FROM home_map_files
                    WHERE home_id = $2 AND name = $3 AND level = $5 AND last_revision IS NULL)",
        )
        .bind(key)
        .bind(home.key())
        .bind(map_file::MESH)
        .bind(map.revision)
        .bind(level.as_str())
        .bind(size_bytes)
        .bind(map.created_at.as_millisecond())
        .execute(&mut transaction)
        .await?;
        if added == 0 {
            return Ok(false);
        }
        transaction.commit().await?;
        Ok(true)
    }
}
