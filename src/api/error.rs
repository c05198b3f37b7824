//! Refusals and failures of requests as RFC 9457 problem documents with stable types. The cause of a failure
//! of the service goes to the log, never into an answer.

mod codes;
mod correction;
mod defence;
mod storage;

pub(super) use codes::CODES;
pub(super) use defence::Defence;

use super::uploads::UploadRefusal;
use axum::Json;
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};
use std::any::Any;
use std::borrow::Cow;
use viola_formats::clip::ClipError;
use viola_formats::lidar::LidarError;
use viola_geometry::LevelName;
use viola_storage::{CorrectionError, MAX_WEBHOOKS, StorageError};

/// `Retry-After` for an export that is refused because too many run.
const EXPORT_RETRY_AFTER_S: u64 = 5;

/// An RFC 9457 problem document.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub(super) struct Problem {
    /// Stable, for programs.
    #[serde(rename = "type")]
    #[schema(example = "urn:viola:problem:home-not-found")]
    pub kind: String,
    /// The same for every problem of this type.
    #[schema(example = "There is no such home")]
    pub title: String,
    /// The HTTP status.
    #[schema(example = 404)]
    pub status: u16,
    /// Explanation of this occurrence and what to do, for people.
    pub detail: String,
    /// The parameter, header or member at fault, if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub field: Option<String>,
}

