//! Fair turns: the requests that a tenant sends at once wait for each other, so that those of another tenant wait for few of
//! them.

use super::places::{FairPlace, FairPlaces};
use futures::future::BoxFuture;
use std::future::Future;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::Semaphore;
use viola_storage::Tenant;

/// Time after which a request gives its turn to the next: one that takes longer makes a file, waits for a change, or
/// receives a body.
const HELD: Duration = Duration::from_millis(50);

/// The turns of all tenants of a process, without a bound for the process.
#[derive(Clone)]
pub(in crate::api) struct Turns(Arc<FairPlaces>);

/// A tenant's turn. The next request begins when it is dropped.
pub(in crate::api) struct Turn {
    _place: FairPlace,
}

impl Turns {
    /// Returns turns for a process with this number of connections to its database: a tenant uses half of them at once, so
    /// that another one finds a free connection.
    pub fn new(connections: u64) -> Turns {
        let at_once = connections.div_ceil(2).max(1) as usize;
        Turns(Arc::new(FairPlaces::new(Semaphore::MAX_PERMITS, at_once)))
    }

    /// Waits until the tenant has a turn.
    pub async fn take(&self, tenant: &Tenant) -> Turn {
        Turn { _place: self.0.take(tenant.name()).await }
    }

    /// Returns what waits for a turn of the tenant, for streams that outlive their request.
    pub fn of(&self, tenant: &Tenant) -> impl Fn() -> BoxFuture<'static, Turn> + Clone + use<> {
        let (turns, tenant) = (self.clone(), tenant.clone());
        move || {
            let (turns, tenant) = (turns.clone(), tenant.clone());
            Box::pin(async move { turns.take(&tenant).await })
        }
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
        // SQLite has four connections that read and one that writes.
        let turns = Turns::new(5);
        let mut held: Vec<Turn> = (0..3).map(|_| take(&turns, "busy").unwrap()).collect();
        assert!(take(&turns, "busy").is_none());
        assert!(take(&turns, "other").is_some());
        held.pop();
        assert!(take(&turns, "busy").is_some());
    }

    #[tokio::test]
    async fn a_request_that_waits_for_long_gives_its_turn_away() {
        let turns = Turns::new(8);
        for _ in 0..4 {
            tokio::spawn(take(&turns, "busy").unwrap().run(pending::<()>()));
        }
        let begun = Instant::now();
        turns.take(&tenant("busy")).await;
        assert!(begun.elapsed() >= HELD);
    }
}
