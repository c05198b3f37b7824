//! Makes the meshes of a home's new revision beside the next job, so that a reader does not wait for them.

use super::merge::{MergeError, on_own_thread};
use std::sync::Arc;
use std::time::Instant;
use tokio::sync::Semaphore;
use tracing::{info, warn};
use viola_home::MESH_TRIANGLES;
use viola_storage::{HomeId, Storage};

/// A mesh takes seconds of all cores, and memory.
static ONE_AT_A_TIME: Semaphore = Semaphore::const_new(1);

/// Adds the meshes that the current revision of a home lacks, unless work is ahead that may replace it. Without them a
/// reader's request makes the mesh, so a failure is only logged.
pub(super) async fn make_meshes(storage: Arc<Storage>, home: HomeId) {
    let Ok(_turn) = ONE_AT_A_TIME.acquire().await else { return };
    if let Err(cause) = try_make(&storage, &home).await {
        warn!(%home, %cause, "a mesh was not made; it is made when somebody asks for it");
    }
}

async fn try_make(storage: &Storage, home: &HomeId) -> Result<(), MergeError> {
    if !storage.has_settled_map(home, storage.now()).await? {
        return Ok(());
    }
    let Some(map) = storage.home_map(home, None).await? else { return Ok(()) };
    for level in storage.levels_without_mesh(home, &map).await? {
        let begun = Instant::now();
        let Some(surface) = storage.level_surface(home, map.revision, level).await? else { return Ok(()) };
        let make = move || surface.mesh(MESH_TRIANGLES).glb();
        let glb = on_own_thread(make)?.await.map_err(|_| MergeError::Panicked)?;
        let bytes = glb.len();
        if storage.add_mesh(home, &map, level, glb).await? {
            let seconds = begun.elapsed().as_secs_f64();
            info!(%home, revision = map.revision, %level, bytes, seconds, "mesh made");
        }
    }
    Ok(())
}
