//! The open connections by the network of their client. A new connection is always accepted: if there are too many, those
//! that have waited longest for their client are closed, of the same network or else of the largest one. So a client that
//! holds connections without using them displaces its own. A connection whose request came whole waits for the service and
//! not for its client: it goes only if all of them do, and after those that are new. A request that waits for others of its
//! tenant waits for its client. A tenant with few connections keeps them as long as others wait for their clients: if
//! the service reads an upload late, its connection looks like one that its client holds.

use crate::api::peer::network;
use std::collections::HashMap;
use std::net::IpAddr;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Instant;
use tokio_util::sync::CancellationToken;
use viola_storage::Tenant;

/// All open connections.
pub(super) struct OpenConnections {
    most: usize,
    most_of_network: usize,
    begun: Instant,
    members: Mutex<Members>,
}

#[derive(Default)]
struct Members {
    of_network: HashMap<IpAddr, HashMap<u64, Arc<Member>>>,
    /// Number of all connections that ever entered.
    entered: u64,
}

struct Member {
    /// Number of its requests that came whole and have no answer yet: they wait for the service.
    unanswered: AtomicUsize,
    /// True until its first bytes came.
    is_new: AtomicBool,
    /// Tenant of its first request, once it came, if its credentials were valid before.
    tenant: OnceLock<Tenant>,
    /// Time of the last byte in either direction, in milliseconds since `begun`.
    moved_ms: AtomicU64,
    displaced: CancellationToken,
}

/// A connection's place. Dropping it frees the place.
pub(super) struct Place {
    connections: Arc<OpenConnections>,
    network: IpAddr,
    number: u64,
    member: Arc<Member>,
}

impl OpenConnections {
    pub fn new(most: usize, most_of_network: usize) -> Arc<OpenConnections> {
        Arc::new(OpenConnections { most, most_of_network, begun: Instant::now(), members: Mutex::default() })
    }

    /// Adds a connection; displaces another one if there are too many.
    pub fn enter(self: &Arc<OpenConnections>, peer: IpAddr) -> Arc<Place> {
        let network = network(peer);
        let member = Arc::new(Member {
            unanswered: AtomicUsize::new(0),
            is_new: AtomicBool::new(true),
            tenant: OnceLock::new(),
            moved_ms: self.now_ms().into(),
            displaced: CancellationToken::new(),
        });
        let now_ms = self.now_ms();
        let mut members = self.members();
        let number = members.entered;
        members.entered += 1;
        let of_network = &mut members.of_network;
        let own = of_network.get(&network).map_or(0, HashMap::len);
        if own >= self.most_of_network {
            displace(of_network, network, now_ms);
        } else if of_network.values().map(HashMap::len).sum::<usize>() >= self.most {
            let largest =
                of_network.iter().max_by_key(|(_, members)| members.len()).map(|(network, _)| *network);
            largest.into_iter().for_each(|network| displace(of_network, network, now_ms));
        }
        of_network.entry(network).or_default().insert(number, member.clone());
        drop(members);
        Arc::new(Place { connections: self.clone(), network, number, member })
    }

    fn members(&self) -> MutexGuard<'_, Members> {
        self.members.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn now_ms(&self) -> u64 {
        self.begun.elapsed().as_millis() as u64
    }
}

/// Connections are displaced in this order.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
enum Waits {
    ForClient,
    /// Nothing came yet, and it is younger than [`NEW_MS`]: its first bytes may be here unread.
    New,
    /// For its client, which is a tenant with few connections.
    ForOneOfFew,
    ForService,
}

const NEW_MS: u64 = 1000;

/// Inverse of the fraction of a network's connections up to which a tenant has few.
const FEW: usize = 16;

impl Member {
    /// Returns what it waits for, and since when.
    fn waits(&self, now_ms: u64, is_of_few: bool) -> (Waits, u64) {
        let moved_ms = self.moved_ms.load(Ordering::Relaxed);
        let is_new = self.is_new.load(Ordering::Relaxed) && now_ms < moved_ms + NEW_MS;
        let waits = match self.unanswered.load(Ordering::Relaxed) {
            0 if is_new => Waits::New,
            0 if is_of_few => Waits::ForOneOfFew,
            0 => Waits::ForClient,
            _ => Waits::ForService,
        };
        (waits, moved_ms)
    }
}

/// Inverse of the fraction of a network's connections that go together, for each search looks at all of them.
const TOGETHER: usize = 32;

