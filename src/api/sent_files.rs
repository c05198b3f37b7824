//! The files that were sent, as they came: recordings and LiDAR maps.

use super::App;
use super::bodies::{FileBytes, attachment, send};
use super::error::Error;
use super::extract::{ClipPath, LevelRevisionPath};
use super::lidar_map::of_revision;
use super::problems::CommonProblems;
use super::reply::{IMMUTABLE, REVALIDATED, unless_known};
use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, header};
use axum::response::Response;
use viola_storage::{BlobReader, StorageError};

/// Get the recording of a clip, as it was uploaded
///
/// `Content-Disposition` has the name of the file, if its sender gave one.
#[utoipa::path(get, path = "/v1/homes/{home}/clips/{clip}/recording", tag = "clips", params(ClipPath),
    responses(
        (status = 200, description = "The file", body = FileBytes, content_type = "application/octet-stream"),
        CommonProblems))]
pub(super) async fn get_clip_recording(
    State(app): State<App>,
    ClipPath { home, clip: id }: ClipPath,
    headers: HeaderMap,
) -> Result<Response, Error> {
    let clip = app.storage.clip(&home, id).await?;
    let blob = app.storage.clip_recording(id).await?.ok_or(StorageError::NoSuchClip)?;
    let name = clip.file_name.unwrap_or_else(|| format!("clip-{id}"));
    // The address has the clip's id, which is never used again.
    Ok(sent(&headers, &clip.sha256, &name, blob, IMMUTABLE))
}

/// Get the file of a LiDAR map, as it was uploaded
///
/// `Content-Disposition` has the name of the file, if its sender gave one.
#[utoipa::path(get, path = "/v1/homes/{home}/lidar-maps/{level}/revisions/{revision}/file", tag = "lidar-map",
    params(LevelRevisionPath),
    responses(
        (status = 200, description = "The file", body = FileBytes, content_type = "application/octet-stream"),
        CommonProblems))]
pub(super) async fn get_lidar_map_file(
    State(app): State<App>,
    LevelRevisionPath { home, level, revision }: LevelRevisionPath,
    headers: HeaderMap,
) -> Result<Response, Error> {
    let map = of_revision(&app, &home, level, revision).await?;
    let blob = app.storage.lidar_map_blob(&map).await?;
    let name = map.file_name.unwrap_or_else(|| format!("{home}-{level}-{revision}"));
    // A home that was deleted and made again counts its revisions from 1 again.
    Ok(sent(&headers, &map.sha256, &name, blob, REVALIDATED))
}

/// Returns the answer with a file.
fn sent(headers: &HeaderMap, sha256: &str, name: &str, blob: BlobReader, cached: HeaderValue) -> Response {
    let file = || attachment(send(blob, "application/octet-stream"), name);
    let mut answer = unless_known(headers, &format!("\"{sha256}\""), file);
    answer.headers_mut().insert(header::CACHE_CONTROL, cached);
    answer
}