/// The reason for which a request is not served.
#[derive(Debug, thiserror::Error)]
pub(super) enum Error {
    #[error("{detail}")]
    InvalidPath { field: Option<&'static str>, detail: String },
    #[error("{detail}")]
    InvalidQuery { field: Option<Cow<'static, str>>, detail: String },
    #[error("{detail}")]
    InvalidHeader { field: &'static str, detail: String },
    #[error("{detail}")]
    MalformedJson { field: Option<String>, detail: String },
    #[error("{detail}")]
    InvalidBody { field: Option<Cow<'static, str>>, detail: String },
    #[error("{0}")]
    UnsupportedMediaType(String),
    #[error("the body is larger than the limit of {limit} bytes")]
    BodyTooLarge { limit: u64 },
    #[error(
        "the upload has {offset} of its {length} bytes, and the body has more than the rest; send the rest alone, or begin \
         another upload with the length of the file"
    )]
    BodyBeyondUpload { offset: u64, length: u64 },
    #[error("the body is too slow: {0}")]
    BodyStalled(String),
    #[error("the body ended before it was whole: {0}")]
    BodyIncomplete(String),
    #[error("the body is empty; send the file itself as the body")]
    BodyEmpty,
    #[error("{0}")]
    Clip(#[from] ClipError),
    #[error("{0}")]
    Lidar(#[from] LidarError),
    #[error(
        "this Idempotency-Key came with another recording before, or with an archive of this one that failed; send a new key"
    )]
    KeyReused,
    #[error("the home has no LiDAR map to align to; put one first")]
    NothingToAlignTo,
    #[error("{0}")]
    NoAnswerYet(String),
    #[error("the job has ended with `{0}` and cannot be cancelled")]
    JobEnded(&'static str),
    #[error("the tenant has {MAX_WEBHOOKS} webhooks already; remove one first")]
    TooManyWebhooks,
    #[error("no job has this id; a job is removed with its clip")]
    NoSuchJob,
    #[error("{0}")]
    Correction(CorrectionError),
    #[error(
        "revision {revision} of the home's map was removed; GET .../map/revisions lists those that are kept"
    )]
    MapRevisionRemoved { revision: i64 },
    #[error(
        "this service asks for a key: send it as `Authorization: Bearer viola_...`, or sign in on the page"
    )]
    KeyMissing,
    #[error("the key is not one of this service's, has expired, or was revoked; ask for a new one")]
    KeyInvalid,
    #[error("the header `Authorization` has no key; send `Authorization: Bearer viola_...`")]
    NoKey,
    #[error("{0}")]
    Forbidden(String),
    #[error("too many requests for this tenant; wait {retry_after_s} s")]
    TooManyRequests { retry_after_s: u64 },
    #[error("at most {most} exports run at once, {most_of_tenant} of one tenant; retry later")]
    TooManyExports { most: usize, most_of_tenant: usize },
    #[error(
        "the clip is `{0}`: it has this file once a job ran to an answer; completion.png only if something was filled in, frames.jpg only if the clip is not `aligned`"
    )]
    NoSuchResult(&'static str),
    #[error(
        "no frame of the clip has a colour picture that can be decoded, or an earlier version of the service aligned it; then align it again"
    )]
    NoThumbnail,
    #[error(
        "the home has no map of this revision: the first revision follows the first clip with an answer, and GET .../map/revisions lists those that are kept"
    )]
    NoSuchMap,
    #[error("the {what} exists already; the request has `If-None-Match: *`")]
    Exists { what: &'static str },
    #[error("the LiDAR map has no revision {0}: the list of its revisions names those that are kept")]
    NoSuchLidarRevision(i64),
    #[error("the home has no LiDAR map of the level `{level}`; it has those of {levels}")]
    NoSuchLevel { level: LevelName, levels: String },
    #[error("nothing is served under this path; GET /openapi.json lists what is")]
    NoSuchRoute,
    #[error("this path does not serve this method; the Allow header lists those it does")]
    MethodNotAllowed,
    #[error("the {what} is unavailable: {}", .cause.as_ref().map_or("it is full".to_owned(), ToString::to_string))]
    NotReady { what: &'static str, cause: Option<StorageError> },
    #[error("the answer has {length} bytes, and the range begins behind them")]
    NoSuchRange { length: u64 },
    #[error(
        "the body is encoded (Content-Encoding: {0}); the service decodes none, so send it as it is, without this header"
    )]
    Encoded(String),
    #[error(
        "the body does not have the SHA-256 of {field}: it was damaged on its way and not kept; send it again"
    )]
    OtherDigest { field: &'static str },
    #[error("{0}")]
    Defence(#[from] Defence),
    #[error("{0}")]
    Upload(#[from] UploadRefusal),
    #[error("{0}")]
    Storage(#[from] StorageError),
    /// The stored refusal of the same file, from an earlier attempt to open it.
    #[error("{}", .0.detail)]
    Told(Problem),
    #[error("a file could not be opened in a process of its own: {0}")]
    Opener(String),
    #[error("a handler panicked: {0}")]
    Panicked(String),
}

impl Error {
    /// Returns the status, the code and the title.
    fn mapping(&self) -> (StatusCode, &'static str, &'static str) {
        use StatusCode as S;
        match self {
            Error::InvalidPath { .. } => (S::BAD_REQUEST, "invalid_path", "A part of the path is not valid"),
            Error::InvalidQuery { .. } => (S::BAD_REQUEST, "invalid_query", "A query parameter is not valid"),
            Error::InvalidHeader { .. } => (S::BAD_REQUEST, "invalid_header", "A header is not valid"),
            Error::MalformedJson { .. } => (S::BAD_REQUEST, "malformed_json", "The body is not JSON"),
            Error::InvalidBody { .. } => {
                (S::UNPROCESSABLE_ENTITY, "invalid_body", "The body does not have the expected members")
            }
            Error::UnsupportedMediaType(_) | Error::Encoded(_) => {
                (S::UNSUPPORTED_MEDIA_TYPE, "unsupported_media_type", "This kind of body is not understood")
            }
            Error::BodyTooLarge { .. } | Error::BodyBeyondUpload { .. } => {
                (S::PAYLOAD_TOO_LARGE, "body_too_large", "The body is too large")
            }
            Error::BodyStalled(_) => (S::REQUEST_TIMEOUT, "body_stalled", "The body did not arrive in time"),
            Error::BodyIncomplete(_) => (S::BAD_REQUEST, "body_incomplete", "The body is not whole"),
            Error::BodyEmpty => (S::UNPROCESSABLE_ENTITY, "body_empty", "The body is empty"),
            Error::Told(problem) => {
                let status = StatusCode::from_u16(problem.status).unwrap_or(S::UNPROCESSABLE_ENTITY);
                (status, "told", "As it was told before")
            }
            // Before the arms of the same errors: a retry of this request may succeed.
            error if error.is_passing() => {
                (S::SERVICE_UNAVAILABLE, "unavailable", "The service cannot do this at this moment")
            }
            Error::Clip(error) => (refusal(error.code()), error.code(), "The clip cannot be used"),
            Error::Lidar(error) => (refusal(error.code()), error.code(), "The LiDAR map cannot be used"),
            Error::KeyReused => (
                S::UNPROCESSABLE_ENTITY,
                "idempotency_key_reused",
                "The Idempotency-Key was used for another file",
            ),
            Error::NothingToAlignTo => (S::CONFLICT, "no_lidar_map", "The home has no LiDAR map"),
            Error::NoAnswerYet(_) => (S::CONFLICT, "no_answer_yet", "The clip has no answer yet"),
            Error::JobEnded(_) => (S::CONFLICT, "job_ended", "The job has ended already"),
            Error::KeyMissing => (S::UNAUTHORIZED, "key_missing", "A key is needed"),
            Error::KeyInvalid | Error::NoKey => (S::UNAUTHORIZED, "key_invalid", "The key is not valid"),
            Error::Forbidden(_) => (S::FORBIDDEN, "forbidden", "The key does not allow this"),
            Error::TooManyRequests { .. } => (S::TOO_MANY_REQUESTS, "too_many_requests", "Too many requests"),
            Error::TooManyExports { .. } => {
                (S::SERVICE_UNAVAILABLE, "too_many_exports", "Too many exports run at once")
            }
            Error::TooManyWebhooks => {
                (S::CONFLICT, "too_many_webhooks", "The tenant has as many webhooks as it may have")
            }
            Error::NoSuchJob => (S::NOT_FOUND, "job_not_found", "There is no such job"),
            Error::Correction(error) => correction::mapping(error),
            Error::MapRevisionRemoved { .. } => {
                (S::GONE, "map_revision_removed", "The revision is not kept any more")
            }
            Error::NoSuchResult(_) => (S::NOT_FOUND, "result_not_found", "The clip has no such file now"),
            Error::NoThumbnail => (S::NOT_FOUND, "no_thumbnail", "The clip has no thumbnail"),
            Error::NoSuchMap => (S::NOT_FOUND, "map_not_found", "The home has no such map"),
            Error::NoSuchLidarRevision(_) | Error::NoSuchLevel { .. } => {
                (S::NOT_FOUND, "lidar_map_not_found", "There is no such LiDAR map")
            }
            Error::NoSuchRoute => (S::NOT_FOUND, "route_not_found", "There is nothing under this path"),
            Error::MethodNotAllowed => {
                (S::METHOD_NOT_ALLOWED, "method_not_allowed", "The path does not serve this method")
            }
            Error::NoSuchRange { .. } => {
                (S::RANGE_NOT_SATISFIABLE, "range_not_satisfiable", "The answer has no such bytes")
            }
            Error::OtherDigest { .. } => {
                (S::BAD_REQUEST, "digest_mismatch", "The body was damaged on its way")
            }
            Error::Defence(refusal) => refusal.mapping(),
            Error::Upload(refusal) => refusal.mapping(),
            Error::NotReady { .. } => (S::SERVICE_UNAVAILABLE, "not_ready", "The service is not ready"),
            Error::Exists { .. } => {
                (S::PRECONDITION_FAILED, "changed_meanwhile", "It was changed since it was read")
            }
            Error::Storage(error) => storage::mapping(error),
            Error::Opener(_) | Error::Panicked(_) => {
                (S::INTERNAL_SERVER_ERROR, "internal_error", "The service failed")
            }
        }
    }

    fn field(&self) -> Option<&str> {
        match self {
            Error::NotReady { what, .. } => Some(what),
            Error::InvalidQuery { field, .. } | Error::InvalidBody { field, .. } => field.as_deref(),
            Error::MalformedJson { field, .. } => field.as_deref(),
            Error::InvalidPath { field, .. } => *field,
            Error::InvalidHeader { field, .. } | Error::OtherDigest { field } => Some(field),
            Error::Encoded(_) => Some("Content-Encoding"),
            Error::UnsupportedMediaType(_) => Some("Content-Type"),
            Error::KeyReused => Some("Idempotency-Key"),
            Error::BodyBeyondUpload { .. } => Some("Upload-Length"),
            Error::Exists { .. } => Some("If-None-Match"),
            Error::NoSuchRange { .. } => Some("Range"),
            Error::Correction(CorrectionError::Impossible { field, .. }) => Some(field),
            Error::Correction(CorrectionError::Changed { .. })
            | Error::Storage(StorageError::Changed { .. }) => Some("If-Match"),
            Error::Defence(refusal) => refusal.field(),
            Error::Upload(refusal) => refusal.field(),
            _ => None,
        }
    }
}

/// Returns 415 for a file of an unknown kind, 413 for one that unpacks to too much, and 422 for other refusals.
fn refusal(code: &str) -> StatusCode {
    if code.starts_with("unknown_") || code == "not_an_archive" {
        StatusCode::UNSUPPORTED_MEDIA_TYPE
    } else if code == "unpacks_too_large" {
        StatusCode::PAYLOAD_TOO_LARGE
    } else {
        StatusCode::UNPROCESSABLE_ENTITY
    }
}

impl Error {
    /// Returns whether the request or its file is at fault, and not the service.
    pub fn is_refusal(&self) -> bool {
        self.mapping().0.is_client_error()
    }

    /// Returns whether a retry of the same request may succeed.
    fn is_passing(&self) -> bool {
        match self {
            Error::Clip(error) => error.is_service_fault(),
            Error::Lidar(error) => error.is_service_fault(),
            Error::Storage(error) => error.is_transient() && !error.is_full(),
            _ => false,
        }
    }

    /// Returns the problem document, and logs the cause of a failure of the service.
    pub fn problem(&self) -> Problem {
        if let Error::Told(problem) = self {
            return problem.clone();
        }
        let (status, code, title) = self.mapping();
        let is_bound = match self {
            Error::Storage(StorageError::TenantFull { .. })
            | Error::TooManyExports { .. }
            | Error::Defence(_) => true,
            Error::Upload(refusal) => refusal.retry_after().is_some(),
            _ => false,
        };
        let is_service_fault = status.is_server_error() && !is_bound;
        let detail = if is_service_fault {
            tracing::error!(code, cause = %self, "a request failed");
            let advice = match code {
                "unavailable" => "Try again in a few seconds. ",
                "storage_full" => "Try again when the service has room; acknowledged bytes are kept. ",
                _ => "",
            };
            format!("{advice}The cause is in the service's log, under this answer's x-request-id.")
        } else {
            self.to_string()
        };
        Problem {
            kind: format!("urn:viola:problem:{}", code.replace('_', "-")),
            title: title.to_owned(),
            status: status.as_u16(),
            detail,
            field: self.field().map(str::to_owned),
        }
    }
}

impl From<CorrectionError> for Error {
    fn from(error: CorrectionError) -> Error {
        match error {
            CorrectionError::Storage(error) => error.into(),
            error => Error::Correction(error),
        }
    }
}

impl IntoResponse for Error {
    fn into_response(self) -> Response {
        let (status, ..) = self.mapping();
        let problem = self.problem();
        let media_type = HeaderValue::from_static("application/problem+json");
        let mut response = (status, [(header::CONTENT_TYPE, media_type)], Json(problem)).into_response();
        match self {
            Error::KeyMissing | Error::KeyInvalid | Error::NoKey | Error::Defence(Defence::SessionEnded) => {
                let scheme = HeaderValue::from_static("Bearer realm=\"viola\"");
                response.headers_mut().insert(header::WWW_AUTHENTICATE, scheme);
            }
            Error::TooManyRequests { retry_after_s } => {
                response.headers_mut().insert(header::RETRY_AFTER, HeaderValue::from(retry_after_s));
            }
            Error::TooManyExports { .. } => {
                response.headers_mut().insert(header::RETRY_AFTER, HeaderValue::from(EXPORT_RETRY_AFTER_S));
            }
            Error::Encoded(_) => {
                // RFC 9110, section 12.5.3.
                response.headers_mut().insert(header::ACCEPT_ENCODING, HeaderValue::from_static("identity"));
            }
            Error::Defence(refusal) => {
                if let Some(wait) = refusal.retry_after() {
                    response.headers_mut().insert(header::RETRY_AFTER, HeaderValue::from(wait.as_secs() + 1));
                }
            }
            Error::Upload(refusal) => {
                if let Some(wait) = refusal.retry_after() {
                    response.headers_mut().insert(header::RETRY_AFTER, HeaderValue::from(wait.as_secs()));
                }
            }
            error if error.is_passing() => {
                response.headers_mut().insert(header::RETRY_AFTER, HeaderValue::from(2));
            }
            _ => {}
        }
        response
    }
}

pub(super) async fn no_such_route() -> Error {
    Error::NoSuchRoute
}

pub(super) async fn method_not_allowed() -> Error {
    Error::MethodNotAllowed
}

pub(super) fn panicked(panic: Box<dyn Any + Send>) -> Response {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
    Error::Panicked(text.unwrap_or_default()).into_response()
}

#[cfg(test)]
mod tests;
