//! Places of blobs.

use super::StorageError;
use super::limits::{Limits, within};
use crate::tls::use_ring;
use object_store::ObjectStore;
use object_store::aws::{AmazonS3, AmazonS3Builder};
use object_store::list::{PaginatedListOptions, PaginatedListStore};
use object_store::local::LocalFileSystem;
use object_store::path::Path as Key;
use object_store::prefix::PrefixStore;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use url::Url;

/// Place of a server's blobs.
#[derive(Debug, Clone)]
pub enum BlobPlace {
    /// Several servers can share a folder on a file system that they all mount.
    Folder(PathBuf),
    S3(S3Params),
}

/// A bucket on S3 or on a compatible store.
///
/// All objects below the prefix belong to one database: a sweep removes those that none of its rows names.
/// The bucket should have a lifecycle rule that aborts incomplete multipart uploads after a few days: a
/// server aborts its own if they fail, but a killed server cannot.
///
/// The access key must allow `s3:GetObject`, `s3:PutObject`, `s3:DeleteObject`, `s3:AbortMultipartUpload` and
/// `s3:ListBucket`, and the store must support `DeleteObjects`.
#[derive(Clone)]
pub struct S3Params {
    pub bucket: String,
    /// Prefix of every key; may be empty.
    pub prefix: String,
    /// A URL such as `https://s3.example.com`, without the bucket. `None` for Amazon's own in the region.
    pub endpoint: Option<String>,
    pub region: String,
    pub access_key_id: String,
    pub secret_access_key: String,
    /// True if the endpoint may be reached without encryption.
    pub allow_http: bool,
    /// True if the bucket is in the path of a request, and not in its host name.
    pub path_style: bool,
}

impl fmt::Debug for S3Params {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let S3Params { bucket, prefix, endpoint, region, allow_http, path_style, .. } = self;
        formatter
            .debug_struct("S3Params")
            .field("bucket", bucket)
            .field("prefix", prefix)
            .field("endpoint", &endpoint.as_deref().map(without_user))
            .field("region", region)
            .field("allow_http", allow_http)
            .field("path_style", path_style)
            .finish_non_exhaustive()
    }
}

/// Hides an endpoint with a user name or password: it is refused, but printed before that.
fn without_user(endpoint: &str) -> &str {
    if endpoint.contains('@') { "(with a password)" } else { endpoint }
}

impl S3Params {
    /// Returns the endpoint for the client: with the bucket in the host unless it is in the path.
    fn address(&self) -> Result<Option<String>, String> {
        let Some(endpoint) = &self.endpoint else { return Ok(None) };
        let unusable = |why: &str| format!("the endpoint {}: {why}", without_user(endpoint));
        let mut url = Url::parse(endpoint).map_err(|error| unusable(&error.to_string()))?;
        if !url.username().is_empty() || url.password().is_some() {
            return Err(unusable("it must not hold a user name or a password"));
        }
        match url.scheme() {
            "https" => {}
            "http" if self.allow_http => {}
            "http" => return Err(unusable("it is not encrypted, and that was not allowed")),
            _ => return Err(unusable("it must begin with https://")),
        }
        if !self.path_style {
            let host = url.host_str().ok_or_else(|| unusable("it has no host"))?;
            let host = format!("{}.{host}", self.bucket);
            url.set_host(Some(&host)).map_err(|error| unusable(&error.to_string()))?;
        }
        Ok(Some(url.as_str().trim_end_matches('/').to_owned()))
    }
}

pub(super) enum Place {
    Folder {
        root: PathBuf,
        /// Key prefix of incoming files, if they lie in the same folder.
        incoming: Option<Key>,
    },
    S3 {
        client: AmazonS3,
        prefix: Key,
    },
}

type Opened = (Arc<dyn ObjectStore>, Place);

