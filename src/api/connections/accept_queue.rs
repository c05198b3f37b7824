//! Fair begins: new connections wait in lanes, one for each tenant and one for each network of clients that no key names.
//! Lanes take turns, so a client waits for few of the connections that another one opens.

use super::super::peer::network;
use crate::storage::Tenant;
use axum::http::{HeaderMap, HeaderName, HeaderValue, header};
use std::collections::{HashMap, VecDeque};
use std::future::poll_fn;
use std::io;
use std::net::IpAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::ready;
use std::time::{Duration, Instant};
use tokio::io::ReadBuf;
use tokio::net::TcpStream;
use tokio::sync::oneshot;

/// Maximum size of a head in which credentials are looked for.
const HEAD_BYTES: usize = 4096;
/// Maximum number of its headers.
const HEADERS: usize = 64;

/// Returns the tenant of credentials that were valid before.
pub(in super::super) type TenantOf = Arc<dyn Fn(&HeaderMap) -> Option<Tenant> + Send + Sync>;

/// The lane of a connection.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) enum Lane {
    Tenant(Tenant),
    Network(IpAddr),
}

/// Limits of the connections that begin at once.
#[derive(Debug, Clone, Copy)]
pub(super) struct AcceptQueueParams {
    pub at_once: usize,
    pub at_once_of_lane: usize,
    /// Minimum time for which a connection holds its place.
    pub hold: Duration,
}

/// The connections that wait to begin.
pub(super) struct AcceptQueue {
    params: AcceptQueueParams,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    begin: usize,
    begin_of_lane: HashMap<Lane, usize>,
    waiting: HashMap<Lane, VecDeque<oneshot::Sender<Begin>>>,
    /// The lanes in which a connection waits; the first one is next.
    order: VecDeque<Lane>,
}

/// A connection's place among those that begin. Another one begins when it is dropped.
pub(super) struct Begin {
    of: Option<(Arc<AcceptQueue>, Lane)>,
    since: Instant,
}

impl AcceptQueue {
    pub fn new(params: AcceptQueueParams) -> Arc<AcceptQueue> {
        Arc::new(AcceptQueue { params, state: Mutex::default() })
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits until a connection of the lane may begin.
    pub async fn begin(self: &Arc<AcceptQueue>, lane: Lane) -> Begin {
        let begin = || Begin { of: Some((self.clone(), lane.clone())), since: Instant::now() };
        let turn = {
            let mut state = self.state();
            if state.take(&lane, &self.params) {
                return begin();
            }
            let (give, turn) = oneshot::channel();
            let State { waiting, order, .. } = &mut *state;
            let queue = waiting.entry(lane.clone()).or_insert_with(|| {
                order.push_back(lane.clone());
                VecDeque::new()
            });
            queue.push_back(give);
            turn
        };
        // A sender is dropped with the lanes only.
        turn.await.unwrap_or_else(|_| begin())
    }

    /// Frees a place of a lane, and lets the next ones begin.
    fn give(self: &Arc<AcceptQueue>, lane: &Lane) {
        let mut state = self.state();
        state.free(lane);
        for _ in 0..state.order.len() {
            // The lanes that had no turn stay in front.
            if state.begin == self.params.at_once {
                return;
            }
            let Some(next) = state.order.pop_front() else { return };
            if state.begin_next(self, &next) {
                state.order.push_back(next);
            }
        }
    }
}

impl State {
    fn take(&mut self, lane: &Lane, params: &AcceptQueueParams) -> bool {
        let of_lane = self.begin_of_lane.get(lane).copied().unwrap_or(0);
        let may = self.begin < params.at_once && of_lane < params.at_once_of_lane;
        if may {
            self.begin += 1;
            self.begin_of_lane.insert(lane.clone(), of_lane + 1);
        }
        may
    }

    fn free(&mut self, lane: &Lane) {
        self.begin -= 1;
        if let Some(of_lane) = self.begin_of_lane.get_mut(lane) {
            *of_lane -= 1;
            if *of_lane == 0 {
                self.begin_of_lane.remove(lane);
            }
        }
    }

