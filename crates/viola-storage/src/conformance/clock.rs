//! A clock that jumps by an hour, forward and back: work goes on at once, and nothing is done twice.

use super::home_maps::{align, due, finish, merge};
use super::*;
use jiff::SignedDuration;
use viola_testing::postgres::try_execute;

const HOUR: i64 = 3600;

on_every_back_end!(
    jobs_go_on_after_the_clock_was_set_back,
    jobs_go_on_after_the_clock_was_set_forward,
    a_job_of_a_clock_that_was_ahead_comes_before_newer_ones,
    merges_go_on_after_the_clock_was_set_back,
    a_clip_changed_no_earlier_after_the_clock_was_set_back,
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
    let done = || answer(AlignmentState::Aligned);
    assert!(!end_attempt(&storage, &lost, done(), -2 * HOUR).await);
    // A worker that lives renews its lease.
    assert!(storage.heartbeat(&held, &JobProgress::default(), LEASE, at(-2 * HOUR)).await.unwrap());
    assert_eq!(release_at(&storage, -2 * HOUR + 1).await, 0);
    assert!(end_attempt(&storage, &held, done(), -2 * HOUR + 2).await);
    assert_eq!(storage.clips(&home, &ClipFilter::default(), &page()).await.unwrap().len(), 1);
    // A pause after a fault stays a pause.
    add(&storage, &home, b"other").await;
    let held = claim_at(&storage, 0).await.unwrap();
    assert!(end_attempt(&storage, &held, AttemptEnd::Fault(Fault::Storage), 0).await);
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
    let done = || answer(AlignmentState::Aligned);
    assert!(!storage.heartbeat(&first, &JobProgress::default(), LEASE, at(HOUR)).await.unwrap());
    assert!(!end_attempt(&storage, &first, done(), HOUR).await);
    assert!(end_attempt(&storage, &second, done(), HOUR + 1).await);
}

async fn a_job_of_a_clock_that_was_ahead_comes_before_newer_ones(storage: Storage) {
    let (home, first) = one_job(&storage).await;
    let now = -4 * HOUR;
    assert_eq!(release_at(&storage, now).await, 0);
    let newer = new_clip(arrived(&storage, b"newer").await);
    storage.add_clip(&home, newer, None, at(now)).await.unwrap();
    assert_eq!(claim_at(&storage, now + 1).await.expect("a job is due").job.clip, first.id);
}

async fn merges_go_on_after_the_clock_was_set_back(storage: Storage) {
    one_job(&storage).await;
    align(&storage, AlignmentState::Aligned).await;
    let lost = due(&storage, 200).await.expect("a merge is due");
    let held = due(&storage, 200 - HOUR).await.expect("its lease is of a clock that was ahead");
    assert!(due(&storage, 201 - HOUR).await.is_none());
    assert!(!finish(&storage, &lost, b"tile", 202 - HOUR).await);
    assert!(finish(&storage, &held, b"tile", 202 - HOUR).await);
}

async fn a_clip_changed_no_earlier_after_the_clock_was_set_back(storage: Storage) {
    let (home, clip) = one_job(&storage).await;
    align(&storage, AlignmentState::Aligned).await;
    let id = clip.id;
    let check = async |what: &str| {
        assert_eq!(storage.clip(&home, id).await.unwrap().updated_at, at(100), "{what}");
    };
    check("aligned").await;
    let edit = ClipEdit { title: Some(Some("Kitchen".to_owned())), ..ClipEdit::default() };
    storage.edit_clip(&home, id, edit, |_| true, at(-HOUR)).await.unwrap();
    check("edited").await;
    storage.choose(&home, id, Chosen::Alternative(0), |_| true, at(-HOUR)).await.unwrap();
    check("chosen").await;
    storage.withdraw_choice(&home, id, |_| true, at(-HOUR)).await.unwrap();
    check("withdrawn").await;
    merge(&storage, b"tile", -HOUR).await;
    check("placed").await;
    storage.align_clip(&home, id, at(-HOUR)).await.unwrap();
    check("queued").await;
    let held = claim_at(&storage, -HOUR).await.expect("the job is due");
    check("claimed").await;
    assert!(end_attempt(&storage, &held, AttemptEnd::Refused(reason("unreadable")), -HOUR).await);
    check("refused").await;
    merge(&storage, b"tile", 1 - HOUR).await;
    assert_eq!(storage.clip(&home, id).await.unwrap().placement, None);
    check("taken out of the map").await;
    storage.delete_home(&home, |_| true, at(-HOUR)).await.unwrap();
    let changes = storage.changes(&Tenant::default(), None, 9, at(200)).await.unwrap().items;
    let of_clip = changes.iter().find(|change| change.clip == Some(id)).expect("the removal is told");
    assert_eq!((of_clip.deleted, of_clip.at), (true, at(100)));
}

