//! `/v1/homes/{home}/clips`

use super::App;
use super::access::Caller;
use super::bodies::{FileBytes, content_length, receive, refuse_json, to_the_end};
use super::content;
use super::error::Error;
use super::extract::{
    ClipPath, HomePath, IdempotencyKey, Json, Member, Query, invalid_query, member, rfc3339, timestamp, wrong,
};
use super::names;
use super::problems::{ChangedClip, CommonProblems, FileProblems, JsonProblems};
use super::reply::{Document, Resource, is_expected};
use super::types::{Clip, ClipInfo, Estimate};
use axum::extract::{Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use jiff::{SignedDuration, Timestamp};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use uuid::Uuid;
use viola_formats::clip;
use viola_formats::video::Tools;
use viola_reconstruct::estimate;
use viola_storage::{Added, Arrived, ClipEdit, HomeId, NewClip, StorageError};

/// Earliest time of recording: no phone recorded depth before the year 2000.
const EARLIEST: Timestamp = Timestamp::constant(946_684_800, 0);
/// Maximum time by which a phone's clock may be ahead of ours.
const AHEAD: SignedDuration = SignedDuration::from_hours(24);

/// The query of an upload.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct AddQuery {
    /// Time of recording. Default: the time in the file, if its layout has times of day. If the home changed
    /// between two clips, the later clip counts.
    #[param(value_type = Option<Timestamp>, example = "2026-03-14T15:09:26Z")]
    recorded_at: Option<String>,
    /// With `unknown`, poses and depth have a common but unknown unit, as reconstructions from plain video have; the
    /// alignment finds the scale. Default: metres, unless the file says otherwise.
    #[param(value_type = Option<String>, pattern = "^unknown$", example = "unknown")]
    scale: Option<String>,
    /// With `true`, the file is only checked: the answer has a summary of the file and an estimate of the
    /// work, and nothing is kept or queued.
    #[param(value_type = Option<bool>, example = true)]
    dry_run: Option<String>,
    /// Name of the file; the download of the recording has it.
    #[param(
        min_length = 1,
        max_length = 255,
        pattern = "^[^\\x00-\\x1f\\x7f-\\x9f]*[^\\s\\x00-\\x1f\\x7f-\\x9f][^\\x00-\\x1f\\x7f-\\x9f]*$",
        example = "kitchen.zip"
    )]
    filename: Option<String>,
    /// Name of the clip, for people.
    #[param(
        min_length = 1,
        max_length = 200,
        pattern = "^[^\\x00-\\x1f\\x7f-\\x9f]*[^\\s\\x00-\\x1f\\x7f-\\x9f][^\\x00-\\x1f\\x7f-\\x9f]*$",
        example = "Kitchen, evening"
    )]
    title: Option<String>,
}

/// The result of a dry run.
#[derive(Debug, Clone, PartialEq, Serialize, utoipa::ToSchema)]
pub(super) struct DryRun {
    /// Size of the file.
    size_bytes: u64,
    understood: ClipInfo,
    estimate: Estimate,
    /// True if the home has a LiDAR map; without one, the clip would wait for it.
    has_lidar_map: bool,
}

/// The answer to an upload.
pub(super) enum Answer {
    Added(Box<Clip>),
    Looked(Box<DryRun>),
}

impl IntoResponse for Answer {
    fn into_response(self) -> Response {
        match self {
            Answer::Added(clip) => {
                let location = format!("/v1/homes/{}/clips/{}", clip.home.as_str(), clip.id);
                (StatusCode::CREATED, [(header::LOCATION, location)], Resource(clip)).into_response()
            }
            Answer::Looked(report) => Document(report).into_response(),
        }
    }
}

