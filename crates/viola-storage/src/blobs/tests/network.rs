use super::*;
use crate::StorageError;
use futures::TryStreamExt;
use jiff::Timestamp;
use std::future::Future;
use std::time::Instant;
use viola_testing::s3_server::{Fault, Faults, When};

/// Short timeouts, so that a silent store costs a test little. A single request may take far longer.
const IMPATIENT: Limits = Limits {
    connect: Duration::from_secs(60),
    request: Duration::from_secs(60),
    repeat: Duration::from_secs(60),
    operation: Duration::from_millis(250),
    removal: Duration::from_millis(250),
    ready: Duration::from_millis(250),
};

/// A timeout so short that a large file needs more than one request.
const SHORT_REQUESTS: Limits =
    Limits { request: Duration::from_millis(200), repeat: Duration::from_millis(100), ..Limits::S3 };

/// Time for an operation with [`IMPATIENT`] on a busy machine.
const ENOUGH: Duration = Duration::from_secs(10);

fn faults(when: When, kinds: &[Fault]) -> Faults {
    Faults { seed: 1, when, kinds: kinds.to_vec() }
}

async fn eventually(what: &str, holds: impl Fn() -> bool) {
    let wait = async {
        let mut tick = tokio::time::interval(Duration::from_millis(2));
        while !holds() {
            tick.tick().await;
        }
    };
    tokio::time::timeout(ENOUGH, wait).await.unwrap_or_else(|_| panic!("not in time: {what}"));
}

