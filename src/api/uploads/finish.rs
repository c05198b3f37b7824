//! Turns a complete upload into a clip.

use super::metadata::Metadata;
use super::opener;
use super::refusal::UploadRefusal;
use crate::api::App;
use crate::api::clips;
use crate::api::error::{Defence, Error};
use std::convert::Infallible;
use std::time::{Duration, Instant};
use uuid::Uuid;
use viola_storage::{Added, NewClip, UploadClaim, UploadError, UploadState};

/// Delay before the next attempt after a fault of the service.
const PAUSE: Duration = Duration::from_secs(10);

/// Delay after an attempt whose fault may be the service's or the file's: each may take minutes of a reader.
const LONG_PAUSE: Duration = Duration::from_mins(5);

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
        let upload = app.storage.upload(id, app.storage.now()).await?;
        let refused = upload.filter(|upload| upload.state == UploadState::Refused);
        if let Some(problem) = refused.and_then(|upload| serde_json::from_value(upload.problem?).ok()) {
            return Err(Error::Told(problem));
        }
        if !app.storage.living_upload(id, app.storage.now()).await?.is_due() {
            return Ok(());
        }
        tokio::time::sleep(LOOK_EVERY).await;
    }
}

/// The step after a failed attempt.
#[derive(Debug, PartialEq, Eq)]
enum Next {
    /// The bytes are removed.
    Refuse,
    /// The bytes stay, and the cleaner retries.
    Retry { after: Duration },
}

impl Next {
    /// Returns the step after an error. `is_old` is true if the last byte came longer ago than idle uploads are kept: a busy
    /// machine opens files slowly, and a store that is not mounted lacks pieces, so such faults refuse only old uploads.
    fn after(error: &Error, is_old: bool) -> Next {
        let is_doubtful = matches!(
            error,
            Error::Defence(Defence::TookTooLong { .. })
                | Error::Upload(UploadRefusal::State(UploadError::Lost))
        );
        let is_old_fault = is_old && matches!(error, Error::Opener(_));
        if !error.is_refusal() {
            Next::Retry { after: if is_old_fault { LONG_PAUSE } else { PAUSE } }
        } else if is_doubtful && !is_old {
            Next::Retry { after: LONG_PAUSE }
        } else {
            Next::Refuse
        }
    }
}

/// Makes a clip of a complete upload that nobody else has claimed; returns whether it made one. The bytes of a
/// refused file are removed; after a fault of the service they stay, and the cleaner retries.
pub(super) async fn finish_if_free(app: &App, id: Uuid) -> Result<bool, Error> {
    let (storage, params) = (&app.storage, &app.uploads);
    let Some(claim) = storage.claim_upload(id, params.lease, storage.now()).await? else {
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
            let now = app.storage.now();
            match Next::after(&error, claim.upload.expires_at <= now) {
                Next::Refuse => {
                    let problem = serde_json::json!(error.problem());
                    storage.refuse_upload(&claim, &problem, params.limits.record, now).await?;
                    Err(error)
                }
                Next::Retry { after } => {
                    storage.give_back_upload(&claim, after, now).await?;
                    Err(waits(error, after))
                }
            }
        }
    }
}

/// Returns the answer after an attempt that the cleaner retries. The client must not take it for a refusal and send all bytes
/// again.
fn waits(error: Error, pause: Duration) -> Error {
    if let Error::Storage(fault) = &error
        && fault.is_full()
    {
        // Its own answer says that acknowledged bytes are kept.
        return error;
    }
    let cause = match &error {
        Error::Defence(Defence::ReadersBusy { .. }) => "other files are being read".to_owned(),
        Error::Upload(UploadRefusal::State(UploadError::Lost)) => "a part of it cannot be read".to_owned(),
        error if error.is_refusal() => error.to_string(),
        fault => {
            tracing::error!(cause = %fault, "a complete upload could not be made a clip");
            "the service had a fault".to_owned()
        }
    };
    UploadRefusal::Waits { cause, pause }.into()
}

