//! The beginning of an upload, as the headers of its POST describe it.

use super::checksum;
use super::headers::{self, Concat};
use super::metadata::Metadata;
use super::receive::Append;
use crate::api::App;
use crate::api::access::Caller;
use crate::api::bodies::content_length;
use crate::api::error::Error;
use axum::http::HeaderMap;
use uuid::Uuid;
use viola_storage::{Joining, NewUpload, UploadError, UploadKind};

/// Creates an upload; returns its id, and a description of the body if there is one.
pub(super) async fn begin(
    app: &App,
    caller: &Caller,
    sent: &HeaderMap,
) -> Result<(Uuid, Option<Append>), Error> {
    let text = headers::metadata(sent)?;
    let metadata = Metadata::parse(&text)?;
    let has_body = headers::has_body(sent);
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
    let new = NewUpload {
        kind: if is_partial { UploadKind::Partial } else { UploadKind::Whole },
        tenant,
        home: if is_partial { None } else { Some(caller.home(&metadata.home()?)?) },
        metadata: text,
        concat: is_partial.then(|| "partial".to_owned()),
        length_bytes: length.known(),
        content_key: metadata.content_key().filter(|_| !is_partial),
    };
    let (checksum, now) = (checksum::asked_for(sent)?, app.storage.now());
    // A client whose answer was lost repeats the request. The bytes that come with it are those that the upload has, or gets
    // from its offset on.
    if let Some(begun) = app.storage.same_upload(&new, now).await? {
        return Ok((begun, None));
    }
    if metadata.idempotency_key.is_some()
        && !has_body
        && let Some(begun) = app.storage.begun_upload(&new, now).await?
    {
        return Ok((begun, None));
    }
    let id = app.storage.create_upload(new, &app.uploads.limits, app.limits.storage_bytes, now).await?.id;
    let body_bytes = content_length(sent);
    Ok((id, has_body.then_some(Append { id, offset: 0, length_bytes: None, body_bytes, checksum })))
}