/// Every third request fails, in one way or in all.
macro_rules! every_third_request {
    ($($case:ident: $kinds:expr,)*) => {
        mod every_third_request {
            use super::Fault::*;
            $(#[tokio::test] async fn $case() { super::nothing_is_lost(&$kinds).await; })*
        }
    };
}

every_third_request! {
    is_refused: [Refuse(500), Refuse(503)],
    is_done_and_denied: [Deny],
    is_cut_off_before: [Cut],
    is_cut_off_after: [CutAfter],
    is_cut_off_halfway: [CutHalfway],
    fails_somehow: [Refuse(500), Refuse(503), Deny, Cut, CutAfter, CutHalfway],
}

async fn nothing_is_lost(kinds: &[Fault]) {
    let bench = Bench::on_s3();
    let large = large();
    bench.server().fail(faults(When::Every(3), kinds));
    bench.keep("clips/large/file", &large).await;
    for number in 0..6 {
        bench.blobs.put(&format!("home-maps/{number}"), vec![number; 1000]).await.unwrap();
    }
    for number in 0..6 {
        assert_eq!(bench.bytes(&format!("home-maps/{number}")).await, Some(vec![number; 1000]));
    }
    let reader = bench.blobs.read("clips/large/file").await.unwrap().unwrap();
    let pieces: Vec<bytes::Bytes> = reader.stream.try_collect().await.unwrap();
    assert!(pieces.concat() == large);
    assert!(std::fs::read(bench.blobs.local_file("clips/large/file").await.unwrap()).unwrap() == large);
    let keys = bench.keys().await;
    assert_eq!(keys.len(), 7);
    bench.blobs.discard(&keys).await;
    assert_eq!(bench.keys().await, Vec::<String>::new());
    assert!(bench.server().failed() >= 8, "{} of {}", bench.server().failed(), bench.server().requests());
}

#[tokio::test]
async fn much_at_once_goes_through_a_store_that_often_fails() {
    let bench = Bench::on_s3();
    let kinds = [Fault::Refuse(503), Fault::Cut, Fault::CutAfter, Fault::Slow(Duration::from_millis(3))];
    bench.server().fail(faults(When::Share(0.25), &kinds));
    let work = (0..50u8).map(|number| {
        let bench = &bench;
        async move {
            let (kept, gone) = (format!("home-maps/{number}"), format!("clips/{number}/file"));
            bench.keep(&gone, &[number; 100]).await;
            bench.blobs.put(&kept, vec![number; 2000]).await.unwrap();
            bench.blobs.discard(&[gone]).await;
            assert_eq!(bench.bytes(&kept).await, Some(vec![number; 2000]));
        }
    });
    futures::future::join_all(work).await;
    assert!(bench.server().failed() > 20);
    bench.server().heal();
    assert_eq!(bench.keys().await.len(), 50);
}

/// Checks that each operation on a broken store ends in time. All but a removal return an error.
async fn all_fail_in_time(bench: &Bench) {
    async fn in_time<T>(what: &str, work: impl Future<Output = T>) -> T {
        let begun = Instant::now();
        let done = work.await;
        assert!(begun.elapsed() < ENOUGH, "{what} took {:?}", begun.elapsed());
        done
    }
    let blobs = &bench.within(IMPATIENT);
    let (small, large) = (bench.arrived(b"small").await, bench.arrived(&large()).await);
    assert!(in_time("put", blobs.put("new", vec![1])).await.is_err());
    assert!(in_time("keep", blobs.keep(small, "new")).await.is_err());
    assert!(in_time("keep in parts", blobs.keep(large, "new")).await.is_err());
    assert!(in_time("read", blobs.read("there")).await.is_err());
    assert!(in_time("read in one piece", blobs.read_if_there("there")).await.is_err());
    assert!(in_time("local file", blobs.local_file("there")).await.is_err());
    in_time("discard", blobs.discard(&["there".to_owned()])).await;
    assert!(in_time("ready", blobs.ready()).await.is_err());
    let look = blobs.unnamed(Timestamp::MAX, async |_: Vec<String>| unreachable!("nothing was listed"));
    assert!(in_time("look for unnamed blobs", look).await.is_err());
    assert!(in_time("sample", blobs.sample()).await.is_err());
}

#[tokio::test]
async fn a_store_that_is_down_fails_in_time() {
    let bench = Bench::on_s3();
    bench.blobs.put("there", b"bytes".to_vec()).await.unwrap();
    bench.server().stop();
    all_fail_in_time(&bench).await;
    bench.server().listen();
    assert_eq!(bench.keys().await, ["there"], "it is as it was, and nothing is left of what arrived");
}

#[tokio::test]
async fn only_a_silent_store_is_a_timeout() {
    let bench = Bench::on_s3();
    bench.blobs.put("there", b"bytes".to_vec()).await.unwrap();
    let missing = bench.blobs.read_all("missing").await.unwrap_err();
    assert!(!missing.is_timeout(), "{missing}");
    bench.server().fail(faults(When::Always, &[Fault::Silent]));
    let silent = bench.within(IMPATIENT).remove_all(&["there".to_owned()]).await.unwrap_err();
    assert!(silent.is_timeout(), "{silent}");
}

#[tokio::test]
async fn a_store_that_is_silent_fails_in_time() {
    fails_in_time(Fault::Silent).await;
}

#[tokio::test]
async fn a_store_that_refuses_all_fails_in_time() {
    fails_in_time(Fault::Refuse(503)).await;
}

#[tokio::test]
async fn a_store_that_cuts_all_connections_fails_in_time() {
    fails_in_time(Fault::Cut).await;
}

async fn fails_in_time(fault: Fault) {
    let bench = Bench::on_s3();
    bench.blobs.put("there", b"bytes".to_vec()).await.unwrap();
    bench.server().fail(faults(When::Always, &[fault]));
    all_fail_in_time(&bench).await;
    bench.server().heal();
    assert_eq!(bench.keys().await, ["there"], "it is as it was, and nothing is left of what arrived");
}

#[tokio::test]
async fn a_file_whose_parts_fail_is_told_and_aborted() {
    let bench = Bench::on_s3();
    for fault in [Fault::Refuse(503), Fault::Silent] {
        let file = bench.arrived(&large()).await;
        // An upload begins with POST, and is aborted with DELETE.
        bench.server().fail(faults(When::Method("PUT"), &[fault]));
        let begun = Instant::now();
        // The upload's beginning and its end succeed, even on a busy machine.
        let limits =
            Limits { operation: Duration::from_secs(2), removal: Duration::from_secs(8), ..IMPATIENT };
        let failed = bench.within(limits).keep(file, "clips/large/file").await;
        assert!(begun.elapsed() < ENOUGH);
        assert!(matches!(failed, Err(StorageError::Blobs(_))), "{failed:?}");
        assert!(bench.server().failed() > 0, "parts were sent");
        eventually("the upload is aborted", || bench.server().unfinished_uploads() == 0).await;
        assert_eq!(bench.keys().await, Vec::<String>::new());
    }
}

#[tokio::test]
async fn a_caller_that_goes_away_leaves_no_upload() {
    let bench = Bench::on_s3();
    let file = bench.arrived(&large()).await;
    bench.server().fail(faults(When::Method("PUT"), &[Fault::Silent]));
    let server = bench.server();
    tokio::select! {
        _ = bench.blobs.keep(file, "clips/large/file") => panic!("no part gets through"),
        () = eventually("parts are under way", || server.unfinished_uploads() == 1 && server.failed() >= 2) => {}
    }
    eventually("the upload is aborted", || server.unfinished_uploads() == 0).await;
    assert_eq!(bench.keys().await, Vec::<String>::new());
}

#[tokio::test]
async fn a_file_is_kept_although_the_answer_to_its_last_request_is_lost() {
    let bench = Bench::on_s3();
    let large = large();
    let file = bench.arrived(&large).await;
    bench.server().fail(faults(When::Every(6), &[Fault::CutHalfway]));
    bench.blobs.keep(file, "clips/large/file").await.unwrap();
    assert_eq!(bench.server().failed(), 1, "the sixth request completes: one begins and four send parts");
    bench.server().heal();
    assert!(bench.bytes("clips/large/file").await == Some(large));
}

#[tokio::test]
async fn a_reader_may_be_slower_than_a_request() {
    let bench = Bench::on_s3();
    let large = large();
    bench.keep("clips/large/file", &large).await;
    bench.server().heal();
    let mut reader = bench.within(SHORT_REQUESTS).read("clips/large/file").await.unwrap().unwrap();
    let mut read = Vec::new();
    let mut waits = 0;
    while let Some(bytes) = reader.stream.try_next().await.unwrap() {
        read.extend_from_slice(&bytes);
        if waits < 2 && read.len() > LARGE / 3 * waits {
            waits += 1;
            tokio::time::sleep(SHORT_REQUESTS.request * 2).await;
        }
    }
    assert!(read == large);
    assert!(bench.server().requests() >= 3, "the rest was asked for after each wait");
}

#[tokio::test]
async fn many_files_share_the_memory_for_parts() {
    let bench = Bench::on_s3();
    let large = large();
    let files = futures::future::join_all((0..20).map(|_| bench.arrived(&large[..(8 << 20) + 1]))).await;
    let kept = files.into_iter().enumerate().map(|(number, file)| {
        let blobs = &bench.blobs;
        async move { blobs.keep(file, &format!("clips/{number}/file")).await }
    });
    // There are more files than permits for parts; none waits for ever.
    futures::future::try_join_all(kept).await.unwrap();
    assert_eq!(bench.keys().await.len(), 20);
    assert_eq!(bench.blobs.parts.available_permits(), keep::PARTS_IN_MEMORY);
}

/// The service's handlers are such tasks: this must compile.
#[tokio::test]
async fn all_is_done_in_tasks_of_their_own() {
    let bench = Bench::on_s3();
    let file = bench.arrived(&large()).await;
    let blobs = Arc::new(bench.blobs);
    let task = tokio::spawn(async move {
        blobs.ready().await?;
        blobs.put("one", vec![1]).await?;
        blobs.keep(file, "two").await?;
        blobs.read_all("one").await?;
        blobs.read("one").await?;
        blobs.local_file("one").await?;
        blobs.discard(&["one".to_owned()]).await;
        let names = ["three".to_owned()];
        let named =
            |keys: Vec<String>| async { Ok(keys.into_iter().filter(|key| names.contains(key)).collect()) };
        let unnamed = blobs.unnamed(Timestamp::MAX, named).await?;
        blobs.sweep(&unnamed).await?;
        Ok::<_, StorageError>(unnamed.keys)
    });
    assert_eq!(task.await.unwrap().unwrap(), ["two"]);
}
