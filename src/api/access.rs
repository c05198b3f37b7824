//! Who calls, and what they may do. Where no key was ever made, everyone who reaches the service may do everything, and
//! it listens to its own machine alone.
//!
//! What a caller may not know of answers as if it were not there: 404 and not 403.

use super::App;
use super::error::Error;
use crate::storage::{HomeId, Role, Secret, Tenant};
use axum::extract::{FromRequestParts, MatchedPath, Request, State};
use axum::http::request::Parts;
use axum::http::{HeaderMap, Method, header};
use axum::middleware::Next;
use axum::response::Response;
use jiff::Timestamp;
use std::sync::atomic::Ordering;
use uuid::Uuid;

/// The cookie that the viewer's session lies in: pictures of a page cannot send a header.
pub(super) const COOKIE: &str = "viola_key";

/// Whoever sent a request.
#[derive(Debug, Clone)]
pub(super) struct Caller {
    pub tenant: Tenant,
    pub role: Role,
    /// The only home that the caller may know of; all of the tenant's when there is none.
    home: Option<HomeId>,
    /// None where no key is asked for.
    pub key: Option<Uuid>,
}

impl Caller {
    /// Where no key is asked for.
    fn anyone() -> Caller {
        Caller { tenant: Tenant::default(), role: Role::Admin, home: None, key: None }
    }

    /// The home that a client means by an id.
    pub fn home(&self, id: &HomeId) -> Result<HomeId, Error> {
        let home = self.tenant.home(id);
        if self.may_know(&home) { Ok(home) } else { Err(crate::storage::StorageError::NoSuchHome.into()) }
    }

    /// Whether a home, or what belongs to it, exists for this caller.
    pub fn may_know(&self, home: &HomeId) -> bool {
        self.tenant.has(home) && self.home.as_ref().is_none_or(|own| own == home)
    }

    /// For what is about all homes of the tenant.
    pub fn for_all_homes(&self) -> Result<&Tenant, Error> {
        match self.home {
            None => Ok(&self.tenant),
            Some(_) => Err(Error::Forbidden("this key is for one home, and this path is about all of them")),
        }
    }
}

impl<S: Send + Sync> FromRequestParts<S> for Caller {
    type Rejection = Error;

    async fn from_request_parts(parts: &mut Parts, _state: &S) -> Result<Caller, Error> {
        of(parts)
    }
}

/// The caller of a request that passed [`check`].
pub(super) fn of(parts: &Parts) -> Result<Caller, Error> {
    parts.extensions.get::<Caller>().cloned().ok_or(Error::KeyMissing)
}

/// Lets a request through that its caller may send.
pub(super) async fn check(
    State(app): State<App>,
    mut request: Request,
    next: Next,
) -> Result<Response, Error> {
    let caller = match secret(request.headers())? {
        Some(secret) => {
            let key = app.storage.use_key(&secret, Timestamp::now()).await?.ok_or(Error::KeyInvalid)?;
            app.has_keys.store(true, Ordering::Relaxed);
            Caller { tenant: key.tenant, role: key.role, home: key.home, key: Some(key.id) }
        }
        None if asks_for_keys(&app).await? => return Err(Error::KeyMissing),
        None => Caller::anyone(),
    };
    tracing::Span::current().record("tenant", caller.tenant.name());
    let route = request.extensions().get::<MatchedPath>().map_or("", MatchedPath::as_str);
    if !may(caller.role, request.method(), route) {
        return Err(Error::Forbidden(match caller.role {
            Role::Reader => {
                "a key with the role `reader` changes nothing and sees no webhooks; this takes `admin`"
            }
            _ => {
                "a key with the role `uploader` uploads clips and follows them; this takes `reader` or `admin`"
            }
        }));
    }
    app.limits.pass(&caller.tenant)?;
    request.extensions_mut().insert(caller);
    Ok(next.run(request).await)
}

/// The last key's tenant may be deleted while this process runs; that opens the service to nobody.
async fn asks_for_keys(app: &App) -> Result<bool, Error> {
    if !app.has_keys.load(Ordering::Relaxed) && app.storage.has_keys().await? {
        app.has_keys.store(true, Ordering::Relaxed);
    }
    Ok(app.has_keys.load(Ordering::Relaxed))
}

/// The secret that a request shows, in a header or else in the cookie, which a browser sends only with what the service's
/// own pages ask for (`SameSite=Strict`).
fn secret(headers: &HeaderMap) -> Result<Option<Secret>, Error> {
    let text = match headers.get(header::AUTHORIZATION) {
        Some(value) => {
            let text = value.to_str().map_err(|_| Error::KeyInvalid)?;
            let (scheme, secret) = text.split_once(' ').ok_or(Error::KeyInvalid)?;
            Some(secret.trim()).filter(|_| scheme.eq_ignore_ascii_case("bearer"))
        }
        None => return cookie(headers).map(|text| text.parse().map_err(|()| Error::KeyInvalid)).transpose(),
    };
    text.ok_or(Error::KeyInvalid)?.parse().map(Some).map_err(|()| Error::KeyInvalid)
}

fn cookie(headers: &HeaderMap) -> Option<&str> {
    let cookies = headers.get_all(header::COOKIE).iter().filter_map(|value| value.to_str().ok());
    let mut pairs = cookies.flat_map(|value| value.split(';')).filter_map(|pair| pair.trim().split_once('='));
    pairs.find(|(name, _)| *name == COOKIE).map(|(_, value)| value)
}

/// What an uploader needs beside its uploads: the home and clip that it sent, and how far the work is.
const OF_UPLOADERS: [(Method, &str); 9] = [
    (Method::POST, "/v1/homes/{home}/clips"),
    (Method::GET, "/v1/homes/{home}"),
    (Method::GET, "/v1/homes/{home}/clips/{clip}"),
    (Method::GET, "/v1/jobs/{job}"),
    (Method::GET, "/v1/jobs/{job}/events"),
    (Method::GET, "/v1/classes"),
    (Method::GET, "/v1/session"),
    (Method::DELETE, "/v1/session"),
    (Method::PUT, "/v1/session"),
];

fn may(role: Role, method: &Method, route: &str) -> bool {
    let method = if method == Method::HEAD { &Method::GET } else { method };
    let is_session = route == "/v1/session";
    match role {
        Role::Admin => true,
        // Addresses of webhooks may hold passwords.
        Role::Reader if route.starts_with("/v1/webhooks") => false,
        Role::Reader => [Method::GET, Method::OPTIONS].contains(method) || is_session,
        Role::Uploader => {
            route.starts_with("/v1/uploads") || OF_UPLOADERS.iter().any(|(m, r)| m == method && *r == route)
        }
    }
}
