//! `/v1/uploads`: clips that arrive in parts, by the resumable upload protocol tus 1.0
//! (<https://tus.io/protocols/resumable-upload>), which apps speak through ready-made clients.
//!
//! The state of an upload is only in storage, so every request of an upload may reach another process.

mod answer;
mod begin;
mod checksum;
mod clean;
mod finish;
mod headers;
mod metadata;
mod opener;
mod receive;
mod refusal;

pub(super) use clean::clean;
pub use opener::opened_clip_json;
pub(super) use refusal::UploadRefusal;

use super::App;
use super::access::Caller;
use super::bodies::{FileBytes, content_length, to_the_end};
use super::error::Error;
use super::extract::UploadPath;
use super::problems::{CommonProblems, UploadProblems};
use super::reply::Document;
use crate::jobs::ChildParams;
use answer::UploadDocument;
use axum::body::Body;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use headers::Length;
use receive::Append;
use std::time::Duration;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;
use uuid::Uuid;
use viola_storage::UploadLimits;

/// Parameters of uploads in parts.
#[derive(Debug, Clone)]
pub struct UploadParams {
    pub limits: UploadLimits,
    /// Number of received bytes after which a running request makes them durable.
    pub piece_bytes: u64,
    /// Age of the first received byte after which a running request makes them durable.
    pub piece_age: Duration,
    /// Lease of a process that makes a clip of an upload; the process must renew it.
    pub lease: Duration,
    /// Interval between searches for abandoned uploads.
    pub clean_every: Duration,
    /// Starts a process that opens one clip file; files are opened in this process only if none.
    pub opener: Option<ChildParams>,
}

impl Default for UploadParams {
    fn default() -> UploadParams {
        UploadParams {
            limits: UploadLimits::default(),
            piece_bytes: 16 << 20,
            piece_age: Duration::from_secs(10),
            lease: Duration::from_secs(30),
            clean_every: Duration::from_secs(30),
            opener: None,
        }
    }
}

pub(super) fn routes() -> OpenApiRouter<App> {
    OpenApiRouter::new()
        .routes(routes!(create_upload, describe_uploads))
        .routes(routes!(
            get_upload,
            head_upload,
            append_to_upload,
            delete_upload,
            override_method,
            describe_upload
        ))
        .layer(axum::middleware::from_fn(speak_tus))
}

/// Adds the version of tus to every answer, also to those of the layers that refuse a request before tus is spoken.
pub(super) async fn name_version(request: Request, next: Next) -> Response {
    let is_tus = request.uri().path().starts_with("/v1/uploads");
    let mut response = next.run(request).await;
    if is_tus {
        response.headers_mut().insert(headers::RESUMABLE, headers::SERVED);
    }
    response
}

/// Refuses requests of another version of tus. OPTIONS is exempt because it asks for the version, GET because it is not
/// part of tus.
async fn speak_tus(request: Request, next: Next) -> Response {
    let asks = [Method::OPTIONS, Method::GET].contains(request.method());
    let version = if asks { Ok(()) } else { headers::check_version(request.headers()) };
    let is_refused = version.is_err();
    let mut response = match version {
        Ok(()) => next.run(request).await,
        Err(error) => error.into_response(),
    };
    let answered = response.headers_mut();
    answered.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    if is_refused {
        answered.insert(headers::VERSION, headers::SERVED);
    }
    response
}

