//! Records and blobs: the only place that knows SQL and object stores.
//!
//! Small records live in a database, files in a blob store; a row refers to a blob by its key, and a blob
//! is never changed once it is written. The order is always: blob durable, then the row committed, then
//! the caller is told. A blob without a row is therefore rubbish from an interrupted write, and
//! [`Storage::open`] sweeps it away.
//!
//! Time is an argument everywhere, so that tests need no clock.

mod blobs;
mod changes;
mod choices;
mod clip_list;
mod clip_state;
mod clips;
mod columns;
#[cfg(test)]
mod conformance;
mod database;
mod doomed;
mod folder_lock;
mod home_maps;
mod homes;
mod idempotency;
mod incoming;
mod job_list;
mod jobs;
mod keys;
mod leases;
mod lidar_maps;
mod placement;
pub mod result_file;
mod signals;
mod sweep;
mod tenants;
#[cfg(test)]
#[path = "../tests/common/postgres.rs"]
mod test_postgres;
mod uploads;
mod webhooks;

pub use blobs::{BlobPlace, BlobReader, LocalFile, S3Params};
pub use changes::{Change, ChangeKind, Changes, ChangesCursor};
pub use choices::{Choice, ChoiceError, Chosen};
pub use clip_list::ClipFilter;
pub use clip_state::ClipState;
pub use clips::{Added, Clip, NewClip};
pub use home_maps::{
    HomeMap, HomeObject, LeftOut, MapClip, MapFile, MapObject, MapScene, MergeClaim, NewRevision,
    ObjectFilter, map_file,
};
pub use homes::{Home, HomeId, InvalidHomeId, InvalidTenant, Tenant};
pub use incoming::{Arrived, Incoming};
pub use jobs::{Job, JobState, QueueState};
pub use keys::{ApiKey, NewKey, Role, Secret};
pub use leases::{Claim, Ending, Fault, RetryPolicy};
pub use lidar_maps::{LidarMapRevision, NewLidarMap};
pub use placement::Placement;
pub use signals::{Signal, Signals};
pub use sweep::SweepLimit;
pub use tenants::Removed;
pub use uploads::{
    Joining, NewUpload, Upload, UploadClaim, UploadError, UploadKind, UploadLimits, UploadState, UploadWriter,
};
pub use webhooks::{
    Delivery, DeliveryState, MOST_WEBHOOKS, RETRY_AFTER, Sending, Sent, ToSend, Webhook, WebhookMade,
    WebhookSecret,
};

use blobs::Blobs;
pub use database::POSTGRES_CONNECTIONS;
use database::{Database, DatabaseFault};
use folder_lock::FolderLock;
use jiff::Timestamp;
use std::fmt;
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};

/// All that a service keeps.
pub struct Storage {
    database: Database,
    blobs: Blobs,
    /// Of the only process that serves, where there can be but one.
    _lock: Option<FolderLock>,
}

/// Where a service keeps what it keeps.
#[derive(Debug, Clone, Default)]
pub struct StorageParams {
    /// The data folder. Files on their way in lie here, and whatever has no other place.
    pub data: PathBuf,
    /// PostgreSQL in place of a file in the data folder.
    pub postgres: Option<PostgresParams>,
    /// A bucket in place of files in the data folder.
    pub s3: Option<S3Params>,
}

/// A database that many processes share.
#[derive(Clone)]
pub struct PostgresParams {
    /// As libpq has it, with the password.
    pub url: String,
    /// At most, of this process.
    pub connections: u32,
}

impl fmt::Debug for PostgresParams {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter
            .debug_struct("PostgresParams")
            .field("connections", &self.connections)
            .finish_non_exhaustive()
    }
}

impl StorageParams {
    /// SQLite and files, all in one folder.
    pub fn in_folder(data: &Path) -> StorageParams {
        StorageParams { data: data.to_owned(), ..StorageParams::default() }
    }
}

