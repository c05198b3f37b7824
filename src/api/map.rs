//! `/v1/homes/{home}/map`

use super::App;
use super::bodies::{FileBytes, send};
use super::error::Error;
use super::extract::HomePath;
use super::problems::CommonProblems;
use crate::storage::{HomeMap, LeftOut};
use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// The current revision of a home's map, and what is not in it
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub(super) struct CurrentMap {
    #[serde(flatten)]
    map: HomeMap,
    /// The home's other clips, with the reasons for which they are not in the map.
    left_out: Vec<LeftOut>,
}

/// The fused map of a home: which clips are in it, which are left out and why, and what it holds
///
/// Every change of the set of aligned clips makes a new revision, a moment after it. `If-None-Match` with the `ETag` of
/// an earlier answer is answered by 304 while nothing changed.
#[utoipa::path(get, path = "/v1/homes/{home}/map", tag = "map", params(HomePath),
    responses(
        (status = 200, description = "The current revision", body = CurrentMap),
        (status = 304, description = "Nothing changed"), CommonProblems))]
pub(super) async fn get_map(
    State(app): State<App>,
    HomePath { home }: HomePath,
    headers: HeaderMap,
) -> Result<Response, Error> {
    let map = app.storage.home_map(&home).await?.ok_or(Error::NoMapYet)?;
    let current = CurrentMap { map, left_out: app.storage.clips_left_out(&home).await? };
    let text =
        serde_json::to_vec(&current).expect("our own records have text keys and cannot fail to serialise");
    let sum: String = Sha256::digest(&text).iter().take(16).map(|byte| format!("{byte:02x}")).collect();
    let tag = format!("\"{sum}\"");
    let json = [(header::CONTENT_TYPE, HeaderValue::from_static("application/json"))];
    Ok(unless_known(&headers, &tag, || (json, text).into_response()))
}

/// The points of a home's map, as a binary PLY with normals, colours and classes, in the LiDAR map's frame
#[utoipa::path(get, path = "/v1/homes/{home}/map/points.ply", tag = "map", params(HomePath),
    responses(
        (status = 200, description = "The points", body = FileBytes, content_type = "model/ply"),
        (status = 304, description = "The revision is the one of the `ETag`"), CommonProblems))]
pub(super) async fn get_map_points(
    State(app): State<App>,
    HomePath { home }: HomePath,
    headers: HeaderMap,
) -> Result<Response, Error> {
    let map = app.storage.home_map(&home).await?.ok_or(Error::NoMapYet)?;
    // Removed between the two reads: then there are newer ones, and asking again helps.
    let points = app.storage.home_map_points(&map).await?.ok_or(Error::NoMapYet)?;
    let tag = format!("\"{}-{}\"", map.revision, map.created_at.as_millisecond());
    Ok(unless_known(&headers, &tag, || send(points, "model/ply")))
}

/// The answer with its entity tag, or 304 when the client has it (RFC 9110, 13.1.2).
pub(super) fn unless_known(headers: &HeaderMap, tag: &str, answer: impl FnOnce() -> Response) -> Response {
    let known = headers.get_all(header::IF_NONE_MATCH).iter().filter_map(|value| value.to_str().ok());
    let is_known = known.flat_map(|list| list.split(',')).any(|one| {
        matches!(one.trim().trim_start_matches("W/"), "*") || one.trim().trim_start_matches("W/") == tag
    });
    let mut response = if is_known { StatusCode::NOT_MODIFIED.into_response() } else { answer() };
    if let Ok(tag) = HeaderValue::from_str(tag) {
        response.headers_mut().insert(header::ETAG, tag);
    }
    response.headers_mut().insert(header::CACHE_CONTROL, HeaderValue::from_static("no-cache"));
    response
}