async fn uploads_go_on_after_the_clock_was_set_back(storage: Storage) {
    let (home, limits) = (home("h"), UploadLimits::default());
    storage.put_home(&home, None, |_| true, at(0)).await.unwrap();
    let new = NewUpload { home: Some(home), ..new_upload(UploadKind::Whole, &Tenant::default(), Some(4)) };
    let id = storage.create_upload(new, &limits, None, at(0)).await.unwrap().id;
    let mut writer = storage.begin_append(id, 0, None, &limits, at(-HOUR)).await.unwrap();
    storage.append(&mut writer, arrived(&storage, b"clip").await, &limits, at(-HOUR)).await.unwrap();
    let lost = storage.claim_upload(id, LEASE, at(0)).await.unwrap();
    assert!(lost.is_some());
    assert_eq!(storage.due_uploads(9, at(-HOUR)).await.unwrap(), [(Tenant::default(), id)]);
    assert!(storage.claim_upload(id, LEASE, at(-HOUR)).await.unwrap().is_some());
    assert!(storage.claim_upload(id, LEASE, at(-HOUR + 1)).await.unwrap().is_none());
}

/// The clock of the database differs from that of its workers' machine.
#[tokio::test]
async fn workers_with_a_wrong_clock_go_by_the_databases() {
    for hours in [-2, 2] {
        let Some(schema) = Schema::new().await else { return };
        let (name, folder) = (schema.name(), tempfile::tempdir().unwrap());
        let clock = format!(
            "CREATE FUNCTION {name}.clock_timestamp() RETURNS timestamptz LANGUAGE sql
            AS $$ SELECT pg_catalog.clock_timestamp() + INTERVAL '{hours} hours' $$"
        );
        try_execute(&schema.url(), clock).await.unwrap();
        // A name of the schema comes before the same one of the system.
        let path = format!("search_path%3D{name}");
        let url = schema.url().replace(&path, &format!("{path},pg_catalog"));
        let open = async || {
            let postgres = Some(PostgresParams { url: url.clone(), connections: 4 });
            let data = folder.path().to_owned();
            Storage::open(&StorageParams { data, postgres, ..StorageParams::default() }).await.unwrap()
        };
        let (worker, other) = (open().await, open().await);
        for storage in [&worker, &other] {
            let ahead = storage.now().duration_since(Timestamp::now()) - SignedDuration::from_hours(hours);
            assert!(ahead.abs() < SignedDuration::from_mins(1), "{hours}: {ahead}");
        }
        let home = home("h");
        worker.put_home(&home, None, |_| true, worker.now()).await.unwrap();
        put_map(&worker, &home, b"map").await;
        let new = new_clip(arrived(&worker, b"clip").await);
        worker.add_clip(&home, new, None, worker.now()).await.unwrap();
        let held = worker.claim(LEASE, worker.now()).await.unwrap().expect("the job is due");
        other.follow_clock().await.unwrap();
        assert_eq!(other.release_lost(&RetryPolicy::default(), other.now()).await.unwrap(), 0, "{hours}");
        // By the clock of the machine, the lease has expired, or is further ahead than any.
        let stolen = other.release_lost(&RetryPolicy::default(), Timestamp::now()).await.unwrap();
        assert_eq!(stolen, 1, "{hours}");
        assert!(!worker.holds(&held).await.unwrap());
        for storage in [worker, other] {
            storage.close().await;
        }
        schema.remove().await;
    }
}
