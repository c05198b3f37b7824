//! What interrupted writes left behind.

use super::place::Place;
use super::{Blobs, StorageError, tried};
use futures::stream::BoxStream;
use futures::{StreamExt, TryStreamExt};
use jiff::Timestamp;
use object_store::aws::AmazonS3;
use object_store::list::{PaginatedListOptions, PaginatedListStore};
use object_store::path::Path as Key;
use std::collections::HashSet;
use std::io;
use std::path::{Path, PathBuf};
use tokio::sync::mpsc;

/// Blobs that are looked up at a time; S3 gives and removes so many in one request.
const BATCH: usize = 1000;

/// Something found where blobs lie, and when it was last written.
enum Found {
    Blob {
        key: String,
        modified: Timestamp,
    },
    /// A file that is arriving or being written, or a copy. No key leads to it.
    Leftover {
        path: PathBuf,
        modified: Timestamp,
    },
}

impl Blobs {
    /// Removes blobs that no row names, and files that never became one, if they were last written before `older_than`.
    /// `named` tells which of some keys rows name. Gives how many were removed.
    ///
    /// Sound while others write as long as whatever was written before `older_than` has its row by now or never will:
    /// more time has to have passed since than from the last byte of an upload to its row, or than a job reads a copy
    /// of its clip.
    ///
    /// Uploads in parts that a killed server left on S3 cannot be listed with this client: the bucket's lifecycle rule
    /// ends those.
    pub async fn sweep<Named>(
        &self,
        older_than: Timestamp,
        named: impl Fn(Vec<String>) -> Named,
    ) -> Result<u64, StorageError>
    where
        Named: Future<Output = Result<HashSet<String>, StorageError>>,
    {
        let mut removed = 0;
        let mut keys = Vec::new();
        let mut listing = self.listing();
        while let Some(found) = listing.try_next().await? {
            match found {
                Found::Blob { key, modified } if modified < older_than => keys.push(key),
                Found::Leftover { path, modified } if modified < older_than => {
                    removed += remove_leftover(path).await?;
                }
                _ => {}
            }
            if keys.len() == BATCH {
                removed += self.sweep_batch(std::mem::take(&mut keys), &named).await?;
            }
        }
        Ok(removed + self.sweep_batch(keys, &named).await?)
    }

    async fn sweep_batch<Named>(
        &self,
        mut keys: Vec<String>,
        named: &impl Fn(Vec<String>) -> Named,
    ) -> Result<u64, StorageError>
    where
        Named: Future<Output = Result<HashSet<String>, StorageError>>,
    {
        if keys.is_empty() {
            return Ok(0);
        }
        let named = named(keys.clone()).await?;
        keys.retain(|key| !named.contains(key));
        for key in &keys {
            tracing::info!(key, "removing a blob that no row names");
        }
        let tries = tried("removing blobs", || self.remove(&keys));
        self.limits.bound(tries).await?;
        Ok(keys.len() as u64)
    }

    /// All there is, also what is arriving.
    fn listing(&self) -> BoxStream<'static, Result<Found, StorageError>> {
        match &self.place {
            Place::Folder { root, incoming } => {
                let outside = match incoming {
                    Some(_) => futures::stream::empty().boxed(),
                    None => walk(&self.incoming, Some(Key::default())),
                };
                walk(root, incoming.clone()).chain(outside).boxed()
            }
            Place::S3 { client, prefix } => {
                let (client, prefix, limits) = (client.clone(), prefix.clone(), self.limits);
                let pages = futures::stream::try_unfold(Some(None), move |page| {
                    let (client, prefix) = (client.clone(), prefix.clone());
                    async move {
                        let Some(token) = page else { return Ok(None) };
                        let (found, next) = limits.bound(list_page(&client, &prefix, token)).await?;
                        let found = futures::stream::iter(found.into_iter().map(Ok));
                        Ok::<_, StorageError>(Some((found, next.map(Some))))
                    }
                });
                pages.try_flatten().chain(walk(&self.incoming, Some(Key::default()))).boxed()
            }
        }
    }

    /// Keys of all there is; files that are arriving have one too.
    #[cfg(test)]
    pub async fn keys(&self) -> Result<Vec<String>, StorageError> {
        let key = |found| match found {
            Found::Blob { key, .. } => key,
            Found::Leftover { path, .. } => path.to_string_lossy().into_owned(),
        };
        self.listing().map_ok(key).try_collect().await
    }
}