/// Create an upload in parts
///
/// The protocol is tus 1.0, with the extensions that OPTIONS lists. `Upload-Metadata` names the clip's
/// `home`, and optionally its `filename`, its `title`, its time of recording (`recorded_at`, RFC 3339), its
/// `scale` (`unknown` if poses and depth are not in metres), the `sha256` of the file (64 hexadecimal digits) and an
/// `idempotency_key`, with the meaning of the header `Idempotency-Key` of `POST /v1/homes/{home}/clips`. Send one of the two
/// always: a repeated upload then makes no second clip.
///
/// With `sha256`, the same request for the same home returns the upload that it began, whatever has arrived of it: continue at
/// the `Upload-Offset` of the answer. A file with another SHA-256 is refused.
///
/// The body may be empty, or the first bytes of the file. A partial upload (`Upload-Concat: partial`) needs no home; a
/// final one (`Upload-Concat: final;PATH PATH ...`) takes over its parts, which are then gone, and has no body. The
/// same final request again returns the same upload.
///
/// The request with the last byte is answered when the clip is durable and its job queued: `Viola-Clip` and
/// `Viola-Job` are their paths. If `Viola-Clip` is missing then, the bytes are safe: GET the upload until it is `finished`
/// or `refused`. A file that is no clip is refused, as by `POST /v1/homes/{home}/clips`.
#[utoipa::path(post, path = "/v1/uploads", tag = "uploads",
    params(
        ("Tus-Resumable" = String, Header, pattern = r"^[0-9]+\.[0-9]+\.[0-9]+$", example = "1.0.0", description = "`1.0.0`"),
        ("Upload-Length" = Option<u64>, Header, description = "Bytes of the whole file"),
        ("Upload-Defer-Length" = Option<u64>, Header, minimum = 1, maximum = 1, description = "`1`: a later PATCH gives the length"),
        ("Upload-Metadata" = Option<String>, Header, description = "`home` and optionally `filename`, `title`, `recorded_at`, \
            `scale`, `sha256` and `idempotency_key`: pairs of a name and a value in base64, with commas between the pairs; at most 4096 bytes"),
        ("Upload-Concat" = Option<String>, Header, description = "`partial`, or `final;` and the paths of partial uploads"),
        ("Upload-Checksum" = Option<String>, Header, description = "Of the body: `sha1` or `sha256`, and the sum in base64"),
        ("Content-Digest" = Option<String>, Header, pattern = "^sha-256=:[A-Za-z0-9+/]{43}=:$", description = "SHA-256 of the body"),
        ("Repr-Digest" = Option<String>, Header, pattern = "^sha-256=:[A-Za-z0-9+/]{43}=:$", description = "SHA-256 of the body")),
    request_body(content = Option<FileBytes>, content_type = "application/offset+octet-stream",
        description = "Nothing, or the first bytes of the file"),
    responses(
        (status = 201, description = "The upload is created, or was by the same request before", body = UploadDocument,
            headers(("Location" = String, description = "The upload's path"),
                ("Upload-Offset" = u64, description = "Number of durable bytes"),
                ("Upload-Expires" = String, description = "Time at which the upload expires if no byte arrives"),
                ("Viola-Clip" = String, description = "The clip's path, if the file is complete. If it is missing then, the bytes are safe: \
                    GET the upload until it is `finished` or `refused`. A partial upload has none"),
                ("Viola-Job" = String, description = "The path of the clip's newest job; absent while the home has no LiDAR map"))),
        (status = 409, description = "Bytes of a partial upload are missing: `upload-unfinished`"),
        (status = 410, description = "A partial upload has expired or was joined already: `upload-gone`"),
        (status = 412, description = "Another version of the protocol: `tus-version-unsupported`"),
        (status = 460, description = "`checksum-mismatch`; the bytes are not kept"),
        UploadProblems))]
async fn create_upload(State(app): State<App>, caller: Caller, request: Request) -> Result<Response, Error> {
    let (parts, body) = request.into_parts();
    let (id, append) = begin::begin(&app, &caller, &parts.headers).await?;
    to_the_end(async move {
        if let Some(append) = append
            && let Err(error) = receive::receive(&app, append, body).await
        {
            app.storage.abandon_upload(id, app.storage.now()).await?;
            return Err(error);
        }
        match finish::finish(&app, id).await {
            Err(error) if error.is_refusal() => return Err(error),
            // All bytes are stored and the cleaner tries again: a client that got an error would send them again.
            Err(error) => tracing::warn!(upload = %id, %error, "a complete upload waits to be made a clip"),
            Ok(_) => {}
        }
        answer::created(&app, id).await
    })
    .await
}

/// Get an upload
#[utoipa::path(get, path = "/v1/uploads/{upload}", tag = "uploads", params(UploadPath),
    responses((status = 200, description = "The upload", body = UploadDocument), CommonProblems))]
async fn get_upload(
    State(app): State<App>,
    UploadPath { upload: id }: UploadPath,
) -> Result<Document<UploadDocument>, Error> {
    answer::document(&app, id).await
}

