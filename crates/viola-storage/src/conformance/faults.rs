//! Faults of the storage in the middle of work: the earlier state stays whole.

use super::home_maps::align_at;
use super::*;
use async_trait::async_trait;
use futures::StreamExt;
use futures::stream::BoxStream;
use object_store::path::Path as Key;
use object_store::*;
use std::fmt;
use std::future::Future;
use std::pin::pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::task::Poll;
use viola_home::TileKey;

/// A blob store whose writes fail on order, every other of them after the blob was written.
#[derive(Debug)]
struct Faulty {
    inner: Arc<dyn ObjectStore>,
    writes: Arc<AtomicU32>,
    fails: fn(u32) -> bool,
    /// Number of the next removals that time out.
    removals_fail: Arc<AtomicU32>,
}

impl fmt::Display for Faulty {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "writes of {} fail", self.inner)
    }
}

#[async_trait]
impl ObjectStore for Faulty {
    async fn put_opts(&self, key: &Key, bytes: PutPayload, options: PutOptions) -> Result<PutResult> {
        let write = self.writes.fetch_add(1, Ordering::Relaxed);
        if !(self.fails)(write) {
            return self.inner.put_opts(key, bytes, options).await;
        }
        if write % 2 == 1 {
            self.inner.put_opts(key, bytes, options).await?;
        }
        Err(Error::Generic { store: "faulty", source: "this write fails".into() })
    }

    async fn put_multipart_opts(
        &self,
        key: &Key,
        options: PutMultipartOptions,
    ) -> Result<Box<dyn MultipartUpload>> {
        self.inner.put_multipart_opts(key, options).await
    }

    async fn get_opts(&self, key: &Key, options: GetOptions) -> Result<GetResult> {
        self.inner.get_opts(key, options).await
    }

    fn delete_stream(&self, keys: BoxStream<'static, Result<Key>>) -> BoxStream<'static, Result<Key>> {
        let left = self.removals_fail.load(Ordering::Relaxed);
        if left > 0 {
            self.removals_fail.store(left - 1, Ordering::Relaxed);
            let timed_out = || std::io::Error::from(std::io::ErrorKind::TimedOut);
            let fail = move |_| Err(Error::Generic { store: "faulty", source: timed_out().into() });
            return keys.map(fail).boxed();
        }
        self.inner.delete_stream(keys)
    }

    fn list(&self, prefix: Option<&Key>) -> BoxStream<'static, Result<ObjectMeta>> {
        self.inner.list(prefix)
    }

    async fn list_with_delimiter(&self, prefix: Option<&Key>) -> Result<ListResult> {
        self.inner.list_with_delimiter(prefix).await
    }

    async fn copy_opts(&self, from: &Key, to: &Key, options: CopyOptions) -> Result<()> {
        self.inner.copy_opts(from, to, options).await
    }

    async fn rename_opts(&self, from: &Key, to: &Key, options: RenameOptions) -> Result<()> {
        self.inner.rename_opts(from, to, options).await
    }
}

const TILES: i32 = 4;

/// Returns a revision whose tiles all hold `number`.
fn revision(number: u8) -> NewRevision {
    let tile = |x| (TileKey { level: LevelName::MAIN, x, y: 0 }, Some(vec![number; 64]));
    NewRevision { tiles: (0..TILES).map(tile).collect(), ..NewRevision::default() }
}

/// Returns the number in the current revision, the same in all tiles; `None` before the first.
async fn whole(storage: &Storage, home: &HomeId) -> Option<u8> {
    let map = storage.home_map(home, None).await.unwrap()?;
    let files = storage.home_map_files(home, map.revision, LevelName::MAIN, map_file::TILE).await.unwrap();
    assert_eq!(files.len(), TILES as usize);
    let mut numbers = Vec::new();
    for file in &files {
        numbers.extend(storage.map_file_bytes(file).await.unwrap().expect("the tile is there"));
    }
    assert!(numbers.iter().all(|number| *number == numbers[0]), "half a map: {numbers:?}");
    storage
        .home_map_files(home, map.revision, LevelName::MAIN, map_file::MANIFEST)
        .await
        .unwrap()
        .first()
        .expect("its manifest");
    Some(numbers[0])
}

