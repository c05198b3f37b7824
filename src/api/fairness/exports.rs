//! The limit of concurrent exports.

use crate::api::error::Error;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::Semaphore;

/// Maximum number of concurrent exports. Each reads one blob at a time and holds about a megabyte.
const MAX_EXPORTS: usize = 64;
/// Maximum number for one tenant, so that others find a place.
const MAX_EXPORTS_OF_TENANT: usize = 16;

/// The running exports of this process.
#[derive(Clone)]
pub(in crate::api) struct ExportPlaces {
    /// Their number by tenant.
    taken: Arc<Mutex<HashMap<String, usize>>>,
    /// One export compresses at a time, so that other requests wait for one piece at most.
    compressing: Arc<Semaphore>,
}

/// The place of an export; its drop frees the place.
pub(in crate::api) struct ExportPlace {
    places: ExportPlaces,
    tenant: String,
}

impl Default for ExportPlaces {
    fn default() -> ExportPlaces {
        ExportPlaces { taken: Arc::default(), compressing: Arc::new(Semaphore::new(1)) }
    }
}

impl ExportPlace {
    /// Returns the turns of the exports that compress.
    pub fn compressing(&self) -> Arc<Semaphore> {
        self.places.compressing.clone()
    }
}

impl ExportPlaces {
    /// Takes a place or refuses immediately: each waiting export would hold a connection.
    pub fn take(&self, tenant: &str) -> Result<ExportPlace, Error> {
        let mut taken = self.taken();
        let all: usize = taken.values().sum();
        let own = taken.get(tenant).copied().unwrap_or_default();
        if all >= MAX_EXPORTS || own >= MAX_EXPORTS_OF_TENANT {
            return Err(Error::TooManyExports { most: MAX_EXPORTS, most_of_tenant: MAX_EXPORTS_OF_TENANT });
        }
        taken.insert(tenant.to_owned(), own + 1);
        Ok(ExportPlace { places: self.clone(), tenant: tenant.to_owned() })
    }

    fn taken(&self) -> MutexGuard<'_, HashMap<String, usize>> {
        self.taken.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for ExportPlace {
    fn drop(&mut self) {
        let mut taken = self.places.taken();
        match taken.get_mut(&self.tenant) {
            Some(own) if *own > 1 => *own -= 1,
            _ => {
                taken.remove(&self.tenant);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tenant_takes_its_share_and_leaves_the_rest() {
        let places = ExportPlaces::default();
        let mut held: Vec<ExportPlace> =
            (0..MAX_EXPORTS_OF_TENANT).map(|_| places.take("acme").unwrap()).collect();
        assert!(places.take("acme").is_err());
        let of_others = (MAX_EXPORTS - MAX_EXPORTS_OF_TENANT) / MAX_EXPORTS_OF_TENANT;
        for tenant in 0..of_others {
            held.extend(
                (0..MAX_EXPORTS_OF_TENANT).map(|_| places.take(&format!("tenant-{tenant}")).unwrap()),
            );
        }
        assert!(places.take("late").is_err(), "all {MAX_EXPORTS} places are taken");
        held.pop();
        held.push(places.take("late").unwrap());
        held.clear();
        assert!(places.taken().is_empty(), "nothing is kept of tenants without exports");
    }
}
