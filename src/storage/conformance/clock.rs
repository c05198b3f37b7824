//! A clock that jumps by an hour, forward and back: work goes on at once, and nothing is done twice.

use super::home_maps::{align, due, revision};
use super::*;
use viola_home::PlacedBy;

const HOUR: i64 = 3600;

on_every_back_end!(
    jobs_go_on_after_the_clock_was_set_back,
    jobs_go_on_after_the_clock_was_set_forward,
    a_job_of_a_clock_that_was_ahead_comes_before_newer_ones,
    merges_go_on_after_the_clock_was_set_back,
    uploads_go_on_after_the_clock_was_set_back,
);

async fn claim_at(storage: &Storage, seconds: i64) -> Option<Claim> {
    storage.claim(LEASE, at(seconds)).await.unwrap()
}

async fn release_at(storage: &Storage, seconds: i64) -> usize {
    storage.release_lost(&RetryPolicy::default(), at(seconds)).await.unwrap()
}

async fn jobs_go_on_after_the_clock_was_set_back(storage: Storage) {
    // Queued in what is now the future.
    let (home, _) = one_job(&storage).await;
    let lost = claim_at(&storage, -HOUR).await.expect("the job is due");
    // The same with a lease: its worker was lost before the jump.
    assert_eq!(release_at(&storage, -2 * HOUR).await, 1);
    let held = claim_at(&storage, -2 * HOUR).await.expect("the job is due");
    assert_eq!((held.job.id, held.job.attempts), (lost.job.id, 1));
    let (done, retry) = (answer(AlignmentState::Aligned), RetryPolicy::default());
    assert!(!storage.finish(&lost, &done, &retry, at(-2 * HOUR)).await.unwrap());
    // A worker that lives renews its lease.
    assert!(storage.heartbeat(&held, &JobProgress::default(), LEASE, at(-2 * HOUR)).await.unwrap());
    assert_eq!(release_at(&storage, -2 * HOUR + 1).await, 0);
    assert!(storage.finish(&held, &done, &retry, at(-2 * HOUR + 2)).await.unwrap());
    assert_eq!(storage.clips(&home, &ClipFilter::default(), &page()).await.unwrap().len(), 1);
    // A pause after a fault stays a pause.
    add(&storage, &home, b"other").await;
    let held = claim_at(&storage, 0).await.unwrap();
    assert!(storage.finish(&held, &AttemptEnd::Fault(Fault::Storage), &retry, at(0)).await.unwrap());
    assert!(claim_at(&storage, 4).await.is_none());
    assert!(claim_at(&storage, 5).await.is_some());
}

fn page() -> Page<Uuid> {
    Page { limit: 9, after: None }
}

async fn jobs_go_on_after_the_clock_was_set_forward(storage: Storage) {
    one_job(&storage).await;
    let first = claim_at(&storage, 0).await.unwrap();
    // The lease seems to have expired: the job starts again, and costs no attempt.
    assert_eq!(release_at(&storage, HOUR).await, 1);
    let second = claim_at(&storage, HOUR).await.unwrap();
    assert_eq!((second.job.id, second.job.attempts), (first.job.id, 1));
    let (done, retry) = (answer(AlignmentState::Aligned), RetryPolicy::default());
    assert!(!storage.heartbeat(&first, &JobProgress::default(), LEASE, at(HOUR)).await.unwrap());
    assert!(!storage.finish(&first, &done, &retry, at(HOUR)).await.unwrap());
    assert!(storage.finish(&second, &done, &retry, at(HOUR + 1)).await.unwrap());
}

async fn a_job_of_a_clock_that_was_ahead_comes_before_newer_ones(storage: Storage) {
    let (home, first) = one_job(&storage).await;
    let now = -4 * HOUR;
    assert_eq!(release_at(&storage, now).await, 0);
    let newer = NewClip {
        file: arrived(&storage, b"newer").await,
        info: clip_info(),
        idempotency_key: None,
        recorded_at: None,
        title: None,
        file_name: None,
    };
    storage.add_clip(&home, newer, None, at(now)).await.unwrap();
    assert_eq!(claim_at(&storage, now + 1).await.expect("a job is due").job.clip, first.id);
}

async fn merges_go_on_after_the_clock_was_set_back(storage: Storage) {
    one_job(&storage).await;
    align(&storage, AlignmentState::Aligned).await;
    let lost = due(&storage, 200).await.expect("a merge is due");
    let held = due(&storage, 200 - HOUR).await.expect("its lease is of a clock that was ahead");
    assert!(due(&storage, 201 - HOUR).await.is_none());
    let finish = async |claim: &MergeClaim| {
        let new = revision(claim, PlacedBy::Alignment, b"tile");
        storage.finish_merge(claim, Some(&new), at(202 - HOUR)).await.unwrap()
    };
    assert!(!finish(&lost).await);
    assert!(finish(&held).await);
}

async fn uploads_go_on_after_the_clock_was_set_back(storage: Storage) {
    let (home, limits) = (home("h"), UploadLimits::default());
    storage.put_home(&home, None, |_| true, at(0)).await.unwrap();
    let new = NewUpload {
        kind: UploadKind::Whole,
        tenant: Tenant::default(),
        home: Some(home),
        metadata: String::new(),
        concat: None,
        length_bytes: Some(4),
        content_key: None,
    };
    let id = storage.create_upload(new, &limits, None, at(0)).await.unwrap().id;
    let mut writer = storage.begin_append(id, 0, None, &limits, at(-HOUR)).await.unwrap();
    storage.append(&mut writer, arrived(&storage, b"clip").await, &limits, at(-HOUR)).await.unwrap();
    let lost = storage.claim_upload(id, LEASE, at(0)).await.unwrap();
    assert!(lost.is_some());
    assert_eq!(storage.due_uploads(9, at(-HOUR)).await.unwrap(), [(Tenant::default(), id)]);
    assert!(storage.claim_upload(id, LEASE, at(-HOUR)).await.unwrap().is_some());
    assert!(storage.claim_upload(id, LEASE, at(-HOUR + 1)).await.unwrap().is_none());
}
