//! Places for slow work: a bounded number in the process and for each tenant. A tenant that wants many places waits in its
//! own queue, so that another one waits only for the work that runs.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

/// The places of one kind of work.
pub(in crate::api) struct FairPlaces {
    most_of_tenant: usize,
    all: Arc<Semaphore>,
    tenants: Mutex<HashMap<String, Arc<Semaphore>>>,
}

/// A place in the tenant and in the process; its drop frees both.
pub(in crate::api) struct FairPlace {
    _of_tenant: OwnedSemaphorePermit,
    _of_process: OwnedSemaphorePermit,
}

impl FairPlaces {
    pub fn new(most: usize, most_of_tenant: usize) -> FairPlaces {
        FairPlaces { most_of_tenant, all: Arc::new(Semaphore::new(most)), tenants: Mutex::default() }
    }

    /// Waits in the queue of the tenant, then in that of the process.
    pub async fn take(&self, tenant: &str) -> FairPlace {
        let of_tenant = {
            let mut tenants = self.tenants.lock().unwrap_or_else(PoisonError::into_inner);
            // The map holds the last reference to the queue of a tenant that does nothing.
            tenants.retain(|_, queue| Arc::strong_count(queue) > 1);
            let new = || Arc::new(Semaphore::new(self.most_of_tenant));
            tenants.entry(tenant.to_owned()).or_insert_with(new).clone()
        };
        let closed = "the semaphore is never closed";
        FairPlace {
            _of_tenant: of_tenant.acquire_owned().await.expect(closed),
            _of_process: self.all.clone().acquire_owned().await.expect(closed),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_tenant_with_many_requests_makes_others_wait_for_one() {
        let places = FairPlaces::new(1, 1);
        let first = places.take("acme").await;
        let mut more: Vec<_> = (0..100).map(|_| Box::pin(places.take("acme"))).collect();
        for next in &mut more {
            assert!(futures::poll!(next).is_pending());
        }
        let mut other = Box::pin(places.take("bolt"));
        assert!(futures::poll!(&mut other).is_pending());
        drop(first);
        drop(other.await);
        let second = more.remove(0).await;
        drop((second, more));
        drop(places.take("acme").await);
        drop(places.take("bolt").await);
        assert_eq!(places.tenants.lock().unwrap().len(), 1, "nothing is kept of tenants without work");
    }
}