/// What a page of a bucket's list has below a prefix, and where the next begins.
async fn list_page(
    client: &AmazonS3,
    prefix: &Key,
    token: Option<String>,
) -> object_store::Result<(Vec<Found>, Option<String>)> {
    let folder = if prefix.as_ref().is_empty() { String::new() } else { format!("{prefix}/") };
    let page = tried("listing blobs", || {
        let options = PaginatedListOptions { page_token: token.clone(), ..Default::default() };
        client.list_paginated(Some(&folder), options)
    });
    let page = page.await?;
    let found = page.result.objects.into_iter().filter_map(|object| {
        let key = object.location.as_ref().strip_prefix(&folder)?.to_owned();
        // Never swept if its time is none.
        let modified = Timestamp::from_millisecond(object.last_modified.timestamp_millis());
        Some(Found::Blob { key, modified: modified.unwrap_or(Timestamp::MAX) })
    });
    Ok((found.collect(), page.page_token))
}

/// Another may have removed it, or kept it.
async fn remove_leftover(path: PathBuf) -> Result<u64, StorageError> {
    match tokio::fs::remove_file(&path).await {
        Ok(()) => {
            tracing::info!(path = %path.display(), "removed what an interrupted write left");
            Ok(1)
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(0),
        Err(source) => Err(StorageError::File { path, source }),
    }
}

/// The files below a folder, those below `leftovers` in it as such. The store's own listing would hide those that are
/// being written.
fn walk(root: &Path, leftovers: Option<Key>) -> BoxStream<'static, Result<Found, StorageError>> {
    let (to, from) = mpsc::channel(2);
    let root = root.to_owned();
    tokio::task::spawn_blocking(move || {
        let mut batch = Vec::new();
        let mut folders = vec![root.clone()];
        while let Some(folder) = folders.pop() {
            let walked = walk_folder(&folder, &mut folders, &mut |path, modified| {
                batch.push(Ok(found(&root, path, modified, leftovers.as_ref())));
                // Whoever listens no longer has ended the walk.
                batch.len() < BATCH || to.blocking_send(std::mem::take(&mut batch)).is_ok()
            });
            match walked {
                Ok(true) => {}
                Ok(false) => return,
                Err(source) => {
                    batch.push(Err(StorageError::File { path: folder, source }));
                    break;
                }
            }
        }
        // The listener may be gone.
        let _ = to.blocking_send(batch);
    });
    let batches = futures::stream::unfold(from, |mut from| async move {
        from.recv().await.map(|batch: Vec<_>| (futures::stream::iter(batch), from))
    });
    batches.flatten().boxed()
}

/// Gives the files of one folder to `each` until it has enough; false then. What goes while it is looked at is left
/// out.
fn walk_folder(
    folder: &Path,
    folders: &mut Vec<PathBuf>,
    each: &mut impl FnMut(PathBuf, Timestamp) -> bool,
) -> io::Result<bool> {
    let gone = |error: &io::Error| error.kind() == io::ErrorKind::NotFound;
    let entries = match std::fs::read_dir(folder) {
        Err(error) if gone(&error) => return Ok(true),
        entries => entries?,
    };
    for entry in entries {
        let entry = entry?;
        let metadata = match entry.metadata() {
            Err(error) if gone(&error) => continue,
            metadata => metadata?,
        };
        if metadata.is_dir() {
            folders.push(entry.path());
            continue;
        }
        // Never swept if its time is none.
        let modified = Timestamp::try_from(metadata.modified()?).unwrap_or(Timestamp::MAX);
        if !each(entry.path(), modified) {
            return Ok(false);
        }
    }
    Ok(true)
}

fn found(root: &Path, path: PathBuf, modified: Timestamp, leftovers: Option<&Key>) -> Found {
    let key = path.strip_prefix(root).ok().and_then(Path::to_str).and_then(|key| Key::parse(key).ok());
    match key {
        Some(key) if !being_written(&key) && !leftovers.is_some_and(|folder| key.prefix_matches(folder)) => {
            Found::Blob { key: key.to_string(), modified }
        }
        _ => Found::Leftover { path, modified },
    }
}

/// Whether a name is one that the store gives to a file until it is whole: `file#1` for `file`.
fn being_written(key: &Key) -> bool {
    let number = key.filename().and_then(|name| name.split_once('#')).map(|(_, number)| number);
    number.is_some_and(|number| !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit()))
}
