//! Protection of a service without keys from pages of other sites: DNS rebinding and cross-site requests. With keys, a
//! page of another site has no credentials: it knows no key, and the session's cookie is `SameSite=Strict`. A page of the
//! same site (another port or subdomain) has the cookie, and changes nothing by it.

use super::App;
use super::access::{asks_for_keys, cookie};
use super::error::{Defence, Error};
use super::layers::Origin;
use axum::extract::{Request, State};
use axum::http::uri::Authority;
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, Version, header};
use axum::middleware::Next;
use axum::response::Response;
use std::net::IpAddr;
use url::Url;

/// Fetch metadata of browsers (W3C), for requests that have no `Origin`: images, scripts, links.
const FETCH_SITE: HeaderName = HeaderName::from_static("sec-fetch-site");
const FETCH_MODE: HeaderName = HeaderName::from_static("sec-fetch-mode");

/// Maximum number of characters of a refused name in the answer.
const MAX_SHOWN: usize = 200;

/// Refuses requests without one `Host`, and those for foreign hosts and from foreign pages while there is no key.
pub(super) async fn check(State(app): State<App>, request: Request, next: Next) -> Result<Response, Error> {
    // RFC 9112, section 3.2.
    if request.version() == Version::HTTP_11 && request.headers().get_all(header::HOST).iter().count() != 1 {
        let detail = "a request has one header Host".to_owned();
        return Err(Error::InvalidHeader { field: "Host", detail });
    }
    refuse_foreign_session(request.method(), request.headers(), &app.cors_origins)?;
    if let Err(refusal) = refuse_foreign(&request, &app.cors_origins)
        && !asks_for_keys(&app).await?
    {
        return Err(refusal.into());
    }
    Ok(next.run(request).await)
}

/// Refuses a change by a session's cookie that a page of another port or subdomain asks for: browsers send the cookie with
/// requests of the same site. Browsers tell the site on TLS and loopback.
fn refuse_foreign_session(method: &Method, headers: &HeaderMap, allowed: &[Origin]) -> Result<(), Defence> {
    let is_by_session = !headers.contains_key(header::AUTHORIZATION) && cookie(headers).is_some();
    if method.is_safe() || !is_by_session || !is_foreign_fetch(headers) {
        return Ok(());
    }
    match headers.get(header::ORIGIN) {
        Some(origin) if allowed.iter().any(|allowed| allowed.is(origin)) => Ok(()),
        Some(origin) => Err(Defence::ForeignSession(shown(origin.as_bytes()))),
        None => Err(Defence::ForeignSession("a page of another site".to_owned())),
    }
}

fn refuse_foreign<B>(request: &axum::http::Request<B>, allowed: &[Origin]) -> Result<(), Defence> {
    let headers = request.headers();
    let named = request.uri().authority().map(|authority| authority.as_str().as_bytes());
    let hosts: Vec<&[u8]> =
        headers.get_all(header::HOST).iter().map(HeaderValue::as_bytes).chain(named).collect();
    for host in hosts.iter().copied() {
        if !is_loopback(host) {
            return Err(Defence::ForeignHost(shown(host)));
        }
    }
    for origin in headers.get_all(header::ORIGIN) {
        let is_own = hosts.iter().any(|host| is_same(origin, host));
        if !is_own && !allowed.iter().any(|allowed| allowed.is(origin)) {
            return Err(Defence::ForeignOrigin(shown(origin.as_bytes())));
        }
    }
    // A request without `Origin` does not say which site it comes from: it passes if any other origin is allowed.
    let is_told = headers.contains_key(header::ORIGIN) || !allowed.is_empty();
    if !is_told && is_foreign_fetch(headers) && !is_link(request.method(), headers) {
        return Err(Defence::ForeignOrigin("a page of another site".to_owned()));
    }
    Ok(())
}

/// Returns whether the host of a `HOST[:PORT]` can only be this machine.
fn is_loopback(host: &[u8]) -> bool {
    let Ok(authority) = Authority::try_from(host) else { return false };
    let name = authority.host().trim_start_matches('[').trim_end_matches(']').to_ascii_lowercase();
    let name = name.strip_suffix('.').unwrap_or(&name);
    // RFC 6761: browsers resolve these names to loopback themselves.
    name == "localhost"
        || name.ends_with(".localhost")
        || name.parse::<IpAddr>().is_ok_and(|address| address.is_loopback())
}

fn is_same(origin: &HeaderValue, host: &[u8]) -> bool {
    let (Some(origin), Ok(host)) =
        (origin.to_str().ok().and_then(|origin| Url::parse(origin).ok()), Authority::try_from(host))
    else {
        return false;
    };
    let port = host.port_u16().or_else(|| origin.port_or_known_default());
    matches!(origin.scheme(), "http" | "https")
        && origin.host_str().is_some_and(|name| name.eq_ignore_ascii_case(host.host()))
        && origin.port_or_known_default() == port
}

