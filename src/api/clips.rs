//! `/v1/homes/{home}/clips`

use super::App;
use super::bodies::{FileBytes, receive, to_the_end, understand};
use super::error::{Error, Problem};
use super::extract::{ClipPath, HomePath, IdempotencyKey, Query};
use super::list::{List, ListQuery};
use super::problems::{CommonProblems, FileProblems};
use crate::clip;
use crate::storage::{Added, Arrived, Clip, NewClip, StorageError};
use axum::Json;
use axum::extract::{Request, State};
use axum::http::{StatusCode, header};
use jiff::Timestamp;

/// Upload a clip
///
/// The body is the file; its layout is found by its content. What can be told at once is refused at once;
/// everything else ends in the clip's state and reasons. When the answer arrives, the clip is durable and its
/// job is queued, or waits for the home's first LiDAR map.
///
/// With an `Idempotency-Key`, sending the same file again gives the same clip again.
#[utoipa::path(post, path = "/v1/homes/{home}/clips", tag = "clips",
    params(HomePath,
        ("Idempotency-Key" = Option<String>, Header, description = "1 to 255 visible ASCII characters, unique to this file in this home")),
    request_body(content = FileBytes, content_type = "application/zip", description = "A zip of an RGB-D recording"),
    responses(
        (status = 201, description = "The clip and its job", body = Clip,
            headers(("Location" = String, description = "The clip's path"))),
        CommonProblems, FileProblems))]
pub(super) async fn add_clip(
    State(app): State<App>,
    HomePath { home }: HomePath,
    IdempotencyKey(idempotency_key): IdempotencyKey,
    request: Request,
) -> Result<(StatusCode, [(header::HeaderName, String); 1], Json<Clip>), Error> {
    app.storage.home(&home).await?;
    let file = receive(&app.storage, request, app.max_upload_bytes).await?;
    let (file, info) = understand(&app, move || open(file)).await?;
    let new = NewClip { file, info, idempotency_key };
    let clip = to_the_end(async move {
        let added = app.storage.add_clip(&home, new, Timestamp::now()).await?;
        app.queue.wake();
        match added {
            Added::New(clip) | Added::Replayed(clip) => Ok(clip),
            Added::KeyReused => Err(Error::KeyReused),
        }
    })
    .await?;
    let location = format!("/v1/homes/{}/clips/{}", clip.home, clip.id);
    Ok((StatusCode::CREATED, [(header::LOCATION, location)], Json(clip)))
}

fn open(file: Arrived) -> Result<(Arrived, clip::ClipInfo), Error> {
    let info = clip::Clip::open(file.path())?.info().clone();
    Ok((file, info))
}

/// The clips of a home, the oldest first
#[utoipa::path(get, path = "/v1/homes/{home}/clips", tag = "clips", params(HomePath, ListQuery),
    responses((status = 200, description = "One page", body = List<Clip>), CommonProblems))]
pub(super) async fn list_clips(
    State(app): State<App>,
    HomePath { home }: HomePath,
    Query(query): Query<ListQuery>,
) -> Result<Json<List<Clip>>, Error> {
    let clips = app.storage.clips(&home, &query.page()?).await?;
    Ok(Json(query.list(clips, |clip| clip.id)?))
}

/// A clip: its state, what was understood of it, its alignment and its newest job
#[utoipa::path(get, path = "/v1/homes/{home}/clips/{clip}", tag = "clips",
    params(ClipPath),
    responses((status = 200, description = "The clip", body = Clip), CommonProblems))]
pub(super) async fn get_clip(
    State(app): State<App>,
    ClipPath { home, clip }: ClipPath,
) -> Result<Json<Clip>, Error> {
    Ok(Json(app.storage.clip(&home, clip).await?))
}

/// Remove a clip with every byte of it
#[utoipa::path(delete, path = "/v1/homes/{home}/clips/{clip}", tag = "clips",
    params(ClipPath),
    responses((status = 204, description = "It is gone"), CommonProblems))]
pub(super) async fn delete_clip(
    State(app): State<App>,
    ClipPath { home, clip }: ClipPath,
) -> Result<StatusCode, Error> {
    to_the_end(async move {
        app.storage.delete_clip(&home, clip).await?;
        app.queue.wake();
        Ok(StatusCode::NO_CONTENT)
    })
    .await
}

/// Align a clip again, to the current LiDAR map
///
/// A clip whose job is under way is left alone.
#[utoipa::path(post, path = "/v1/homes/{home}/clips/{clip}/align", tag = "clips",
    params(ClipPath),
    responses(
        (status = 202, description = "The clip with the job that is under way", body = Clip,
            headers(("Location" = String, description = "The job's path"))),
        (status = 409, description = "The home has no LiDAR map: `no-lidar-map`", body = Problem,
            content_type = "application/problem+json"),
        CommonProblems))]
pub(super) async fn align_clip(
    State(app): State<App>,
    ClipPath { home, clip }: ClipPath,
) -> Result<(StatusCode, [(header::HeaderName, String); 1], Json<Clip>), Error> {
    let clip = app.storage.align_clip(&home, clip, Timestamp::now()).await.map_err(|error| match error {
        StorageError::NoLidarMap => Error::NothingToAlignTo,
        other => other.into(),
    })?;
    app.queue.wake();
    let location = clip.job.as_ref().map(|job| format!("/v1/jobs/{}", job.id)).unwrap_or_default();
    Ok((StatusCode::ACCEPTED, [(header::LOCATION, location)], Json(clip)))
}
