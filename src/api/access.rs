//! Authentication and authorisation. Until the first key is created, every caller may do everything, and the
//! service listens only on loopback addresses. Resources of other tenants and homes return 404, not 403.

use super::App;
use super::connections::Asked;
use super::error::{Defence, Error};
use super::fairness::Turn;
use super::peer;
use axum::extract::{FromRequestParts, MatchedPath, Request, State};
use axum::http::request::Parts;
use axum::http::{Extensions, HeaderMap, Method, header};
use axum::middleware::Next;
use axum::response::Response;
use futures::FutureExt;
use std::future::Future;
use std::net::IpAddr;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;
use tokio_util::task::AbortOnDropHandle;
use uuid::Uuid;
use viola_storage::{ApiKey, HomeId, Role, Secret, SessionToken, StorageError, Tenant};

/// The cookie of the viewer's session: image requests of a page cannot send a header.
pub(super) const COOKIE: &str = "viola_session";

/// The sender of a request.
#[derive(Debug, Clone)]
pub(super) struct Caller {
    pub tenant: Tenant,
    pub role: Role,
    /// The only home that the caller may access; none means all homes of the tenant.
    home: Option<HomeId>,
    /// None if the service requires no key.
    pub key: Option<Uuid>,
    credentials: Option<Credentials>,
}

impl Caller {
    /// Returns the caller of a service that requires no key.
    fn anyone() -> Caller {
        Caller { tenant: Tenant::default(), role: Role::Admin, home: None, key: None, credentials: None }
    }

    fn new(key: ApiKey, credentials: Credentials) -> Caller {
        let ApiKey { tenant, role, home, id, .. } = key;
        Caller { tenant, role, home, key: Some(id), credentials: Some(credentials) }
    }

    /// Returns the tenant's home with an id; refuses a home that the caller may not access.
    pub fn home(&self, id: &HomeId) -> Result<HomeId, Error> {
        let home = self.tenant.home(id);
        match &self.home {
            Some(own) if *own != home => Err(Defence::OtherHome(own.clone()).into()),
            _ => Ok(home),
        }
    }

    /// Returns whether the caller may access a home and its resources.
    pub fn may_know(&self, home: &HomeId) -> bool {
        self.tenant.has(home) && self.home.as_ref().is_none_or(|own| own == home)
    }

    /// Returns the tenant; refuses a caller that is limited to one home.
    pub fn for_all_homes(&self) -> Result<&Tenant, Error> {
        let Some(home) = &self.home else { return Ok(&self.tenant) };
        Err(Error::Forbidden(format!(
            "this path is about all homes of the tenant, and needs a key for all of them; this key, with the role `{}`, is \
             for the home `{home}` only",
            self.role.name()
        )))
    }
}

impl<S: Send + Sync> FromRequestParts<S> for Caller {
    type Rejection = Error;

    async fn from_request_parts(parts: &mut Parts, _state: &S) -> Result<Caller, Error> {
        of(parts)
    }
}

/// Returns the caller of a request that passed [`check`].
pub(super) fn of(parts: &Parts) -> Result<Caller, Error> {
    parts.extensions.get::<Caller>().cloned().ok_or(Error::KeyMissing)
}

/// Identifies the caller of a request, and refuses the request if its role does not allow it.
pub(super) async fn check(
    State(app): State<App>,
    mut request: Request,
    next: Next,
) -> Result<Response, Error> {
    let address = peer::client(request.extensions(), request.headers());
    let credentials = credentials(request.headers());
    let is_session =
        matches!(credentials, Ok(Some(Credentials::Session(_))) | Err(Error::Defence(Defence::SessionEnded)));
    // The cookie is of another service then: a browser sends the cookies of a machine to all its ports, and a new data folder
    // knows none of them.
    let credentials = if is_session && !asks_for_keys(&app).await? { None } else { credentials? };
    // Before the query for the key: it waits for the database, too.
    let known = credentials.as_ref().and_then(|credentials| credentials.known_tenant(&app));
    let mut turn = None;
    if let Some(tenant) = &known {
        turn = Some(take_turn(&app, tenant, request.extensions()).await);
    }
    let caller = match credentials {
        Some(credentials) => {
            let key = match &credentials {
                Credentials::Key(secret) => key(&app, address, secret).await?,
                Credentials::Session(token) => session(&app, address, token).await?,
            };
            Some(Caller::new(key, credentials))
        }
        None if asks_for_keys(&app).await? => return Err(Error::KeyMissing),
        None => None,
    };
    if caller.is_some() {
        app.has_keys.store(true, Ordering::Relaxed);
    }
    let caller = caller.unwrap_or_else(Caller::anyone);
    tracing::Span::current().record("tenant", caller.tenant.name());
    // A request that the role does not allow counts, too: its key was looked up.
    app.limits.pass(&caller.tenant)?;
    let route = request.extensions().get::<MatchedPath>().map_or("", MatchedPath::as_str);
    if !may(caller.role, request.method(), route) {
        return Err(Error::Forbidden(needed_role(caller.role, request.method(), route)));
    }
    if OF_ALL_HOMES.contains(&route) {
        caller.for_all_homes()?;
    }
    let turn = match turn {
        Some(turn) => turn,
        None => take_turn(&app, &caller.tenant, request.extensions()).await,
    };
    request.extensions_mut().insert(caller);
    Ok(turn.run(next.run(request)).await)
}

