//! The places of requests whose files are made while they wait, and of those files until they are sent.

use super::places::{FairPlace, FairPlaces};
use crate::api::error::{Defence, Error};
use std::time::Duration;
use tokio::time::timeout;

/// Timeout for waiting until a file can be made.
const WAIT: Duration = Duration::from_secs(60);

/// Number of made files of a process and of a tenant that are not sent yet. Each takes up to a hundred megabytes of memory,
/// or room on the disk.
const UNSENT: usize = 16;
const UNSENT_OF_TENANT: usize = 4;

/// The places of requests whose file is made while they wait. One mesh and one other file are made at a time, and tenants
/// take turns.
pub(in crate::api) struct Makers {
    meshes: FairPlaces,
    files: FairPlaces,
    unsent: FairPlaces,
}

impl Default for Makers {
    fn default() -> Makers {
        let unsent = FairPlaces::new(UNSENT, UNSENT_OF_TENANT);
        Makers { meshes: FairPlaces::new(1, 1), files: FairPlaces::new(1, 1), unsent }
    }
}

/// The places of a file.
pub(in crate::api) struct MakerPlaces {
    /// Until it is sent.
    pub unsent: FairPlace,
    /// While it is made.
    pub making: FairPlace,
}

impl Makers {
    /// Waits for the places of a mesh: making one takes seconds and all cores.
    pub async fn mesh(&self, tenant: &str) -> Result<MakerPlaces, Error> {
        self.places(&self.meshes, tenant).await
    }

    /// Waits for the places of another file: making one takes a core for seconds, memory, and room on the disk.
    pub async fn file(&self, tenant: &str) -> Result<MakerPlaces, Error> {
        self.places(&self.files, tenant).await
    }

    /// Waits for the place until the file is sent first, so that a tenant whose clients are slow does not keep that of the making.
    async fn places(&self, makers: &FairPlaces, tenant: &str) -> Result<MakerPlaces, Error> {
        Ok(MakerPlaces { unsent: self.unsent(tenant).await?, making: place(makers, tenant).await? })
    }

    /// Waits for the place that a made file has until it is sent.
    pub async fn unsent(&self, tenant: &str) -> Result<FairPlace, Error> {
        place(&self.unsent, tenant).await
    }
}

async fn place(places: &FairPlaces, tenant: &str) -> Result<FairPlace, Error> {
    let place = timeout(WAIT, places.take(tenant)).await;
    Ok(place.map_err(|_| Defence::MakersBusy { wait: WAIT })?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use futures::poll;
    use std::pin::pin;

    #[tokio::test]
    async fn files_that_are_not_sent_yet_are_bounded() {
        let makers = Makers::default();
        let mut held = Vec::new();
        for _ in 0..UNSENT_OF_TENANT {
            held.push(makers.unsent("acme").await.unwrap());
        }
        assert!(poll!(pin!(makers.unsent("acme"))).is_pending());
        for number in UNSENT_OF_TENANT..UNSENT {
            held.push(makers.unsent(&format!("tenant-{number}")).await.unwrap());
        }
        assert!(poll!(pin!(makers.unsent("late"))).is_pending());
        held.clear();
        assert!(poll!(pin!(makers.unsent("acme"))).is_ready());
    }
}
