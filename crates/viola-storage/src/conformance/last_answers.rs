//! The last answer of a clip, while its newest job has none.

use super::home_maps::{align, due, merge_by};
use super::limits::check;
use super::*;
use viola_home::PlacedBy;

on_every_back_end!(
    a_new_map_keeps_the_last_answer_until_another,
    a_clip_with_a_last_answer_goes_whole,
    a_sweep_leaves_last_answers,
    a_new_answer_has_not_the_place_of_the_last_one,
);

/// Answers the next job, with a picture.
async fn answer_with(storage: &Storage, state: AlignmentState, picture: &[u8], seconds: i64) {
    let claim = storage.claim(LEASE, at(seconds)).await.unwrap().expect("a job is due");
    storage.put_result(&claim, result_file::OVERLAY, picture.to_vec()).await.unwrap();
    assert!(end_attempt(storage, &claim, answer(state), seconds).await);
}

async fn picture(storage: &Storage, clip: &Clip) -> Vec<u8> {
    bytes_of(storage.clip_result(clip, result_file::OVERLAY).await.unwrap()).await
}

async fn a_new_map_keeps_the_last_answer_until_another(storage: Storage) {
    let (home, clip) = one_job(&storage).await;
    let read = async || storage.clip(&home, clip.id).await.unwrap();
    assert_eq!(read().await.last_answer, None);
    answer_with(&storage, AlignmentState::Ambiguous, b"first picture", 10).await;
    let first = read().await;
    assert_eq!((&first.last_answer, picture(&storage, &first).await), (&None, b"first picture".to_vec()));
    let key = first.result_key().map(str::to_owned);
    let merge = due(&storage, 20).await.expect("a clip has an answer");
    assert!(storage.finish_merge(&merge, None, at(21)).await.unwrap());

    // Whatever becomes of the jobs, the first answer and its files stay, as those of the first map.
    let check_last = async |what: &str, state: ClipState| {
        let clip = read().await;
        assert_eq!((clip.state, &clip.alignment), (state, &None), "{what}");
        let last = clip.last_answer.as_ref().expect(what);
        assert_eq!((Some(&last.alignment), last.lidar_map_revision), (first.alignment.as_ref(), 1), "{what}");
        assert_eq!(clip.result_key().map(str::to_owned), key, "{what}");
        assert_eq!(picture(&storage, &clip).await, b"first picture", "{what}");
        assert_eq!(storage.result_keys(&home).await.unwrap().get(&clip.id), key.as_ref(), "{what}");
        check(&storage, what).await;
    };
    put_map(&storage, &home, b"second map").await;
    check_last("a second map", ClipState::Queued).await;
    assert!(due(&storage, 30).await.is_none(), "the map waits for the clip");
    put_map(&storage, &home, b"third map").await;
    check_last("a third map", ClipState::Queued).await;
    let late = storage.claim(LEASE, at(40)).await.unwrap().expect("a job is due");
    check_last("a running job", ClipState::Aligning).await;
    assert!(end_attempt(&storage, &late, AttemptEnd::Refused(reason("took_too_long")), 41).await);
    check_last("a failed job", ClipState::Failed).await;
    // It is no part of the home's map meanwhile.
    let merge = due(&storage, 42).await.expect("a clip is gone from the map");
    assert!(merge.members.is_empty());
    assert!(storage.finish_merge(&merge, None, at(43)).await.unwrap());
    let again = storage.align_clip(&home, clip.id, at(50)).await.unwrap();
    check_last("another job", ClipState::Queued).await;
    storage.cancel_job(again.job.unwrap().id, at(51)).await.unwrap();
    check_last("a cancelled job", ClipState::Uploaded).await;

    storage.align_clip(&home, clip.id, at(60)).await.unwrap();
    answer_with(&storage, AlignmentState::Aligned, b"second", 61).await;
    let second = read().await;
    assert_eq!((second.state, &second.last_answer), (ClipState::Aligned, &None));
    assert_eq!(picture(&storage, &second).await, b"second");
    check(&storage, "another answer").await;
    // Three maps with their pictures, the recording and one picture: nothing is left of the first answer.
    assert_eq!(storage.blobs_that_exist().await.len(), 3 * 2 + 2);
}

async fn a_clip_with_a_last_answer_goes_whole(storage: Storage) {
    let (home, clip) = one_job(&storage).await;
    answer_with(&storage, AlignmentState::Aligned, b"picture", 10).await;
    put_map(&storage, &home, b"second map").await;
    let other = add(&storage, &home, b"other").await;
    answer_with(&storage, AlignmentState::Aligned, b"picture", 20).await;
    assert!(storage.clip(&home, other.id).await.unwrap().alignment.is_some(), "new clips come first");
    storage.delete_clip(&home, clip.id, |_| true, at(30)).await.unwrap();
    check(&storage, "the end of a clip").await;
    assert_eq!(storage.blobs_that_exist().await.len(), 2 * 2 + 2);
    storage.align_clip(&home, other.id, at(40)).await.unwrap();
    storage.delete_home(&home, |_| true, at(50)).await.unwrap();
    assert_eq!(storage.blobs_that_exist().await, Vec::<String>::new());
    assert_eq!(storage.tenant_bytes(&Tenant::default()).await.unwrap(), 0);
}

async fn a_sweep_leaves_last_answers(storage: Storage) {
    let (home, clip) = one_job(&storage).await;
    answer_with(&storage, AlignmentState::Aligned, b"picture", 10).await;
    let before = storage.clip(&home, clip.id).await.unwrap();
    put_map(&storage, &home, b"second map").await;
    assert_eq!(storage.sweep(Timestamp::MAX, SweepLimit::Everything).await.unwrap(), 0);
    // Nor does a worker that ends late, and whose files the clip still has.
    storage.discard_unless_kept(before.result_key().unwrap()).await.unwrap();
    assert_eq!(picture(&storage, &before).await, b"picture");
}

/// The place is in the frame of another LiDAR map, maybe for hours: a merge waits for all clips of the home.
async fn a_new_answer_has_not_the_place_of_the_last_one(storage: Storage) {
    let (home, clip) = one_job(&storage).await;
    let read = async || storage.clip(&home, clip.id).await.unwrap();
    let merge = async |seconds| {
        merge_by(&storage, PlacedBy::Neighbours, b"tile", seconds).await;
        read().await.placement.expect("it is in the map").map_from_clip
    };
    align(&storage, AlignmentState::Ambiguous).await;
    let own = read().await.alignment.unwrap();
    let place = merge(110).await;
    assert_ne!(own.map_from_clip, Some(place));
    assert_eq!(read().await.alignment.unwrap().map_from_clip, Some(place));
    put_map(&storage, &home, b"second map").await;
    assert_eq!(read().await.last_answer.unwrap().alignment.map_from_clip, Some(place));
    align(&storage, AlignmentState::Ambiguous).await;
    let again = read().await;
    assert_eq!((again.alignment.unwrap(), again.state), (own, ClipState::Ambiguous));
    assert!(again.placement.is_some(), "the newest map has it");
    let place = merge(120).await;
    assert_eq!(read().await.alignment.unwrap().map_from_clip, Some(place));
}