/// Counts a request and does its `work` in its tenant's turn, for operations without [`check`].
pub(super) async fn in_turn<T>(
    app: &App,
    tenant: &Tenant,
    extensions: &Extensions,
    work: impl Future<Output = T>,
) -> Result<T, Error> {
    app.limits.pass(tenant)?;
    Ok(take_turn(app, tenant, extensions).await.run(work).await)
}

/// Waits for the tenant's turn.
async fn take_turn(app: &App, tenant: &Tenant, extensions: &Extensions) -> Turn {
    let _queued = extensions.get::<Arc<Asked>>().map(Asked::queue);
    app.turns.take(tenant).await
}

/// Returns whether requests need a key; remains true for the life of the process if the last key is deleted.
pub(super) async fn asks_for_keys(app: &App) -> Result<bool, Error> {
    if !app.has_keys.load(Ordering::Relaxed) && app.storage.has_keys().await? {
        app.has_keys.store(true, Ordering::Relaxed);
    }
    Ok(app.has_keys.load(Ordering::Relaxed))
}

/// Returns the valid key with a secret.
pub(super) async fn key(app: &App, address: Option<IpAddr>, secret: &Secret) -> Result<ApiKey, Error> {
    let find = app.storage.use_key(secret, app.storage.now());
    find_key(app, address, &secret.sha256(), find).await?.ok_or(Error::KeyInvalid)
}

/// Returns the valid key of a session.
pub(super) async fn session(
    app: &App,
    address: Option<IpAddr>,
    token: &SessionToken,
) -> Result<ApiKey, Error> {
    let find = app.storage.use_session(token, app.storage.now());
    Ok(find_key(app, address, &token.sha256(), find).await?.ok_or(Defence::SessionEnded)?)
}

/// Runs a query for a key, unless too many from this address found none.
async fn find_key(
    app: &App,
    address: Option<IpAddr>,
    sha256: &str,
    find: impl Future<Output = Result<Option<ApiKey>, StorageError>>,
) -> Result<Option<ApiKey>, Error> {
    app.failed_keys.begin(address, sha256, Instant::now())?;
    let found = find.await.inspect_err(|_| app.failed_keys.undecided(address, sha256))?;
    match &found {
        Some(key) => app.failed_keys.succeeded(address, sha256, &key.tenant),
        None => app.failed_keys.failed(sha256),
    }
    Ok(found)
}

/// Resolves when the key or the session of a caller is no longer valid: an endless answer may outlive it. A task looks,
/// since the answer is only polled while its client reads, and a query that is not polled holds its connection.
pub(super) fn expiry(app: App, caller: Caller) -> impl Future<Output = ()> + Unpin {
    AbortOnDropHandle::new(tokio::spawn(expired(app, caller))).map(|_| ())
}

async fn expired(app: App, caller: Caller) {
    loop {
        tokio::time::sleep(app.bodies.credentials).await;
        let found = match &caller.credentials {
            Some(Credentials::Key(secret)) => app.storage.use_key(secret, app.storage.now()).await,
            Some(Credentials::Session(token)) => app.storage.use_session(token, app.storage.now()).await,
            // The first key ends the time without keys.
            None => match asks_for_keys(&app).await {
                Ok(true) => Ok(None),
                _ => continue,
            },
        };
        if matches!(found, Ok(None)) {
            return;
        }
    }
}

#[derive(Debug, Clone)]
enum Credentials {
    Key(Secret),
    Session(SessionToken),
}