async fn make_clip(app: &App, claim: &UploadClaim) -> Result<(), Error> {
    if claim.upload.received_bytes == 0 {
        return Err(Error::BodyEmpty);
    }
    let metadata = Metadata::parse(&claim.upload.metadata)?;
    let file = app.storage.assemble_upload(claim).await?;
    if metadata.sha256.as_ref().is_some_and(|sum| *sum != file.sha256) {
        return Err(UploadRefusal::FileMismatch.into());
    }
    let unknown_scale = metadata.unknown_scale;
    let (file, mut info, content_sha256) = match &app.uploads.opener {
        Some(opener) if claim.lost_attempts >= LOST_ATTEMPTS => opener::open(opener, file).await?,
        None if claim.lost_attempts >= LOST_ATTEMPTS => return Err(UploadRefusal::Unreadable.into()),
        _ => {
            let opened = clips::open(app, claim.home.tenant(), file, unknown_scale).await?;
            (opened.file, opened.info, opened.content_sha256)
        }
    };
    info.metric &= !unknown_scale;
    let new = NewClip {
        file,
        recorded_at: metadata.recorded_at.or_else(|| clips::recorded_at_of_file(&info)),
        info,
        content_sha256,
        title: metadata.title.clone(),
        file_name: metadata.filename.clone(),
        idempotency_key: metadata.clip_key(),
    };
    let record = app.uploads.limits.record;
    match app.storage.finish_upload(claim, new, record, app.storage.now()).await? {
        Some(Added::KeyReused) => Err(UploadRefusal::KeyReused.into()),
        // None: another process has made the clip meanwhile.
        Some(Added::New(_) | Added::Replayed(_)) | None => Ok(()),
    }
}

/// Renews a claim until it is dropped. The loss of a claim is noticed when the clip is stored.
async fn hold(app: &App, claim: &UploadClaim) -> Infallible {
    loop {
        tokio::time::sleep(app.uploads.lease / 3).await;
        if let Err(error) = app.storage.renew_upload(claim, app.uploads.lease, app.storage.now()).await {
            tracing::warn!(upload = %claim.upload.id, %error, "a claim could not be renewed");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use viola_storage::StorageError;

    #[test]
    fn a_fault_that_may_be_the_services_refuses_only_an_old_upload() {
        let slow = || Error::from(Defence::TookTooLong { limit: Duration::from_secs(120) });
        let busy = || Error::from(Defence::ReadersBusy { wait: Duration::from_secs(60) });
        let lost = || Error::from(UploadError::Lost);
        let (soon, later) = (Next::Retry { after: PAUSE }, Next::Retry { after: LONG_PAUSE });
        let cases = [
            (busy(), false, &soon),
            (busy(), true, &soon),
            (Error::Opener("no descriptors".to_owned()), false, &soon),
            (Error::Opener("no descriptors".to_owned()), true, &later),
            (slow(), false, &later),
            (slow(), true, &Next::Refuse),
            (lost(), false, &later),
            (lost(), true, &Next::Refuse),
            (Error::BodyEmpty, false, &Next::Refuse),
            (UploadRefusal::KeyReused.into(), false, &Next::Refuse),
            (UploadRefusal::Unreadable.into(), false, &Next::Refuse),
            (UploadRefusal::FileMismatch.into(), false, &Next::Refuse),
        ];
        for (error, is_old, expected) in cases {
            assert_eq!(Next::after(&error, is_old), *expected, "{error}, {is_old}");
        }
    }

    #[test]
    fn a_client_is_never_told_to_send_acknowledged_bytes_again() {
        let slow = Error::from(Defence::TookTooLong { limit: Duration::from_secs(120) });
        let busy = Error::from(Defence::ReadersBusy { wait: Duration::from_secs(60) });
        for (error, cause) in [
            (slow, "took longer than 120 s"),
            (busy, "other files are being read"),
            (Error::from(UploadError::Lost), "a part of it cannot be read"),
            (Error::Opener("a secret".to_owned()), "the service had a fault"),
            (Error::Storage(StorageError::WritesFail { is_full: false }), "the service had a fault"),
        ] {
            let told = waits(error, PAUSE);
            let problem = told.problem();
            assert!(!told.is_refusal() && problem.status == 503, "{problem:?}");
            assert!(problem.detail.contains("do not send it again"), "{problem:?}");
            assert!(problem.detail.contains(cause) && !problem.detail.contains("secret"), "{problem:?}");
        }
        let full = waits(Error::Storage(StorageError::WritesFail { is_full: true }), PAUSE).problem();
        assert!(full.status == 507 && full.detail.contains("acknowledged bytes are kept"), "{full:?}");
    }
}
