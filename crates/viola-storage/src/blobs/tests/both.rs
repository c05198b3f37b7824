use super::*;
use crate::StorageError;
use futures::TryStreamExt;
use jiff::{SignedDuration, Timestamp};
use std::collections::HashSet;
use std::path::Path;
use std::sync::Mutex;

macro_rules! on_both {
    ($($case:ident),* $(,)?) => {
        mod folder {
            $(#[tokio::test] async fn $case() { super::$case(super::Bench::in_folder("blobs/incoming")).await; })*
        }
        mod folder_and_arrivals_elsewhere {
            $(#[tokio::test] async fn $case() { super::$case(super::Bench::in_folder("incoming")).await; })*
        }
        mod s3 {
            $(#[tokio::test] async fn $case() { super::$case(super::Bench::on_s3()).await; })*
        }
    };
}

#[test]
fn blobs_do_not_lie_among_arriving_files() {
    let folder = tempfile::tempdir().unwrap();
    for blobs in ["", "blobs"] {
        let place = BlobPlace::Folder(folder.path().join(blobs));
        assert!(Blobs::open(&place, folder.path()).is_err(), "a sweep would remove them");
    }
}

on_both! {
    what_is_put_is_read,
    an_arrived_file_becomes_a_blob,
    a_blob_is_read_as_it_comes,
    a_part_is_read_without_the_rest,
    a_blob_is_a_local_file,
    a_missing_blob_is_told,
    discarded_blobs_are_gone,
    a_sweep_leaves_what_is_named_or_recent,
    a_sweep_asks_for_a_thousand_at_a_time,
    a_sweep_removes_files_of_any_name,
    folders_of_killed_jobs_go,
    a_place_that_is_there_is_ready,
}

async fn what_is_put_is_read(bench: Bench) {
    bench.blobs.put("home-maps/one", b"bytes".to_vec()).await.unwrap();
    bench.blobs.put("home-maps/empty", vec![]).await.unwrap();
    assert_eq!(bench.bytes("home-maps/one").await, Some(b"bytes".to_vec()));
    assert_eq!(bench.bytes("home-maps/empty").await, Some(vec![]));
    assert_eq!(bench.blobs.read_all("home-maps/one").await.unwrap(), &b"bytes"[..]);
    assert_eq!(bench.keys().await, ["home-maps/empty", "home-maps/one"]);
    assert_eq!(std::fs::read(bench.path_of("home-maps/one")).unwrap(), b"bytes");
}

async fn a_part_is_read_without_the_rest(bench: Bench) {
    let large = large();
    bench.keep("clips/large/file", &large).await;
    let end = large.len() as u64;
    let reader = bench.blobs.read("clips/large/file").await.unwrap().unwrap();
    for range in [0..1, 5..6, end / 2..end - 3, end - 1..end] {
        let part = reader.parts.open(range.clone()).await.unwrap();
        let part: Vec<bytes::Bytes> = part.try_collect().await.unwrap();
        assert!(part.concat() == large[range.start as usize..range.end as usize], "{range:?}");
    }
    bench.blobs.remove_all(&["clips/large/file".to_owned()]).await.unwrap();
    assert!(reader.parts.open(0..1).await.is_err());
}

async fn an_arrived_file_becomes_a_blob(bench: Bench) {
    let large = large();
    bench.keep("clips/small/file", b"small").await;
    bench.keep("clips/large/file", &large).await;
    bench.keep("clips/part/file", &large[..8 << 20]).await;
    bench.keep("clips/empty/file", b"").await;
    assert_eq!(bench.bytes("clips/small/file").await, Some(b"small".to_vec()));
    assert!(bench.bytes("clips/large/file").await == Some(large.clone()), "the large file is another");
    assert!(bench.bytes("clips/part/file").await == Some(large[..8 << 20].to_vec()), "one part is another");
    assert_eq!(bench.bytes("clips/empty/file").await, Some(vec![]));
    let all = ["clips/empty/file", "clips/large/file", "clips/part/file", "clips/small/file"];
    assert_eq!(bench.keys().await, all, "nothing is left of the files that arrived");
}

async fn a_blob_is_read_as_it_comes(bench: Bench) {
    let large = large();
    bench.keep("clips/large/file", &large).await;
    let reader = bench.blobs.read("clips/large/file").await.unwrap().unwrap();
    assert_eq!(reader.size_bytes, LARGE as u64);
    let pieces: Vec<bytes::Bytes> = reader.stream.try_collect().await.unwrap();
    assert!(pieces.len() > 3 && pieces.concat() == large);
}

async fn a_blob_is_a_local_file(bench: Bench) {
    let large = large();
    bench.keep("clips/large/file", &large).await;
    let file = bench.blobs.local_file("clips/large/file").await.unwrap();
    assert!(std::fs::read(&file).unwrap() == large);
    let path = file.to_path_buf();
    drop(file);
    assert_eq!(path.exists(), bench.server.is_none(), "a copy goes, the blob does not");
    assert_eq!(bench.keys().await, ["clips/large/file"]);
}

async fn a_missing_blob_is_told(bench: Bench) {
    let missing =
        |error: StorageError| matches!(error, StorageError::Blobs(object_store::Error::NotFound { .. }));
    assert!(bench.blobs.read("clips/no/file").await.unwrap().is_none());
    assert!(bench.bytes("clips/no/file").await.is_none());
    assert!(bench.blobs.read_all("clips/no/file").await.is_err_and(missing));
    assert!(bench.blobs.local_file("clips/no/file").await.is_err_and(missing));
    assert_eq!(bench.keys().await, Vec::<String>::new(), "no copy was begun");
}

async fn discarded_blobs_are_gone(bench: Bench) {
    for key in ["a/one", "a/two", "b/three"] {
        bench.blobs.put(key, b"bytes".to_vec()).await.unwrap();
    }
    bench.blobs.discard(&["a/one".to_owned(), "a/missing".to_owned(), "b/three".to_owned()]).await;
    bench.blobs.discard(&[]).await;
    assert_eq!(bench.keys().await, ["a/two"]);
    assert!(bench.blobs.read("a/one").await.unwrap().is_none());
}

fn written(path: &Path, at: Timestamp) {
    let file = std::fs::File::options().write(true).open(path).unwrap();
    file.set_modified(at.into()).unwrap();
}

/// Sweeps and returns the number of removed files.
async fn swept<Named>(bench: &Bench, older_than: Timestamp, named: impl Fn(Vec<String>) -> Named) -> u64
where
    Named: Future<Output = Result<HashSet<String>, StorageError>>,
{
    let unnamed = bench.blobs.unnamed(older_than, named).await.unwrap();
    bench.blobs.sweep(&unnamed).await.unwrap();
    unnamed.leftovers + unnamed.keys.len() as u64
}

async fn a_sweep_leaves_what_is_named_or_recent(bench: Bench) {
    // To the second, the resolution of S3.
    let now = Timestamp::from_second(Timestamp::now().as_second()).unwrap();
    let before = now - SignedDuration::from_hours(2);
    for key in ["clips/old/file", "clips/named/file", "clips/recent/file"] {
        bench.blobs.put(key, b"bytes".to_vec()).await.unwrap();
        written(&bench.path_of(key), if key.contains("recent") { now } else { before });
    }
    // Interrupted uploads, and interrupted writes of blobs; S3 does not show the latter.
    let (old, recent) = (bench.blobs.incoming.join("old"), bench.blobs.incoming.join("recent"));
    std::fs::write(&old, b"half").unwrap();
    std::fs::write(&recent, b"half").unwrap();
    written(&old, before);
    let mut leftovers = 1;
    if bench.server.is_none() {
        for name in ["clips/recent/file#1", "clips/recent/file#2"] {
            std::fs::write(bench.path_of(name), b"half").unwrap();
        }
        written(&bench.path_of("clips/recent/file#1"), before);
        leftovers += 1;
    }
    let asked = Mutex::new(Vec::new());
    let named = async |keys: Vec<String>| {
        asked.lock().unwrap().extend_from_slice(&keys);
        Ok(keys.iter().filter(|key| key.contains("named")).cloned().collect())
    };
    let all = bench.keys().await.len();
    assert_eq!(swept(&bench, before, named).await, 0, "nothing is older than the oldest");
    assert_eq!(bench.keys().await.len(), all);
    assert!(asked.lock().unwrap().is_empty(), "nothing is looked up that is too young");

    let removed = swept(&bench, now - SignedDuration::from_hours(1), named).await;
    assert_eq!(removed, 1 + leftovers);
    let mut asked = asked.into_inner().unwrap();
    asked.sort();
    assert_eq!(asked, ["clips/named/file", "clips/old/file"]);
    assert!(!old.exists() && recent.exists());
    let kept: Vec<String> = bench.keys().await.into_iter().filter(|key| key.starts_with("clips/")).collect();
    assert_eq!(kept, ["clips/named/file", "clips/recent/file"]);
    assert_eq!(bench.path_of("clips/recent/file#2").exists(), bench.server.is_none());
    assert!(!bench.path_of("clips/recent/file#1").exists());
}

async fn a_sweep_asks_for_a_thousand_at_a_time(bench: Bench) {
    const BLOBS: usize = 2_100;
    bench.blobs.put("home-maps/first", b"".to_vec()).await.unwrap();
    let folder = bench.path_of("home-maps");
    for number in 1..BLOBS {
        std::fs::write(folder.join(format!("{number}")), b"").unwrap();
    }
    let asked = Mutex::new((HashSet::new(), 0));
    let named = async |keys: Vec<String>| {
        let mut asked = asked.lock().unwrap();
        assert!(keys.len() <= 1000);
        asked.0.extend(keys.iter().cloned());
        asked.1 += keys.len();
        Ok(keys.iter().filter(|key| key.ends_with('7')).cloned().collect())
    };
    let later = Timestamp::now() + SignedDuration::from_hours(1);
    let removed = swept(&bench, later, named).await;
    let asked = asked.into_inner().unwrap();
    assert_eq!((asked.0.len(), asked.1), (BLOBS, BLOBS), "each blob is looked up once");
    let kept = bench.keys().await;
    assert!(kept.len() == 210 && kept.iter().all(|key| key.ends_with('7')), "{}", kept.len());
    assert_eq!(removed, (BLOBS - 210) as u64);
}

async fn a_sweep_removes_files_of_any_name(bench: Bench) {
    bench.blobs.put("clips/one/file", b"".to_vec()).await.unwrap();
    for name in ["file~", "file [copy]"] {
        std::fs::write(bench.path_of(&format!("clips/one/{name}")), b"").unwrap();
    }
    let later = Timestamp::now() + SignedDuration::from_hours(1);
    assert_eq!(swept(&bench, later, async |_| Ok(HashSet::new())).await, 3);
    assert_eq!(bench.keys().await, Vec::<String>::new());
}

async fn folders_of_killed_jobs_go(bench: Bench) {
    let folder = bench.blobs.incoming.join("job-1");
    std::fs::create_dir(&folder).unwrap();
    std::fs::write(folder.join("alignment.json"), b"half").unwrap();
    let none = async |_| Ok(HashSet::new());
    let (before, later) =
        (Timestamp::now() - SignedDuration::from_hours(1), Timestamp::now() + SignedDuration::from_hours(1));
    assert_eq!(bench.blobs.unnamed(before, none).await.unwrap().leftovers, 0);
    assert!(folder.join("alignment.json").exists(), "the job may be at work");
    // The file goes first, the empty folder at the next sweep at the latest.
    assert_eq!(bench.blobs.unnamed(later, none).await.unwrap().leftovers, 1);
    assert_eq!(bench.blobs.unnamed(later, none).await.unwrap().leftovers, 0);
    assert!(!folder.exists() && bench.blobs.incoming.exists());
}

async fn a_place_that_is_there_is_ready(bench: Bench) {
    assert!(bench.blobs.ready().await.unwrap() > 0);
    assert_eq!(bench.keys().await, Vec::<String>::new(), "it leaves nothing");
    std::fs::remove_dir_all(&bench.blobs.incoming).unwrap();
    assert!(bench.blobs.ready().await.is_err(), "nothing can arrive");
}
