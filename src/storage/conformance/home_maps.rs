//! Which homes are merged, by whom, and what is kept of it.

use super::*;
use crate::home::HomeMapInfo;

on_every_back_end!(
    a_home_is_merged_when_its_clips_have_settled,
    one_worker_merges_a_home_at_a_time,
    a_change_during_a_merge_makes_it_due_again,
    removing_a_clip_makes_a_new_revision,
    old_revisions_go,
);

/// A home with two aligned clips.
async fn two_aligned(storage: &Storage) -> (HomeId, Vec<Uuid>) {
    let (home, first) = one_job(storage).await;
    let second = add(storage, &home, b"other").await;
    for _ in 0..2 {
        align(storage).await;
    }
    (home, vec![first.id, second.id])
}

/// Does the next job: its clip is aligned, with a cloud that holds its id.
async fn align(storage: &Storage) {
    let claim = storage.claim(LEASE, at(100)).await.unwrap().expect("a job is due");
    storage.put_result(&claim, "cloud.ply", claim.job.clip.to_string().into_bytes()).await.unwrap();
    let retry = RetryPolicy::default();
    assert!(storage.finish(&claim, &answer(AlignmentState::Aligned), &retry, at(100)).await.unwrap());
}

async fn due(storage: &Storage, seconds: i64) -> Option<MergeClaim> {
    storage.claim_merge(LEASE, at(seconds)).await.unwrap()
}

/// The clouds of a claim, one after the other.
async fn clouds(storage: &Storage, claim: &MergeClaim) -> Vec<u8> {
    let mut all = Vec::new();
    for place in 0..claim.clips() {
        all.extend_from_slice(&storage.merge_cloud(claim, place).await.unwrap().expect("the cloud is there"));
    }
    all
}

fn info(points: usize) -> HomeMapInfo {
    HomeMapInfo { points, voxel_m: 0.03, min_m: None, max_m: None, classes: Vec::new() }
}

async fn finish(storage: &Storage, claim: &MergeClaim, bytes: &[u8], seconds: i64) -> bool {
    storage.finish_merge(claim, &info(bytes.len()), bytes.to_vec(), at(seconds)).await.unwrap()
}

async fn current(storage: &Storage, home: &HomeId) -> HomeMap {
    storage.home_map(home).await.unwrap().expect("there is a map")
}

async fn a_home_is_merged_when_its_clips_have_settled(storage: Storage) {
    let (home, first) = one_job(&storage).await;
    assert!(due(&storage, 1).await.is_none(), "nothing is aligned");
    let second = add(&storage, &home, b"other").await;
    align(&storage).await;
    assert!(due(&storage, 2).await.is_none(), "a clip is on its way");
    assert_eq!(storage.home_map(&home).await.unwrap(), None);
    align(&storage).await;
    let claim = due(&storage, 3).await.expect("the home is due");
    assert_eq!(clouds(&storage, &claim).await, format!("{}{}", first.id, second.id).into_bytes());
    assert!(finish(&storage, &claim, b"both", 4).await);
    let map = current(&storage, &home).await;
    assert_eq!((map.revision, map.lidar_map_revision, map.created_at), (1, 1, at(4)));
    assert_eq!((map.clips.clone(), map.info.points), (vec![first.id, second.id], 4));
    assert_eq!(bytes_of(storage.home_map_points(&map).await.unwrap()).await, b"both");
    assert!(due(&storage, 5).await.is_none());
    // A clip that cannot be aligned changes no map.
    let third = add(&storage, &home, b"third").await;
    let held = storage.claim(LEASE, at(6)).await.unwrap().unwrap();
    let failed = Ending::Refused(reason("unreadable"));
    assert!(storage.finish(&held, &failed, &RetryPolicy::default(), at(6)).await.unwrap());
    assert!(due(&storage, 7).await.is_none());
    let left_out = storage.clips_left_out(&home).await.unwrap();
    assert_eq!((left_out.len(), left_out[0].clip, left_out[0].state), (1, third.id, ClipState::Failed));
    assert_eq!(left_out[0].reasons, [reason("unreadable")]);
}