/// Opens a folder. Both folders exist, and their paths are canonical.
pub(super) fn open_folder(root: &Path, incoming: &Path) -> Result<Opened, StorageError> {
    let store = LocalFileSystem::new_with_prefix(root)?.with_fsync(true).with_automatic_cleanup(true);
    if root.starts_with(incoming) {
        let why = "blobs would lie among files that are still arriving";
        let source = std::io::Error::new(std::io::ErrorKind::InvalidInput, why);
        return Err(StorageError::File { path: incoming.to_owned(), source });
    }
    let inside = incoming.strip_prefix(root).ok().and_then(Path::to_str);
    let incoming = inside.map(Key::parse).transpose().map_err(object_store::Error::from)?;
    Ok((Arc::new(store), Place::Folder { root: root.to_owned(), incoming }))
}

pub(super) fn open_s3(params: &S3Params, limits: &Limits) -> Result<Opened, StorageError> {
    use_ring();
    let unusable = |why: String| object_store::Error::Generic { store: "S3", source: why.into() };
    // Without credentials the client would look for some elsewhere.
    for (name, value) in [
        ("bucket", &params.bucket),
        ("region", &params.region),
        ("access key id", &params.access_key_id),
        ("secret access key", &params.secret_access_key),
    ] {
        if value.is_empty() {
            return Err(unusable(format!("the {name} is missing")).into());
        }
    }
    let mut builder = AmazonS3Builder::new()
        .with_bucket_name(&params.bucket)
        .with_region(&params.region)
        .with_access_key_id(&params.access_key_id)
        .with_secret_access_key(&params.secret_access_key)
        .with_virtual_hosted_style_request(!params.path_style)
        .with_client_options(limits.client_options(params.allow_http))
        .with_retry(limits.retry_config());
    if let Some(address) = params.address().map_err(unusable)? {
        builder = builder.with_endpoint(address);
    }
    let client = builder.build()?;
    let prefix = Key::parse(&params.prefix).map_err(object_store::Error::from)?;
    let store = PrefixStore::new(client.clone(), prefix.clone());
    Ok((Arc::new(store), Place::S3 { client, prefix }))
}

impl super::Blobs {
    /// Checks that the place can be used: its folders can be written, a bucket can be listed. Returns the
    /// free bytes of the fullest disk that is written to.
    pub async fn ready(&self) -> Result<u64, StorageError> {
        let folders = self.folders();
        let listed = match &self.place {
            Place::Folder { .. } => None,
            Place::S3 { client, prefix } => {
                let options = PaginatedListOptions { max_keys: Some(1), ..Default::default() };
                Some(client.list_paginated(Some(prefix.as_ref()), options))
            }
        };
        let work = async {
            let free = tokio::task::spawn_blocking(move || {
                let written = try_write(&folders);
                written.and_then(|()| free_bytes(&folders))
            });
            let free = free.await?;
            if let Some(listed) = listed {
                listed.await?;
            }
            Ok(free)
        };
        within(self.limits.ready, work).await?
    }

    /// Returns the free bytes of the fullest disk that is written to.
    pub async fn free_bytes(&self) -> Result<u64, StorageError> {
        let folders = self.folders();
        let free = tokio::task::spawn_blocking(move || free_bytes(&folders));
        free.await.map_err(object_store::Error::from)?
    }

    /// Returns the folders that are written to.
    fn folders(&self) -> Vec<PathBuf> {
        let mut folders = vec![self.incoming.clone()];
        if let Place::Folder { root, .. } = &self.place {
            folders.push(root.clone());
        }
        folders
    }
}

fn try_write(folders: &[PathBuf]) -> Result<(), StorageError> {
    for folder in folders {
        let file = tempfile::tempfile_in(folder);
        file.map_err(|source| StorageError::File { path: folder.clone(), source })?;
    }
    Ok(())
}

fn free_bytes(folders: &[PathBuf]) -> Result<u64, StorageError> {
    let mut least = u64::MAX;
    for folder in folders {
        let disk = rustix::fs::statvfs(folder);
        let disk = disk.map_err(|error| StorageError::File { path: folder.clone(), source: error.into() })?;
        least = least.min(disk.f_bavail.saturating_mul(disk.f_frsize));
    }
    Ok(least)
}
