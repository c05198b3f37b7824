//! `/v1/homes/{home}/clips`

use super::App;
use super::access::Caller;
use super::bodies::{FileBytes, content_length, receive, to_the_end, understand};
use super::error::{Error, Problem};
use super::extract::{ClipPath, HomePath, IdempotencyKey, Query, timestamp};
use super::list::{List, ListQuery, UpdatedQuery, states};
use super::problems::{CommonProblems, FileProblems};
use crate::storage::{Added, Arrived, Clip, ClipFilter, ClipState, NewClip, StorageError};
use axum::Json;
use axum::extract::{Request, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use jiff::{SignedDuration, Timestamp};
use serde::{Deserialize, Serialize};
use viola_formats::clip;
use viola_reconstruct::{Estimate, estimate};

/// No phone recorded depth before the year 2000.
const EARLIEST: Timestamp = Timestamp::constant(946_684_800, 0);
/// How far ahead of ours a phone's clock may be.
const AHEAD: SignedDuration = SignedDuration::from_hours(24);

/// The query of an upload.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct AddQuery {
    /// When the clip was recorded; when not given, what the file says, where its layout has times of day. Where the
    /// home changed between two clips, the later one is believed.
    #[param(value_type = Option<Timestamp>, example = "2026-03-14T15:09:26Z")]
    recorded_at: Option<String>,
    /// With `true` the file is only looked at: the answer tells what would be understood of it and how much work it
    /// would be, and nothing is kept or queued.
    #[param(value_type = Option<bool>, example = true)]
    dry_run: Option<String>,
}

/// What would become of a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub(super) struct DryRun {
    /// Size of the file.
    size_bytes: u64,
    understood: clip::ClipInfo,
    estimate: Estimate,
    /// Whether the home has a LiDAR map; without one the clip would wait for it.
    has_lidar_map: bool,
}

/// What an upload is answered with.
pub(super) enum Answer {
    Added(Box<Clip>),
    Looked(Box<DryRun>),
}

impl IntoResponse for Answer {
    fn into_response(self) -> Response {
        match self {
            Answer::Added(clip) => {
                let location = format!("/v1/homes/{}/clips/{}", clip.home, clip.id);
                (StatusCode::CREATED, [(header::LOCATION, location)], Json(clip)).into_response()
            }
            Answer::Looked(report) => Json(report).into_response(),
        }
    }
}

/// Upload a clip
///
/// The body is the file; its layout is found by its content. What can be told at once is refused at once;
/// everything else ends in the clip's state and reasons. When the answer arrives, the clip is durable and its
/// job is queued, or waits for the home's first LiDAR map.
///
/// With an `Idempotency-Key`, sending the same file again gives the same clip again.
#[utoipa::path(post, path = "/v1/homes/{home}/clips", tag = "clips",
    params(HomePath, AddQuery,
        ("Idempotency-Key" = Option<String>, Header, pattern = "^[!-~]{1,255}$", description = "1 to 255 visible ASCII characters, unique to this file in this home")),
    request_body(content = FileBytes, content_type = "application/octet-stream",
        description = "An RGB-D recording: a zip, tar, tar.gz or tar.zst of its folder, or its one file (.r3d, .sens)"),
    responses(
        (status = 200, description = "With `dry_run`: what would become of the file", body = DryRun),
        (status = 201, description = "The clip and its job", body = Clip,
            headers(("Location" = String, description = "The clip's path"))),
        CommonProblems, FileProblems))]
