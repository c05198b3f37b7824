//! The places of requests whose files are made while they wait.

use super::error::{Defence, Error};
use super::fair::{FairPlace, FairPlaces};
use std::time::Duration;
use tokio::time::timeout;

/// Timeout for waiting until a file can be made.
const WAIT: Duration = Duration::from_secs(60);

/// The places of requests whose file is made while they wait. One mesh and one other file are made at a time, and tenants
/// take turns.
pub(super) struct Making {
    meshes: FairPlaces,
    files: FairPlaces,
}

impl Default for Making {
    fn default() -> Making {
        Making { meshes: FairPlaces::new(1, 1), files: FairPlaces::new(1, 1) }
    }
}

impl Making {
    /// Waits for the place of a mesh: making one takes seconds and all cores.
    pub async fn mesh(&self, tenant: &str) -> Result<FairPlace, Error> {
        place(&self.meshes, tenant).await
    }

    /// Waits for the place of another file: making one takes a core for seconds, memory, and room on the disk.
    pub async fn file(&self, tenant: &str) -> Result<FairPlace, Error> {
        place(&self.files, tenant).await
    }
}

async fn place(places: &FairPlaces, tenant: &str) -> Result<FairPlace, Error> {
    let place = timeout(WAIT, places.take(tenant)).await;
    Ok(place.map_err(|_| Defence::MakersBusy { wait: WAIT })?)
}