fn displace(members: &mut HashMap<IpAddr, HashMap<u64, Arc<Member>>>, network: IpAddr, now_ms: u64) {
    let Some(of_network) = members.get_mut(&network) else { return };
    let mut of_tenants: HashMap<&Tenant, usize> = HashMap::new();
    let tenants = of_network.values().filter_map(|member| member.tenant.get());
    tenants.for_each(|tenant| *of_tenants.entry(tenant).or_default() += 1);
    let most = of_network.len() / FEW;
    // Another thread may tell a tenant meanwhile.
    let has_few = |tenant: &Tenant| of_tenants.get(tenant).is_none_or(|count| *count <= most);
    let is_of_few = |member: &Member| member.tenant.get().is_some_and(has_few);
    let mut waiting: Vec<_> = of_network
        .iter()
        .map(|(number, member)| (member.waits(now_ms, is_of_few(member)), *number))
        .collect();
    let count = waiting.len().div_ceil(TOGETHER);
    if count == 0 {
        return;
    }
    waiting.select_nth_unstable(count - 1);
    for (_, number) in &waiting[..count] {
        if let Some(member) = of_network.remove(number) {
            member.displaced.cancel();
        }
    }
}

impl Place {
    /// Records that the first bytes came, which tell what the connection waits for and may tell its tenant.
    pub fn came(&self, tenant: Option<&Tenant>) {
        if let Some(tenant) = tenant {
            self.member.tenant.get_or_init(|| tenant.clone());
        }
        self.member.is_new.store(false, Ordering::Relaxed);
    }

    /// Records that bytes came or went.
    pub fn moved(&self) {
        self.member.moved_ms.store(self.connections.now_ms(), Ordering::Relaxed);
    }

    /// Waits until another connection takes the place.
    pub async fn displaced(&self) {
        self.member.displaced.cancelled().await;
    }
}

/// A request on a connection. Once it came whole it waits for the service, until it is answered or dropped.
pub(in super::super) struct Asked {
    place: Arc<Place>,
    came: AtomicBool,
}

/// A request that waits for others of its tenant, and not for the service.
pub(in super::super) struct Queued {
    asked: Arc<Asked>,
    had_come: bool,
}

impl Asked {
    pub(super) fn new(place: Arc<Place>) -> Asked {
        Asked { place, came: AtomicBool::new(false) }
    }

