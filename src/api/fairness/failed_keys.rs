//! The limit of failed keys by address. Beyond it, a secret that this process has not seen valid is refused without a query;
//! secrets that were valid are still looked up, so an attacker locks nobody out who works already.

use crate::api::error::Defence;
use std::collections::HashMap;
use std::net::IpAddr;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use viola_storage::Tenant;

/// Maximum number of addresses and of valid secrets in memory.
const MAX_ENTRIES: usize = 1 << 16;

/// Limits of failed keys.
#[derive(Debug, Clone, Copy)]
pub struct FailedKeyParams {
    /// Number of failures that an address may have at once.
    pub burst: u32,
    /// Time after which one further failure is allowed.
    pub every: Duration,
}

impl Default for FailedKeyParams {
    fn default() -> FailedKeyParams {
        FailedKeyParams { burst: 60, every: Duration::from_secs(1) }
    }
}

pub(in crate::api) struct FailedKeys {
    params: FailedKeyParams,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    /// Time at which each address has its whole burst again.
    whole_at: HashMap<IpAddr, Instant>,
    /// The tenants of secrets that were valid, by the secrets' SHA-256.
    valid: HashMap<String, Tenant>,
}

impl FailedKeys {
    pub fn new(params: FailedKeyParams) -> FailedKeys {
        FailedKeys { params, state: Mutex::default() }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Counts a failure in advance, so that parallel attempts count too; refuses it if there were too many.
    pub fn begin(&self, address: Option<IpAddr>, sha256: &str, now: Instant) -> Result<(), Defence> {
        let mut state = self.state();
        let Some(address) = address.filter(|_| !state.valid.contains_key(sha256)) else { return Ok(()) };
        if state.whole_at.len() >= MAX_ENTRIES && !state.whole_at.contains_key(&address) {
            state.whole_at.retain(|_, whole_at| *whole_at > now);
            if state.whole_at.len() >= MAX_ENTRIES {
                state.whole_at.clear();
            }
        }
        let whole_at = state.whole_at.get(&address).copied().unwrap_or(now).max(now) + self.params.every;
        let wait = (whole_at - now).saturating_sub(self.params.every * self.params.burst);
        if !wait.is_zero() {
            return Err(Defence::TooManyFailures { wait });
        }
        state.whole_at.insert(address, whole_at);
        Ok(())
    }

    /// Takes back the failure that [`FailedKeys::begin`] counted, and records that the secret is valid.
    pub fn succeeded(&self, address: Option<IpAddr>, sha256: &str, tenant: &Tenant) {
        let mut state = self.state();
        if state.valid.contains_key(sha256) {
            return;
        }
        if state.valid.len() >= MAX_ENTRIES {
            state.valid.clear();
        }
        state.valid.insert(sha256.to_owned(), tenant.clone());
        self.take_back(&mut state, address);
    }

    /// Takes back the failure that [`FailedKeys::begin`] counted: the secret could not be looked up.
    pub fn undecided(&self, address: Option<IpAddr>, sha256: &str) {
        let mut state = self.state();
        // The use of a valid secret was not counted.
        if !state.valid.contains_key(sha256) {
            self.take_back(&mut state, address);
        }
    }

    fn take_back(&self, state: &mut State, address: Option<IpAddr>) {
        if let Some(whole_at) = address.and_then(|address| state.whole_at.get_mut(&address)) {
            *whole_at = whole_at.checked_sub(self.params.every).unwrap_or(*whole_at);
        }
    }

    /// Returns the tenant of a secret that was valid. The database knows whether it is still valid.
    pub fn tenant_of(&self, sha256: &str) -> Option<Tenant> {
        self.state().valid.get(sha256).cloned()
    }

    /// Records that a secret is not valid, or not any more.
    pub fn failed(&self, sha256: &str) {
        self.state().valid.remove(sha256);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    fn failed_keys() -> FailedKeys {
        FailedKeys::new(FailedKeyParams { burst: 3, every: SECOND })
    }

    #[test]
    fn failures_are_limited_by_address_and_forgiven_with_time() {
        let (failed_keys, now) = (failed_keys(), Instant::now());
        let (first, second) = ("192.0.2.1".parse().ok(), "192.0.2.2".parse().ok());
        for _ in 0..3 {
            assert!(failed_keys.begin(first, "wrong", now).is_ok());
        }
        let refused = failed_keys.begin(first, "wrong", now);
        assert!(matches!(refused, Err(Defence::TooManyFailures { wait }) if wait == SECOND));
        assert!(failed_keys.begin(second, "wrong", now).is_ok());
        assert!(failed_keys.begin(first, "wrong", now + SECOND).is_ok());
        assert!(failed_keys.begin(first, "wrong", now + SECOND).is_err());
    }

    #[test]
    fn a_look_up_that_fails_is_no_failure_of_the_address() {
        let (failed_keys, now) = (failed_keys(), Instant::now());
        let address = "192.0.2.1".parse().ok();
        for _ in 0..100 {
            failed_keys.begin(address, "unknown", now).unwrap();
            failed_keys.undecided(address, "unknown");
        }
        // The use of a valid secret is not counted, so nothing is taken back.
        failed_keys.succeeded(None, "valid", &Tenant::default());
        for _ in 0..3 {
            failed_keys.begin(address, "wrong", now).unwrap();
            failed_keys.begin(address, "valid", now).unwrap();
            failed_keys.undecided(address, "valid");
        }
        assert!(failed_keys.begin(address, "wrong", now).is_err());
    }

    #[test]
    fn valid_secrets_cost_nothing_and_are_never_locked_out() {
        let (failed_keys, now) = (failed_keys(), Instant::now());
        let address = "192.0.2.1".parse().ok();
        for phone in 0..100 {
            let secret = phone.to_string();
            failed_keys.begin(address, &secret, now).unwrap();
            failed_keys.succeeded(address, &secret, &Tenant::default());
        }
        while failed_keys.begin(address, "wrong", now).is_ok() {}
        assert!(failed_keys.begin(address, "7", now).is_ok());
        failed_keys.failed("7");
        assert!(failed_keys.begin(address, "7", now).is_err(), "it was revoked");
    }
}
