//! Answers about an upload: the headers of tus, and a document for people and programs.

use super::metadata::Metadata;
use super::{checksum, headers};
use crate::api::App;
use crate::api::error::{Error, Problem};
use crate::api::reply::Document;
use crate::api::types::{self, HomeId, UploadKind};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use jiff::Timestamp;
use jiff::fmt::rfc2822::DateTimePrinter;
use serde::Serialize;
use uuid::Uuid;
use viola_storage::{StorageError, Upload, UploadError, UploadState};

const OFFSET: HeaderName = HeaderName::from_static("upload-offset");
const LENGTH: HeaderName = HeaderName::from_static("upload-length");
const DEFER_LENGTH: HeaderName = HeaderName::from_static("upload-defer-length");
const METADATA: HeaderName = HeaderName::from_static("upload-metadata");
const CONCAT: HeaderName = HeaderName::from_static("upload-concat");
const EXPIRES: HeaderName = HeaderName::from_static("upload-expires");
const CLIP: HeaderName = HeaderName::from_static("viola-clip");
const JOB: HeaderName = HeaderName::from_static("viola-job");

const EXTENSIONS: &str =
    "creation,creation-with-upload,creation-defer-length,checksum,expiration,termination,concatenation";

/// An upload in parts.
#[derive(Debug, Serialize, utoipa::ToSchema)]
#[schema(as = Upload)]
pub(super) struct UploadDocument {
    #[schema(example = "01a1f766-7a97-7747-9dbb-391e0eeccb64")]
    id: Uuid,
    kind: UploadKind,
    state: types::UploadState,
    /// Null for partial ones.
    home: Option<HomeId>,
    #[schema(example = "kitchen.zip")]
    filename: Option<String>,
    /// Length of the whole file; null while its sender does not know it.
    #[schema(example = 15147863)]
    length_bytes: Option<u64>,
    /// Number of durable bytes, from the start of the file.
    #[schema(example = 8388608)]
    received_bytes: u64,
    /// The path of the clip that was made of it.
    #[schema(example = "/v1/homes/home-42/clips/01a1f766-7a97-7747-9dbb-391e0eeccb64")]
    clip: Option<String>,
    /// The path of the clip's newest job, if there is one.
    #[schema(example = "/v1/jobs/01a1f766-7a97-7747-9dbb-391e0eeccb64")]
    job: Option<String>,
    /// The problem for which the file was refused, if it was.
    #[schema(value_type = Option<Problem>)]
    problem: Option<serde_json::Value>,
    created_at: Timestamp,
    /// Time at which it expires if no byte arrives, or until which its record is kept.
    expires_at: Timestamp,
}

/// The paths of the clip that an upload became and of the clip's job.
#[derive(Debug, Default)]
struct Made {
    clip: Option<String>,
    job: Option<String>,
}

impl Made {
    async fn of(app: &App, upload: &Upload) -> Result<Made, Error> {
        let (Some(home), Some(id)) = (&upload.home, upload.clip) else { return Ok(Made::default()) };
        let clip = match app.storage.clip(home, id).await {
            Ok(clip) => clip,
            // It was removed since the upload was read.
            Err(StorageError::NoSuchClip | StorageError::NoSuchHome) => return Ok(Made::default()),
            Err(error) => return Err(error.into()),
        };
        Ok(Made {
            clip: Some(format!("/v1/homes/{home}/clips/{id}")),
            job: clip.job.map(|job| format!("/v1/jobs/{}", job.id)),
        })
    }
}

fn path(id: Uuid) -> String {
    format!("/v1/uploads/{id}")
}

/// Returns a time in the format of HTTP headers (RFC 9110).
fn http_date(time: Timestamp) -> String {
    DateTimePrinter::new().timestamp_to_rfc9110_string(&time).unwrap_or_default()
}

fn insert_header(headers: &mut HeaderMap, name: HeaderName, value: impl AsRef<str>) {
    // Always valid: our own numbers and paths, and values that arrived as headers.
    if let Ok(value) = HeaderValue::from_str(value.as_ref()) {
        headers.insert(name, value);
    }
}

fn headers_of(upload: &Upload, made: &Made) -> HeaderMap {
    let mut headers = HeaderMap::new();
    insert_header(&mut headers, OFFSET, upload.received_bytes.to_string());
    match upload.length_bytes {
        Some(bytes) => insert_header(&mut headers, LENGTH, bytes.to_string()),
        None => insert_header(&mut headers, DEFER_LENGTH, "1"),
    }
    if !upload.metadata.is_empty() {
        insert_header(&mut headers, METADATA, &upload.metadata);
    }
    if let Some(concat) = &upload.concat {
        insert_header(&mut headers, CONCAT, concat);
    }
    let is_kept = upload.state == UploadState::Finished || upload.is_due();
    if !is_kept {
        insert_header(&mut headers, EXPIRES, http_date(upload.expires_at));
    }
    for (name, path) in [(CLIP, &made.clip), (JOB, &made.job)] {
        if let Some(path) = path {
            insert_header(&mut headers, name, path);
        }
    }
    headers
}

fn document_of(upload: Upload, made: Made) -> UploadDocument {
    let filename = Metadata::parse(&upload.metadata).ok().and_then(|metadata| metadata.filename);
    UploadDocument {
        id: upload.id,
        kind: upload.kind.into(),
        state: upload.state.into(),
        home: upload.home.map(HomeId::from),
        filename,
        length_bytes: upload.length_bytes,
        received_bytes: upload.received_bytes,
        clip: made.clip,
        job: made.job,
        problem: upload.problem,
        created_at: upload.created_at,
        expires_at: upload.expires_at,
    }
}

/// Returns the state of an upload as headers, for a client that resumes it.
pub(super) async fn state(app: &App, id: Uuid) -> Result<HeaderMap, Error> {
    let upload = app.storage.living_upload(id, app.storage.now()).await?;
    let made = Made::of(app, &upload).await?;
    Ok(headers_of(&upload, &made))
}

/// Returns the state of an upload as a document, even if its file was refused.
pub(super) async fn document(app: &App, id: Uuid) -> Result<Document<UploadDocument>, Error> {
    let upload = app.storage.upload(id, app.storage.now()).await?.ok_or(UploadError::NotFound)?;
    let made = Made::of(app, &upload).await?;
    Ok(Document(document_of(upload, made)))
}

/// Returns the answer to the request that created an upload.
pub(super) async fn created(app: &App, id: Uuid) -> Result<Response, Error> {
    let upload = app.storage.living_upload(id, app.storage.now()).await?;
    let made = Made::of(app, &upload).await?;
    let mut headers = headers_of(&upload, &made);
    insert_header(&mut headers, header::LOCATION, path(id));
    Ok((StatusCode::CREATED, headers, Document(document_of(upload, made))).into_response())
}

/// Returns the supported version, extensions and limits of tus as headers.
pub(super) fn abilities(max_bytes: u64) -> HeaderMap {
    let mut abilities = HeaderMap::new();
    abilities.insert(headers::VERSION, headers::SERVED);
    insert_header(&mut abilities, HeaderName::from_static("tus-extension"), EXTENSIONS);
    insert_header(&mut abilities, HeaderName::from_static("tus-max-size"), max_bytes.to_string());
    insert_header(&mut abilities, HeaderName::from_static("tus-checksum-algorithm"), checksum::ALGORITHMS);
    abilities
}
