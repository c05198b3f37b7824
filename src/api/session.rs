//! `/v1/session`: a key in a cookie, for people in a browser. Pages cannot send a header with the pictures they show.

use super::App;
use super::access::{COOKIE, Caller};
use super::error::Error;
use super::extract::Json;
use super::problems::{CommonProblems, JsonProblems};
use crate::storage::{Role, Secret};
use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use jiff::Timestamp;
use serde::{Deserialize, Serialize};

/// A key to be used by this browser.
#[derive(Debug, Default, Deserialize, utoipa::ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SessionBody {
    /// As `viola keys create` showed it.
    #[schema(example = "viola_0000000000000000000000000000000000000000000000000000000000000000")]
    key: String,
}

/// Whose requests these are.
#[derive(Debug, Serialize, utoipa::ToSchema)]
pub(super) struct Session {
    #[schema(example = "acme")]
    tenant: String,
    role: Role,
    /// Whether a key was shown; without one the service serves only its own machine.
    with_key: bool,
}

impl From<Caller> for Session {
    fn from(caller: Caller) -> Session {
        Session { tenant: caller.tenant.name().to_owned(), role: caller.role, with_key: caller.key.is_some() }
    }
}

/// Who I am
#[utoipa::path(get, path = "/v1/session", tag = "service",
    responses((status = 200, description = "The tenant and role of the key in use", body = Session), CommonProblems))]
pub(super) async fn get_session(caller: Caller) -> axum::Json<Session> {
    axum::Json(caller.into())
}

/// Use a key in this browser
///
/// It is kept in a cookie that pages cannot read and that goes to this service alone.
#[utoipa::path(put, path = "/v1/session", tag = "service", security(()), request_body = SessionBody,
    responses(
        (status = 204, description = "The cookie is set", headers(("Set-Cookie" = String, description = "The key"))),
        CommonProblems, JsonProblems))]
pub(super) async fn put_session(
    State(app): State<App>,
    headers: HeaderMap,
    Json(body): Json<SessionBody>,
) -> Result<(StatusCode, HeaderMap), Error> {
    let secret: Secret = body.key.parse().map_err(|()| Error::KeyInvalid)?;
    app.storage.use_key(&secret, Timestamp::now()).await?.ok_or(Error::KeyInvalid)?;
    // Behind a proxy that speaks TLS, the cookie goes back through TLS only.
    let is_secure = headers.get("x-forwarded-proto").is_some_and(|proto| proto == "https");
    Ok((StatusCode::NO_CONTENT, set(secret.show(), "2592000", is_secure)))
}

/// Use no key any more in this browser
#[utoipa::path(delete, path = "/v1/session", tag = "service", security(()),
    responses((status = 204, description = "The cookie is gone"), CommonProblems))]
pub(super) async fn delete_session() -> (StatusCode, HeaderMap) {
    (StatusCode::NO_CONTENT, set("", "0", false))
}

fn set(value: &str, life_s: &str, is_secure: bool) -> HeaderMap {
    let secure = if is_secure { "; Secure" } else { "" };
    let cookie = format!("{COOKIE}={value}; Path=/; HttpOnly; SameSite=Strict; Max-Age={life_s}{secure}");
    let mut headers = HeaderMap::new();
    if let Ok(mut cookie) = HeaderValue::from_str(&cookie) {
        cookie.set_sensitive(true);
        headers.insert(header::SET_COOKIE, cookie);
    }
    headers
}
