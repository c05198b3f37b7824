//! Blobs as local files, for readers that seek or need a path.

use super::place::Place;
use super::{Blobs, StorageError};
use futures::TryStreamExt;
use object_store::ObjectStoreExt;
use object_store::path::Path as Key;
use std::ops::Deref;
use std::path::{Path, PathBuf};
use tempfile::{NamedTempFile, TempPath};
use tokio::fs::File;
use tokio::io::AsyncWriteExt;

/// A blob as a local file, to be read and not changed. It may be a copy, which is removed with this value.
#[derive(Debug)]
pub struct LocalFile(Inner);

#[derive(Debug)]
enum Inner {
    Blob(PathBuf),
    Copy(TempPath),
}

impl Deref for LocalFile {
    type Target = Path;

    fn deref(&self) -> &Path {
        match &self.0 {
            Inner::Blob(path) => path,
            Inner::Copy(path) => path,
        }
    }
}

impl AsRef<Path> for LocalFile {
    fn as_ref(&self) -> &Path {
        self
    }
}

impl Blobs {
    /// Returns the blob as a file; `object_store::Error::NotFound` if it was removed.
    pub async fn local_file(&self, key: &str) -> Result<LocalFile, StorageError> {
        match &self.place {
            Place::Folder { root, .. } => {
                self.store.head(&Key::from(key)).await?;
                Ok(LocalFile(Inner::Blob(root.join(key))))
            }
            Place::S3 { .. } => {
                let mut blob = self.begin_to_read(key).await?;
                let error = |source| StorageError::File { path: self.incoming.clone(), source };
                let (file, path) = NamedTempFile::new_in(&self.incoming).map_err(error)?.into_parts();
                let mut file = File::from_std(file);
                while let Some(bytes) = blob.stream.try_next().await? {
                    file.write_all(&bytes).await.map_err(error)?;
                }
                file.flush().await.map_err(error)?;
                Ok(LocalFile(Inner::Copy(path)))
            }
        }
    }
}