/// Get the offset of an upload
///
/// An interrupted client resumes at `Upload-Offset`.
#[utoipa::path(head, path = "/v1/uploads/{upload}", tag = "uploads",
    params(UploadPath, ("Tus-Resumable" = String, Header, pattern = r"^[0-9]+\.[0-9]+\.[0-9]+$", example = "1.0.0", description = "`1.0.0`")),
    responses(
        (status = 200, description = "The upload resumes at `Upload-Offset`, or is complete",
            headers(("Upload-Offset" = u64, description = "Number of durable bytes"),
                ("Upload-Length" = u64, description = "Bytes of the file; or `Upload-Defer-Length: 1` if unknown"),
                ("Upload-Metadata" = String, description = "As it was sent"),
                ("Upload-Concat" = String, description = "As it was sent"),
                ("Upload-Expires" = String, description = "Time at which the upload expires if no byte arrives"),
                ("Viola-Clip" = String, description = "The clip's path, if the file is complete. If it is missing then, the bytes are safe: \
                    GET the upload until it is `finished` or `refused`. A partial upload has none"),
                ("Viola-Job" = String, description = "The path of the clip's newest job; absent while the home has no LiDAR map"))),
        (status = 410, description = "The upload expired or was joined, or its file was refused: `upload-gone`; \
            GET says which"),
        (status = 412, description = "Another version of the protocol: `tus-version-unsupported`"),
        CommonProblems))]
async fn head_upload(
    State(app): State<App>,
    UploadPath { upload: id }: UploadPath,
) -> Result<HeaderMap, Error> {
    answer::state(&app, id).await
}

/// Resume an upload
///
/// The body is the file from byte `Upload-Offset`. If the connection breaks, the received bytes are kept, and
/// HEAD returns the offset at which to resume; with `Upload-Checksum`, all of the body is kept or nothing. If
/// two requests resume the same upload, the one that began later succeeds; the other gets 409.
///
/// When the file is complete, the answer has the clip's path in `Viola-Clip`, or the reason why it is not a
/// clip. If the answer has neither, the bytes are safe: GET the upload until it is `finished` or `refused`. A file that comes
/// in more than 10 000 pieces is refused with 413, `too-many-pieces`.
#[utoipa::path(patch, path = "/v1/uploads/{upload}", tag = "uploads",
    params(UploadPath,
        ("Tus-Resumable" = String, Header, pattern = r"^[0-9]+\.[0-9]+\.[0-9]+$", example = "1.0.0", description = "`1.0.0`"),
        ("Upload-Offset" = u64, Header, description = "Number of bytes that the service has"),
        ("Upload-Length" = Option<u64>, Header, description = "Bytes of the whole file, if not given before"),
        ("Upload-Checksum" = Option<String>, Header, description = "Of the body: `sha1` or `sha256`, and the sum in base64"),
        ("Content-Digest" = Option<String>, Header, pattern = "^sha-256=:[A-Za-z0-9+/]{43}=:$", description = "SHA-256 of the body"),
        ("Repr-Digest" = Option<String>, Header, pattern = "^sha-256=:[A-Za-z0-9+/]{43}=:$", description = "SHA-256 of the body")),
    request_body(content = FileBytes, content_type = "application/offset+octet-stream"),
    responses(
        (status = 204, description = "The body is durable",
            headers(("Upload-Offset" = u64, description = "Number of durable bytes"),
                ("Upload-Expires" = String, description = "Time at which the upload expires if no byte arrives"),
                ("Viola-Clip" = String, description = "The clip's path, if the file is complete. If it is missing then, the bytes are safe: \
                    GET the upload until it is `finished` or `refused`. A partial upload has none"),
                ("Viola-Job" = String, description = "The path of the clip's newest job; absent while the home has no LiDAR map"))),
        (status = 409, description = "The service has another number of bytes, or another request has resumed it: \
            `upload-offset-mismatch`. HEAD returns the offset"),
        (status = 410, description = "The upload expired or was joined, or its file was refused: `upload-gone`; \
            GET says which. Or the service lost bytes of it: `upload-lost`"),
        (status = 412, description = "Another version of the protocol: `tus-version-unsupported`"),
        (status = 460, description = "`checksum-mismatch`; the bytes are not kept"),
        UploadProblems))]
async fn append_to_upload(
    State(app): State<App>,
    UploadPath { upload: id }: UploadPath,
    request: Request,
) -> Result<Response, Error> {
    let (parts, body) = request.into_parts();
    append(app, id, &parts.headers, body).await
}

async fn append(app: App, id: Uuid, sent: &HeaderMap, body: Body) -> Result<Response, Error> {
    headers::check_media_type(sent)?;
    let length = headers::length(sent)?;
    if let Some(length) = length {
        headers::check_length(length, app.max_upload_bytes)?;
    }
    let append = Append {
        id,
        offset: headers::offset(sent)?,
        length_bytes: length.and_then(Length::known),
        body_bytes: content_length(sent),
        checksum: checksum::asked_for(sent)?,
    };
    to_the_end(async move {
        receive::receive(&app, append, body).await.map_err(receive::may_go_on)?;
        finish::finish(&app, id).await?;
        Ok((StatusCode::NO_CONTENT, answer::state(&app, id).await?).into_response())
    })
    .await
}

