//! Leases of jobs, and jobs whose workers die, fail, are slow or are asked to stop.

use super::*;
use std::collections::HashSet;
use std::sync::Arc;
use viola_geometry::Pose2;
use viola_geometry::progress::EarlyPose;

on_every_back_end!(
    every_job_goes_to_one_worker,
    a_heartbeat_keeps_the_lease,
    an_early_pose_is_told_until_the_job_ends,
    a_late_worker_changes_nothing,
    a_lost_worker_costs_no_attempt,
    a_job_whose_workers_are_lost_for_a_day_fails,
    faults_cost_no_attempt_and_are_borne_for_a_day,
    an_attempt_that_counts_ends_a_row_of_faults,
    a_pause_does_not_count_as_waiting,
    a_machine_that_was_off_for_a_day_fails_nothing,
    a_broken_attempt_is_tried_later_and_not_for_ever,
    a_refused_clip_fails_at_once,
    a_job_given_up_is_not_held_against_it,
    cancelling_ends_what_waits_or_runs,
    jobs_that_cannot_be_read_let_others_pass,
    a_lost_job_that_cannot_be_read_lets_others_pass,
);

/// Returns the claim of a worker at this moment.
async fn due(storage: &Storage, seconds: i64) -> Option<Claim> {
    storage.release_lost(&RetryPolicy::default(), at(seconds)).await.unwrap();
    storage.claim(LEASE, at(seconds)).await.unwrap()
}

async fn claim(storage: &Storage, seconds: i64) -> Claim {
    due(storage, seconds).await.expect("a job is due")
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
        assert!(
            storage
                .heartbeat(&held, &job_progress(Some(Stage::Fuse), 0.5), LEASE, at(seconds))
                .await
                .unwrap()
        );
        assert!(due(&storage, seconds + 29).await.is_none());
    }
    let job = storage.job(held.job.id).await.unwrap().unwrap();
    assert_eq!((job.stage, job.progress, job.updated_at), (Some(Stage::Fuse), 0.5, at(60)));
    assert_eq!(job.version, held.job.version + 3);
    let versions = storage.job_versions(&[Uuid::now_v7(), job.id]).await.unwrap();
    assert_eq!(versions, [(job.id, job.version)].into());
    assert!(storage.job_versions(&[]).await.unwrap().is_empty());
    assert!(end_attempt(&storage, &held, answer(AlignmentState::Aligned), 200).await);
}

async fn an_early_pose_is_told_until_the_job_ends(storage: Storage) {
    one_job(&storage).await;
    let held = claim(&storage, 0).await;
    let pose =
        EarlyPose { level: LevelName::MAIN, map_from_clip: Pose2::new(1.0, 2.0, 0.5), probability: 0.97 };
    let early = JobProgress { early_pose: Some(pose), ..job_progress(Some(Stage::Label), 0.4) };
    assert!(storage.heartbeat(&held, &early, LEASE, at(1)).await.unwrap());
    let job = async || storage.job(held.job.id).await.unwrap().unwrap();
    assert_eq!(job().await.early_pose, Some(pose));
    // The clip has no answer yet, and the next attempt begins without a pose.
    let clip = clip_of(&storage, &held).await;
    assert_eq!((clip.state, clip.alignment), (ClipState::Aligning, None));
    assert!(end_attempt(&storage, &held, AttemptEnd::GivenUp, 2).await);
    assert_eq!(job().await.early_pose, None);
    let held = claim(&storage, 3).await;
    assert!(storage.heartbeat(&held, &early, LEASE, at(4)).await.unwrap());
    assert!(end_attempt(&storage, &held, answer(AlignmentState::Aligned), 5).await);
    assert_eq!(job().await.early_pose, None);
}

