//! Limits per tenant, so that no tenant slows another down.

use super::error::Error;
use crate::storage::{Storage, StorageError, Tenant};
use governor::clock::{Clock, DefaultClock};
use governor::{DefaultKeyedRateLimiter, Quota, RateLimiter};
use std::collections::HashMap;
use std::num::NonZeroU32;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Lifetime of the cached count of a tenant's bytes.
const COUNT_LIFE: Duration = Duration::from_secs(10);

/// Limits of every tenant.
#[derive(Debug, Clone, Default)]
pub struct LimitParams {
    /// Maximum mean rate of requests to one process, per second; none means unlimited. A burst may have twice
    /// as many.
    pub requests_per_s: Option<NonZeroU32>,
    /// Maximum size of the files that it has sent and not removed; none means unlimited.
    pub storage_bytes: Option<u64>,
}

pub(super) struct Limits {
    requests: Option<DefaultKeyedRateLimiter<Tenant>>,
    storage_bytes: Option<u64>,
    counts: Mutex<HashMap<Tenant, (u64, Instant)>>,
}

impl Limits {
    pub fn new(params: &LimitParams) -> Limits {
        let quota = |rate: NonZeroU32| Quota::per_second(rate).allow_burst(rate.saturating_mul(TWICE));
        Limits {
            requests: params.requests_per_s.map(|rate| RateLimiter::keyed(quota(rate))),
            storage_bytes: params.storage_bytes,
            counts: Mutex::default(),
        }
    }

    /// Counts a request; refuses it if there are too many.
    pub fn pass(&self, tenant: &Tenant) -> Result<(), Error> {
        let Some(limiter) = &self.requests else { return Ok(()) };
        limiter.check_key(tenant).map_err(|until| {
            let wait = until.wait_time_from(DefaultClock::default().now());
            Error::TooManyRequests { retry_after_s: wait.as_secs() + 1 }
        })
    }

    /// Returns an error if a tenant has no room for `more_bytes`.
    pub async fn room(&self, storage: &Storage, tenant: &Tenant, more_bytes: u64) -> Result<(), Error> {
        let Some(limit) = self.storage_bytes else { return Ok(()) };
        let used = self.used(storage, tenant).await?;
        if used.saturating_add(more_bytes) > limit {
            return Err(Error::TenantFull { used, limit });
        }
        Ok(())
    }

    async fn used(&self, storage: &Storage, tenant: &Tenant) -> Result<u64, StorageError> {
        let counted = self.counts.lock().unwrap_or_else(PoisonError::into_inner).get(tenant).copied();
        if let Some((bytes, at)) = counted
            && at.elapsed() < COUNT_LIFE
        {
            return Ok(bytes);
        }
        let bytes = storage.tenant_bytes(tenant).await?;
        let mut counts = self.counts.lock().unwrap_or_else(PoisonError::into_inner);
        counts.insert(tenant.clone(), (bytes, Instant::now()));
        Ok(bytes)
    }

    /// Adds received bytes to the cached count, which would otherwise be too low until it is renewed.
    pub fn came(&self, tenant: &Tenant, bytes: u64) {
        let mut counts = self.counts.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((count, _)) = counts.get_mut(tenant) {
            *count = count.saturating_add(bytes);
        }
    }
}

const TWICE: NonZeroU32 = NonZeroU32::new(2).expect("two is not zero");
