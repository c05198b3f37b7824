//! Errors of storage.

mod words;

use super::database::DatabaseFault;
use sqlx::migrate::MigrateError;
use std::path::PathBuf;
use uuid::Uuid;
use viola_geometry::MAX_LEVELS;

#[derive(Debug, thiserror::Error)]
pub enum StorageError {
    #[error(
        "the data folder {path} is in use by another viola server; stop it or choose another folder. With SQLite one process \
         serves and works; several processes need PostgreSQL (--database-url)"
    )]
    InUse { path: PathBuf },
    #[error("{path}: {source}")]
    File { path: PathBuf, source: std::io::Error },
    #[error(
        "the data folder {path} cannot be written: {source}. Give the user of this process the right to write there, mount \
         it writable, or choose another folder with --data"
    )]
    ReadOnly { path: PathBuf, source: std::io::Error },
    #[error("the data folder {path} cannot be used: it is a file, or lies in one. Name a folder with --data")]
    NotAFolder { path: PathBuf },
    #[error(
        "there is no service in the data folder {path}: it has no viola.sqlite. Correct --data, name PostgreSQL with \
         --database-url, or begin a service with `viola serve` or `viola keys create`"
    )]
    NoService { path: PathBuf },
    #[error("the database {path} is damaged: {source}. Restore it from a backup: docs/operating.md")]
    DamagedDatabase { path: PathBuf, source: Box<StorageError> },
    #[error(
        "the file {key} has {found} bytes, and {expected} were stored: the disk or the bucket lost some. Restore it from a \
         backup"
    )]
    DamagedFile { key: String, found: u64, expected: u64 },
    #[error(
        "the database at {host}, port {port}, cannot be reached: {}. Start it, or correct the database URL",
        words::of_driver(.source)
    )]
    NoDatabase { host: String, port: u16, source: sqlx::Error },
    #[error(
        "the database URL cannot be used: {why}. It is postgres://USER:PASSWORD@HOST/DATABASE (--database-url)"
    )]
    DatabaseUrl { why: String },
    #[error("database: {}", words::of_driver(.0))]
    Database(#[from] sqlx::Error),
    /// The commit was sent; its effect is unknown.
    #[error("database, while it committed: {}", words::of_driver(.0))]
    Unsettled(#[source] sqlx::Error),
    #[error("writes to the database failed in the last seconds")]
    WritesFail { is_full: bool },
    #[error("it did not answer within {limit_s} s")]
    Silent { limit_s: f64 },
    #[error("database tables: {}", words::of_migration(.0))]
    Migrate(#[from] MigrateError),
    #[error("blob store: {0}")]
    Blobs(#[from] object_store::Error),
    #[error(
        "the blob store has at least {blobs} files, and the database names none of them: the database was lost, or one of \
         the two is the wrong one. Restore the database, or correct the data folder, the database URL or the bucket. To \
         start with an empty service, delete these files: `viola clean --remove-unknown --store-id {store} \
         --older-than-seconds 0`"
    )]
    LostDatabase { blobs: usize, store: Uuid },
    #[error(
        "the files in {place} belong to another database: its file viola-store-id has the id {found}, and {}. Correct the \
         data folder, the bucket, its prefix or the database URL. If the two belong together, {}",
        words::of_own_store(.own.as_ref()), words::of_same_store(.own.as_ref())
    )]
    OtherStore { place: String, own: Option<Uuid>, found: Uuid },
    #[error(
        "{place} has no file viola-store-id with the id {own}, so the files that the database names are in another place. \
         Correct the data folder, the bucket, its prefix or the database URL. If this file alone was lost, write the id into \
         it"
    )]
    UnmarkedStore { place: String, own: Uuid },
    #[error(
        "{place} has none of the files that the database names. Correct the data folder, the bucket, its prefix or the \
         database URL, or restore the files from a backup"
    )]
    StoreWithoutFiles { place: String },
    #[error(
        "the file viola-store-id in {place} has no id: restore it from a backup, or delete it and start again"
    )]
    DamagedStoreId { place: String },
    #[error("{place} is not the store {asked}; the refusal to start names its id")]
    NotThisStore { place: String, asked: Uuid },
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
    #[error(
        "the database has secrets of webhooks that are sealed with another key: give this process the file of the right \
         one with --secrets-key-file"
    )]
    SecretsKey,
    #[error(
        "the tenant has {used} bytes here, of at most {limit}, and {more} more do not fit; remove clips or homes, or ask for \
         more room"
    )]
    TenantFull { used: u64, limit: u64, more: u64 },
    #[error("the tenant has no home of this id; PUT /v1/homes/{{home}} makes one")]
    NoSuchHome,
    #[error("the home has no clip of this id; it may have been removed")]
    NoSuchClip,
    #[error(
        "the home has no such LiDAR map; GET /v1/homes/{{home}}/lidar-maps lists those that it has, and PUT .../lidar-map sends one"
    )]
    NoLidarMap,
    #[error("the home has LiDAR maps of {MAX_LEVELS} levels already, which is the maximum")]
    TooManyLevels,
    #[error(
        "this is the only level of the home; put the LiDAR map of another level first, or remove the home"
    )]
    LastLevel,
    #[error("the {what} was changed since it was read; read it again")]
    Changed { what: &'static str },
    #[error("the tenant has no webhook of this id; GET /v1/webhooks lists them")]
    NoSuchWebhook,
    #[error("the webhook has no delivery of this id; its log lists those that are kept")]
    NoSuchDelivery,
    #[error(
        "the feed no longer has all removals since this cursor; begin again without `after`, and delete all that the new \
         reading does not name"
    )]
    CursorExpired,
}

