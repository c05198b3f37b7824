//! Fair turns: the requests that a tenant sends at once wait for each other, so that those of another tenant wait for few of
//! them.

use super::places::{FairPlace, FairPlaces};
use std::future::Future;
use std::pin::pin;
use std::time::Duration;
use tokio::sync::Semaphore;
use viola_storage::Tenant;

/// Number of requests of a tenant that one process answers at once: twice the connections that read SQLite, as many as
/// those to PostgreSQL.
const AT_ONCE: usize = 8;
/// Time after which a request gives its turn to the next: one that takes longer makes a file, waits for a change, or
/// receives a body.
const HELD: Duration = Duration::from_millis(50);

/// The turns of all tenants of a process, without a bound for the process.
pub(in crate::api) struct Turns(FairPlaces);

/// A tenant's turn. The next request begins when it is dropped.
pub(in crate::api) struct Turn {
    _place: FairPlace,
}

impl Default for Turns {
    fn default() -> Turns {
        Turns(FairPlaces::new(Semaphore::MAX_PERMITS, AT_ONCE))
    }
}

impl Turns {
    /// Waits until the tenant has a turn.
    pub async fn take(&self, tenant: &Tenant) -> Turn {
        Turn { _place: self.0.take(tenant.name()).await }
    }
}

impl Turn {
    /// Returns the answer, and ends the turn with it or after [`HELD`].
    pub async fn run<T>(self, answer: impl Future<Output = T>) -> T {
        let mut answer = pin!(answer);
        match tokio::time::timeout(HELD, &mut answer).await {
            Ok(answer) => answer,
            Err(_) => {
                drop(self);
                answer.await
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use futures::FutureExt;
    use std::future::pending;
    use std::time::Instant;

    fn tenant(name: &str) -> Tenant {
        name.parse().unwrap()
    }

    fn take(turns: &Turns, name: &str) -> Option<Turn> {
        turns.take(&tenant(name)).now_or_never()
    }

    #[test]
    fn a_tenant_waits_for_its_own_requests_only() {
        let turns = Turns::default();
        let mut held: Vec<Turn> = (0..AT_ONCE).map(|_| take(&turns, "busy").unwrap()).collect();
        assert!(take(&turns, "busy").is_none());
        assert!(take(&turns, "other").is_some());
        held.pop();
        assert!(take(&turns, "busy").is_some());
    }

    #[tokio::test]
    async fn a_request_that_waits_for_long_gives_its_turn_away() {
        let turns = Turns::default();
        for _ in 0..AT_ONCE {
            tokio::spawn(take(&turns, "busy").unwrap().run(pending::<()>()));
        }
        let begun = Instant::now();
        turns.take(&tenant("busy")).await;
        assert!(begun.elapsed() >= HELD);
    }
}