fn is_foreign_fetch(headers: &HeaderMap) -> bool {
    headers.get(FETCH_SITE).is_some_and(|site| site != "same-origin" && site != "none")
}

/// Returns whether a person followed a link: the answer is shown to the person, not to the page with the link.
fn is_link(method: &Method, headers: &HeaderMap) -> bool {
    [Method::GET, Method::HEAD].contains(method)
        && headers.get(FETCH_MODE).is_some_and(|mode| mode == "navigate")
}

fn shown(name: &[u8]) -> String {
    String::from_utf8_lossy(name).chars().take(MAX_SHOWN).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(method: &str, headers: &[(&str, &str)], allowed: &[&str]) -> Result<(), Defence> {
        let mut request = axum::http::Request::builder().method(method).uri("/v1/homes");
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        let allowed: Vec<Origin> = allowed.iter().map(|origin| origin.parse().unwrap()).collect();
        refuse_foreign(&request.body(()).unwrap(), &allowed)
    }

    #[test]
    fn a_page_of_the_same_site_changes_nothing_by_the_session() {
        let cookie = ("cookie", "viola_session=x");
        let (same_site, origin) = (("sec-fetch-site", "same-site"), ("origin", "https://blog.example.com"));
        for (method, headers, allowed, is_refused) in [
            ("POST", vec![cookie, same_site, origin], &[][..], true),
            ("POST", vec![cookie, same_site], &[], true),
            ("POST", vec![cookie, same_site, origin], &["https://blog.example.com"], false),
            ("GET", vec![cookie, same_site, origin], &[], false),
            ("POST", vec![cookie, ("sec-fetch-site", "same-origin"), origin], &[], false),
            ("POST", vec![cookie, origin], &[], false),
            ("POST", vec![same_site, origin], &[], false),
            ("POST", vec![cookie, same_site, origin, ("authorization", "Bearer x")], &[], false),
        ] {
            let mut map = HeaderMap::new();
            for (name, value) in &headers {
                map.insert(HeaderName::from_static(name), HeaderValue::from_static(value));
            }
            let allowed: Vec<Origin> = allowed.iter().map(|origin| origin.parse().unwrap()).collect();
            let refused = refuse_foreign_session(&method.parse().unwrap(), &map, &allowed);
            assert_eq!(refused.is_err(), is_refused, "{method} {headers:?} {allowed:?}");
        }
    }

    #[test]
    fn only_names_of_this_machine_are_hosts() {
        for host in [
            "localhost",
            "LocalHost:8080",
            "localhost.",
            "a.localhost:1",
            "127.0.0.1:80",
            "[::1]:8080",
            "127.1.2.3",
        ] {
            assert!(check("GET", &[("host", host)], &[]).is_ok(), "{host}");
        }
        for host in [
            "evil.example",
            "localhost.evil.example",
            "evil.example:8080",
            "192.168.0.9",
            "10.0.0.1:8080",
            "",
            "a b",
        ] {
            assert!(matches!(check("GET", &[("host", host)], &[]), Err(Defence::ForeignHost(_))), "{host}");
        }
        // Several hosts, or one in the request's line.
        let two = [("host", "localhost"), ("host", "evil.example")];
        assert!(check("GET", &two, &[]).is_err());
        let line = axum::http::Request::get("http://evil.example/v1/homes")
            .header("host", "localhost")
            .body(())
            .unwrap();
        assert!(refuse_foreign(&line, &[]).is_err());
    }

    #[test]
    fn only_own_and_allowed_pages_call() {
        let from = |origin: &str, allowed: &[&str]| {
            check("POST", &[("host", "localhost:8080"), ("origin", origin)], allowed)
        };
        assert!(from("http://localhost:8080", &[]).is_ok());
        assert!(from("https://app.example", &["https://app.example"]).is_ok());
        for origin in [
            "http://evil.example",
            "http://localhost:3000",
            "http://localhost",
            "null",
            "file://",
            "http://127.0.0.1:8080",
        ] {
            assert!(
                matches!(from(origin, &["https://app.example"]), Err(Defence::ForeignOrigin(_))),
                "{origin}"
            );
        }
        assert!(check("POST", &[("host", "127.0.0.1"), ("origin", "http://127.0.0.1")], &[]).is_ok());
        assert!(check("POST", &[("host", "[::1]:8080"), ("origin", "http://[::1]:8080")], &[]).is_ok());
    }

    #[test]
    fn a_link_may_lead_here_and_an_image_may_not_load_from_here() {
        let fetched = |method: &str, site: &str, mode: &str| {
            let headers = [("host", "localhost"), ("sec-fetch-site", site), ("sec-fetch-mode", mode)];
            check(method, &headers, &[]).is_ok()
        };
        assert!(fetched("GET", "same-origin", "no-cors") && fetched("GET", "none", "navigate"));
        assert!(fetched("GET", "cross-site", "navigate") && !fetched("POST", "cross-site", "navigate"));
        assert!(!fetched("GET", "cross-site", "no-cors") && !fetched("GET", "same-site", "no-cors"));
    }
}