/// One page of a list: at most `limit` items after the item `after`.
#[derive(Debug, Clone)]
pub struct Page<Id> {
    pub limit: u32,
    pub after: Option<Id>,
}

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
        let is_alone = self._lock.is_some();
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

    /// The same without removing anything.
    pub async fn migrate(params: &StorageParams) -> Result<Storage, StorageError> {
        Storage::connect(params, true).await
    }

    async fn connect(params: &StorageParams, is_alone: bool) -> Result<Storage, StorageError> {
        let file_error = |source| StorageError::File { path: params.data.clone(), source };
        // Recordings of homes are nobody else's business on this machine.
        std::fs::DirBuilder::new().recursive(true).mode(0o700).create(&params.data).map_err(file_error)?;
        let folder = &params.data.canonicalize().map_err(file_error)?;
        let (database, lock) = match &params.postgres {
            Some(postgres) => (Database::open_postgres(&postgres.url, postgres.connections).await?, None),
            None => {
                let lock = is_alone.then(|| FolderLock::take(folder)).transpose()?;
                (Database::open_sqlite(&folder.join("viola.sqlite")).await?, lock)
            }
        };
        let (place, incoming) = match &params.s3 {
            Some(s3) => (BlobPlace::S3(s3.clone()), folder.join("incoming")),
            None => (BlobPlace::Folder(folder.join("blobs")), folder.join("blobs/incoming")),
        };
        let blobs = Blobs::open(&place, &incoming)?;
        Ok(Storage { database, blobs, _lock: lock })
    }

    /// The records alone, beside a server that may be running.
    pub async fn administer(params: &StorageParams) -> Result<Storage, StorageError> {
        Storage::connect(params, false).await
    }

    /// What the database is.
    pub fn database_name(&self) -> &'static str {
        self.database.name()
    }

    /// Checks that the database can write.
    pub async fn check_writes(&self) -> Result<(), StorageError> {
        self.database.check_writes().await
    }

    /// Ends all connections; what is under way is finished first.
    pub async fn close(&self) {
        self.database.close().await;
    }

    /// Every blob that a row refers to.
    #[cfg(test)]
    async fn blob_keys(&self) -> Result<std::collections::HashSet<String>, StorageError> {
        let mut keys = self.clip_blob_keys().await?;
        keys.extend(self.lidar_map_blob_keys().await?);
        keys.extend(self.home_map_blob_keys().await?);
        keys.extend(self.upload_blob_keys().await?);
        Ok(keys.into_iter().collect())
    }
}

/// Why storage could not do as asked.
#[derive(Debug, thiserror::Error)]
pub enum StorageError {
    #[error("the data folder {path} is in use by another viola server; stop it or choose another folder")]
    InUse { path: PathBuf },
    #[error("{path}: {source}")]
    File { path: PathBuf, source: std::io::Error },
    #[error("database: {0}")]
    Database(#[from] sqlx::Error),
    /// The commit was sent, and whether it took effect is not known.
    #[error("database, while it committed: {0}")]
    Unsettled(#[source] sqlx::Error),
    #[error("writes to the database failed in the last seconds")]
    WritesFail { is_full: bool },
    #[error("database tables: {0}")]
    Migrate(#[from] sqlx::migrate::MigrateError),
    #[error("blob store: {0}")]
    Blobs(#[from] object_store::Error),
    #[error(
        "the blob store has at least {blobs} files, and the database names none of them: the database was lost, or one of \
         the two is the wrong one. Restore the database, or correct the data folder, the database URL or the bucket. To \
         begin anew, delete these files: `viola clean --remove-unknown --older-than-seconds 0`"
    )]
    LostDatabase { blobs: usize },
    #[error(
        "the database names {named} files, but not {sent} recordings, LiDAR maps and uploads, nor {made} results and \
         parts of maps. Killed processes leave fewer, so none was removed. Check that the database is the right one and \
         not an old copy; then delete them: `viola clean --remove-unknown`"
    )]
    TooMuchToSweep { sent: u64, made: u64, named: u64 },
    #[error("column {column} holds what this version cannot read: {detail}")]
    Column { column: &'static str, detail: String },
    #[error("the system gives no random numbers: {0}")]
    Randomness(String),
    #[error("no such home")]
    NoSuchHome,
    #[error("no such clip")]
    NoSuchClip,
    #[error("the home has no LiDAR map")]
    NoLidarMap,
    #[error("no such webhook")]
    NoSuchWebhook,
    #[error("no such delivery")]
    NoSuchDelivery,
    #[error("the cursor is too old for what was deleted since to be told; begin again without one")]
    CursorExpired,
}

impl StorageError {
    /// Whether a retry may succeed: the database or the store could not be reached, gave way to somebody else, or met a
    /// fault of the system.
    pub fn is_transient(&self) -> bool {
        match self {
            StorageError::Database(error) => DatabaseFault::of(error) != DatabaseFault::Lasting,
            StorageError::Unsettled(_) | StorageError::WritesFail { .. } => true,
            StorageError::Blobs(object_store::Error::NotFound { .. }) => false,
            StorageError::Blobs(_) => true,
            _ => false,
        }
    }

    /// Whether a change may have taken effect all the same.
    fn is_unsettled(&self) -> bool {
        matches!(self, StorageError::Unsettled(_))
    }

    /// Whether the disk is full, or this process may not take more of it.
    pub fn is_full(&self) -> bool {
        use std::io::ErrorKind::{FileTooLarge, QuotaExceeded, StorageFull};
        fn find(error: &(dyn std::error::Error + 'static)) -> bool {
            let full = error
                .downcast_ref::<std::io::Error>()
                .is_some_and(|error| [StorageFull, QuotaExceeded, FileTooLarge].contains(&error.kind()));
            full || error.source().is_some_and(find)
        }
        match self {
            StorageError::Database(error) if DatabaseFault::of(error) == DatabaseFault::Full => true,
            StorageError::WritesFail { is_full } => *is_full,
            StorageError::File { source, .. } => find(source),
            other => std::error::Error::source(other).is_some_and(find),
        }
    }
}