/// Upload a clip
///
/// The body is the file; its layout is detected from its content. A file that cannot be read is refused
/// immediately; the outcome of everything else is in the clip's state and reasons. When the answer arrives,
/// the clip is durable and its job is queued, or waits for the home's first LiDAR map.
///
/// With an `Idempotency-Key`, sending the same file again returns the same clip. Without one it makes another clip,
/// whose `duplicate_of` names the first. A key belongs to the home, and lasts as long as its clip. The answer may take three
/// minutes after the last byte. With `Content-Digest` or `Repr-Digest` (RFC 9530), a file without that SHA-256 is refused.
#[utoipa::path(post, path = "/v1/homes/{home}/clips", tag = "clips",
    params(HomePath, AddQuery,
        ("Idempotency-Key" = Option<String>, Header, pattern = "^[!-~]{1,255}$", description = "1 to 255 visible ASCII characters, unique to this file in this home"),
        ("Content-Digest" = Option<String>, Header, pattern = "^sha-256=:[A-Za-z0-9+/]{43}=:$", description = "SHA-256 of the body"),
        ("Repr-Digest" = Option<String>, Header, pattern = "^sha-256=:[A-Za-z0-9+/]{43}=:$", description = "SHA-256 of the body")),
    request_body(content = FileBytes, content_type = "application/octet-stream",
        description = "An RGB-D recording: a zip, tar, tar.gz or tar.zst of its folder, or its one file (.r3d, .sens, .db, .mcap, .db3)"),
    responses(
        (status = 200, description = "With `dry_run`: summary of the file and estimate of the work", body = DryRun),
        (status = 201, description = "The clip and its job", body = Clip,
            headers(("Location" = String, description = "The clip's path"),
                ("ETag" = String, description = "For `If-Match` of the next change"))),
        CommonProblems, FileProblems))]
pub(super) async fn add_clip(
    State(app): State<App>,
    caller: Caller,
    HomePath { home }: HomePath,
    Query(query): Query<AddQuery>,
    IdempotencyKey(idempotency_key): IdempotencyKey,
    request: Request,
) -> Result<Answer, Error> {
    refuse_json(request.headers())?;
    let has_lidar_map = app.storage.home(&home).await?.lidar_map_revision.is_some();
    let dry_run = flag("dry_run", query.dry_run.as_deref())?;
    let told = query.recorded_at.map(|text| recorded_at_of_query(&text)).transpose()?;
    let unknown_scale = is_scale_unknown(query.scale.as_deref())?;
    let (title, file_name) = (names::title(query.title)?, names::file_name(query.filename)?);
    // A dry run stores nothing, and neither does a retry.
    let is_retry = match &idempotency_key {
        Some(key) => app.storage.bytes_of_key(&home, key).await?.is_some(),
        None => false,
    };
    if !dry_run && !is_retry {
        let told_bytes = content_length(request.headers()).unwrap_or(0);
        app.limits.check_quota(&app.storage, &caller.tenant, told_bytes).await?;
    }
    let (file, _arrival) = receive(&app, caller.tenant.name(), request, app.max_upload_bytes).await?;
    let size_bytes = file.size_bytes;
    let opened = open(&app, caller.tenant.name(), file, unknown_scale).await?;
    let OpenedClip { file, info, content_sha256, estimate } = opened;
    if dry_run {
        let report = DryRun { size_bytes, understood: info.into(), estimate: estimate.into(), has_lidar_map };
        return Ok(Answer::Looked(Box::new(report)));
    }
    let recorded_at = told.or_else(|| recorded_at_of_file(&info));
    let new = NewClip { file, info, content_sha256, idempotency_key, recorded_at, title, file_name };
    let clip = to_the_end(async move {
        let added = app.storage.add_clip(&home, new, app.limits.storage_bytes, app.storage.now()).await?;
        app.queue.wake();
        match added {
            Added::New(clip) | Added::Replayed(clip) => Ok(clip),
            Added::KeyReused => Err(Error::KeyReused),
        }
    })
    .await?;
    Ok(Answer::Added(Box::new(clip.into())))
}

/// Parses `true` or `false`; the default is false.
pub(super) fn flag(field: &'static str, text: Option<&str>) -> Result<bool, Error> {
    match text {
        None | Some("false") => Ok(false),
        Some("true") => Ok(true),
        Some(_) => Err(invalid_query(field, format!("{field} is true or false"))),
    }
}

/// Returns the time of recording that a clip's file has. A time too far ahead is ignored: the clock was wrong.
pub fn recorded_at_of_file(info: &clip::ClipInfo) -> Option<Timestamp> {
    let in_file = info.recorded_at_ms.and_then(|ms| Timestamp::from_millisecond(ms).ok());
    in_file.filter(|time| *time <= latest())
}

