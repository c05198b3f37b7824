//! The address of a client.

use axum::http::{Extensions, HeaderMap, HeaderName};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};

const FORWARDED_FOR: HeaderName = HeaderName::from_static("x-forwarded-for");

/// The address of the other end of a request's connection, as an extension of the request.
#[derive(Debug, Clone, Copy)]
pub(super) struct Peer(pub IpAddr);

/// Returns the address that a client's limits are counted for. A peer in a private network is taken for a proxy: then the
/// last address that it forwards counts.
pub(super) fn client(extensions: &Extensions, headers: &HeaderMap) -> Option<IpAddr> {
    let Peer(peer) = *extensions.get()?;
    let forwarded = || {
        let last = headers.get_all(FORWARDED_FOR).iter().next_back()?.to_str().ok()?;
        let last = last.rsplit(',').next()?.trim();
        // Azure's gateways add the port, some other proxies brackets.
        let with_port = || last.parse().ok().map(|address: SocketAddr| address.ip());
        last.trim_matches(['[', ']']).parse().ok().or_else(with_port)
    };
    let proxied = Some(peer).filter(|peer| is_private(peer.to_canonical())).and_then(|_| forwarded());
    Some(network(proxied.unwrap_or(peer)))
}

/// Returns the address without the part that one subscriber chooses at will: the lower half of an IPv6 address.
pub(super) fn network(address: IpAddr) -> IpAddr {
    match address.to_canonical() {
        IpAddr::V6(address) => IpAddr::V6(Ipv6Addr::from_bits(address.to_bits() >> 64 << 64)),
        address => address,
    }
}

fn is_private(address: IpAddr) -> bool {
    match address {
        IpAddr::V4(address) => address.is_loopback() || address.is_private() || is_shared(address),
        IpAddr::V6(address) => address.is_loopback() || address.is_unique_local(),
    }
}

/// Returns whether an address is of the shared space 100.64.0.0/10 (RFC 6598), which clusters use for their pods.
fn is_shared(address: Ipv4Addr) -> bool {
    let [first, second, ..] = address.octets();
    first == 100 && second & 0xc0 == 64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(peer: &str, forwarded: &[&str]) -> String {
        let (mut extensions, mut headers) = (Extensions::new(), HeaderMap::new());
        extensions.insert(Peer(peer.parse().unwrap()));
        for value in forwarded {
            headers.append(FORWARDED_FOR, value.parse().unwrap());
        }
        client(&extensions, &headers).unwrap().to_string()
    }

    #[test]
    fn only_a_proxy_names_another_address() {
        assert_eq!(of("203.0.113.9", &[]), "203.0.113.9");
        assert_eq!(of("203.0.113.9", &["198.51.100.1"]), "203.0.113.9", "forged");
        assert_eq!(of("172.18.0.5", &["198.51.100.1"]), "198.51.100.1");
        assert_eq!(
            of("::ffff:127.0.0.1", &["192.0.2.1, 198.51.100.1"]),
            "198.51.100.1",
            "the proxy's own entry is last"
        );
        assert_eq!(of("127.0.0.1", &["192.0.2.1", "198.51.100.2"]), "198.51.100.2");
        assert_eq!(of("127.0.0.1", &["unknown"]), "127.0.0.1");
        assert_eq!(of("10.0.0.4", &["192.0.2.1:55001, 198.51.100.1:40112"]), "198.51.100.1");
        for (peer, is_proxy) in [("100.64.0.9", true), ("100.127.255.1", true), ("100.128.0.9", false)] {
            let counted = of(peer, &["198.51.100.1"]);
            assert_eq!(counted, if is_proxy { "198.51.100.1" } else { peer }, "{peer}");
        }
        for written in ["2001:db8:1:2::7", "[2001:db8:1:2::7]", "[2001:db8:1:2::7]:443"] {
            assert_eq!(of("10.0.0.4", &[written]), "2001:db8:1:2::", "{written}");
        }
    }

    #[test]
    fn a_subscriber_has_one_network() {
        assert_eq!(of("2001:db8:1:2:3:4:5:6", &[]), "2001:db8:1:2::");
        assert_eq!(of("::ffff:203.0.113.9", &[]), "203.0.113.9");
    }
}
