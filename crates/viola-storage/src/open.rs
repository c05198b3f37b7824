//! The storage of a service: opening and closing it.

use super::blobs::{BlobPlace, Blobs};
use super::database::{Connections, Database, query};
use super::error::StorageError;
use super::folder_lock::FolderLock;
use super::incoming::Incoming;
use super::keys::KeyUses;
use super::params::StorageParams;
use super::scratch::Unpacking;
use super::seal::SecretsKey;
use jiff::Timestamp;
use std::io;
use std::os::unix::fs::DirBuilderExt;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use tempfile::TempDir;

/// Name of the SQLite file in the data folder.
const SQLITE_FILE: &str = "viola.sqlite";

/// Opens SQLite; an error names a damaged file.
async fn open_sqlite(file: &Path) -> Result<Database, StorageError> {
    let opened = Database::open_sqlite(file).await;
    opened.map_err(|error| match error.is_damage() {
        true => StorageError::DamagedDatabase { path: file.to_owned(), source: error.into() },
        false => error,
    })
}

/// Records and blobs of a service.
pub struct Storage {
    pub(super) database: Database,
    pub(super) blobs: Blobs,
    /// Lock of the data folder: exclusive if this is the only process that serves, else of the incoming files.
    pub(super) lock: Option<FolderLock>,
    pub(super) secrets_key: Option<SecretsKey>,
    pub(super) unpacking: Unpacking,
    pub(super) key_uses: KeyUses,
    /// True once the store was found to be this database's.
    pub(super) is_store_checked: AtomicBool,
}

impl Storage {
    /// Opens the storage, creates missing parts, and migrates the tables.
    pub async fn migrate(params: &StorageParams) -> Result<Storage, StorageError> {
        Storage::connect(params, true).await
    }

    async fn connect(params: &StorageParams, is_alone: bool) -> Result<Storage, StorageError> {
        let file_error = |source: io::Error| match source.kind() {
            io::ErrorKind::ReadOnlyFilesystem | io::ErrorKind::PermissionDenied => {
                StorageError::ReadOnly { path: params.data.clone(), source }
            }
            io::ErrorKind::AlreadyExists | io::ErrorKind::NotADirectory => {
                StorageError::NotAFolder { path: params.data.clone() }
            }
            _ => StorageError::File { path: params.data.clone(), source },
        };
        // Recordings of homes are private: no other user of this machine may read them.
        std::fs::DirBuilder::new().recursive(true).mode(0o700).create(&params.data).map_err(file_error)?;
        let folder = &params.data.canonicalize().map_err(file_error)?;
        tempfile::tempfile_in(folder).map_err(file_error)?;
        let (database, lock) = match &params.postgres {
            Some(postgres) => (Database::open_postgres(&postgres.url, postgres.connections).await?, None),
            None => {
                let lock = is_alone.then(|| FolderLock::take(folder)).transpose()?;
                (open_sqlite(&folder.join(SQLITE_FILE)).await?, lock)
            }
        };
        let (place, incoming) = match &params.s3 {
            Some(s3) => (BlobPlace::S3(s3.clone()), folder.join("incoming")),
            None => (BlobPlace::Folder(folder.join("blobs")), folder.join("blobs/incoming")),
        };
        let blobs = Blobs::open(&place, &incoming)?;
        let (secrets_key, unpacking) = (params.secrets_key.clone(), Unpacking::new(params.unpack));
        Ok(Storage {
            database,
            blobs,
            lock,
            secrets_key,
            unpacking,
            key_uses: KeyUses::default(),
            is_store_checked: AtomicBool::new(false),
        })
    }

    /// Opens the storage without the lock, beside a server that may be running. Refuses a data folder without a service, since
    /// its name may be misspelt.
    pub async fn administer(params: &StorageParams) -> Result<Storage, StorageError> {
        let is_missing = || matches!(params.data.join(SQLITE_FILE).try_exists(), Ok(false));
        if params.postgres.is_none() && is_missing() {
            return Err(StorageError::NoService { path: params.data.clone() });
        }
        Storage::connect(params, false).await
    }

    /// Opens the storage as [`Storage::administer`] does, and creates missing parts.
    pub async fn administer_or_create(params: &StorageParams) -> Result<Storage, StorageError> {
        Storage::connect(params, false).await
    }

    /// Returns whether several processes may serve and work with the database at once.
    pub fn is_shared(&self) -> bool {
        self.database.is_shared()
    }

    /// Returns the name of the database system.
    pub fn database_name(&self) -> &'static str {
        if self.is_shared() { "postgresql" } else { "sqlite" }
    }

    /// Returns the time of the service, for all times that rows keep. On PostgreSQL it is the database's, so that processes on
    /// machines with wrong clocks agree on leases and due times.
    pub fn now(&self) -> Timestamp {
        self.database.now()
    }

    /// Reads the clock of PostgreSQL if the last reading is a minute old, or if this machine slept or its clock was set since.
    /// To be called before leases of other processes are compared with [`Storage::now`].
    pub async fn follow_clock(&self) -> Result<(), StorageError> {
        self.database.follow_clock().await
    }

    /// Checks that the database can be read, by one row.
    pub async fn check_reads(&self) -> Result<(), StorageError> {
        let row = query("SELECT last_seq FROM change_counter");
        row.fetch_one(&mut self.database.reader().await?).await?;
        Ok(())
    }

    /// Checks that the database can write.
    pub async fn check_writes(&self) -> Result<(), StorageError> {
        self.database.check_writes().await
    }

    /// Closes all connections after their current work.
    pub async fn close(&self) {
        self.database.close().await;
    }

    /// Begins to receive a file.
    pub fn incoming(&self) -> Result<Incoming, StorageError> {
        self.blobs.incoming()
    }

    /// Checks that blobs can be written and read; returns the bytes that are free for incoming files. Refuses a store that
    /// did not answer at the start and is not this database's.
    pub async fn blobs_ready(&self) -> Result<u64, StorageError> {
        self.require_store().await?;
        self.blobs.ready().await
    }

    /// Returns the free bytes of the fullest disk that this process writes files to.
    pub async fn free_bytes(&self) -> Result<u64, StorageError> {
        self.blobs.free_bytes().await
    }

    /// Returns the state of this process's connections to the database.
    pub fn connections(&self) -> Connections {
        self.database.connections()
    }

    /// Creates a local folder for the files of one job. Dropping the value removes it; a sweep removes the
    /// folders of killed processes.
    pub fn work_folder(&self) -> Result<TempDir, StorageError> {
        let folder = self.blobs.incoming_folder();
        tempfile::Builder::new()
            .prefix("job-")
            .tempdir_in(folder)
            .map_err(|source| StorageError::File { path: folder.to_owned(), source })
    }

    /// Creates a local file without a name, which ends with its last handle.
    pub fn scratch_file(&self) -> Result<std::fs::File, StorageError> {
        let folder = self.blobs.incoming_folder();
        tempfile::tempfile_in(folder).map_err(|source| StorageError::File { path: folder.to_owned(), source })
    }
}