fn latest() -> Timestamp {
    Timestamp::now() + AHEAD
}

/// Parses the time of recording in a query.
fn recorded_at_of_query(text: &str) -> Result<Timestamp, Error> {
    possible(timestamp("recorded_at", text)?).map_err(|detail| invalid_query("recorded_at", detail))
}

/// Parses the time of recording that the sender gives; an error is its explanation.
pub(super) fn recorded_at(text: &str) -> Result<Timestamp, String> {
    possible(rfc3339("recorded_at", text)?)
}

fn possible(time: Timestamp) -> Result<Timestamp, String> {
    if is_possible(time) {
        return Ok(time);
    }
    Err("recorded_at is between the year 2000 and a day from now".to_owned())
}

fn is_possible(time: Timestamp) -> bool {
    (EARLIEST..=latest()).contains(&time)
}

/// Parses the scale that the sender gives; returns whether it is unknown.
pub(super) fn is_scale_unknown(text: Option<&str>) -> Result<bool, Error> {
    match text {
        None => Ok(false),
        Some("unknown") => Ok(true),
        Some(other) => {
            Err(invalid_query("scale", format!("scale is `unknown` or absent, and not `{other}`")))
        }
    }
}

/// A received file that is a clip.
pub(super) struct OpenedClip {
    pub file: Arrived,
    pub info: clip::ClipInfo,
    pub content_sha256: Option<String>,
    pub estimate: viola_reconstruct::Estimate,
}

/// Opens a received file; refuses it if it is not a clip.
pub(super) async fn open(
    app: &App,
    tenant: &str,
    file: Arrived,
    unknown_scale: bool,
) -> Result<OpenedClip, Error> {
    let scratch = app.storage.scratch(tenant);
    let read = move || {
        let clip = clip::Clip::open_in(file.path(), &Tools::default(), &scratch)?;
        let clip = if unknown_scale { clip.with_unknown_scale() } else { clip };
        let (content_sha256, estimate) = (content::of_clip(&clip)?, estimate(&clip));
        Ok(OpenedClip { file, info: clip.info().clone(), content_sha256, estimate })
    };
    app.readers.run(tenant, read).await?
}

/// Get a clip: its state, the summary of its file, its alignment and its newest job
#[utoipa::path(get, path = "/v1/homes/{home}/clips/{clip}", tag = "clips",
    params(ClipPath),
    responses((status = 200, description = "The clip", body = Clip), CommonProblems))]
pub(super) async fn get_clip(
    State(app): State<App>,
    ClipPath { home, clip }: ClipPath,
) -> Result<Document<Clip>, Error> {
    Ok(Document(app.storage.clip(&home, clip).await?.into()))
}

/// A correction of a clip, as a JSON Merge Patch: absent members stay, null withdraws.
#[derive(Debug, Default, Deserialize, utoipa::ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({"title": "Kitchen, evening"}))]
pub(super) struct ClipPatch {
    /// Name of the clip, for people.
    #[serde(default, deserialize_with = "member")]
    #[schema(value_type = Option<String>, min_length = 1, max_length = 200, pattern = "^[^\\x00-\\x1f\\x7f-\\x9f]*[^\\s\\x00-\\x1f\\x7f-\\x9f][^\\x00-\\x1f\\x7f-\\x9f]*$")]
    title: Member,
    /// Time of recording, from the year 2000 to a day from now; null takes the time in the file again, if it has one. If the
    /// home changed between two clips, the later clip counts, so a new time makes a new revision of the home's map.
    #[serde(default, deserialize_with = "member")]
    #[schema(value_type = Option<Timestamp>, example = "2026-03-14T15:09:26Z")]
    recorded_at: Member,
}

/// Correct a clip: its title and its time of recording
#[utoipa::path(patch, path = "/v1/homes/{home}/clips/{clip}", tag = "clips",
    params(ClipPath, ("If-Match" = Option<String>, Header, description = "The `ETag` of the clip as it was read")),
    request_body(content((ClipPatch = "application/merge-patch+json"), (ClipPatch = "application/json"))),
    responses((status = 200, description = "The corrected clip", body = Clip,
            headers(("ETag" = String, description = "For `If-Match` of the next change"))),
        (status = 412, description = "It was changed since it was read: `changed-meanwhile`"),
        CommonProblems, JsonProblems))]
