//! The body of a request that appends to an upload.

use super::checksum::Checksum;
use super::refusal::UploadRefusal;
use crate::api::App;
use crate::api::bodies::Pace;
use crate::api::error::Error;
use crate::api::metrics;
use axum::body::{Body, BodyDataStream};
use bytes::Bytes;
use std::time::Instant;
use uuid::Uuid;
use viola_storage::{Incoming, Tenant, UploadKind, UploadWriter};

/// Description of a body, from its request.
pub(super) struct Append {
    pub id: Uuid,
    pub offset: u64,
    pub length_bytes: Option<u64>,
    pub body_bytes: Option<u64>,
    pub checksum: Option<Checksum>,
}

/// Bytes that have arrived and are not durable yet.
struct Piece {
    file: Incoming,
    begun: Instant,
}

/// Appends a body. If the body breaks off, the received bytes are kept; a body with a checksum is kept whole
/// or not at all.
pub(super) async fn receive(app: &App, append: Append, body: Body) -> Result<(), Error> {
    let tenant = check_room(app, &append).await?;
    let Append { id, offset, length_bytes, body_bytes, mut checksum } = append;
    // Other bodies are kept piece by piece, and their bytes count for the tenant.
    let mut arrival = match checksum {
        Some(_) => Some(app.arrivals.begin(tenant.name(), body_bytes.unwrap_or_default())?),
        None => None,
    };
    let limits = &app.uploads.limits;
    let mut writer = app.storage.begin_append(id, offset, length_bytes, limits, app.storage.now()).await?;
    let length = writer.length_bytes;
    let mut left = room(app, length, offset);
    // Another request may have given the length meanwhile.
    if body_bytes.is_some_and(|bytes| bytes > left) {
        return Err(too_large(app, length, offset));
    }
    let mut piece: Option<Piece> = None;
    let mut chunks = body.into_data_stream();
    let mut pace = Pace::new(app.bodies.window);
    let ended = loop {
        let has_checksum = checksum.is_some();
        let chunk = match next_chunk(app, &mut pace, &mut chunks, &mut writer, &mut piece, has_checksum).await
        {
            Ok(Some(chunk)) => chunk,
            Ok(None) => break Ok(()),
            Err(error) => break Err(error),
        };
        if chunk.is_empty() {
            continue;
        }
        left = left.checked_sub(chunk.len() as u64).ok_or_else(|| too_large(app, length, offset))?;
        if let Some(arrival) = &mut arrival {
            arrival.grow(chunk.len() as u64)?;
        }
        let growing = match &mut piece {
            Some(piece) => piece,
            None => piece.insert(Piece { file: app.storage.incoming()?, begun: Instant::now() }),
        };
        growing.file.write(&chunk).await?;
        if let Some(checksum) = &mut checksum {
            checksum.update(&chunk);
        } else if growing.file.size_bytes() >= app.uploads.piece_bytes
            || growing.begun.elapsed() >= app.uploads.piece_age
        {
            keep(app, &mut writer, piece.take()).await?;
        }
    };
    match checksum {
        None => {
            keep(app, &mut writer, piece).await?;
            ended
        }
        Some(checksum) => {
            ended?;
            checksum.check()?;
            keep(app, &mut writer, piece).await
        }
    }
}

/// Returns the next chunk, none at the end. A piece that is old enough is kept meanwhile, because a network may pause for
/// long; one of a body with a checksum is not.
async fn next_chunk(
    app: &App,
    pace: &mut Pace,
    chunks: &mut BodyDataStream,
    writer: &mut UploadWriter,
    piece: &mut Option<Piece>,
    has_checksum: bool,
) -> Result<Option<Bytes>, Error> {
    let mut next = std::pin::pin!(pace.next(chunks));
    loop {
        let left = |piece: &Piece| app.uploads.piece_age.saturating_sub(piece.begun.elapsed());
        let due = piece.as_ref().filter(|_| !has_checksum).map(left);
        tokio::select! {
            next = &mut next => return next,
            () = app.stop.cancelled() => return Err(UploadRefusal::Stopping.into()),
            () = tokio::time::sleep(due.unwrap_or_default()), if due.is_some() => keep(app, writer, piece.take()).await?,
        }
    }
}

/// Returns the error of a body that continues an upload. Clients of tus give up at 408, but a stalled one loses nothing.
pub(super) fn may_go_on(error: Error) -> Error {
    match error {
        Error::BodyStalled(least) => UploadRefusal::Stalled(least).into(),
        error => error,
    }
}

/// Returns the tenant of an upload. Refuses a body for which the upload or the tenant has no room, before the request takes
/// effect: it would set a deferred length, and stop another request that appends.
async fn check_room(app: &App, append: &Append) -> Result<Tenant, Error> {
    let upload = app.storage.living_upload(append.id, app.storage.now()).await?;
    // A length that was given first has counted since.
    if let (None, Some(length)) = (upload.length_bytes, append.length_bytes) {
        let more_bytes = length.saturating_sub(upload.received_bytes);
        app.limits.check_quota(&app.storage, &upload.tenant, more_bytes).await?;
    }
    let (offset, length) = (append.offset, upload.length_bytes.or(append.length_bytes));
    // Requests of other offsets and lengths have refusals of their own when they begin.
    let may_begin = upload.kind != UploadKind::Final
        && upload.received_bytes == offset
        && append.length_bytes.is_none_or(|told| length == Some(told) && told >= offset);
    if may_begin && append.body_bytes.is_some_and(|bytes| bytes > room(app, length, offset)) {
        return Err(too_large(app, length, offset));
    }
    Ok(upload.tenant)
}

/// Returns the number of bytes that an upload may still get.
fn room(app: &App, length: Option<u64>, offset: u64) -> u64 {
    length.unwrap_or(app.max_upload_bytes).saturating_sub(offset)
}

/// Returns the refusal of a body with more bytes than that.
fn too_large(app: &App, length: Option<u64>, offset: u64) -> Error {
    match length {
        Some(length) => Error::BodyBeyondUpload { offset, length },
        None => Error::BodyTooLarge { limit: room(app, None, offset) },
    }
}

async fn keep(app: &App, writer: &mut UploadWriter, piece: Option<Piece>) -> Result<(), Error> {
    let Some(piece) = piece else { return Ok(()) };
    let bytes = piece.file.finish().await?;
    let size_bytes = bytes.size_bytes;
    if writer.length_bytes.is_none() {
        app.limits.check_quota(&app.storage, &writer.tenant, size_bytes).await?;
    }
    app.storage.append(writer, bytes, &app.uploads.limits, app.storage.now()).await?;
    metrics::received("parts", size_bytes);
    Ok(())
}
