//! Limits per tenant, so that no tenant slows another down.

use crate::api::error::Error;
use governor::clock::{Clock, DefaultClock};
use governor::{DefaultKeyedRateLimiter, Quota, RateLimiter};
use std::num::NonZeroU32;
use viola_storage::{Storage, StorageError, Tenant};

/// Limits of every tenant.
#[derive(Debug, Clone, Default)]
pub struct LimitParams {
    /// Maximum mean rate of requests to one process, per second; none means unlimited. A burst may have twice
    /// as many.
    pub requests_per_s: Option<NonZeroU32>,
    /// Maximum size of its files, if it has no limit of its own; none means unlimited.
    pub storage_bytes: Option<u64>,
}

pub(in crate::api) struct Limits {
    requests: Option<DefaultKeyedRateLimiter<Tenant>>,
    /// Maximum size of the files of a tenant that has no limit of its own; none means unlimited.
    pub storage_bytes: Option<u64>,
}

impl Limits {
    pub fn new(params: &LimitParams) -> Limits {
        let quota = |rate: NonZeroU32| Quota::per_second(rate).allow_burst(rate.saturating_mul(TWICE));
        Limits {
            requests: params.requests_per_s.map(|rate| RateLimiter::keyed(quota(rate))),
            storage_bytes: params.storage_bytes,
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

    /// Returns an error if `more_bytes` exceed the tenant's quota. Concurrent requests may all pass it.
    pub async fn check_quota(
        &self,
        storage: &Storage,
        tenant: &Tenant,
        more_bytes: u64,
    ) -> Result<(), Error> {
        let own = storage.tenant_limits(tenant).await?.max_bytes;
        let Some(limit) = own.or(self.storage_bytes) else { return Ok(()) };
        let used = storage.tenant_bytes(tenant).await?;
        if used.saturating_add(more_bytes) > limit {
            return Err(StorageError::TenantFull { used, limit, more: more_bytes }.into());
        }
        Ok(())
    }
}

const TWICE: NonZeroU32 = NonZeroU32::new(2).expect("two is not zero");
