//! Merges that end without a result are repeated after pauses.

use super::home_maps::{align, due, revision, two_aligned};
use super::*;
use viola_home::PlacedBy;

on_every_back_end!(
    a_merge_that_fails_rests_longer_each_time,
    a_merge_that_loses_its_worker_rests_from_the_second_time,
    a_clip_with_damaged_files_tells_it,
    a_result_ends_the_faults_of_a_home,
    a_home_that_cannot_be_read_lets_others_pass,
);

async fn one_due(storage: &Storage) -> (HomeId, Clip) {
    let made = one_job(storage).await;
    align(storage, AlignmentState::Aligned).await;
    made
}

/// Checks that a home rests for `pause_s` from `now` on, and returns the next claim with its time.
async fn after_pause(storage: &Storage, now: i64, pause_s: i64) -> (MergeClaim, i64) {
    let end = now + pause_s;
    for early in [now, end - 1].into_iter().filter(|early| (now..end).contains(early)) {
        assert!(due(storage, early).await.is_none(), "{early} of {now} + {pause_s}");
    }
    (due(storage, end).await.expect("the pause is over"), end)
}

async fn a_merge_that_fails_rests_longer_each_time(storage: Storage) {
    one_due(&storage).await;
    let (mut claim, mut now) = after_pause(&storage, 200, 0).await;
    for pause_s in [5, 10, 20, 40, 80, 160, 320, 640, 1280, 1800, 1800] {
        storage.fail_merge(&claim, None, at(now)).await.unwrap();
        (claim, now) = after_pause(&storage, now, pause_s).await;
    }
}

async fn a_merge_that_loses_its_worker_rests_from_the_second_time(storage: Storage) {
    one_due(&storage).await;
    let (mut claim, mut now) = after_pause(&storage, 200, 0).await;
    for pause_s in [0, 10, 20, 40] {
        let lost = claim;
        (claim, now) = after_pause(&storage, now + 30, pause_s).await;
        assert!(!storage.renew_merge(&lost, LEASE, at(now)).await.unwrap());
    }
}

async fn a_clip_with_damaged_files_tells_it(storage: Storage) {
    let (home, clips) = two_aligned(&storage).await;
    let codes = async || {
        let mut codes = Vec::new();
        for id in &clips {
            let clip = storage.clip(&home, *id).await.unwrap();
            assert_eq!(clip.state, ClipState::Aligned);
            codes.push(clip.reasons.into_iter().map(|reason| reason.code).collect::<Vec<_>>());
        }
        codes
    };
    let (own, damaged) = (vec!["two_modes"], vec!["two_modes", "results_damaged"]);
    // No merge without this clip is possible.
    let claim = due(&storage, 200).await.expect("the home is due");
    storage.fail_merge(&claim, Some(clips[0]), at(200)).await.unwrap();
    assert_eq!(codes().await, [damaged.clone(), own.clone()]);
    // The next one is without the other clip, and so is the one after it, which changes nothing.
    for seconds in [201, 203] {
        let mut claim = due(&storage, seconds).await.expect("the home is due");
        claim.leave_out(clips[1]);
        let new = revision(&claim, PlacedBy::Alignment, b"tile");
        let new = Some(&new).filter(|_| seconds == 201);
        assert!(storage.finish_merge(&claim, new, at(seconds)).await.unwrap());
        assert_eq!(codes().await, [own.clone(), damaged.clone()], "{seconds}");
        let edit = ClipEdit { recorded_at: Some(Some(at(seconds))), ..ClipEdit::default() };
        storage.edit_clip(&home, clips[0], edit, |_| true, at(seconds)).await.unwrap();
    }
    let left_out = storage.clips_left_out(&home).await.unwrap();
    assert_eq!((left_out[0].clip, left_out[0].reasons[1].code.as_str()), (clips[1], "results_damaged"));
    // Its files are there again.
    let claim = due(&storage, 205).await.expect("the home is due");
    let new = revision(&claim, PlacedBy::Alignment, b"both");
    assert!(storage.finish_merge(&claim, Some(&new), at(205)).await.unwrap());
    assert_eq!(codes().await, [own.clone(), own]);
}

async fn a_result_ends_the_faults_of_a_home(storage: Storage) {
    let (home, clip) = one_due(&storage).await;
    let (mut claim, mut now) = after_pause(&storage, 200, 0).await;
    // The cause of these may have passed: the first retry comes at once.
    for pause_s in [0, 10] {
        storage.fail_merge(&claim, Some(clip.id), at(now)).await.unwrap();
        (claim, now) = after_pause(&storage, now, pause_s).await;
    }
    let new = revision(&claim, PlacedBy::Alignment, b"tile");
    assert!(storage.finish_merge(&claim, Some(&new), at(now)).await.unwrap());
    storage.align_clip(&home, clip.id, at(100)).await.unwrap();
    align(&storage, AlignmentState::Aligned).await;
    let (claim, now) = after_pause(&storage, 300, 0).await;
    storage.fail_merge(&claim, Some(clip.id), at(now)).await.unwrap();
    after_pause(&storage, now, 0).await;
}

async fn a_home_that_cannot_be_read_lets_others_pass(storage: Storage) {
    let (_, clip) = one_due(&storage).await;
    let other = home("other");
    storage.put_home(&other, None, |_| true, at(0)).await.unwrap();
    put_map(&storage, &other, b"map").await;
    add(&storage, &other, b"clip").await;
    align(&storage, AlignmentState::Aligned).await;
    let later = "UPDATE clips SET alignment = 'of a later version' WHERE id = $1";
    execute(&storage, later, &clip.id.to_string()).await;
    let is_unreadable = async |seconds| {
        let claimed = storage.claim_merge("", LEASE, at(seconds)).await;
        matches!(claimed, Err(StorageError::Column { .. }))
    };
    assert!(is_unreadable(200).await);
    assert_eq!(due(&storage, 200).await.expect("a home is due").home, other);
    assert!(due(&storage, 204).await.is_none());
    assert!(is_unreadable(205).await);
}
