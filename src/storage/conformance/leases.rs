//! Who works on a job, and what becomes of it when workers die, fail, dawdle or are told to stop.

use super::*;
use crate::progress::Stage;
use std::collections::HashSet;
use std::sync::Arc;

on_every_back_end!(
    every_job_goes_to_one_worker,
    a_heartbeat_keeps_the_lease,
    a_late_worker_changes_nothing,
    a_job_that_kills_its_workers_fails,
    a_broken_attempt_is_tried_later_and_not_for_ever,
    a_refused_clip_fails_at_once,
    a_job_given_up_is_not_held_against_it,
    cancelling_ends_what_waits_or_runs,
);

async fn claim(storage: &Storage, seconds: i64) -> Claim {
    storage.claim(LEASE, at(seconds)).await.unwrap().expect("a job is due")
}

async fn finish(storage: &Storage, claim: &Claim, ending: Ending, seconds: i64) -> bool {
    storage.finish(claim, &ending, &RetryPolicy::default(), at(seconds)).await.unwrap()
}

async fn clip_of(storage: &Storage, claim: &Claim) -> Clip {
    storage.clip(&claim.job.home, claim.job.clip).await.unwrap()
}

async fn every_job_goes_to_one_worker(storage: Storage) {
    let (id, _) = one_job(&storage).await;
    for n in 1..10u8 {
        add(&storage, &id, &[n]).await;
    }
    let storage = Arc::new(storage);
    let claims = (0..20).map(|_| {
        let storage = storage.clone();
        tokio::spawn(async move { storage.claim(LEASE, at(1)).await.unwrap() })
    });
    let claims = futures::future::join_all(claims).await;
    let jobs: Vec<Uuid> =
        claims.into_iter().filter_map(|claim| claim.unwrap()).map(|claim| claim.job.id).collect();
    assert_eq!(jobs.len(), 10);
    assert_eq!(jobs.iter().collect::<HashSet<_>>().len(), 10);
}

async fn a_heartbeat_keeps_the_lease(storage: Storage) {
    one_job(&storage).await;
    let held = claim(&storage, 0).await;
    assert_eq!((held.job.state, held.job.attempts), (JobState::Running, 1));
    assert_eq!(clip_of(&storage, &held).await.state, ClipState::Aligning);
    for seconds in [20, 40, 60] {
        assert!(storage.heartbeat(&held, Some(Stage::Fuse), 0.5, LEASE, at(seconds)).await.unwrap());
        assert!(storage.claim(LEASE, at(seconds + 29)).await.unwrap().is_none());
    }
    let job = storage.job(held.job.id).await.unwrap().unwrap();
    assert_eq!((job.stage, job.progress, job.updated_at), (Some(Stage::Fuse), 0.5, at(60)));
    assert_eq!(job.version, held.job.version + 3);
    assert!(finish(&storage, &held, answer(AlignmentState::Aligned), 200).await);
}

async fn a_late_worker_changes_nothing(storage: Storage) {
    one_job(&storage).await;
    let late = claim(&storage, 0).await;
    let next = claim(&storage, 30).await;
    assert_eq!((next.job.id, next.job.attempts), (late.job.id, 2));
    storage.put_result(&late, "overlay.png", b"late".to_vec()).await.unwrap();
    storage.put_result(&next, "overlay.png", b"next".to_vec()).await.unwrap();
    assert!(!storage.holds(&late).await.unwrap() && storage.holds(&next).await.unwrap());
    assert!(!storage.heartbeat(&late, None, 0.9, LEASE, at(31)).await.unwrap());
    for ending in [answer(AlignmentState::Failed), Ending::Refused(reason("late")), Ending::GivenUp] {
        assert!(!finish(&storage, &late, ending, 31).await);
    }
    assert!(finish(&storage, &next, answer(AlignmentState::Aligned), 32).await);
    // Nor when the job has ended.
    assert!(!finish(&storage, &late, answer(AlignmentState::Failed), 33).await);
    assert!(!finish(&storage, &next, answer(AlignmentState::Failed), 33).await);
    let clip = clip_of(&storage, &next).await;
    assert_eq!(clip.state, ClipState::Aligned);
    assert_eq!(bytes_of(storage.clip_result(&clip, "overlay.png").await.unwrap()).await, b"next");
}

