//! Clean-up of uploads: idle ones expire, and complete ones whose last request was cut off become clips.

use super::finish::finish_if_free;
use crate::api::App;
use crate::storage::StorageError;
use jiff::Timestamp;
use tokio::time::sleep;
use tracing::{info, warn};

/// Maximum number of uploads made into clips per pass.
const BATCH: u32 = 100;

/// Cleans at the start and then periodically until the server stops. Several processes may do so at once. A pass that the
/// stop cuts off is repeated by any process: claims have leases, and deletions are recorded.
pub(in crate::api) async fn clean(app: App) {
    // Complete uploads do not wait for a store that deletes nothing.
    tokio::select! {
        () = app.stop.cancelled() => {}
        () = make_clips(&app) => {}
        () = delete(&app) => {}
    }
}

/// Makes complete uploads into clips, periodically.
async fn make_clips(app: &App) {
    loop {
        if let Err(error) = make_due_clips(app).await {
            warn!(%error, "complete uploads could not be found; it is tried again");
        }
        sleep(app.uploads.clean_every).await;
    }
}

async fn make_due_clips(app: &App) -> Result<(), StorageError> {
    for id in app.storage.due_uploads(BATCH, Timestamp::now()).await? {
        // A refusal is stored with the upload; after a fault, a later pass retries.
        match finish_if_free(app, id).await {
            Ok(false) => {}
            Ok(true) => info!(upload = %id, "an upload that was left alone is a clip"),
            Err(error) => info!(upload = %id, %error, "an upload that was left alone is not a clip"),
        }
    }
    Ok(())
}

/// Removes idle uploads, and the files of earlier deletions whose store failed, periodically.
async fn delete(app: &App) {
    loop {
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
        sleep(app.uploads.clean_every).await;
    }
}