    /// Lets the next connection of a lane begin, if it may. Returns whether others wait in the lane.
    fn begin_next(&mut self, lanes: &Arc<AcceptQueue>, lane: &Lane) -> bool {
        while self.take(lane, &lanes.params) {
            let next = self.waiting.get_mut(lane).and_then(VecDeque::pop_front);
            let Some(next) = next else {
                self.free(lane);
                break;
            };
            let begin = Begin { of: Some((lanes.clone(), lane.clone())), since: Instant::now() };
            match next.send(begin) {
                Ok(()) => break,
                // The connection was closed meanwhile.
                Err(mut unused) => unused.of = None,
            }
            self.free(lane);
        }
        let waits = self.waiting.get(lane).is_some_and(|queue| !queue.is_empty());
        if !waits {
            self.waiting.remove(lane);
        }
        waits
    }
}

impl Drop for Begin {
    fn drop(&mut self) {
        let Some((lanes, lane)) = self.of.take() else { return };
        let rest = lanes.params.hold.saturating_sub(self.since.elapsed());
        if rest.is_zero() {
            return lanes.give(&lane);
        }
        tokio::spawn(async move {
            tokio::time::sleep(rest).await;
            lanes.give(&lane);
        });
    }
}

/// Waits for the first bytes of a connection and returns its lane. The bytes stay unread.
pub(super) async fn lane_of(stream: &TcpStream, peer: IpAddr, tenant_of: &TenantOf) -> io::Result<Lane> {
    poll_fn(|context| {
        let mut bytes = [0; HEAD_BYTES];
        let mut head = ReadBuf::new(&mut bytes);
        ready!(stream.poll_peek(context, &mut head))?;
        let tenant = credentials(head.filled()).and_then(|headers| tenant_of(&headers));
        Ok(tenant.map_or_else(|| Lane::Network(network(peer)), Lane::Tenant)).into()
    })
    .await
}

/// Returns the headers of a whole head that may have credentials.
fn credentials(head: &[u8]) -> Option<HeaderMap> {
    let mut headers = [httparse::EMPTY_HEADER; HEADERS];
    let mut request = httparse::Request::new(&mut headers);
    if !request.parse(head).is_ok_and(|parsed| parsed.is_complete()) {
        return None;
    }
    let pairs = request.headers.iter().filter_map(|header| {
        let name = HeaderName::try_from(header.name).ok()?;
        let value = HeaderValue::from_bytes(header.value).ok()?;
        matches!(name, header::AUTHORIZATION | header::COOKIE).then_some((name, value))
    });
    let mut found = HeaderMap::new();
    pairs.for_each(|(name, value)| _ = found.append(name, value));
    (!found.is_empty()).then_some(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use futures::FutureExt;

    fn lane(name: &str) -> Lane {
        Lane::Tenant(name.parse().unwrap())
    }

    fn lanes(at_once: usize, at_once_of_lane: usize) -> Arc<AcceptQueue> {
        AcceptQueue::new(AcceptQueueParams { at_once, at_once_of_lane, hold: Duration::ZERO })
    }

    #[test]
    fn lanes_take_turns() {
        let lanes = lanes(1, 1);
        let first = lanes.begin(lane("busy")).now_or_never().unwrap();
        let [mut second, mut closed, mut third, mut honest] =
            ["busy", "closed", "busy", "honest"].map(|name| Box::pin(lanes.begin(lane(name))));
        for begin in [&mut second, &mut closed, &mut third, &mut honest] {
            assert!(begin.now_or_never().is_none());
        }
        drop((closed, first));
        // One of the busy lane, then the honest one; nobody waits for the connection that was closed.
        let begun = second.as_mut().now_or_never().unwrap();
        assert!(honest.as_mut().now_or_never().is_none());
        drop(begun);
        assert!(third.as_mut().now_or_never().is_none());
        drop(honest.as_mut().now_or_never().unwrap());
        drop(third.as_mut().now_or_never().unwrap());
        let state = lanes.state();
        assert!(state.begin == 0 && state.begin_of_lane.is_empty() && state.waiting.is_empty());
    }

    #[test]
    fn a_lane_leaves_places_for_others() {
        let lanes = lanes(2, 1);
        let first = lanes.begin(lane("busy")).now_or_never().unwrap();
        let mut second = Box::pin(lanes.begin(lane("busy")));
        assert!(second.as_mut().now_or_never().is_none());
        drop(lanes.begin(lane("honest")).now_or_never().unwrap());
        assert!(second.as_mut().now_or_never().is_none());
        drop(first);
        assert!(second.as_mut().now_or_never().is_some());
    }

    #[test]
    fn a_place_that_nobody_took_is_given_again() {
        let lanes = lanes(1, 1);
        let first = lanes.begin(lane("a")).now_or_never().unwrap();
        let mut gone = Box::pin(lanes.begin(lane("a")));
        assert!(gone.as_mut().now_or_never().is_none());
        drop(first);
        drop(gone);
        assert_eq!(lanes.state().begin, 0);
    }

    #[tokio::test]
    async fn places_are_held_for_a_time() {
        let hold = Duration::from_millis(20);
        let lanes = AcceptQueue::new(AcceptQueueParams { at_once: 1, at_once_of_lane: 1, hold });
        let begun = Instant::now();
        drop(lanes.begin(lane("a")).await);
        lanes.begin(lane("a")).await;
        assert!(begun.elapsed() >= hold);
    }

    #[test]
    fn only_whole_heads_tell_credentials() {
        let of = |head: &str| credentials(head.as_bytes()).map(|headers| headers.len());
        let key = "GET / HTTP/1.1\r\nHost: h\r\nauthorization: Bearer x\r\n";
        assert_eq!(of(key), None);
        assert_eq!(of(&format!("{key}\r\nbody")), Some(1));
        assert_eq!(of(&format!("{key}Cookie: viola_session=y\r\n\r\n")), Some(2));
        assert_eq!(of("GET / HTTP/1.1\r\nHost: h\r\n\r\n"), None);
        assert_eq!(of("\x16\x03\x01 no HTTP"), None);
    }
}