async fn a_job_that_kills_its_workers_fails(storage: Storage) {
    one_job(&storage).await;
    let mut held = claim(&storage, 0).await;
    for attempt in 2..=held.job.max_attempts {
        held = claim(&storage, i64::from(attempt) * 100).await;
        assert_eq!(held.job.attempts, attempt);
    }
    assert!(storage.claim(LEASE, at(1000)).await.unwrap().is_none());
    let job = storage.job(held.job.id).await.unwrap().unwrap();
    assert_eq!((job.state, job.error.unwrap().code.as_str()), (JobState::Failed, "worker_died"));
    let clip = clip_of(&storage, &held).await;
    assert_eq!((clip.state, clip.reasons[0].code.as_str()), (ClipState::Failed, "worker_died"));
}

async fn a_broken_attempt_is_tried_later_and_not_for_ever(storage: Storage) {
    one_job(&storage).await;
    // 5 s after the first failure and twice that after the second: the policy's default.
    let held = claim(&storage, 0).await;
    assert!(finish(&storage, &held, Ending::Broken(reason("first")), 0).await);
    assert_eq!(clip_of(&storage, &held).await.reasons[0].code, "first");
    assert!(storage.claim(LEASE, at(4)).await.unwrap().is_none());
    let held = claim(&storage, 5).await;
    assert!(finish(&storage, &held, Ending::Broken(reason("second")), 10).await);
    assert!(storage.claim(LEASE, at(19)).await.unwrap().is_none());
    let held = claim(&storage, 20).await;
    assert!(finish(&storage, &held, Ending::Broken(reason("third")), 21).await);
    assert!(storage.claim(LEASE, at(9999)).await.unwrap().is_none());
    let clip = clip_of(&storage, &held).await;
    assert_eq!((clip.state, clip.reasons[0].code.as_str()), (ClipState::Failed, "third"));
    assert_eq!(clip.job.unwrap().state, JobState::Failed);
}

async fn a_refused_clip_fails_at_once(storage: Storage) {
    one_job(&storage).await;
    let held = claim(&storage, 0).await;
    assert!(finish(&storage, &held, Ending::Refused(reason("bad_picture")), 1).await);
    assert!(storage.claim(LEASE, at(9999)).await.unwrap().is_none());
    let clip = clip_of(&storage, &held).await;
    assert_eq!((clip.state, clip.reasons), (ClipState::Failed, vec![reason("bad_picture")]));
}

async fn a_job_given_up_is_not_held_against_it(storage: Storage) {
    one_job(&storage).await;
    for _ in 0..5 {
        let held = claim(&storage, 0).await;
        assert_eq!(held.job.attempts, 1);
        assert!(finish(&storage, &held, Ending::GivenUp, 0).await);
        assert_eq!(clip_of(&storage, &held).await.state, ClipState::Queued);
    }
}

async fn cancelling_ends_what_waits_or_runs(storage: Storage) {
    let (id, clip) = one_job(&storage).await;
    let waiting = clip.job.unwrap().id;
    let cancelled = storage.cancel_job(waiting, at(1)).await.unwrap().unwrap();
    assert_eq!((cancelled.state, cancelled.finished_at), (JobState::Cancelled, Some(at(1))));
    assert!(storage.claim(LEASE, at(2)).await.unwrap().is_none());
    let clip = storage.clip(&id, clip.id).await.unwrap();
    assert_eq!((clip.state, clip.reasons[0].code.as_str()), (ClipState::Uploaded, "cancelled"));

    storage.align_clip(&id, clip.id, at(3)).await.unwrap();
    let running = claim(&storage, 3).await;
    storage.cancel_job(running.job.id, at(4)).await.unwrap();
    assert!(!storage.holds(&running).await.unwrap());
    assert!(!finish(&storage, &running, answer(AlignmentState::Aligned), 5).await);
    assert_eq!(clip_of(&storage, &running).await.state, ClipState::Uploaded);

    // What has ended stays as it is; a job of before does not touch the clip.
    storage.align_clip(&id, clip.id, at(6)).await.unwrap();
    let done = claim(&storage, 6).await;
    assert!(finish(&storage, &done, answer(AlignmentState::Aligned), 7).await);
    let unmoved = storage.cancel_job(done.job.id, at(8)).await.unwrap().unwrap();
    assert_eq!(unmoved.state, JobState::Succeeded);
    storage.cancel_job(waiting, at(8)).await.unwrap();
    assert_eq!(clip_of(&storage, &done).await.state, ClipState::Aligned);
    assert_eq!(storage.cancel_job(Uuid::now_v7(), at(8)).await.unwrap(), None);
}
