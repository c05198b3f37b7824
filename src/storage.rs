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
mod folder_lock;
mod home_maps;
mod homes;
mod idempotency;
mod incoming;
mod jobs;
mod leases;
mod lidar_maps;
mod placement;
pub mod result_file;
mod uploads;

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
pub use homes::{Home, HomeId, InvalidHomeId};
pub use incoming::{Arrived, Incoming};
pub use jobs::{Job, JobState};
pub use leases::{Claim, Ending, RetryPolicy};
pub use lidar_maps::{LidarMapRevision, NewLidarMap};
pub use placement::Placement;
pub use uploads::{
    Joining, NewUpload, Upload, UploadClaim, UploadError, UploadKind, UploadLimits, UploadState, UploadWriter,
};

use blobs::Blobs;
use database::Database;
use folder_lock::FolderLock;
use jiff::Timestamp;
use std::path::{Path, PathBuf};

/// All that a server keeps, in one data folder.
pub struct Storage {
    database: Database,
    blobs: Blobs,
    _lock: FolderLock,
}

/// One page of a list: at most `limit` items after the item `after`.
#[derive(Debug, Clone)]
pub struct Page<Id> {
    pub limit: u32,
    pub after: Option<Id>,
}

impl Storage {
    /// Opens a data folder, makes it when it is not there, brings its tables up to date, and removes what
    /// interrupted writes left behind.
    pub async fn open(folder: &Path) -> Result<Storage, StorageError> {
        let storage = Storage::migrate(folder).await?;
        let keys = storage.blob_keys().await?;
        let named =
            async |some: &[String]| Ok(some.iter().filter(|key| keys.contains(*key)).cloned().collect());
        storage.blobs.sweep(Timestamp::now(), named).await?;
        Ok(storage)
    }

    /// Opens a data folder and brings its tables up to date.
    pub async fn migrate(folder: &Path) -> Result<Storage, StorageError> {
        let file_error = |source| StorageError::File { path: folder.to_owned(), source };
        std::fs::create_dir_all(folder).map_err(file_error)?;
        let folder = &folder.canonicalize().map_err(file_error)?;
        let lock = FolderLock::take(folder)?;
        let database = Database::open(&folder.join("viola.sqlite")).await?;
        let place = folder.join("blobs");
        let incoming = place.join("incoming");
        let blobs = Blobs::open(&BlobPlace::Folder(place), &incoming)?;
        Ok(Storage { database, blobs, _lock: lock })
    }

    /// Whether the database answers.
    pub async fn ready(&self) -> Result<(), StorageError> {
        sqlx::query("SELECT 1").fetch_one(self.database.reader()).await?;
        Ok(())
    }

    /// Ends all connections; what is under way is finished first.
    pub async fn close(&self) {
        self.database.close().await;
    }

    /// Every blob that a row refers to.
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
    #[error("database tables: {0}")]
    Migrate(#[from] sqlx::migrate::MigrateError),
    #[error("blob store: {0}")]
    Blobs(#[from] object_store::Error),
    #[error("column {column} holds what this version cannot read: {detail}")]
    Column { column: &'static str, detail: String },
    #[error("no such home")]
    NoSuchHome,
    #[error("no such clip")]
    NoSuchClip,
    #[error("the home has no LiDAR map")]
    NoLidarMap,
    #[error("the cursor is too old for what was deleted since to be told; begin again without one")]
    CursorExpired,
}

impl StorageError {
    /// Whether the disk is full.
    pub fn is_full(&self) -> bool {
        fn find(error: &(dyn std::error::Error + 'static)) -> bool {
            let full = error
                .downcast_ref::<std::io::Error>()
                .is_some_and(|error| error.kind() == std::io::ErrorKind::StorageFull);
            full || error.source().is_some_and(find)
        }
        match self {
            // SQLITE_FULL
            StorageError::Database(sqlx::Error::Database(error)) => error.code().as_deref() == Some("13"),
            StorageError::File { source, .. } => find(source),
            other => std::error::Error::source(other).is_some_and(find),
        }
    }
}