async fn a_late_worker_changes_nothing(storage: Storage) {
    one_job(&storage).await;
    let late = claim(&storage, 0).await;
    let next = claim(&storage, 30).await;
    assert_eq!((next.job.id, next.job.attempts), (late.job.id, 1));
    storage.put_result(&late, "overlay.png", b"late".to_vec()).await.unwrap();
    storage.put_result(&next, "overlay.png", b"next".to_vec()).await.unwrap();
    assert!(!storage.holds(&late).await.unwrap() && storage.holds(&next).await.unwrap());
    assert!(!storage.heartbeat(&late, &job_progress(None, 0.9), LEASE, at(31)).await.unwrap());
    for ending in [answer(AlignmentState::Failed), AttemptEnd::Refused(reason("late")), AttemptEnd::GivenUp] {
        assert!(!end_attempt(&storage, &late, ending, 31).await);
    }
    assert!(end_attempt(&storage, &next, answer(AlignmentState::Aligned), 32).await);
    // The same after the job has ended.
    assert!(!end_attempt(&storage, &late, answer(AlignmentState::Failed), 33).await);
    assert!(!end_attempt(&storage, &next, answer(AlignmentState::Failed), 33).await);
    let clip = clip_of(&storage, &next).await;
    assert_eq!(clip.state, ClipState::Aligned);
    assert_eq!(bytes_of(storage.clip_result(&clip, "overlay.png").await.unwrap()).await, b"next");
}

async fn a_lost_worker_costs_no_attempt(storage: Storage) {
    one_job(&storage).await;
    let first = claim(&storage, 0).await;
    assert!(first.is_first());
    // At once the first time, then after the default policy's pauses: 5 s, 10 s, 20 s.
    let mut now_s = 0;
    for pause_s in [0, 5, 10, 20] {
        now_s += 30 + pause_s;
        if pause_s > 0 {
            assert_eq!(storage.release_lost(&RetryPolicy::default(), at(now_s - pause_s)).await.unwrap(), 1);
            let clip = clip_of(&storage, &first).await;
            assert_eq!((clip.state, clip.reasons[0].code.as_str()), (ClipState::Queued, "worker_lost"));
            assert!(due(&storage, now_s - 1).await.is_none());
        }
        let next = claim(&storage, now_s).await;
        assert_eq!((next.job.id, next.job.attempts), (first.job.id, 1));
        assert!(!next.is_first());
    }
    assert_eq!(storage.release_lost(&RetryPolicy::default(), at(now_s + 30)).await.unwrap(), 1);
    let last = claim(&storage, now_s + 1000).await;
    assert!(end_attempt(&storage, &last, answer(AlignmentState::Aligned), now_s + 1001).await);
    assert_eq!(clip_of(&storage, &last).await.state, ClipState::Aligned);
}

async fn a_job_whose_workers_are_lost_for_a_day_fails(storage: Storage) {
    one_job(&storage).await;
    let (mut now_s, mut lost) = (0, 0);
    let mut last = claim(&storage, now_s).await;
    loop {
        // As a machine that goes down with the job, and comes back when the job is due again.
        now_s += 30 + 1800;
        assert_eq!(storage.release_lost(&RetryPolicy::default(), at(now_s)).await.unwrap(), 1);
        lost += 1;
        now_s += 1800;
        let Some(next) = due(&storage, now_s).await else { break };
        assert_eq!((next.job.id, next.job.attempts), (last.job.id, 1));
        last = next;
    }
    assert!(lost >= 20 && now_s >= 24 * 3600, "{lost} workers in {now_s} s");
    let job = storage.job(last.job.id).await.unwrap().unwrap();
    assert_eq!((job.state, job.error.unwrap().code.as_str()), (JobState::Failed, "worker_lost"));
    let clip = clip_of(&storage, &last).await;
    assert_eq!((clip.state, clip.reasons[0].code.as_str()), (ClipState::Failed, "worker_lost"));
    assert!(clip.reasons[0].detail.contains("24 hours"), "{:?}", clip.reasons);
}

