//! Places for work: a bounded number in the process and for each tenant, or for each network of clients that no key names.
//! Tenants take turns: a tenant that wants many places waits in its own queue, and another one waits only for the work that
//! runs and for one request of each tenant that came before it.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

/// Number of tenants above which those without work are forgotten.
const MAX_TENANTS: usize = 1024;

/// The places of one kind of work.
pub(in crate::api) struct FairPlaces {
    most_of_tenant: usize,
    all: Arc<Semaphore>,
    tenants: Mutex<HashMap<String, Queue>>,
}

/// The queue of a tenant.
#[derive(Clone)]
struct Queue {
    places: Arc<Semaphore>,
    /// Has one permit, for the request that waits in the queue of the process.
    turn: Arc<Semaphore>,
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
        let closed = "the semaphore is never closed";
        let Queue { places, turn } = self.queue(tenant);
        let of_tenant = places.acquire_owned().await.expect(closed);
        let _turn = turn.acquire().await.expect(closed);
        let of_process = self.all.clone().acquire_owned().await.expect(closed);
        FairPlace { _of_tenant: of_tenant, _of_process: of_process }
    }

    /// Takes a place if the tenant and the process have one now.
    pub fn try_take(&self, tenant: &str) -> Option<FairPlace> {
        let of_tenant = self.queue(tenant).places.try_acquire_owned().ok()?;
        let of_process = self.all.clone().try_acquire_owned().ok()?;
        Some(FairPlace { _of_tenant: of_tenant, _of_process: of_process })
    }

    fn queue(&self, tenant: &str) -> Queue {
        let mut tenants = self.tenants.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = tenants.get(tenant) {
            return known.clone();
        }
        if tenants.len() >= MAX_TENANTS {
            // The map holds the last reference to the places of a tenant that does nothing.
            tenants.retain(|_, queue| Arc::strong_count(&queue.places) > 1);
        }
        let places = Arc::new(Semaphore::new(self.most_of_tenant));
        let queue = Queue { places, turn: Arc::new(Semaphore::new(1)) };
        tenants.insert(tenant.to_owned(), queue.clone());
        queue
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use futures::FutureExt;
    use std::pin::Pin;

    type Waiting<'a> = Pin<Box<dyn Future<Output = FairPlace> + 'a>>;

    /// Begins to wait for a place; none may be free.
    fn wait<'a>(places: &'a FairPlaces, tenant: &'a str) -> Waiting<'a> {
        let mut waiting: Waiting = Box::pin(places.take(tenant));
        assert!(now(&mut waiting).is_none(), "{tenant} has a place");
        waiting
    }

    fn now(waiting: &mut Waiting) -> Option<FairPlace> {
        waiting.as_mut().now_or_never()
    }

    #[test]
    fn a_tenant_with_many_requests_makes_others_wait_for_one() {
        let places = FairPlaces::new(1, 1);
        let first = places.try_take("acme").unwrap();
        let mut more: Vec<Waiting> = (0..100).map(|_| wait(&places, "acme")).collect();
        let mut other = wait(&places, "bolt");
        drop(first);
        drop(now(&mut other).unwrap());
        drop(now(&mut more[0]).unwrap());
        drop(more);
        drop(places.try_take("acme").unwrap());
        drop(places.try_take("bolt").unwrap());
    }

    #[test]
    fn tenants_take_turns() {
        let places = FairPlaces::new(1, 2);
        let first = places.try_take("busy").unwrap();
        let [mut second, mut third] = [(); 2].map(|()| wait(&places, "busy"));
        let closed = wait(&places, "closed");
        let mut honest = wait(&places, "honest");
        drop((closed, first));
        // One of the busy tenant, then the honest one; nobody waits for the request that ended.
        let begun = now(&mut second).unwrap();
        assert!(now(&mut third).is_none() && now(&mut honest).is_none());
        drop(begun);
        assert!(now(&mut third).is_none());
        drop(now(&mut honest).unwrap());
        drop(now(&mut third).unwrap());
    }

    #[test]
    fn a_tenant_leaves_places_for_others() {
        let places = FairPlaces::new(2, 1);
        let first = places.try_take("busy").unwrap();
        let mut second = wait(&places, "busy");
        drop(places.take("honest").now_or_never().unwrap());
        assert!(now(&mut second).is_none());
        drop(first);
        assert!(now(&mut second).is_some());
    }

    #[test]
    fn a_place_that_nobody_took_is_given_again() {
        let places = FairPlaces::new(1, 1);
        for tenant in ["acme", "bolt"] {
            let first = places.try_take("acme").unwrap();
            let gone = wait(&places, tenant);
            drop(first);
            drop(gone);
        }
        assert!(places.try_take("acme").is_some());
    }

    #[test]
    fn tenants_without_work_are_forgotten() {
        let places = FairPlaces::new(2, 1);
        let held = places.try_take("busy").unwrap();
        for number in 0..MAX_TENANTS {
            places.try_take(&format!("tenant-{number}")).unwrap();
        }
        assert!(places.tenants.lock().unwrap().len() <= 2);
        assert!(places.try_take("busy").is_none(), "a tenant with work is kept");
        drop(held);
        assert!(places.try_take("busy").is_some());
    }
}
