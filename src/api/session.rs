//! `/v1/session`: the session of a browser, in a cookie: image requests of a page cannot send a header.

use super::App;
use super::access::{self, COOKIE, Caller};
use super::error::{Defence, Error};
use super::extract::Json;
use super::peer;
use super::problems::{CommonProblems, JsonProblems};
use super::reply::Document;
use super::types::Role;
use axum::extract::State;
use axum::http::{Extensions, HeaderMap, HeaderValue, StatusCode, header};
use serde::{Deserialize, Serialize};
use viola_storage::{SESSION_LIFE, Secret, SessionToken};

/// The key that this browser shall use.
#[derive(Debug, Default, Deserialize, utoipa::ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SessionBody {
    /// The key as `viola keys create` printed it.
    #[schema(
        min_length = 1,
        example = "viola_0000000000000000000000000000000000000000000000000000000000000000"
    )]
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

/// Sign in: begin a session of this browser with a key
///
/// The session's random token is in a cookie that pages cannot read and that is sent only to this service. The session has
/// the rights of the key, and ends after 12 hours, with `DELETE /v1/session`, or when the key is revoked or expires.
#[utoipa::path(put, path = "/v1/session", tag = "service", security(()), request_body = SessionBody,
    responses(
        (status = 204, description = "The cookie is set", headers(("Set-Cookie" = String, description = "The session's token"))),
        CommonProblems, JsonProblems))]
pub(super) async fn put_session(
    State(app): State<App>,
    extensions: Extensions,
    headers: HeaderMap,
    Json(body): Json<SessionBody>,
) -> Result<(StatusCode, HeaderMap), Error> {
    if body.key.is_empty() {
        let detail = "it is the key as `viola keys create` printed it".to_owned();
        return Err(Error::InvalidBody { field: Some("key".into()), detail });
    }
    let secret: Secret = body.key.parse().map_err(|()| Error::KeyInvalid)?;
    let key = access::key(&app, peer::client(&extensions, &headers), &secret).await?;
    let begin = app.storage.begin_session(key.id, app.storage.now());
    let token = access::in_turn(&app, &key.tenant, &extensions, begin).await??;
    Ok((StatusCode::NO_CONTENT, set(token.show(), SESSION_LIFE.as_secs(), is_secure(&app, &headers))))
}

/// Sign out: end the session of this browser
#[utoipa::path(delete, path = "/v1/session", tag = "service", security(()),
    responses((status = 204, description = "The session has ended and the cookie is removed"), CommonProblems))]
pub(super) async fn delete_session(
    State(app): State<App>,
    extensions: Extensions,
    headers: HeaderMap,
) -> Result<(StatusCode, HeaderMap), Error> {
    let token: Option<SessionToken> = access::cookie(&headers).and_then(|token| token.parse().ok());
    if let Some(token) = token {
        // Everybody may send a token, so an invalid one counts as a failed attempt and reaches no writer.
        match access::session(&app, peer::client(&extensions, &headers), &token).await {
            Ok(key) => {
                let end = app.storage.end_session(&token);
                access::in_turn(&app, &key.tenant, &extensions, end).await??;
            }
            Err(Error::Defence(Defence::SessionEnded)) => {}
            Err(error) => return Err(error),
        }
        app.failed_keys.failed(&token.sha256());
    }
    Ok((StatusCode::NO_CONTENT, set("", 0, is_secure(&app, &headers))))
}

/// Returns whether the browser may return the cookie over TLS only. A service on loopback has no TLS, except behind a proxy
/// on the same machine.
fn is_secure(app: &App, headers: &HeaderMap) -> bool {
    !app.is_on_loopback || headers.get("x-forwarded-proto").is_some_and(|proto| proto == "https")
}

fn set(value: &str, life_s: i64, is_secure: bool) -> HeaderMap {
    let secure = if is_secure { "; Secure" } else { "" };
    let cookie = format!("{COOKIE}={value}; Path=/; HttpOnly; SameSite=Strict; Max-Age={life_s}{secure}");
    let mut headers = HeaderMap::new();
    if let Ok(mut cookie) = HeaderValue::from_str(&cookie) {
        cookie.set_sensitive(true);
        headers.insert(header::SET_COOKIE, cookie);
    }
    headers
}