impl StorageError {
    /// Returns whether a retry may succeed: the database or the store was unreachable, gave way to another
    /// transaction, or met a fault of the system.
    pub fn is_transient(&self) -> bool {
        match self {
            StorageError::Database(error) => {
                !matches!(DatabaseFault::of(error), DatabaseFault::Lasting | DatabaseFault::Damaged)
            }
            StorageError::Unsettled(_)
            | StorageError::WritesFail { .. }
            | StorageError::Silent { .. }
            | StorageError::NoDatabase { .. } => true,
            StorageError::Blobs(object_store::Error::NotFound { .. }) => false,
            StorageError::Blobs(_) => true,
            // Until somebody gives the right back.
            StorageError::File { source, .. } => {
                use std::io::ErrorKind::{PermissionDenied, ReadOnlyFilesystem};
                matches!(source.kind(), PermissionDenied | ReadOnlyFilesystem)
            }
            _ => false,
        }
    }

    /// Returns whether a change may have taken effect despite the error.
    pub(super) fn is_unsettled(&self) -> bool {
        matches!(self, StorageError::Unsettled(_))
    }

    /// Returns whether SQLite found that its file is damaged, or is no database.
    pub(super) fn is_damage(&self) -> bool {
        let error = match self {
            StorageError::Database(error)
            | StorageError::Migrate(
                MigrateError::Execute(error) | MigrateError::ExecuteMigration(error, _),
            ) => error,
            _ => return false,
        };
        DatabaseFault::of(error) == DatabaseFault::Damaged
    }

    /// Returns whether the blob store did not answer in time.
    pub(super) fn is_timeout(&self) -> bool {
        let StorageError::Blobs(object_store::Error::Generic { source, .. }) = self else { return false };
        let error = source.downcast_ref::<std::io::Error>();
        error.is_some_and(|error| error.kind() == std::io::ErrorKind::TimedOut)
    }

    /// Returns whether the disk is full, or this process reached a limit on its disk use.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_that_cannot_be_written_may_be_writable_later() {
        use std::io::ErrorKind as K;
        for (kind, is_transient) in
            [(K::PermissionDenied, true), (K::ReadOnlyFilesystem, true), (K::NotFound, false)]
        {
            let error = StorageError::File { path: "blobs".into(), source: kind.into() };
            assert_eq!(error.is_transient(), is_transient, "{error}");
        }
    }

    #[test]
    fn errors_of_the_driver_are_told_in_words() {
        let no_database = |source| StorageError::NoDatabase { host: "db".to_owned(), port: 5432, source };
        let table: [(StorageError, &[&str]); 6] = [
            (sqlx::Error::PoolTimedOut.into(), &["no connection became free", "--database-connections"]),
            (StorageError::Unsettled(sqlx::Error::PoolTimedOut), &["while it committed", "does not answer"]),
            (no_database(sqlx::Error::PoolTimedOut), &["db, port 5432", "does not answer", "Start it"]),
            (sqlx::Error::PoolClosed.into(), &["the process ends"]),
            (MigrateError::VersionMismatch(7).into(), &["migration 7", "another build", "backup"]),
            (MigrateError::Dirty(7).into(), &["migration 7", "halfway", "backup"]),
        ];
        for (error, parts) in table {
            let words = error.to_string();
            assert!(parts.iter().all(|part| words.contains(part)), "{words}");
            assert!(!words.contains("pool"), "{words}");
        }
    }
}
