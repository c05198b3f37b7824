//! Pictures and clouds of one clip.

use super::App;
use super::bodies::{FileBytes, send};
use super::error::Error;
use super::extract::ClipPath;
use super::problems::CommonProblems;
use super::reply::{tag_of, unless_known};
use super::types::ClipScan;
use crate::storage::{HomeId, StorageError, result_file};
use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, header};
use axum::response::{IntoResponse, Response};
use uuid::Uuid;
use viola_home::{MAP_VOXEL_M, NotOurs, cloud_ply, read_cloud_ply};

/// A picture of somebody's home belongs into no shared cache.
const THUMBNAIL_CACHE: &str = "private, max-age=300";

/// Get a picture of the LiDAR map with the clip's hit points and path
#[utoipa::path(get, path = "/v1/homes/{home}/clips/{clip}/overlay.png", tag = "clips",
    params(ClipPath),
    responses((status = 200, description = "The picture", body = FileBytes, content_type = "image/png"), CommonProblems))]
pub(super) async fn get_clip_overlay(
    State(app): State<App>,
    ClipPath { home, clip }: ClipPath,
) -> Result<Response, Error> {
    send_result(app, home, clip, result_file::OVERLAY, "image/png").await
}

/// Get a picture of the clip's completion: the views, the filled-in pictures, and the plan before and after
#[utoipa::path(get, path = "/v1/homes/{home}/clips/{clip}/completion.png", tag = "clips",
    params(ClipPath),
    responses((status = 200, description = "The picture", body = FileBytes, content_type = "image/png"), CommonProblems))]
pub(super) async fn get_clip_completion(
    State(app): State<App>,
    ClipPath { home, clip }: ClipPath,
) -> Result<Response, Error> {
    send_result(app, home, clip, result_file::COMPLETION, "image/png").await
}

/// Get the clip's fused points with colours, in the map's frame if the clip has a pose
///
/// The pose is the one in the home's map, else a person's choice, else that of the clip's own alignment.
/// Without a pose, the points are in the clip's frame. The comment of the PLY names the frame.
#[utoipa::path(get, path = "/v1/homes/{home}/clips/{clip}/cloud.ply", tag = "clips",
    params(ClipPath),
    responses((status = 200, description = "The points", body = FileBytes, content_type = "model/ply"), CommonProblems))]
pub(super) async fn get_clip_cloud(
    State(app): State<App>,
    ClipPath { home, clip: id }: ClipPath,
) -> Result<Response, Error> {
    let clip = app.storage.clip(&home, id).await?;
    let bytes = app.storage.clip_result_bytes(&clip, result_file::CLOUD).await?;
    let bytes = bytes.ok_or(Error::NoSuchResult(clip.state.name()))?;
    let Some(map_from_clip) = clip.map_from_clip() else {
        return Ok(([(header::CONTENT_TYPE, HeaderValue::from_static("model/ply"))], bytes).into_response());
    };
    let moved = app.readers.run(home.tenant(), move || {
        let cloud = read_cloud_ply(&bytes, MAP_VOXEL_M)?;
        Ok::<_, NotOurs>(cloud_ply(&cloud, Some(&map_from_clip)))
    });
    let damaged = |error: NotOurs| StorageError::Column { column: "cloud.ply", detail: error.to_string() };
    let moved = moved.await?.map_err(damaged)?;
    Ok(([(header::CONTENT_TYPE, HeaderValue::from_static("model/ply"))], moved).into_response())
}

/// Get the clip's hits at the vacuum's height and its cameras, in the clip's frame, to draw it at any pose
#[utoipa::path(get, path = "/v1/homes/{home}/clips/{clip}/scan", tag = "clips",
    params(ClipPath),
    responses((status = 200, description = "Hits and cameras", body = ClipScan), CommonProblems))]
pub(super) async fn get_clip_scan(
    State(app): State<App>,
    ClipPath { home, clip }: ClipPath,
) -> Result<Response, Error> {
    send_result(app, home, clip, result_file::SCAN, "application/json").await
}

/// Get a small picture of the clip: its sharpest frame of about five, upright
///
/// The job that aligns the clip makes it. Its longest side has 320 pixels. A clip without an answer returns 404
/// `result-not-found`; a clip without a colour picture, or with an answer of an earlier version, `no-thumbnail`.
#[utoipa::path(get, path = "/v1/homes/{home}/clips/{clip}/thumbnail.jpg", tag = "clips",
    params(ClipPath),
    responses((status = 200, description = "The picture", body = FileBytes, content_type = "image/jpeg"),
        (status = 304, description = "The client has it"), CommonProblems))]
pub(super) async fn get_clip_thumbnail(
    State(app): State<App>,
    ClipPath { home, clip: id }: ClipPath,
    headers: HeaderMap,
) -> Result<Response, Error> {
    let clip = app.storage.clip(&home, id).await?;
    let result = clip.result_key().ok_or(Error::NoSuchResult(clip.state.name()))?;
    let tag = tag_of(&[result.as_bytes()]);
    let blob = app.storage.clip_result(&clip, result_file::THUMBNAIL).await?.ok_or(Error::NoThumbnail)?;
    let mut answer = unless_known(&headers, &tag, || send(blob, "image/jpeg"));
    answer.headers_mut().insert(header::CACHE_CONTROL, HeaderValue::from_static(THUMBNAIL_CACHE));
    Ok(answer)
}

async fn send_result(
    app: App,
    home: HomeId,
    id: Uuid,
    name: &str,
    media_type: &'static str,
) -> Result<Response, Error> {
    let clip = app.storage.clip(&home, id).await?;
    let blob = app.storage.clip_result(&clip, name).await?;
    Ok(send(blob.ok_or(Error::NoSuchResult(clip.state.name()))?, media_type))
}