/// Cancel an upload
///
/// Its bytes are removed. A clip that was made of it stays; the clip has a DELETE of its own.
#[utoipa::path(delete, path = "/v1/uploads/{upload}", tag = "uploads",
    params(UploadPath, ("Tus-Resumable" = String, Header, pattern = r"^[0-9]+\.[0-9]+\.[0-9]+$", example = "1.0.0", description = "`1.0.0`")),
    responses(
        (status = 204, description = "The upload is removed"),
        (status = 410, description = "The upload was gone already: `upload-gone`"),
        (status = 412, description = "Another version of the protocol: `tus-version-unsupported`"),
        CommonProblems))]
async fn delete_upload(
    State(app): State<App>,
    UploadPath { upload: id }: UploadPath,
) -> Result<StatusCode, Error> {
    to_the_end(async move {
        app.storage.delete_upload(id, app.storage.now()).await?;
        Ok(StatusCode::NO_CONTENT)
    })
    .await
}

/// Send PATCH or DELETE as POST, from clients that can send neither
///
/// `X-HTTP-Method-Override` names the method; everything else is as for this method.
#[utoipa::path(post, path = "/v1/uploads/{upload}", tag = "uploads",
    params(UploadPath,
        ("Tus-Resumable" = String, Header, pattern = r"^[0-9]+\.[0-9]+\.[0-9]+$", example = "1.0.0", description = "`1.0.0`"),
        ("X-HTTP-Method-Override" = String, Header, pattern = "^(PATCH|DELETE)$", description = "`PATCH` or `DELETE`"),
        ("Upload-Offset" = Option<u64>, Header, description = "As for PATCH"),
        ("Upload-Length" = Option<u64>, Header, description = "As for PATCH"),
        ("Upload-Checksum" = Option<String>, Header, description = "As for PATCH")),
    request_body(content = Option<FileBytes>, content_type = "application/offset+octet-stream"),
    responses(
        (status = 204, description = "As for PATCH or DELETE"),
        (status = 409, description = "As for PATCH"),
        (status = 410, description = "As for PATCH"),
        (status = 412, description = "As for PATCH"),
        (status = 460, description = "As for PATCH"),
        UploadProblems))]
async fn override_method(
    State(app): State<App>,
    UploadPath { upload }: UploadPath,
    request: Request,
) -> Result<Response, Error> {
    let method = request.headers().get("x-http-method-override").map(HeaderValue::as_bytes);
    if method == Some(b"PATCH") {
        let (parts, body) = request.into_parts();
        append(app, upload, &parts.headers, body).await
    } else if method == Some(b"DELETE") {
        Ok(delete_upload(State(app), UploadPath { upload }).await?.into_response())
    } else {
        let detail = "X-HTTP-Method-Override is PATCH or DELETE".to_owned();
        Err(Error::InvalidHeader { field: "X-HTTP-Method-Override", detail })
    }
}

/// Get the supported version and extensions of tus
#[utoipa::path(options, path = "/v1/uploads", tag = "uploads",
    responses((status = 204, description = "The answer is in the headers",
        headers(("Tus-Version" = String, description = "`1.0.0`"),
            ("Tus-Extension" = String, description = "The extensions"),
            ("Tus-Max-Size" = u64, description = "Maximum size of one file, in bytes"),
            ("Tus-Checksum-Algorithm" = String, description = "Algorithms of `Upload-Checksum`"))), CommonProblems))]
async fn describe_uploads(State(app): State<App>) -> (StatusCode, HeaderMap) {
    (StatusCode::NO_CONTENT, answer::abilities(app.max_upload_bytes))
}

/// Get the supported version and extensions of tus, which are the same for every upload
#[utoipa::path(options, path = "/v1/uploads/{upload}", tag = "uploads", params(UploadPath),
    responses((status = 204, description = "The answer is in the headers, as for `/v1/uploads`"),
        (status = 410, description = "The upload is gone: `upload-gone`"),
        CommonProblems))]
async fn describe_upload(
    State(app): State<App>,
    UploadPath { upload: id }: UploadPath,
) -> Result<(StatusCode, HeaderMap), Error> {
    app.storage.living_upload(id, app.storage.now()).await?;
    Ok((StatusCode::NO_CONTENT, answer::abilities(app.max_upload_bytes)))
}