pub(super) async fn add_clip(
    State(app): State<App>,
    caller: Caller,
    HomePath { home }: HomePath,
    Query(query): Query<AddQuery>,
    IdempotencyKey(idempotency_key): IdempotencyKey,
    request: Request,
) -> Result<Answer, Error> {
    let has_lidar_map = app.storage.home(&home).await?.lidar_map_revision.is_some();
    let dry_run = flag("dry_run", query.dry_run.as_deref())?;
    let told = query.recorded_at.map(|text| recorded_at(&text)).transpose()?;
    let told_bytes = content_length(request.headers()).unwrap_or(0);
    app.limits.room(&app.storage, &caller.tenant, told_bytes).await?;
    let file = receive(&app.storage, request, app.max_upload_bytes).await?;
    let size_bytes = file.size_bytes;
    app.limits.room(&app.storage, &caller.tenant, size_bytes).await?;
    let (file, info, estimate) = understand(&app, move || open(file)).await?;
    if dry_run {
        let report = DryRun { size_bytes, understood: info, estimate, has_lidar_map };
        return Ok(Answer::Looked(Box::new(report)));
    }
    let new = new_clip(file, info, told, idempotency_key);
    let clip = to_the_end(async move {
        let added = app.storage.add_clip(&home, new, Timestamp::now()).await?;
        app.queue.wake();
        app.limits.came(&caller.tenant, size_bytes);
        match added {
            Added::New(clip) | Added::Replayed(clip) => Ok(clip),
            Added::KeyReused => Err(Error::KeyReused),
        }
    })
    .await?;
    Ok(Answer::Added(Box::new(clip)))
}

/// `true` or `false`; not given is false.
fn flag(field: &'static str, text: Option<&str>) -> Result<bool, Error> {
    match text {
        None | Some("false") => Ok(false),
        Some("true") => Ok(true),
        Some(_) => {
            Err(Error::InvalidQuery { field: Some(field), detail: format!("{field} is true or false") })
        }
    }
}

/// A file that was opened and found good.
pub(super) fn new_clip(
    file: Arrived,
    info: clip::ClipInfo,
    told_recorded_at: Option<Timestamp>,
    idempotency_key: Option<String>,
) -> NewClip {
    let in_file = info.recorded_at_ms.and_then(|ms| Timestamp::from_millisecond(ms).ok());
    // A file whose clock is far ahead says nothing.
    let recorded_at = told_recorded_at.or(in_file.filter(|time| *time <= latest()));
    NewClip { file, info, idempotency_key, recorded_at }
}

fn latest() -> Timestamp {
    Timestamp::now() + AHEAD
}

/// When a clip was recorded, as its sender says.
pub(super) fn recorded_at(text: &str) -> Result<Timestamp, Error> {
    let time = timestamp("recorded_at", text)?;
    if (EARLIEST..=latest()).contains(&time) {
        return Ok(time);
    }
    let detail = "recorded_at is between the year 2000 and a day from now".to_owned();
    Err(Error::InvalidQuery { field: Some("recorded_at"), detail })
}

/// Opens a file that has arrived, and refuses it when it is no clip.
pub(super) fn open(file: Arrived) -> Result<(Arrived, clip::ClipInfo, Estimate), Error> {
    let clip = clip::Clip::open(file.path())?;
    let estimate = estimate(&clip);
    Ok((file, clip.info().clone(), estimate))
}

/// Which clips a list has.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct StateQuery {
    /// Only clips in one of these states, with commas between them. To be given with every page.
    #[param(value_type = Option<Vec<ClipState>>, style = Form, explode = false, min_items = 1, example = json!(["ambiguous", "failed"]))]
    state: Option<String>,
}

/// The clips of a home, the oldest first
#[utoipa::path(get, path = "/v1/homes/{home}/clips", tag = "clips",
    params(HomePath, ListQuery, UpdatedQuery, StateQuery),
    responses((status = 200, description = "One page", body = List<Clip>), CommonProblems))]
pub(super) async fn list_clips(
    State(app): State<App>,
    HomePath { home }: HomePath,
    Query(query): Query<ListQuery>,
    Query(updated): Query<UpdatedQuery>,
    Query(state): Query<StateQuery>,
) -> Result<Json<List<Clip>>, Error> {
    let states = states(state.state.as_deref(), &ClipState::ALL, ClipState::name)?;
    let filter = ClipFilter { states, updated_after: updated.updated_after()? };
    let clips = app.storage.clips(&home, &filter, &query.page()?).await?;
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
        app.storage.delete_clip(&home, clip, Timestamp::now()).await?;
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
