//! Makes the meshes of a home's new revision beside the next job, so that a reader does not wait for them.

use super::merge::{MergeError, on_own_thread};
use std::collections::HashSet;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;
use tokio::sync::Semaphore;
use tracing::{info, warn};
use viola_home::MESH_TRIANGLES;
use viola_storage::{HomeId, Storage};

/// A mesh takes seconds of all cores, and memory.
static ONE_AT_A_TIME: Semaphore = Semaphore::const_new(1);

/// Maximum number of homes that wait for their meshes. Those of a further home are made when somebody asks for them.
const MAX_WAITING: usize = 1000;

/// The homes that wait for their meshes after jobs and merges of a worker, which may end faster than meshes are made.
#[derive(Default)]
pub(super) struct WaitingHomes(Mutex<HashSet<HomeId>>);

impl WaitingHomes {
    fn homes(&self) -> MutexGuard<'_, HashSet<HomeId>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a home; returns false if it waits already, or too many do.
    fn enter(&self, home: &HomeId) -> bool {
        let mut homes = self.homes();
        homes.len() < MAX_WAITING && homes.insert(home.clone())
    }
}

/// Adds the meshes that the current revision of a home lacks, unless work is ahead that may replace it. Without them a
/// reader's request makes the mesh, so a failure is only logged.
pub(super) fn begin_meshes(waiting: Arc<WaitingHomes>, storage: Arc<Storage>, home: HomeId) {
    if !waiting.enter(&home) {
        return;
    }
    tokio::spawn(async move {
        let Ok(_turn) = ONE_AT_A_TIME.acquire().await else { return };
        // A revision that is made from now on is not seen below.
        waiting.homes().remove(&home);
        if let Err(cause) = try_make(&storage, &home).await {
            warn!(%home, %cause, "a mesh was not made; it is made when somebody asks for it");
        }
    });
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_home_waits_once_and_a_bounded_number_waits() {
        let waiting = WaitingHomes::default();
        let home = |number: usize| format!("h{number}").parse::<HomeId>().unwrap();
        assert!(waiting.enter(&home(0)) && !waiting.enter(&home(0)));
        assert_eq!(
            (1..2 * MAX_WAITING).filter(|number| waiting.enter(&home(*number))).count(),
            MAX_WAITING - 1
        );
        waiting.homes().remove(&home(0));
        assert!(waiting.enter(&home(0)), "its next revision waits again");
    }
}
