//! Turns a complete upload into a clip.

use super::metadata::Metadata;
use super::opener;
use super::refusal::UploadRefusal;
use crate::api::App;
use crate::api::bodies::understand;
use crate::api::clips;
use crate::api::error::Error;
use crate::storage::{Added, NewClip, UploadClaim, UploadState};
use jiff::Timestamp;
use std::convert::Infallible;
use std::time::{Duration, Instant};
use uuid::Uuid;

/// Delay before the next attempt after a fault of the service.
const PAUSE: Duration = Duration::from_secs(10);

/// Timeout and polling interval of a request while another one, or the cleaner, makes the clip.
const MAX_WAIT: Duration = Duration::from_secs(15);
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// Number of lost attempts after which a file is opened in its own process, since it may have caused them.
const LOST_ATTEMPTS: u32 = 3;

/// Makes a clip of a complete upload. If another request or the cleaner already makes it, waits for a while,
/// so that the answer can name the clip.
pub(super) async fn finish(app: &App, id: Uuid) -> Result<(), Error> {
    let begun = Instant::now();
    loop {
        if finish_if_free(app, id).await? || begun.elapsed() >= MAX_WAIT {
            return Ok(());
        }
        // The other request may have refused the file: the sender needs the reason, not `upload-gone`.
        let upload = app.storage.upload(id, Timestamp::now()).await?;
        let refused = upload.filter(|upload| upload.state == UploadState::Refused);
        if let Some(problem) = refused.and_then(|upload| serde_json::from_value(upload.problem?).ok()) {
            return Err(Error::Told(problem));
        }
        if !app.storage.living_upload(id, Timestamp::now()).await?.is_due() {
            return Ok(());
        }
        tokio::time::sleep(LOOK_EVERY).await;
    }
}

/// Makes a clip of a complete upload that nobody else has claimed; returns whether it made one. The bytes of a
/// refused file are removed; after a fault of the service they stay, and the cleaner retries.
pub(super) async fn finish_if_free(app: &App, id: Uuid) -> Result<bool, Error> {
    let (storage, params) = (&app.storage, &app.uploads);
    let Some(claim) = storage.claim_upload(id, params.lease, Timestamp::now()).await? else {
        return Ok(false);
    };
    let made = tokio::select! {
        made = make_clip(app, &claim) => made,
        never = hold(app, &claim) => match never {},
    };
    match made {
        Ok(()) => {
            app.queue.wake();
            Ok(true)
        }
        Err(error) => {
            if error.is_refusal() {
                let problem = serde_json::json!(error.problem());
                storage.refuse_upload(&claim, &problem, params.limits.record, Timestamp::now()).await?;
            } else {
                storage.give_back_upload(&claim, PAUSE, Timestamp::now()).await?;
            }
            Err(error)
        }
    }
}

async fn make_clip(app: &App, claim: &UploadClaim) -> Result<(), Error> {
    if claim.upload.received_bytes == 0 {
        return Err(Error::BodyEmpty);
    }
    let metadata = Metadata::parse(&claim.upload.metadata)?;
    let file = app.storage.assemble_upload(claim).await?;
    let (file, info) = match &app.uploads.opener {
        Some(opener) if claim.lost_attempts >= LOST_ATTEMPTS => opener::open(opener, file).await?,
        None if claim.lost_attempts >= LOST_ATTEMPTS => return Err(UploadRefusal::Unreadable.into()),
        _ => {
            let (file, info, _) = understand(app, move || clips::open(file)).await?;
            (file, info)
        }
    };
    let new = NewClip {
        file,
        recorded_at: metadata.recorded_at.or_else(|| clips::recorded_at_of_file(&info)),
        info,
        idempotency_key: metadata.idempotency_key,
        title: metadata.title,
        file_name: metadata.filename,
    };
    let record = app.uploads.limits.record;
    match app.storage.finish_upload(claim, new, record, Timestamp::now()).await? {
        Some(Added::KeyReused) => Err(Error::KeyReused),
        // None: another process has made the clip meanwhile.
        Some(Added::New(_) | Added::Replayed(_)) | None => Ok(()),
    }
}

/// Renews a claim until it is dropped. The loss of a claim is noticed when the clip is stored.
async fn hold(app: &App, claim: &UploadClaim) -> Infallible {
    loop {
        tokio::time::sleep(app.uploads.lease / 3).await;
        if let Err(error) = app.storage.renew_upload(claim, app.uploads.lease, Timestamp::now()).await {
            tracing::warn!(upload = %claim.upload.id, %error, "a claim could not be renewed");
        }
    }
}
