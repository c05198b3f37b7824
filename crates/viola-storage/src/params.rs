//! Parameters of storage: the data folder, the database, the bucket.

use super::blobs::S3Params;
use super::seal::SecretsKey;
use std::fmt;
use std::path::{Path, PathBuf};

/// The places of a service's records and blobs.
#[derive(Debug, Clone, Default)]
pub struct StorageParams {
    /// The data folder, for incoming files and for everything without another place.
    pub data: PathBuf,
    /// PostgreSQL in place of a file in the data folder.
    pub postgres: Option<PostgresParams>,
    /// A bucket in place of files in the data folder.
    pub s3: Option<S3Params>,
    /// Seals the secrets of webhooks; none keeps them in plain text.
    pub secrets_key: Option<SecretsKey>,
    pub unpack: UnpackParams,
}

/// Maximum number of bytes that are unpacked at once. A file that exceeds a limit alone is refused, otherwise it must wait.
#[derive(Debug, Clone, Copy)]
pub struct UnpackParams {
    /// Of one process.
    pub process_bytes: u64,
    /// Of one tenant in one process.
    pub tenant_bytes: u64,
}

impl Default for UnpackParams {
    fn default() -> UnpackParams {
        UnpackParams { process_bytes: 16 << 30, tenant_bytes: 8 << 30 }
    }
}

/// A database that many processes share.
#[derive(Clone)]
pub struct PostgresParams {
    /// URL as for libpq, with the password.
    pub url: String,
    /// Most connections of this process.
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
    /// Returns the params of SQLite and files in one folder.
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