async fn faults_cost_no_attempt_and_are_borne_for_a_day(storage: Storage) {
    one_job(&storage).await;
    let (mut now_s, mut pause_s, mut faults) = (0, 5, 0);
    let last = loop {
        let held = claim(&storage, now_s).await;
        assert_eq!(held.job.attempts, 1);
        assert!(end_attempt(&storage, &held, AttemptEnd::Fault(Fault::Storage), now_s).await);
        faults += 1;
        let clip = clip_of(&storage, &held).await;
        assert_eq!(clip.reasons[0].code, "storage_fault");
        if clip.state == ClipState::Failed {
            break clip;
        }
        assert_eq!((clip.state, clip.job.unwrap().state), (ClipState::Queued, JobState::Queued));
        assert!(due(&storage, now_s + pause_s - 1).await.is_none(), "fault {faults}");
        now_s += pause_s;
        pause_s = (2 * pause_s).min(30 * 60);
    };
    let day_s = 24 * 3600;
    assert!((day_s..day_s + 1800).contains(&now_s), "{faults} faults in {now_s} s");
    assert!(last.reasons[0].detail.contains("24 hours"), "{:?}", last.reasons);
    assert!(due(&storage, 2 * day_s).await.is_none());
}

async fn an_attempt_that_counts_ends_a_row_of_faults(storage: Storage) {
    one_job(&storage).await;
    let mut now_s = 0;
    for _ in 0..30 {
        let held = claim(&storage, now_s).await;
        assert!(end_attempt(&storage, &held, AttemptEnd::Fault(Fault::System), now_s).await);
        now_s += 1800;
    }
    let held = claim(&storage, now_s).await;
    assert!(end_attempt(&storage, &held, AttemptEnd::Broken(reason("internal_error")), now_s).await);
    // Another 30 of them are less than a day again, though both series together are more.
    for _ in 0..30 {
        now_s += 1800;
        let held = claim(&storage, now_s).await;
        assert_eq!(held.job.attempts, 2);
        assert!(end_attempt(&storage, &held, AttemptEnd::Fault(Fault::System), now_s).await);
    }
    assert!(now_s > 24 * 3600);
    let held = claim(&storage, now_s + 1800).await;
    assert!(end_attempt(&storage, &held, answer(AlignmentState::Aligned), now_s + 1801).await);
}

async fn a_pause_does_not_count_as_waiting(storage: Storage) {
    one_job(&storage).await;
    let state = async |seconds| {
        let state = storage.queue_state(at(seconds)).await.unwrap();
        (state.queued, state.paused, state.running, state.age.as_secs())
    };
    assert_eq!(state(10).await, (1, 0, 0, 10));
    let held = claim(&storage, 10).await;
    assert_eq!(state(20).await, (0, 0, 1, 0));
    // The first pause of the default policy is 5 s.
    assert!(end_attempt(&storage, &held, AttemptEnd::Fault(Fault::Storage), 20).await);
    assert_eq!(state(22).await, (1, 1, 0, 0));
    assert_eq!(state(28).await, (1, 0, 0, 3));
}

async fn a_machine_that_was_off_for_a_day_fails_nothing(storage: Storage) {
    one_job(&storage).await;
    for now_s in [0, 100_000, 200_000] {
        let held = claim(&storage, now_s).await;
        assert!(end_attempt(&storage, &held, AttemptEnd::Fault(Fault::Storage), now_s).await);
        assert_eq!(clip_of(&storage, &held).await.state, ClipState::Queued);
    }
}

