//! The beginning of an upload, as the headers of its POST describe it.

use super::checksum;
use super::headers::{self, Concat};
use super::metadata::Metadata;
use super::receive::Append;
use crate::api::App;
use crate::api::access::Caller;
use crate::api::bodies::content_length;
use crate::api::error::Error;
use crate::api::extract::has_body;
use axum::http::HeaderMap;
use jiff::Timestamp;
use uuid::Uuid;
use viola_storage::{Joining, NewUpload, StorageError, UploadError, UploadKind};

/// Creates an upload; returns its id, and a description of the body if there is one.
pub(super) async fn begin(
    app: &App,
    caller: &Caller,
    sent: &HeaderMap,
) -> Result<(Uuid, Option<Append>), Error> {
    let text = headers::metadata(sent)?;
    let metadata = Metadata::parse(&text)?;
    let has_body = has_body(sent);
    if has_body {
        headers::check_media_type(sent)?;
    }
    let (concat, tenant) = (headers::concat(sent)?, caller.tenant.clone());
    if let Concat::Final { ids, sent: concat } = concat {
        if has_body || headers::length(sent)?.is_some() {
            return Err(UploadError::Final.into());
        }
        let (home, max_bytes) = (caller.home(&metadata.home()?)?, app.max_upload_bytes);
        let joining = Joining { parts: ids, tenant, home, metadata: text, concat, max_bytes };
        let joined = app.storage.join_uploads(&joining, &app.uploads.limits, app.storage.now()).await?;
        return Ok((joined.id, None));
    }
    let is_partial = concat == Concat::Partial;
    let length = headers::length(sent)?.ok_or_else(headers::no_length)?;
    headers::check_length(length, app.max_upload_bytes)?;
    let mut new = NewUpload {
        kind: if is_partial { UploadKind::Partial } else { UploadKind::Whole },
        tenant,
        home: if is_partial { None } else { Some(caller.home(&metadata.home()?)?) },
        metadata: text,
        concat: is_partial.then(|| "partial".to_owned()),
        length_bytes: length.known(),
        content_key: metadata.content_key().filter(|_| !is_partial),
        is_stored: false,
    };
    let (checksum, now) = (checksum::asked_for(sent)?, app.storage.now());
    let has_only_key = metadata.idempotency_key.is_some() && !has_body;
    // A client whose answer was lost repeats the request. The bytes that come with it are those that the upload has, or gets
    // from its offset on.
    if let Some(begun) = begun_before(app, &new, has_only_key, now).await? {
        return Ok((begun, None));
    }
    let (limits, max_bytes) = (&app.uploads.limits, app.limits.storage_bytes);
    if let (Some(home), Some(key), Some(bytes)) = (&new.home, metadata.clip_key(), new.length_bytes) {
        // A larger file needs room: the stored clip may be removed before the upload is complete.
        new.is_stored = app.storage.bytes_of_key(home, &key).await?.is_some_and(|stored| bytes <= stored);
    }
    let id = app.storage.create_upload(new.clone(), limits, max_bytes, now).await?.id;
    // Of equal requests at the same time, each creates an upload, and all continue with the oldest.
    if let Some(oldest) = begun_before(app, &new, has_only_key, now).await?.filter(|oldest| *oldest != id) {
        app.storage.delete_upload(id, now).await?;
        return Ok((oldest, None));
    }
    let body_bytes = content_length(sent);
    Ok((id, has_body.then_some(Append { id, offset: 0, length_bytes: None, body_bytes, checksum })))
}

/// Returns the oldest upload that an equal request began: one of the same file or, for a request with a key and without bytes,
/// one without bytes.
async fn begun_before(
    app: &App,
    new: &NewUpload,
    has_only_key: bool,
    now: Timestamp,
) -> Result<Option<Uuid>, StorageError> {
    match app.storage.same_upload(new, now).await? {
        None if has_only_key => app.storage.begun_upload(new, now).await,
        same => Ok(same),
    }
}
