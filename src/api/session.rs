//! `/v1/session`: a key in a cookie, for browsers: image requests of a page cannot send a header.

use super::App;
use super::access::{COOKIE, Caller};
use super::error::Error;
use super::extract::Json;
use super::problems::{CommonProblems, JsonProblems};
use super::reply::Document;
use super::types::Role;
use crate::storage::Secret;
use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use jiff::Timestamp;
use serde::{Deserialize, Serialize};

/// The key that this browser shall use.
#[derive(Debug, Default, Deserialize, utoipa::ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SessionBody {
    /// The key as `viola keys create` printed it.
    #[schema(example = "viola_0000000000000000000000000000000000000000000000000000000000000000")]
    key: String,
}

/// The tenant and the role of the caller.
#[derive(Debug, Serialize, utoipa::ToSchema)]
pub(super) struct Session {
    #[schema(example = "acme")]
    tenant: String,
    role: Role,
    /// True if the request has a key; until the first key exists, the service serves only its own machine.
    with_key: bool,
}

impl From<Caller> for Session {
    fn from(caller: Caller) -> Session {
        Session {
            tenant: caller.tenant.name().to_owned(),
            role: caller.role.into(),
            with_key: caller.key.is_some(),
        }
    }
}

/// Get the tenant and role of the caller
#[utoipa::path(get, path = "/v1/session", tag = "service",
    responses((status = 200, description = "The tenant and role of the key in use", body = Session), CommonProblems))]
pub(super) async fn get_session(caller: Caller) -> Document<Session> {
    Document(caller.into())
}

/// Use a key in this browser
///
/// The key is kept in a cookie that pages cannot read and that is sent only to this service.
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
    // Behind a proxy that speaks TLS, the browser may return the cookie only over TLS.
    let is_secure = headers.get("x-forwarded-proto").is_some_and(|proto| proto == "https");
    Ok((StatusCode::NO_CONTENT, set(secret.show(), "2592000", is_secure)))
}

/// Stop using a key in this browser
#[utoipa::path(delete, path = "/v1/session", tag = "service", security(()),
    responses((status = 204, description = "The cookie is removed"), CommonProblems))]
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
