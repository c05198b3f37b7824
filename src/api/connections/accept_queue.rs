//! Fair begins: new connections wait in lanes, one for each tenant and one for each network of clients that no key names.
//! Lanes take turns, so a client waits for few of the connections that another one opens.

use super::super::peer::network;
use crate::api::fairness::{FairPlace, FairPlaces};
use axum::http::{HeaderMap, HeaderName, HeaderValue, header};
use std::future::poll_fn;
use std::io;
use std::net::IpAddr;
use std::sync::Arc;
use std::task::ready;
use std::time::Duration;
use tokio::io::ReadBuf;
use tokio::net::TcpStream;
use tokio::time::sleep;
use viola_storage::Tenant;

/// Maximum size of a head in which credentials are looked for.
const HEAD_BYTES: usize = 4096;
/// Maximum number of its headers.
const HEADERS: usize = 64;

/// Returns the tenant of credentials that were valid before.
pub(in super::super) type TenantOf = Arc<dyn Fn(&HeaderMap) -> Option<Tenant> + Send + Sync>;

/// The lane of a connection.
pub(super) enum Lane {
    Tenant(Tenant),
    Network(IpAddr),
}

impl Lane {
    pub fn tenant(&self) -> Option<&Tenant> {
        match self {
            Lane::Tenant(tenant) => Some(tenant),
            Lane::Network(_) => None,
        }
    }
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
    places: FairPlaces,
    hold: Duration,
}

impl AcceptQueue {
    pub fn new(params: AcceptQueueParams) -> AcceptQueue {
        let AcceptQueueParams { at_once, at_once_of_lane, hold } = params;
        AcceptQueue { places: FairPlaces::new(at_once, at_once_of_lane), hold }
    }

    /// Waits until a connection of the lane may begin. Its place is free when the connection has dropped it and the time
    /// to hold it is over.
    pub async fn begin(&self, lane: &str) -> Arc<FairPlace> {
        let place = Arc::new(self.places.take(lane).await);
        let (held, hold) = (place.clone(), self.hold);
        tokio::spawn(async move {
            sleep(hold).await;
            drop(held);
        });
        place
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
    use std::time::Instant;
    use tokio::time::timeout;

    #[tokio::test]
    async fn places_are_held_for_a_time() {
        let hold = Duration::from_millis(20);
        let lanes = AcceptQueue::new(AcceptQueueParams { at_once: 1, at_once_of_lane: 1, hold });
        let begun = Instant::now();
        drop(lanes.begin("a").await);
        lanes.begin("a").await;
        assert!(begun.elapsed() >= hold);
    }

    #[tokio::test]
    async fn a_connection_that_begins_slowly_keeps_its_place() {
        let hold = Duration::ZERO;
        let lanes = AcceptQueue::new(AcceptQueueParams { at_once: 1, at_once_of_lane: 1, hold });
        let begun = lanes.begin("a").await;
        assert!(timeout(Duration::from_millis(20), lanes.begin("a")).await.is_err());
        drop(begun);
        lanes.begin("a").await;
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
