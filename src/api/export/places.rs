//! The limit of concurrent exports.

use crate::api::error::Error;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::Semaphore;

/// Maximum number of concurrent exports. Each reads one blob at a time and holds about a megabyte.
const MOST: usize = 64;
/// Maximum number for one tenant, so that others find a place.
const MOST_OF_TENANT: usize = 16;

/// The running exports of this process.
#[derive(Clone)]
pub(in crate::api) struct Places {
    /// Their number by tenant.
    taken: Arc<Mutex<HashMap<String, usize>>>,
    /// One export compresses at a time, so that other requests wait for one piece at most.
    compressing: Arc<Semaphore>,
}

/// The place of an export; its drop frees the place.
pub(super) struct Place {
    places: Places,
    tenant: String,
}

impl Default for Places {
    fn default() -> Places {
        Places { taken: Arc::default(), compressing: Arc::new(Semaphore::new(1)) }
    }
}

impl Place {
    /// Returns the turns of the exports that compress.
    pub fn compressing(&self) -> Arc<Semaphore> {
        self.places.compressing.clone()
    }
}

impl Places {
    /// Takes a place or refuses immediately: each waiting export would hold a connection.
    pub(super) fn take(&self, tenant: &str) -> Result<Place, Error> {
        let mut taken = self.taken();
        let all: usize = taken.values().sum();
        let own = taken.get(tenant).copied().unwrap_or_default();
        if all >= MOST || own >= MOST_OF_TENANT {
            return Err(Error::TooManyExports { most: MOST, most_of_tenant: MOST_OF_TENANT });
        }
        taken.insert(tenant.to_owned(), own + 1);
        Ok(Place { places: self.clone(), tenant: tenant.to_owned() })
    }

    fn taken(&self) -> MutexGuard<'_, HashMap<String, usize>> {
        self.taken.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Place {
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
        let places = Places::default();
        let mut held: Vec<Place> = (0..MOST_OF_TENANT).map(|_| places.take("acme").unwrap()).collect();
        assert!(places.take("acme").is_err());
        let of_others = (MOST - MOST_OF_TENANT) / MOST_OF_TENANT;
        for tenant in 0..of_others {
            held.extend((0..MOST_OF_TENANT).map(|_| places.take(&format!("tenant-{tenant}")).unwrap()));
        }
        assert!(places.take("late").is_err(), "all {MOST} places are taken");
        held.pop();
        held.push(places.take("late").unwrap());
        held.clear();
        assert!(places.taken().is_empty(), "nothing is kept of tenants without exports");
    }
}
