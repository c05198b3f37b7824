//! Clean-up of uploads: idle ones expire, and complete ones whose last request was cut off become clips.

use super::finish::finish_if_free;
use crate::api::App;
use crate::storage::StorageError;
use jiff::Timestamp;
use tracing::{info, warn};

/// Maximum number of uploads made into clips per pass.
const BATCH: u32 = 100;

/// Cleans at the start and then periodically until the server stops. Several processes may do so at once.
pub(in crate::api) async fn clean(app: App) {
    while !app.stop.is_cancelled() {
        if let Err(error) = pass(&app).await {
            warn!(%error, "uploads could not be cleaned; it is tried again");
        }
        tokio::select! {
            () = app.stop.cancelled() => {}
            () = tokio::time::sleep(app.uploads.clean_every) => {}
        }
    }
}

async fn pass(app: &App) -> Result<(), StorageError> {
    // A file that cannot be deleted must not keep complete uploads from becoming clips.
    match app.storage.expire_uploads(Timestamp::now()).await {
        Ok(0) => {}
        Ok(expired) => info!(expired, "uploads expired"),
        Err(error) => warn!(%error, "uploads could not expire; it is tried again"),
    }
    match app.storage.finish_deletions().await {
        Ok(0) => {}
        Ok(finished) => info!(finished, "files of what had been deleted are gone now"),
        Err(error) => warn!(%error, "files of what had been deleted are still there; it is tried again"),
    }
    for id in app.storage.due_uploads(BATCH, Timestamp::now()).await? {
        if app.stop.is_cancelled() {
            break;
        }
        // A refusal is stored with the upload; after a fault, a later pass retries.
        match finish_if_free(app, id).await {
            Ok(false) => {}
            Ok(true) => info!(upload = %id, "an upload that was left alone is a clip"),
            Err(error) => info!(upload = %id, %error, "an upload that was left alone is not a clip"),
        }
    }
    Ok(())
}