/// Creates a home with an aligned clip.
async fn aligned(storage: &Storage) -> (HomeId, Clip) {
    let (home, clip) = one_job(storage).await;
    align(storage).await;
    (home, clip)
}

/// Runs the next job.
async fn align(storage: &Storage) {
    align_at(storage, AlignmentState::Aligned, 10_000).await;
}

/// Makes the writes of a storage fail from now on; returns the counter of writes.
fn break_writes(storage: &mut Storage, fails: fn(u32) -> bool) -> Arc<AtomicU32> {
    let nothing = Arc::new(object_store::memory::InMemory::new());
    let inner = std::mem::replace(&mut storage.blobs.store, nothing);
    let writes = Arc::new(AtomicU32::new(0));
    let removals_fail = Arc::default();
    storage.blobs.store = Arc::new(Faulty { inner, writes: writes.clone(), fails, removals_fail });
    writes
}

/// Makes the removals of a storage fail until the returned function is called.
pub fn removals_fail(storage: &mut Storage) -> impl Fn() + use<> {
    removals_fail_times(storage, u32::MAX)
}

/// Makes the next removals of a storage fail, at most until the returned function is called.
pub fn removals_fail_times(storage: &mut Storage, times: u32) -> impl Fn() + use<> {
    let nothing = Arc::new(object_store::memory::InMemory::new());
    let inner = std::mem::replace(&mut storage.blobs.store, nothing);
    let removals_fail = Arc::new(AtomicU32::new(times));
    let faulty =
        Faulty { inner, writes: Arc::default(), fails: |_| false, removals_fail: removals_fail.clone() };
    storage.blobs.store = Arc::new(faulty);
    move || removals_fail.store(0, Ordering::Relaxed)
}

#[tokio::test]
async fn a_store_that_fails_every_third_write_makes_whole_maps() {
    let folder = tempfile::tempdir().unwrap();
    let mut storage = in_folder(folder.path()).await;
    let writes = break_writes(&mut storage, |write| write % 3 == 2);
    let (home, clip) = aligned(&storage).await;
    for number in 1..=4u8 {
        let claim = storage.claim_merge("", LEASE, at(10)).await.unwrap().expect("the home is due");
        assert!(storage.finish_merge(&claim, Some(&revision(number)), at(10)).await.unwrap());
        assert_eq!(whole(&storage, &home).await, Some(number));
        storage.align_clip(&home, clip.id, at(11)).await.unwrap();
        align(&storage).await;
    }
    // Five files a revision and one a job, and half as many again.
    assert!(writes.load(Ordering::Relaxed) >= 36);
    assert_eq!(storage.clip(&home, clip.id).await.unwrap().state, ClipState::Aligned);
    storage.check_no_blob_is_left("writes that failed").await;
}

#[tokio::test]
async fn a_store_that_fails_for_good_leaves_the_map_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let mut storage = in_folder(folder.path()).await;
    let (home, clip) = aligned(&storage).await;
    let claim = storage.claim_merge("", LEASE, at(10)).await.unwrap().expect("the home is due");
    assert!(storage.finish_merge(&claim, Some(&revision(1)), at(10)).await.unwrap());
    storage.align_clip(&home, clip.id, at(11)).await.unwrap();
    align(&storage).await;
    break_writes(&mut storage, |write| write >= 2);
    let claim = storage.claim_merge("", LEASE, at(12)).await.unwrap().expect("the home is due");
    let failed = storage.finish_merge(&claim, Some(&revision(2)), at(12)).await;
    assert!(matches!(failed, Err(StorageError::Blobs(_))), "{failed:?}");
    assert_eq!(whole(&storage, &home).await, Some(1));
    storage.check_no_blob_is_left("a merge that failed").await;
    storage.give_back_merge(&claim, at(13)).await.unwrap();
    assert!(storage.claim_merge("", LEASE, at(13)).await.unwrap().is_some(), "it is tried again");
}

