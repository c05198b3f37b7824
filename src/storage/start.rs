//! Checks and cleaning before a service begins.

use super::error::StorageError;
use super::open::Storage;
use super::params::StorageParams;
use super::sweep::SweepLimit;
use jiff::Timestamp;

impl Storage {
    /// Opens the storage, creates missing parts and migrates the tables. If no other process can be running,
    /// it removes the leftovers of interrupted writes. Refuses blobs that the database does not know.
    pub async fn open(params: &StorageParams) -> Result<Storage, StorageError> {
        let storage = Storage::migrate(params).await?;
        if let Err(error) = storage.check_contents().await {
            // Otherwise SQLite's log stays, and would be applied to a copy that replaces the database.
            storage.close().await;
            return Err(error);
        }
        Ok(storage)
    }

    async fn check_contents(&self) -> Result<(), StorageError> {
        self.compare_blobs().await?;
        if let Err(error) = self.begin_epoch(Timestamp::now()).await {
            // A full disk must not keep the service from being read.
            tracing::warn!(%error, "if the database was restored, readers of the changes may miss some");
        }
        self.fill_searches().await?;
        self.seal_secrets().await
    }

    /// Refuses blobs that the database does not know; removes leftovers if no other process can be running.
    async fn compare_blobs(&self) -> Result<(), StorageError> {
        let is_alone = self.lock.is_some();
        match self.check_blobs_are_known().await {
            // Nothing is swept in this case, and `/readyz` reports a store that does not answer.
            Err(error @ StorageError::Blobs(_)) if !is_alone => {
                tracing::warn!(%error, "the blobs could not be compared with the database");
            }
            checked => checked?,
        }
        if is_alone {
            match self.sweep(Timestamp::now(), SweepLimit::Leftovers).await {
                Err(error @ StorageError::TooMuchToSweep { .. }) => {
                    tracing::error!(%error, "nothing was swept");
                }
                swept => drop(swept?),
            }
        }
        Ok(())
    }
}
