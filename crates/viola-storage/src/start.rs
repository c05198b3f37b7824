//! Checks and cleaning before a service begins.

use super::error::StorageError;
use super::folder_lock::FolderLock;
use super::open::Storage;
use super::params::StorageParams;
use super::sweep::SweepLimit;

impl Storage {
    /// Opens the storage, creates missing parts and migrates the tables. If no other process can be running,
    /// it removes the leftovers of interrupted writes. Refuses a store that is not the database's, and blobs that the database
    /// does not know.
    pub async fn open(params: &StorageParams) -> Result<Storage, StorageError> {
        let mut storage = Storage::migrate(params).await?;
        if let Err(error) = storage.check_contents().await {
            // Otherwise SQLite's log stays, and would be applied to a copy that replaces the database.
            storage.close().await;
            return Err(error);
        }
        if storage.lock.is_none() {
            storage.lock = storage.share_incoming(params);
        }
        Ok(storage)
    }

    /// Shares the folder of incoming files with other processes of a PostgreSQL database. Without any, it removes what killed
    /// processes left there.
    fn share_incoming(&self, params: &StorageParams) -> Option<FolderLock> {
        let shared = FolderLock::share(&params.data, || self.blobs.empty_incoming());
        let told = "the folder of incoming files could not be locked and emptied; `viola clean` removes what is left there";
        shared.inspect_err(|error| tracing::warn!(%error, "{told}")).ok()
    }

    async fn check_contents(&self) -> Result<(), StorageError> {
        self.compare_blobs().await?;
        if let Err(error) = self.begin_epoch(self.now()).await {
            // A full disk must not keep the service from being read.
            tracing::warn!(%error, "if the database was restored, readers of the changes may miss some");
        }
        if self.is_alone()
            && let Err(error) = self.begin_waits_again(self.now()).await
        {
            tracing::warn!(%error, "maps may lose clips that were to be aligned before the service stopped");
        }
        self.fill_searches().await?;
        self.seal_secrets().await
    }

    /// Returns whether no other process can be running.
    fn is_alone(&self) -> bool {
        self.lock.as_ref().is_some_and(FolderLock::is_exclusive)
    }

    /// Compares the store and its blobs with the database; removes leftovers if no other process can be running.
    async fn compare_blobs(&self) -> Result<(), StorageError> {
        let is_alone = self.is_alone();
        let compare = async {
            let store = self.check_store().await?;
            self.check_blobs_are_known(store).await
        };
        match compare.await {
            // Nothing is swept in this case, and `/readyz` reports a store that does not answer.
            Err(error @ StorageError::Blobs(_)) if !is_alone => {
                tracing::warn!(%error, "the blobs could not be compared with the database");
                return Ok(());
            }
            // A full disk must not keep the service from being read.
            Err(error) if error.is_full() => {
                tracing::warn!(%error, "the store has no id yet; it is tried again");
                return Ok(());
            }
            compared => compared?,
        }
        if is_alone {
            match self.sweep(self.now(), SweepLimit::Leftovers).await {
                Err(error @ StorageError::TooMuchToSweep { .. }) => {
                    tracing::error!(%error, "nothing was swept");
                }
                swept => drop(swept?),
            }
        }
        Ok(())
    }
}
