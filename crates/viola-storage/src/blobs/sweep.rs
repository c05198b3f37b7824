//! Leftovers of interrupted writes.

use super::identity::STORE_ID;
use super::place::Place;
use super::{Blobs, StorageError, tried};
use futures::stream::BoxStream;
use futures::{StreamExt, TryStreamExt};
use jiff::Timestamp;
use object_store::aws::AmazonS3;
use object_store::list::{PaginatedListOptions, PaginatedListStore};
use object_store::path::Path as Key;
use std::collections::HashSet;
use std::fs::{DirEntry, ReadDir};
use std::io;
use std::path::{Path, PathBuf};

/// Blobs that are looked up at a time; S3 lists and removes at most this many in one request.
const BATCH: usize = 1000;

/// Most keys that one listing keeps in memory. The rest is left to the next one.
const MAX_KEYS: usize = 100_000;

/// Folder of a file system's own checks, at the root of its disk. Only the system's administrator may read it.
const LOST_AND_FOUND: &str = "lost+found";

/// The blobs that no row names.
#[derive(Debug, Default)]
pub struct Unnamed {
    pub keys: Vec<String>,
    /// Number of unnamed blobs beyond `keys`.
    pub more: u64,
    /// Number of blobs that rows name.
    pub named: u64,
    /// Number of files that never became a blob; they have been removed.
    pub leftovers: u64,
}

/// An entry of a listing, with the time of its last write.
enum Found {
    Blob {
        key: String,
        modified: Timestamp,
    },
    /// A file that is arriving or being written, or a copy. It has no key.
    Leftover {
        path: PathBuf,
        modified: Timestamp,
    },
}

impl Found {
    /// Returns whether it is the file with the store's id.
    fn is_store_id(&self) -> bool {
        matches!(self, Found::Blob { key, .. } if key == STORE_ID)
    }
}

impl Unnamed {
    fn add(&mut self, keys: &[String], named: &HashSet<String>) {
        for key in keys {
            if named.contains(key) {
                self.named += 1;
            } else if self.keys.len() < MAX_KEYS {
                self.keys.push(key.clone());
            } else {
                self.more += 1;
            }
        }
    }
}

impl Blobs {
    /// Removes files that never became a blob, and returns the blobs that no row names, if they were last
    /// written before `older_than`. `named` returns those of some keys that rows name.
    ///
    /// Safe beside concurrent writers if every file written before `older_than` has its row by now or never
    /// will. The time since must be longer than from the last byte of an upload to its row, and longer than a
    /// job reads a copy of its clip.
    ///
    /// This client cannot list multipart uploads that a killed server left on S3: the bucket's lifecycle rule
    /// aborts those.
    pub async fn unnamed<Named>(
        &self,
        older_than: Timestamp,
        named: impl Fn(Vec<String>) -> Named,
    ) -> Result<Unnamed, StorageError>
    where
        Named: Future<Output = Result<HashSet<String>, StorageError>>,
    {
        let mut unnamed = Unnamed::default();
        let mut keys = Vec::new();
        let mut listing = self.listing();
        while let Some(found) = listing.try_next().await? {
            match found {
                Found::Blob { key, modified } if modified < older_than => keys.push(key),
                Found::Leftover { path, modified } if modified < older_than => {
                    unnamed.leftovers += remove_leftover(path).await?;
                }
                _ => {}
            }
            if keys.len() == BATCH {
                let batch = std::mem::take(&mut keys);
                unnamed.add(&batch, &named(batch.clone()).await?);
            }
        }
        if !keys.is_empty() {
            unnamed.add(&keys, &named(keys.clone()).await?);
        }
        Ok(unnamed)
    }

    /// Removes the blobs that [`Blobs::unnamed`] found.
    pub async fn sweep(&self, unnamed: &Unnamed) -> Result<(), StorageError> {
        for keys in unnamed.keys.chunks(BATCH) {
            for key in keys {
                tracing::info!(key, "removing a blob that no row names");
            }
            self.remove_recorded(keys).await?;
        }
        Ok(())
    }

    /// Returns the keys of at most [`BATCH`] blobs.
    pub async fn sample(&self) -> Result<Vec<String>, StorageError> {
        let key = |found| match found {
            Found::Blob { key, .. } => Some(key),
            Found::Leftover { .. } => None,
        };
        let keys = self.listing().try_filter_map(|found| std::future::ready(Ok(key(found))));
        keys.take(BATCH).try_collect().await
    }

    /// Lists all blobs and leftovers.
    fn listing(&self) -> BoxStream<'static, Result<Found, StorageError>> {
        self.all_files().try_filter(|found| std::future::ready(!found.is_store_id())).boxed()
    }

    fn all_files(&self) -> BoxStream<'static, Result<Found, StorageError>> {
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

    /// Returns the keys of all blobs and the paths of all leftovers.
    #[cfg(test)]
    pub async fn keys(&self) -> Result<Vec<String>, StorageError> {
        let key = |found| match found {
            Found::Blob { key, .. } => key,
            Found::Leftover { path, .. } => path.to_string_lossy().into_owned(),
        };
        self.listing().map_ok(key).try_collect().await
    }
}

/// Returns a page of a bucket's list below a prefix, and the token of the next page.
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
        // Without a valid time it is never swept.
        let modified = Timestamp::from_millisecond(object.last_modified.timestamp_millis());
        Some(Found::Blob { key, modified: modified.unwrap_or(Timestamp::MAX) })
    });
    Ok((found.collect(), page.page_token))
}

