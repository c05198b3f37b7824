//! The viewer: one page and its assets, bundled from `web/` by `build.rs` and held by the binary.

use super::App;
use super::compression::StaticFile;
use super::error::Error;
use super::reply::{tag_of, unless_known};
use axum::extract::Path;
use axum::extract::rejection::PathRejection;
use axum::http::uri::PathAndQuery;
use axum::http::{HeaderMap, HeaderName, HeaderValue, Uri, header};
use axum::response::{IntoResponse, Redirect, Response};
use axum::{Router, routing};
use std::collections::HashMap;
use std::sync::LazyLock;

// `INDEX`, the page, and `ASSETS`, whose names carry a hash of their content.
include!(concat!(env!("OUT_DIR"), "/viewer/list.rs"));

/// Content security policy: the page loads nothing from other hosts, and text in a name or a reason cannot
/// run as code. Pictures that the page draws itself have `blob:` addresses.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; \
    connect-src 'self'; worker-src 'self'; base-uri 'none'; form-action 'none'; \
    frame-ancestors 'none'";

static PAGE: LazyLock<StaticFile> = LazyLock::new(|| StaticFile::new(INDEX));

static FILES: LazyLock<HashMap<&str, StaticFile>> =
    LazyLock::new(|| ASSETS.iter().map(|(name, bytes)| (*name, StaticFile::new(*bytes))).collect());

static INDEX_TAG: LazyLock<String> = LazyLock::new(|| tag_of(&[INDEX]));

pub(super) fn routes() -> Router<App> {
    Router::new()
        .route("/", routing::get(index))
        .route("/assets/{name}", routing::get(asset))
        .route("/homes/{*place}", routing::get(typed))
}

/// Leads from an address as a person types it to that of the page, which is behind a `#`.
async fn typed(address: Uri) -> Response {
    let place = address.path_and_query().map_or(address.path(), PathAndQuery::as_str);
    Redirect::to(&format!("/#{place}")).into_response()
}

async fn index(headers: HeaderMap) -> Response {
    unless_known(&headers, &INDEX_TAG, || file("text/html; charset=utf-8", "no-cache", PAGE.answer(&headers)))
}

/// Returns an asset. Its name changes with its content, so a browser never has to revalidate it.
async fn asset(name: Result<Path<String>, PathRejection>, headers: HeaderMap) -> Result<Response, Error> {
    let name = name.map_err(|_| Error::NoSuchRoute)?.0;
    let found = FILES.get(name.as_str()).ok_or(Error::NoSuchRoute)?;
    Ok(file(media_type(&name), "public, max-age=31536000, immutable", found.answer(&headers)))
}

fn media_type(name: &str) -> &'static str {
    if name.ends_with(".css") { "text/css; charset=utf-8" } else { "text/javascript; charset=utf-8" }
}

fn file(media_type: &'static str, caching: &'static str, answer: Response) -> Response {
    let headers: [(HeaderName, HeaderValue); 5] = [
        (header::CONTENT_TYPE, HeaderValue::from_static(media_type)),
        (header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(POLICY)),
        (header::CACHE_CONTROL, HeaderValue::from_static(caching)),
        (header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff")),
        (header::REFERRER_POLICY, HeaderValue::from_static("no-referrer")),
    ];
    (headers, answer).into_response()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_typed_address_keeps_its_query() {
        for place in ["/homes/demo", "/homes/demo?at=object.bed-1&view=3d"] {
            let answer = typed(place.parse().unwrap()).await;
            assert_eq!(answer.headers()[header::LOCATION], format!("/#{place}"));
        }
    }
}
