//! Checks and cleaning before a service begins.

use super::error::StorageError;
use super::open::Storage;
use super::params::StorageParams;
use super::sweep::SweepLimit;
use jiff::Timestamp;

impl Storage {
    /// Opens what is there, makes what is not, brings the tables up to date, and, where no other process can be at
    /// work, removes what interrupted writes left behind. Refuses blobs of which the database knows nothing.
    pub async fn open(params: &StorageParams) -> Result<Storage, StorageError> {
        let storage = Storage::migrate(params).await?;
        if let Err(error) = storage.compare_blobs().await {
            // Without this, SQLite's log stays, and would be applied to the copy that is put in the database's place.
            storage.close().await;
            return Err(error);
        }
        Ok(storage)
    }

    /// Refuses blobs of which the database knows nothing; removes leftovers where no other process can be at work.
    async fn compare_blobs(&self) -> Result<(), StorageError> {
        let is_alone = self.lock.is_some();
        match self.check_blobs_are_known().await {
            // Nothing is swept here, and `/readyz` tells of a store that does not answer.
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