impl Blobs {
    /// Empties the folder of incoming files, which no process may use. Blocks.
    pub fn empty_incoming(&self) -> io::Result<()> {
        for entry in std::fs::read_dir(&self.incoming)? {
            let entry = entry?;
            let path = entry.path();
            tracing::info!(path = %path.display(), "removing what an interrupted process left");
            if entry.file_type()?.is_dir() {
                std::fs::remove_dir_all(path)?;
            } else {
                std::fs::remove_file(path)?;
            }
        }
        Ok(())
    }
}

/// Removes a leftover. Another process may have removed or stored it.
async fn remove_leftover(path: PathBuf) -> Result<u64, StorageError> {
    match tokio::fs::remove_file(&path).await {
        Ok(()) => {
            tracing::info!(path = %path.display(), "removed what an interrupted write left");
            Ok(1)
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(0),
        Err(error) if is_folder(&error) => remove_empty_folder(path).await,
        Err(source) => Err(StorageError::File { path, source }),
    }
}

/// Removes a folder of leftovers; one that is not empty is left to the next sweep.
async fn remove_empty_folder(path: PathBuf) -> Result<u64, StorageError> {
    match tokio::fs::remove_dir(&path).await {
        Ok(()) => Ok(0),
        Err(error) if [io::ErrorKind::NotFound, io::ErrorKind::DirectoryNotEmpty].contains(&error.kind()) => {
            Ok(0)
        }
        Err(source) => Err(StorageError::File { path, source }),
    }
}

/// Returns whether a removal failed because of a folder; macOS and Linux have different errors for this.
fn is_folder(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::IsADirectory | io::ErrorKind::PermissionDenied)
}

/// Lists the files below a folder, those below `leftovers` as leftovers. The store's own listing would hide
/// files that are being written.
fn walk(root: &Path, leftovers: Option<Key>) -> BoxStream<'static, Result<Found, StorageError>> {
    let walk = Walk { root: root.to_owned(), leftovers, folders: vec![root.to_owned()], open: None };
    let batches = futures::stream::try_unfold(walk, |mut walk| async move {
        let work = move || {
            let batch = walk.batch();
            (batch, walk)
        };
        let (batch, walk) = tokio::task::spawn_blocking(work).await.map_err(object_store::Error::from)?;
        let batch = batch?;
        Ok::<_, StorageError>(
            (!batch.is_empty()).then(|| (futures::stream::iter(batch.into_iter().map(Ok)), walk)),
        )
    });
    batches.try_flatten().boxed()
}

/// State of a walk through folders.
struct Walk {
    root: PathBuf,
    leftovers: Option<Key>,
    /// Folders still to be opened.
    folders: Vec<PathBuf>,
    open: Option<(PathBuf, ReadDir)>,
}

impl Walk {
    /// Returns the next files, none at the end.
    fn batch(&mut self) -> Result<Vec<Found>, StorageError> {
        let mut batch = Vec::new();
        while batch.len() < BATCH {
            let Some((folder, entries)) = &mut self.open else {
                let Some(folder) = self.folders.pop() else { break };
                self.open = open(&folder)?.map(|entries| (folder, entries));
                continue;
            };
            let Some(entry) = entries.next() else {
                self.open = None;
                continue;
            };
            let looked = entry.and_then(|entry| look(&entry));
            let looked = looked.map_err(|source| StorageError::File { path: folder.clone(), source })?;
            let Some(Entry { path, modified, is_folder }) = looked else { continue };
            // The folder of the blobs may be a disk of its own.
            if is_folder && path == self.root.join(LOST_AND_FOUND) {
                continue;
            }
            let key = path.strip_prefix(&self.root).ok().and_then(Path::to_str);
            let key = key.and_then(|key| Key::parse(key).ok());
            // Only folders of leftovers are swept; the store removes the folders of its blobs.
            if !is_folder || key.as_ref().is_some_and(|key| self.is_below_leftovers(key)) {
                batch.push(self.found(key, path.clone(), modified));
            }
            if is_folder {
                self.folders.push(path);
            }
        }
        Ok(batch)
    }

    /// Returns whether a key lies below the folder of leftovers.
    fn is_below_leftovers(&self, key: &Key) -> bool {
        self.leftovers.as_ref().is_some_and(|folder| key != folder && key.prefix_matches(folder))
    }

    fn found(&self, key: Option<Key>, path: PathBuf, modified: Timestamp) -> Found {
        match key.filter(|key| !being_written(key) && !self.is_below_leftovers(key)) {
            Some(key) => Found::Blob { key: key.to_string(), modified },
            None => Found::Leftover { path, modified },
        }
    }
}

struct Entry {
    path: PathBuf,
    modified: Timestamp,
    is_folder: bool,
}

/// Opens a folder; returns `None` if it was removed meanwhile.
fn open(folder: &Path) -> Result<Option<ReadDir>, StorageError> {
    match std::fs::read_dir(folder) {
        Ok(entries) => Ok(Some(entries)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(source) => Err(StorageError::File { path: folder.to_owned(), source }),
    }
}

/// Returns the kind and time of an entry; `None` if it was removed meanwhile, or if it is a link.
fn look(entry: &DirEntry) -> io::Result<Option<Entry>> {
    let metadata = match entry.metadata() {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        metadata => metadata?,
    };
    // The service makes none. A person may have moved a folder to another disk, and its files have rows.
    if metadata.is_symlink() {
        return Ok(None);
    }
    // Without a valid time it is never swept.
    let modified = Timestamp::try_from(metadata.modified()?).unwrap_or(Timestamp::MAX);
    Ok(Some(Entry { path: entry.path(), modified, is_folder: metadata.is_dir() }))
}

/// Returns whether a name is the store's temporary name of an incomplete file: `file#1` for `file`.
fn being_written(key: &Key) -> bool {
    let number = key.filename().and_then(|name| name.split_once('#')).map(|(_, number)| number);
    number.is_some_and(|number| !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit()))
}