/// Runs `work` until it has waited `waits` times, and drops it there, like a kill at that moment.
pub async fn cut_off<T>(work: impl Future<Output = T>, waits: usize) -> Option<T> {
    let mut work = pin!(work);
    let mut waited = 0;
    std::future::poll_fn(|context| match work.as_mut().poll(context) {
        Poll::Ready(value) => Poll::Ready(Some(value)),
        Poll::Pending if waited == waits => Poll::Ready(None),
        Poll::Pending => {
            waited += 1;
            Poll::Pending
        }
    })
    .await
}

on_every_back_end!(a_beginning_that_is_cut_off_leaves_nothing_open, a_write_that_fails_leaves_no_blob);

async fn a_write_that_fails_leaves_no_blob(mut storage: Storage) {
    let (home, _) = aligned(&storage).await;
    let claim = storage.claim_merge("", LEASE, at(10)).await.unwrap().expect("the home is due");
    assert!(storage.finish_merge(&claim, Some(&revision(1)), at(10)).await.unwrap());
    let map = storage.home_map(&home, None).await.unwrap().expect("there is a map");
    let new = new_clip(arrived(&storage, b"another clip").await);
    break_writes(&mut storage, |_| true);
    let failed = storage.add_mesh(&home, &map, LevelName::MAIN, b"mesh".to_vec()).await;
    assert!(matches!(failed, Err(StorageError::Blobs(_))), "{failed:?}");
    // In a folder the file is moved and not written, which succeeds.
    let added = storage.add_clip(&home, new, None, at(20)).await;
    assert!(matches!(added, Ok(Added::New(_)) | Err(StorageError::Blobs(_))), "{added:?}");
    storage.check_no_blob_is_left("writes that failed").await;
}

/// As when a client hangs up: its work is dropped wherever it waits.
async fn a_beginning_that_is_cut_off_leaves_nothing_open(storage: Storage) {
    for round in 0..30 {
        for waits in 0..4 {
            drop(cut_off(storage.database.snapshot(), waits).await);
            drop(cut_off(storage.database.begin(), waits).await);
        }
        let id = home(&format!("h-{round}"));
        storage.put_home(&id, None, |_| true, at(round)).await.unwrap();
        // No read sees an earlier state, as an old snapshot would.
        for _ in 0..4 {
            storage.home(&id).await.unwrap();
            storage.changes(&Tenant::default(), None, 9, at(round)).await.unwrap();
        }
    }
}

#[tokio::test]
async fn a_merge_that_is_killed_anywhere_leaves_a_whole_map() {
    let folder = tempfile::tempdir().unwrap();
    let mut storage = in_folder(folder.path()).await;
    let (home, clip) = aligned(&storage).await;
    let (mut number, mut now) = (0u8, 100);
    let mut cuts = 0;
    for waits in 0.. {
        let before = whole(&storage, &home).await;
        let mut claim = storage.claim_merge("", LEASE, at(now)).await.unwrap();
        if claim.is_none() {
            // The longest pause after a merge that lost its worker.
            now += 1_800;
            claim = storage.claim_merge("", LEASE, at(now)).await.unwrap();
        }
        let claim = claim.expect("the home is due");
        number += 1;
        let finished = cut_off(storage.finish_merge(&claim, Some(&revision(number)), at(now)), waits).await;
        // As after a kill: the storage is opened again, which sweeps.
        storage.close().await;
        drop(storage);
        storage = in_folder(folder.path()).await;
        let after = whole(&storage, &home).await;
        let came_through = finished.is_some();
        match finished {
            None => assert!(after == before || after == Some(number), "{before:?} {after:?} {waits}"),
            Some(kept) => assert!(kept.unwrap() && after == Some(number)),
        }
        assert_eq!(storage.clip(&home, clip.id).await.unwrap().state, ClipState::Aligned);
        storage.check_no_blob_is_left("a merge that was cut off").await;
        if came_through {
            break;
        }
        cuts += 1;
        // The lease expires; if the merge took effect, a new answer makes the home due.
        now += 100;
        if after == Some(number) {
            storage.align_clip(&home, clip.id, at(now)).await.unwrap();
            align(&storage).await;
        }
    }
    assert!(cuts > 0, "a merge waits for its blobs and its transaction");
}