#[tokio::test]
async fn faults_outlive_a_restart() {
    let folder = tempfile::tempdir().unwrap();
    let storage = in_folder(folder.path()).await;
    one_job(&storage).await;
    let held = claim(&storage, 0).await;
    assert!(end_attempt(&storage, &held, AttemptEnd::Fault(Fault::System), 0).await);
    claim(&storage, 5).await;
    storage.close().await;
    drop(storage);
    let storage = in_folder(folder.path()).await;
    // The lost worker is the second fault in a row.
    assert_eq!(storage.release_lost(&RetryPolicy::default(), at(35)).await.unwrap(), 1);
    assert!(due(&storage, 35 + 4).await.is_none());
    let held = claim(&storage, 35 + 5).await;
    assert_eq!(held.job.attempts, 1);
    assert!(end_attempt(&storage, &held, AttemptEnd::Fault(Fault::System), 100).await);
    assert!(due(&storage, 100 + 19).await.is_none());
    assert_eq!(claim(&storage, 100 + 20).await.job.attempts, 1);
}

async fn a_broken_attempt_is_tried_later_and_not_for_ever(storage: Storage) {
    one_job(&storage).await;
    // 5 s after the first failure and twice that after the second: the policy's default.
    let held = claim(&storage, 0).await;
    assert!(end_attempt(&storage, &held, AttemptEnd::Broken(reason("first")), 0).await);
    assert_eq!(clip_of(&storage, &held).await.reasons[0].code, "first");
    assert!(due(&storage, 4).await.is_none());
    let held = claim(&storage, 5).await;
    assert!(end_attempt(&storage, &held, AttemptEnd::Broken(reason("second")), 10).await);
    assert!(due(&storage, 19).await.is_none());
    let held = claim(&storage, 20).await;
    assert!(end_attempt(&storage, &held, AttemptEnd::Broken(reason("third")), 21).await);
    assert!(due(&storage, 9999).await.is_none());
    let clip = clip_of(&storage, &held).await;
    assert_eq!((clip.state, clip.reasons[0].code.as_str()), (ClipState::Failed, "third"));
    assert_eq!(clip.job.unwrap().state, JobState::Failed);
}

async fn a_refused_clip_fails_at_once(storage: Storage) {
    one_job(&storage).await;
    let held = claim(&storage, 0).await;
    assert!(end_attempt(&storage, &held, AttemptEnd::Refused(reason("bad_picture")), 1).await);
    assert!(due(&storage, 9999).await.is_none());
    let clip = clip_of(&storage, &held).await;
    assert_eq!((clip.state, clip.reasons), (ClipState::Failed, vec![reason("bad_picture")]));
}

async fn a_job_given_up_is_not_held_against_it(storage: Storage) {
    one_job(&storage).await;
    for _ in 0..5 {
        let held = claim(&storage, 0).await;
        assert_eq!(held.job.attempts, 1);
        assert!(end_attempt(&storage, &held, AttemptEnd::GivenUp, 0).await);
        assert_eq!(clip_of(&storage, &held).await.state, ClipState::Queued);
    }
}

async fn cancelling_ends_what_waits_or_runs(storage: Storage) {
    let (id, clip) = one_job(&storage).await;
    let waiting = clip.job.unwrap().id;
    let cancelled = storage.cancel_job(waiting, at(1)).await.unwrap().unwrap();
    assert_eq!((cancelled.state, cancelled.finished_at), (JobState::Cancelled, Some(at(1))));
    assert_eq!(cancelled.error.as_ref().map(|reason| reason.code.as_str()), Some("cancelled"));
    assert!(due(&storage, 2).await.is_none());
    let clip = storage.clip(&id, clip.id).await.unwrap();
    assert_eq!((clip.state, clip.reasons[0].code.as_str()), (ClipState::Uploaded, "cancelled"));

    storage.align_clip(&id, clip.id, at(3)).await.unwrap();
    let running = claim(&storage, 3).await;
    storage.cancel_job(running.job.id, at(4)).await.unwrap();
    assert!(!storage.holds(&running).await.unwrap());
    assert!(!end_attempt(&storage, &running, answer(AlignmentState::Aligned), 5).await);
    assert_eq!(clip_of(&storage, &running).await.state, ClipState::Uploaded);

    // An ended job stays as it is; an earlier job does not touch the clip.
    storage.align_clip(&id, clip.id, at(6)).await.unwrap();
    let done = claim(&storage, 6).await;
    assert!(end_attempt(&storage, &done, answer(AlignmentState::Aligned), 7).await);
    let unmoved = storage.cancel_job(done.job.id, at(8)).await.unwrap().unwrap();
    assert_eq!(unmoved.state, JobState::Succeeded);
    storage.cancel_job(waiting, at(8)).await.unwrap();
    assert_eq!(clip_of(&storage, &done).await.state, ClipState::Aligned);
    assert_eq!(storage.cancel_job(Uuid::now_v7(), at(8)).await.unwrap(), None);
}

