//! The bytes of files that arrive. No quota counts them yet, so a process and each tenant have bounds for them.

use crate::api::error::Defence;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The arriving files of a process.
#[derive(Clone)]
pub(in crate::api) struct Arrivals {
    process_bytes: u64,
    tenant_bytes: u64,
    held: Arc<Mutex<Held>>,
}

/// The bytes that are on the disk.
#[derive(Default)]
struct Held {
    all: u64,
    of_tenants: HashMap<String, u64>,
}

/// A file that arrives, until it is stored or refused. Its drop frees its bytes.
pub(in crate::api) struct Arrival {
    arrivals: Arrivals,
    tenant: String,
    bytes: u64,
}

impl Arrivals {
    /// Returns the bounds. One file of `max_file_bytes` fits always.
    pub fn new(process_bytes: u64, tenant_bytes: u64, max_file_bytes: u64) -> Arrivals {
        Arrivals {
            process_bytes: process_bytes.max(max_file_bytes),
            tenant_bytes: tenant_bytes.max(max_file_bytes),
            held: Arc::default(),
        }
    }

    /// Begins a file; refuses it for now if its announced bytes do not fit. They count when they arrive, so that announced
    /// bytes alone keep nobody out.
    pub fn begin(&self, tenant: &str, announced_bytes: u64) -> Result<Arrival, Defence> {
        self.check(&self.held(), tenant, announced_bytes)?;
        Ok(Arrival { arrivals: self.clone(), tenant: tenant.to_owned(), bytes: 0 })
    }

    fn check(&self, held: &Held, tenant: &str, more_bytes: u64) -> Result<(), Defence> {
        let of_tenant = held.of_tenants.get(tenant).copied().unwrap_or_default();
        let fits = held.all.saturating_add(more_bytes) <= self.process_bytes
            && of_tenant.saturating_add(more_bytes) <= self.tenant_bytes;
        if fits { Ok(()) } else { Err(Defence::ArrivalsFull) }
    }

    fn held(&self) -> MutexGuard<'_, Held> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Arrival {
    /// Counts further bytes; refuses them if they do not fit.
    pub fn grow(&mut self, bytes: u64) -> Result<(), Defence> {
        let mut held = self.arrivals.held();
        self.arrivals.check(&held, &self.tenant, bytes)?;
        held.all += bytes;
        *held.of_tenants.entry(self.tenant.clone()).or_default() += bytes;
        self.bytes += bytes;
        Ok(())
    }
}

impl Drop for Arrival {
    fn drop(&mut self) {
        let mut held = self.arrivals.held();
        held.all -= self.bytes;
        if let Some(of_tenant) = held.of_tenants.get_mut(&self.tenant) {
            *of_tenant -= self.bytes;
            if *of_tenant == 0 {
                held.of_tenants.remove(&self.tenant);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arriving_bytes_are_bounded_for_all_and_for_each_tenant() {
        let arrivals = Arrivals::new(10, 2, 6);
        let mut first = arrivals.begin("acme", 6).unwrap();
        first.grow(4).unwrap();
        assert!(arrivals.begin("acme", 3).is_err() && first.grow(3).is_err());
        let mut second = arrivals.begin("acme", 2).unwrap();
        second.grow(2).unwrap();
        assert!(first.grow(1).is_err());
        let mut other = arrivals.begin("bolt", 0).unwrap();
        other.grow(4).unwrap();
        assert!(arrivals.begin("cole", 1).is_err(), "the process holds all that it may");
        drop(first);
        arrivals.begin("cole", 4).unwrap().grow(4).unwrap();
        drop((second, other));
        let held = arrivals.held();
        assert!(held.all == 0 && held.of_tenants.is_empty(), "nothing is kept of tenants without files");
    }
}