impl Credentials {
    fn sha256(&self) -> String {
        match self {
            Credentials::Key(secret) => secret.sha256(),
            Credentials::Session(token) => token.sha256(),
        }
    }

    /// Returns the tenant, if the credentials were valid before.
    fn known_tenant(&self, app: &App) -> Option<Tenant> {
        app.failed_keys.tenant_of(&self.sha256())
    }
}

/// Returns the tenant whose credentials the headers of a request have, if they were valid before.
pub(super) fn known_tenant(app: &App, headers: &HeaderMap) -> Option<Tenant> {
    credentials(headers).ok()??.known_tenant(app)
}

/// Returns the credentials of a request, from the header or else from the cookie. A browser sends the cookie
/// only with requests of the service's own pages (`SameSite=Strict`).
fn credentials(headers: &HeaderMap) -> Result<Option<Credentials>, Error> {
    let Some(value) = headers.get(header::AUTHORIZATION) else {
        let token =
            cookie(headers).map(|text| text.parse().map_err(|()| Defence::SessionEnded)).transpose()?;
        return Ok(token.map(Credentials::Session));
    };
    let text = value.to_str().map_err(|_| Error::NoKey)?;
    let (scheme, secret) = text.split_once(' ').ok_or(Error::NoKey)?;
    if !scheme.eq_ignore_ascii_case("bearer") {
        return Err(Error::NoKey);
    }
    secret.trim().parse().map(|secret| Some(Credentials::Key(secret))).map_err(|()| Error::KeyInvalid)
}

/// Returns the value of the session's cookie.
pub(super) fn cookie(headers: &HeaderMap) -> Option<&str> {
    let cookies = headers.get_all(header::COOKIE).iter().filter_map(|value| value.to_str().ok());
    let mut pairs = cookies.flat_map(|value| value.split(';')).filter_map(|pair| pair.trim().split_once('='));
    pairs.find(|(name, _)| *name == COOKIE).map(|(_, value)| value)
}

/// Operations about all homes whose handlers know no caller, since the second listener serves them, too.
const OF_ALL_HOMES: [&str; 2] = ["/metrics", "/readyz"];

/// Operations of an uploader besides uploads: read its home and its clip, and follow the job. Of the pictures, it sees those
/// of the recording that it sent itself: they show why a clip failed. The overlay shows the home's LiDAR map.
const OF_UPLOADERS: [(Method, &str); 11] = [
    (Method::POST, "/v1/homes/{home}/clips"),
    (Method::GET, "/v1/homes/{home}"),
    (Method::GET, "/v1/homes/{home}/clips/{clip}"),
    (Method::GET, "/v1/homes/{home}/clips/{clip}/frames.jpg"),
    (Method::GET, "/v1/homes/{home}/clips/{clip}/thumbnail.jpg"),
    (Method::GET, "/v1/jobs/{job}"),
    (Method::GET, "/v1/jobs/{job}/events"),
    (Method::GET, "/v1/classes"),
    (Method::GET, "/v1/session"),
    (Method::DELETE, "/v1/session"),
    (Method::PUT, "/v1/session"),
];

/// Returns the words that refuse a request: the roles that it needs, and the one that its key has.
fn needed_role(has: Role, method: &Method, route: &str) -> String {
    let roles = [Role::Uploader, Role::Reader, Role::Admin].into_iter();
    let needed: Vec<String> =
        roles.filter(|role| may(*role, method, route)).map(|role| format!("`{}`", role.name())).collect();
    let rights = match has {
        Role::Uploader => "uploads clips and follows them",
        Role::Reader => "reads everything except webhooks, and changes nothing",
        Role::Admin => "does everything",
    };
    format!(
        "{method} of this path needs a key with the role {}; this key has the role `{}`, which {rights}",
        needed.join(" or "),
        has.name()
    )
}

fn may(role: Role, method: &Method, route: &str) -> bool {
    let method = if method == Method::HEAD { &Method::GET } else { method };
    let is_session = route == "/v1/session";
    match role {
        Role::Admin => true,
        // URLs of webhooks may contain passwords.
        Role::Reader if route.starts_with("/v1/webhooks") => false,
        Role::Reader => [Method::GET, Method::OPTIONS].contains(method) || is_session,
        Role::Uploader => {
            route.starts_with("/v1/uploads") || OF_UPLOADERS.iter().any(|(m, r)| m == method && *r == route)
        }
    }
}