async fn jobs_that_cannot_be_read_let_others_pass(storage: Storage) {
    let (home, first) = one_job(&storage).await;
    let second = add(&storage, &home, b"second").await;
    let third = add(&storage, &home, b"third").await;
    let later = "UPDATE clips SET choice = 'of a later version' WHERE id = $1";
    execute(&storage, later, &first.id.to_string()).await;
    let later = "UPDATE jobs SET error = 'of a later version' WHERE clip_id = $1";
    execute(&storage, later, &second.id.to_string()).await;
    for _ in 0..2 {
        let refused = storage.claim(LEASE, at(1)).await;
        assert!(matches!(refused, Err(StorageError::Column { .. })), "{refused:?}");
    }
    assert_eq!(claim(&storage, 1).await.job.clip, third.id);
    assert!(due(&storage, 5).await.is_none(), "both rest");
    execute(&storage, "UPDATE clips SET choice = NULL WHERE id = $1", &first.id.to_string()).await;
    for clip in [first.id, second.id] {
        let held = claim(&storage, 6).await;
        assert_eq!((held.job.clip, held.job.attempts), (clip, 1));
    }
}

async fn a_lost_job_that_cannot_be_read_lets_others_pass(storage: Storage) {
    let (home, first) = one_job(&storage).await;
    let second = add(&storage, &home, b"second").await;
    let held = [claim(&storage, 0).await, claim(&storage, 1).await];
    assert_eq!(held.map(|claim| claim.job.clip), [first.id, second.id]);
    let later = "UPDATE clips SET choice = 'of a later version' WHERE id = $1";
    execute(&storage, later, &first.id.to_string()).await;
    assert_eq!(storage.release_lost(&RetryPolicy::default(), at(31)).await.unwrap(), 2);
    let refused = storage.claim(LEASE, at(31)).await;
    assert!(matches!(refused, Err(StorageError::Column { .. })), "{refused:?}");
    assert_eq!(claim(&storage, 31).await.job.clip, second.id);
    execute(&storage, "UPDATE clips SET choice = NULL WHERE id = $1", &first.id.to_string()).await;
    assert_eq!(storage.clip(&home, first.id).await.unwrap().state, ClipState::Queued);
    let held = claim(&storage, 50).await;
    assert_eq!((held.job.clip, held.job.attempts), (first.id, 1));
}

/// On SQLite no two transactions write at once.
#[tokio::test]
async fn a_lost_job_of_a_busy_home_lets_others_pass() {
    let Some(postgres) = Schema::new().await else { return };
    let folder = tempfile::tempdir().unwrap();
    let storage = on(&postgres, folder.path(), None).await;
    let (busy, _) = one_job(&storage).await;
    let other = home("other");
    storage.put_home(&other, None, |_| true, at(0)).await.unwrap();
    put_map(&storage, &other, b"map").await;
    add(&storage, &other, b"clip").await;
    assert_eq!(claim(&storage, 0).await.job.home, busy);
    assert_eq!(claim(&storage, 1).await.job.home, other);
    let mut change = storage.database.begin().await.unwrap();
    assert!(crate::homes::lock(&mut change, &busy).await.unwrap());
    assert_eq!(claim(&storage, 31).await.job.home, other);
    change.commit().await.unwrap();
    assert_eq!(claim(&storage, 31).await.job.home, busy);
    postgres.remove().await;
}