pub(super) async fn patch_clip(
    State(app): State<App>,
    ClipPath { home, clip: id }: ClipPath,
    headers: HeaderMap,
    Json(patch): Json<ClipPatch>,
) -> Result<Resource<Clip>, Error> {
    let is_expected = is_expected::<Clip, viola_storage::Clip>(headers);
    let clip = match edit(&app, &home, id, &patch).await? {
        edit if edit == ClipEdit::default() => app.storage.clip(&home, id).await?,
        edit => app.storage.edit_clip(&home, id, edit, is_expected, app.storage.now()).await?,
    };
    // A home's map with the clip is due if the clip's time changed.
    app.queue.wake();
    Ok(Resource(clip.into()))
}

/// Returns the correction of a patch.
async fn edit(app: &App, home: &HomeId, id: Uuid, patch: &ClipPatch) -> Result<ClipEdit, Error> {
    let title = |title: &Value| {
        let title = title.as_str().filter(|title| names::is_title(title)).map(str::to_owned);
        title.ok_or_else(|| {
            wrong("title", "a text of 1 to 200 characters on one line, not only spaces, or null")
        })
    };
    let title = patch.title.as_ref().map(|value| value.as_ref().map(title).transpose()).transpose()?;
    let recorded_at = match &patch.recorded_at {
        None => None,
        Some(None) => Some(recorded_at_of_file(&app.storage.clip(home, id).await?.info)),
        Some(Some(time)) => {
            let time = time.as_str().and_then(|text| text.parse::<Timestamp>().ok());
            let time = time.filter(|time| is_possible(*time));
            let what = "a time of RFC 3339 as 2026-03-14T15:09:26Z, between the year 2000 and a day from now, or null";
            Some(Some(time.ok_or_else(|| wrong("recorded_at", what))?))
        }
    };
    Ok(ClipEdit { title, recorded_at })
}

/// Remove a clip with all its data
#[utoipa::path(delete, path = "/v1/homes/{home}/clips/{clip}", tag = "clips",
    params(ClipPath, ("If-Match" = Option<String>, Header, description = "The `ETag` of the clip as it was read")),
    responses(
        (status = 204, description = "The clip is removed"),
        ChangedClip, CommonProblems))]
pub(super) async fn delete_clip(
    State(app): State<App>,
    ClipPath { home, clip }: ClipPath,
    headers: HeaderMap,
) -> Result<StatusCode, Error> {
    to_the_end(async move {
        app.storage
            .delete_clip(&home, clip, is_expected::<Clip, viola_storage::Clip>(headers), app.storage.now())
            .await?;
        app.queue.wake();
        Ok(StatusCode::NO_CONTENT)
    })
    .await
}

/// Align a clip again, to the current LiDAR map
///
/// If a job of the clip is under way, nothing changes.
#[utoipa::path(post, path = "/v1/homes/{home}/clips/{clip}/align", tag = "clips",
    params(ClipPath),
    responses(
        (status = 202, description = "The clip with the job that is under way", body = Clip,
            headers(("Location" = String, description = "The job's path"),
                ("ETag" = String, description = "For `If-Match` of the next change"))),
        (status = 409, description = "The home has no LiDAR map: `no-lidar-map`"),
        CommonProblems))]
pub(super) async fn align_clip(
    State(app): State<App>,
    ClipPath { home, clip }: ClipPath,
) -> Result<(StatusCode, [(header::HeaderName, String); 1], Resource<Clip>), Error> {
    let aligned = to_the_end(async move {
        let aligned = app.storage.align_clip(&home, clip, app.storage.now()).await;
        app.queue.wake();
        aligned
    });
    let clip = aligned.await.map_err(|error| match error {
        StorageError::NoLidarMap => Error::NothingToAlignTo,
        other => other.into(),
    })?;
    let location = clip.job.as_ref().map(|job| format!("/v1/jobs/{}", job.id)).unwrap_or_default();
    Ok((StatusCode::ACCEPTED, [(header::LOCATION, location)], Resource(clip.into())))
}