    /// Records that all of the request has come.
    pub(super) fn came_whole(&self) {
        if !self.came.swap(true, Ordering::Relaxed) {
            self.place.member.unanswered.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Records that the request waits no longer; its client has not had the time yet to read the answer.
    pub(super) fn answered(&self) {
        self.place.moved();
        if self.came.swap(false, Ordering::Relaxed) {
            self.place.member.unanswered.fetch_sub(1, Ordering::Relaxed);
        }
    }

    /// Records that the request waits for others of its tenant, until the result is dropped.
    pub fn queue(self: &Arc<Asked>) -> Queued {
        let had_come = self.came.load(Ordering::Relaxed);
        if had_come {
            self.place.member.unanswered.fetch_sub(1, Ordering::Relaxed);
        }
        Queued { asked: self.clone(), had_come }
    }
}

impl Drop for Queued {
    fn drop(&mut self) {
        if self.had_come {
            self.asked.place.member.unanswered.fetch_add(1, Ordering::Relaxed);
        }
    }
}

impl Drop for Asked {
    fn drop(&mut self) {
        self.answered();
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let of_network = &mut self.connections.members().of_network;
        let Some(members) = of_network.get_mut(&self.network) else { return };
        members.remove(&self.number);
        if members.is_empty() {
            of_network.remove(&self.network);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_displaced(place: &Place) -> bool {
        place.member.displaced.is_cancelled()
    }

    fn set(place: &Place, moved_ms: u64) {
        place.came(None);
        place.member.moved_ms.store(moved_ms, Ordering::Relaxed);
    }

    #[test]
    fn a_network_displaces_its_own_longest_waiting_connection() {
        let connections = OpenConnections::new(10, 2);
        let (greedy, other) = ("192.0.2.1".parse().unwrap(), "192.0.2.2".parse().unwrap());
        let honest = connections.enter(other);
        set(&honest, 0);
        let (first, second) = (connections.enter(greedy), connections.enter(greedy));
        set(&first, 20);
        set(&second, 10);
        let third = connections.enter(greedy);
        assert!(
            is_displaced(&second) && !is_displaced(&first) && !is_displaced(&third) && !is_displaced(&honest)
        );
        drop((first, second, third));
        assert_eq!(connections.members().of_network.len(), 1);
    }

    #[test]
    fn a_new_connection_is_not_displaced_before_its_first_bytes() {
        let connections = OpenConnections::new(10, 2);
        let address = "192.0.2.1".parse().unwrap();
        let (new, used) = (connections.enter(address), connections.enter(address));
        set(&used, u64::MAX);
        let third = connections.enter(address);
        assert!(is_displaced(&used) && !is_displaced(&new));
        let waits = |now_ms| new.member.waits(now_ms, false).0;
        assert!(waits(0) == Waits::New && waits(2 * NEW_MS) == Waits::ForClient);
        drop(third);
    }

    #[test]
    fn a_tenant_with_few_connections_keeps_them() {
        let connections = OpenConnections::new(100, 2 * FEW);
        let address = "192.0.2.1".parse().unwrap();
        let enter = |tenant: Option<&str>, moved_ms: u64| {
            let place = connections.enter(address);
            let tenant = tenant.map(|name| Tenant::try_from(name.to_owned()).unwrap());
            place.came(tenant.as_ref());
            place.member.moved_ms.store(moved_ms, Ordering::Relaxed);
            place
        };
        let few = [0, 1].map(|at| enter(Some("few"), at));
        let unknown = enter(None, 2);
        let many: Vec<_> = (few.len() + 1..2 * FEW).map(|at| enter(Some("many"), at as u64)).collect();
        let new = connections.enter(address);
        assert!(is_displaced(&unknown) && !few.iter().chain(&many).any(|place| is_displaced(place)));
        drop(unknown);
        let _next = connections.enter(address);
        assert!(
            is_displaced(&many[0]) && !is_displaced(&new) && !few.iter().any(|place| is_displaced(place))
        );
        // With one more they are not few.
        drop(many);
        let more: Vec<_> = (2..2 * FEW - 2).map(|at| enter(Some("few"), at as u64)).collect();
        let _last = connections.enter(address);
        assert!(
            is_displaced(&few[0]) && !is_displaced(&few[1]) && !more.iter().any(|place| is_displaced(place))
        );
    }

    #[test]
    fn a_request_that_waits_for_the_service_is_not_displaced() {
        let connections = OpenConnections::new(10, 2);
        let address = "192.0.2.1".parse().unwrap();
        let (asking, idle) = (connections.enter(address), connections.enter(address));
        set(&asking, 5);
        set(&idle, 10);
        let asked = Asked::new(asking.clone());
        asked.came_whole();
        asked.came_whole();
        let third = connections.enter(address);
        assert!(is_displaced(&idle) && !is_displaced(&asking));
        drop(asked);
        set(&asking, 5);
        let fourth = connections.enter(address);
        assert!(is_displaced(&asking) && !is_displaced(&third) && !is_displaced(&fourth));
    }

    #[test]
    fn a_request_that_waits_for_its_tenant_may_be_displaced() {
        let connections = OpenConnections::new(10, 2);
        let address = "192.0.2.1".parse().unwrap();
        let (queued, idle) = (connections.enter(address), connections.enter(address));
        set(&queued, 5);
        set(&idle, 10);
        // One that comes whole while it waits, and one that had come.
        let late = Arc::new(Asked::new(queued.clone()));
        let of_late = late.queue();
        late.came_whole();
        let asked = Arc::new(Asked::new(queued.clone()));
        asked.came_whole();
        drop((of_late, late, asked.queue()));
        assert_eq!(queued.member.unanswered.load(Ordering::Relaxed), 1);
        let _queue = asked.queue();
        let _third = connections.enter(address);
        assert!(is_displaced(&queued) && !is_displaced(&idle));
    }

    #[test]
    fn if_all_places_are_taken_the_largest_network_gives_one() {
        let connections = OpenConnections::new(3, 2);
        let [a, b, c] = ["2001:db8::1", "2001:db8::2", "192.0.2.1"]
            .map(|address| connections.enter(address.parse().unwrap()));
        set(&b, 0);
        set(&a, 5);
        let late = connections.enter("192.0.2.7".parse().unwrap());
        assert!(is_displaced(&b) && !is_displaced(&a) && !is_displaced(&c) && !is_displaced(&late));
    }
}