async fn one_worker_merges_a_home_at_a_time(storage: Storage) {
    let (home, _) = two_aligned(&storage).await;
    let late = due(&storage, 10).await.expect("the home is due");
    assert!(due(&storage, 39).await.is_none(), "its lease runs");
    let next = due(&storage, 40).await.expect("its worker is dead");
    assert!(!finish(&storage, &late, b"late", 41).await);
    assert_eq!(storage.home_map(&home).await.unwrap(), None, "a late worker changes nothing");
    assert!(finish(&storage, &next, b"next", 42).await);
    assert!(!finish(&storage, &late, b"late", 43).await);
    let map = current(&storage, &home).await;
    assert_eq!(map.revision, 1);
    assert_eq!(bytes_of(storage.home_map_points(&map).await.unwrap()).await, b"next");
}

async fn a_change_during_a_merge_makes_it_due_again(storage: Storage) {
    let (home, clips) = two_aligned(&storage).await;
    let claim = due(&storage, 10).await.expect("the home is due");
    storage.delete_clip(&home, clips[0], at(500)).await.unwrap();
    assert!(storage.merge_cloud(&claim, 0).await.unwrap().is_none(), "its cloud is gone");
    storage.give_back_merge(&claim, at(15)).await.unwrap();
    assert!(due(&storage, 14).await.is_none());
    let again = due(&storage, 15).await.expect("the home is due");
    assert_eq!(again.clips(), 1);
    // A change after the clouds were read: what was merged is kept, and the next merge follows.
    let third = add(&storage, &home, b"third").await;
    align(&storage).await;
    assert!(finish(&storage, &again, b"one", 16).await);
    assert_eq!(current(&storage, &home).await.clips, [clips[1]]);
    let last = due(&storage, 17).await.expect("the home is due");
    assert!(finish(&storage, &last, b"two", 18).await);
    let map = current(&storage, &home).await;
    assert_eq!((map.revision, map.clips), (2, vec![clips[1], third.id]));
}

async fn removing_a_clip_makes_a_new_revision(storage: Storage) {
    let (home, clips) = two_aligned(&storage).await;
    let claim = due(&storage, 10).await.unwrap();
    assert!(finish(&storage, &claim, b"both", 10).await);
    // While a clip is aligned anew the old map stays.
    storage.align_clip(&home, clips[1], at(11)).await.unwrap();
    assert!(due(&storage, 11).await.is_none());
    assert_eq!(current(&storage, &home).await.clips, clips);
    align(&storage).await;
    let claim = due(&storage, 12).await.expect("aligned anew, merged anew");
    assert!(finish(&storage, &claim, b"again", 12).await);
    for id in &clips {
        storage.delete_clip(&home, *id, at(500)).await.unwrap();
    }
    let claim = due(&storage, 13).await.expect("the home is due");
    assert_eq!(claim.clips(), 0);
    assert!(finish(&storage, &claim, b"", 13).await);
    assert!(current(&storage, &home).await.clips.is_empty());
    storage.delete_home(&home, at(500)).await.unwrap();
    assert!(storage.blob_keys().await.unwrap().is_empty());
    assert!(storage.blobs.keys().unwrap().is_empty(), "nothing is left of the home");
}

async fn old_revisions_go(storage: Storage) {
    let (home, clips) = two_aligned(&storage).await;
    let mut maps = Vec::new();
    for n in 0..7 {
        storage.align_clip(&home, clips[0], at(20 + n)).await.unwrap();
        align(&storage).await;
        let claim = due(&storage, 20 + n).await.expect("the home is due");
        assert!(finish(&storage, &claim, &[n as u8], 20 + n).await);
        maps.push(current(&storage, &home).await);
    }
    assert_eq!(maps.last().unwrap().revision, 7);
    for (n, map) in maps.iter().enumerate() {
        let points = storage.home_map_points(map).await.unwrap();
        assert_eq!(points.is_some(), n >= 2, "the newest five are kept: {}", map.revision);
    }
}
