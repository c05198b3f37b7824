//! Homes, LiDAR maps, clips and idempotency keys.

use super::home_maps::{align, due, finish, two_aligned};
use super::*;

on_every_back_end!(
    homes_come_and_go,
    a_renamed_home_is_merged_again,
    lists_page_through_everything_once,
    what_is_not_there_is_told,
    a_clip_waits_for_the_first_map,
    the_same_map_again_changes_nothing,
    a_new_map_queues_every_clip_anew,
    a_key_replays_its_file_and_refuses_another,
    aligning_again_replaces_the_answer,
    deleting_leaves_no_byte,
);

async fn homes_come_and_go(storage: Storage) {
    let id = home("Home_1.a-b");
    let (made, is_new) = storage.put_home(&id, Some("Nice \u{1f3e0} 'home'"), |_| true, at(0)).await.unwrap();
    assert!(is_new);
    assert_eq!(made.name.as_deref(), Some("Nice \u{1f3e0} 'home'"));
    let (renamed, is_new) = storage.put_home(&id, None, |_| true, at(5)).await.unwrap();
    assert!(!is_new);
    assert_eq!((renamed.name.as_ref(), renamed.created_at, renamed.updated_at), (None, at(0), at(5)));
    assert_eq!(storage.home(&id).await.unwrap(), renamed);
    storage.delete_home(&id, |_| true, at(500)).await.unwrap();
    assert!(matches!(storage.home(&id).await, Err(StorageError::NoSuchHome)));
}

/// The plans of its map have its name.
async fn a_renamed_home_is_merged_again(storage: Storage) {
    let bare = home("bare");
    for name in [None, Some("Oak")] {
        storage.put_home(&bare, name, |_| true, at(1)).await.unwrap();
        assert!(due(&storage, 2).await.is_none(), "it has nothing to merge");
    }
    let (elm, _) = two_aligned(&storage).await;
    let claim = due(&storage, 101).await.expect("the home is due");
    assert_eq!(claim.home_name, None);
    assert!(finish(&storage, &claim, b"tile", 102).await);
    for name in [Some("Elm"), None] {
        storage.put_home(&elm, name, |_| true, at(103)).await.unwrap();
        let claim = due(&storage, 104).await.expect("the home has another name");
        assert_eq!(claim.home_name.as_deref(), name);
        assert!(storage.finish_merge(&claim, None, at(105)).await.unwrap());
        storage.put_home(&elm, name, |_| true, at(106)).await.unwrap();
        assert!(due(&storage, 107).await.is_none(), "the name is the same");
    }
}

async fn lists_page_through_everything_once(storage: Storage) {
    let homes: Vec<HomeId> = (0..7).map(|n| home(&format!("h{n}"))).collect();
    for id in &homes {
        storage.put_home(id, None, |_| true, at(0)).await.unwrap();
    }
    let mut seen = Vec::new();
    let mut page = Page { limit: 3, after: None };
    loop {
        let part = storage.homes(&Tenant::default(), &HomeFilter::default(), &page).await.unwrap();
        assert!(part.len() <= 3);
        let Some(last) = part.last() else { break };
        page.after = Some(last.id.clone());
        seen.extend(part.into_iter().map(|home| home.id));
    }
    assert_eq!(seen, homes);

    let mut clips = Vec::new();
    for n in 0..5u8 {
        clips.push(add(&storage, &homes[0], &[n]).await.id);
    }
    let first =
        storage.clips(&homes[0], &ClipFilter::default(), &Page { limit: 3, after: None }).await.unwrap();
    let rest = storage
        .clips(&homes[0], &ClipFilter::default(), &Page { limit: 3, after: Some(first[2].id) })
        .await
        .unwrap();
    let seen: Vec<Uuid> = first.iter().chain(&rest).map(|clip| clip.id).collect();
    assert_eq!(seen, clips);

    for n in 0..4u8 {
        put_map(&storage, &homes[0], &[n]).await;
    }
    let newest = storage
        .lidar_map_revisions(&homes[0], LevelName::MAIN, &Page { limit: 2, after: None })
        .await
        .unwrap();
    let older = storage
        .lidar_map_revisions(&homes[0], LevelName::MAIN, &Page { limit: 9, after: Some(3) })
        .await
        .unwrap();
    let seen: Vec<i64> = newest.iter().chain(&older).map(|map| map.revision).collect();
    assert_eq!(seen, [4, 3, 2, 1]);
}

async fn what_is_not_there_is_told(storage: Storage) {
    let (nowhere, page) = (home("nowhere"), Page { limit: 9, after: None });
    assert!(matches!(storage.home(&nowhere).await, Err(StorageError::NoSuchHome)));
    assert!(matches!(storage.delete_home(&nowhere, |_| true, at(500)).await, Err(StorageError::NoSuchHome)));
    assert!(matches!(
        storage.clips(&nowhere, &ClipFilter::default(), &page).await,
        Err(StorageError::NoSuchHome)
    ));
    assert!(matches!(storage.lidar_map(&nowhere, LevelName::MAIN).await, Err(StorageError::NoSuchHome)));
    let here = home("here");
    storage.put_home(&here, None, |_| true, at(0)).await.unwrap();
    let id = Uuid::now_v7();
    assert!(matches!(storage.lidar_map(&here, LevelName::MAIN).await, Err(StorageError::NoLidarMap)));
    assert!(matches!(storage.clip(&here, id).await, Err(StorageError::NoSuchClip)));
    assert!(matches!(storage.delete_clip(&here, id, |_| true, at(500)).await, Err(StorageError::NoSuchClip)));
    assert_eq!(storage.job(id).await.unwrap(), None);
    // A clip is found in its own home only.
    let clip = add(&storage, &here, b"clip").await;
    let other = home("other");
    storage.put_home(&other, None, |_| true, at(0)).await.unwrap();
    assert!(matches!(storage.clip(&other, clip.id).await, Err(StorageError::NoSuchClip)));
    assert!(matches!(storage.align_clip(&here, clip.id, at(0)).await, Err(StorageError::NoLidarMap)));
}

async fn a_clip_waits_for_the_first_map(storage: Storage) {
    let id = home("h");
    storage.put_home(&id, None, |_| true, at(0)).await.unwrap();
    let clip = add(&storage, &id, b"clip").await;
    assert_eq!((clip.state, clip.reasons[0].code.as_str()), (ClipState::Uploaded, "no_lidar_map"));
    assert_eq!((clip.size_bytes, &clip.info, &clip.job), (4, &clip_info(), &None));
    // sha256 of the four letters by coreutils.
    assert_eq!(clip.sha256, "67905ad3cc2dd52b1f5f6a6d2814de0396618b29b4238b9af5207aeb69936e6d");
    assert!(storage.claim(LEASE, at(1)).await.unwrap().is_none());

    let (map, is_new) = put_map(&storage, &id, b"map").await;
    assert_eq!((map.revision, is_new, &map.info), (1, true, &lidar_info()));
    let clip = storage.clip(&id, clip.id).await.unwrap();
    assert_eq!((clip.state, clip.reasons.len()), (ClipState::Queued, 0));
    assert_eq!(clip.job.as_ref().map(|job| (job.state, job.lidar_map_revision)), Some((JobState::Queued, 1)));
    let claim = storage.claim(LEASE, at(1)).await.unwrap().unwrap();
    assert_eq!(storage.lidar_map_file(claim.lidar_maps[0].id()).await.unwrap(), &b"map"[..]);
    let file = storage.clip_file(claim.job.clip).await.unwrap();
    assert_eq!(std::fs::read(file).unwrap(), b"clip");
    assert_eq!(bytes_of(Some(storage.lidar_map_image(&map).await.unwrap())).await, b"picture");
}

async fn the_same_map_again_changes_nothing(storage: Storage) {
    let (id, clip) = one_job(&storage).await;
    let (again, is_new) = put_map(&storage, &id, b"map").await;
    assert_eq!((again.revision, is_new), (1, false));
    assert_eq!(storage.clip(&id, clip.id).await.unwrap(), clip);
}

async fn a_new_map_queues_every_clip_anew(storage: Storage) {
    let (id, clip) = one_job(&storage).await;
    let late = storage.claim(LEASE, at(1)).await.unwrap().unwrap();
    let (map, is_new) = put_map(&storage, &id, b"another map").await;
    assert_eq!((map.revision, is_new), (2, true));
    // The worker that aligns to the old map is refused, and its files are gone.
    storage.put_result(&late, "overlay.png", b"late".to_vec()).await.unwrap();
    assert!(!storage.holds(&late).await.unwrap());
    assert!(!end_attempt(&storage, &late, answer(AlignmentState::Aligned), 2).await);
    let clip = storage.clip(&id, clip.id).await.unwrap();
    assert_eq!((clip.state, &clip.alignment), (ClipState::Queued, &None));
    let fresh = storage.claim(LEASE, at(2)).await.unwrap().unwrap();
    assert_eq!((fresh.job.lidar_map_revision, fresh.job.attempts), (2, 1));
    let replaced = storage.job(late.job.id).await.unwrap().unwrap();
    let code = replaced.error.map(|reason| reason.code);
    assert_eq!((replaced.state, code.as_deref()), (JobState::Cancelled, Some("superseded")));
}

async fn a_key_replays_its_file_and_refuses_another(storage: Storage) {
    let (id, _) = one_job(&storage).await;
    let Added::New(first) = add_with_key(&storage, &id, b"one", Some("key")).await else { panic!("not new") };
    match add_with_key(&storage, &id, b"one", Some("key")).await {
        Added::Replayed(clip) => assert_eq!(clip, first),
        other => panic!("{other:?}"),
    }
    assert!(matches!(add_with_key(&storage, &id, b"two", Some("key")).await, Added::KeyReused));
    assert!(matches!(add_with_key(&storage, &id, b"one", Some("other key")).await, Added::New(_)));
    // An archive that is packed again has other bytes.
    let (content, key) = (Some("content"), Some("archive"));
    let Added::New(packed) = add_content(&storage, &id, b"zip", content, key).await else {
        panic!("not new")
    };
    match add_content(&storage, &id, b"zipped again", content, key).await {
        Added::Replayed(clip) => assert_eq!(clip, packed),
        other => panic!("{other:?}"),
    }
    let other = Some("other content");
    assert!(matches!(add_content(&storage, &id, b"zipped", other, key).await, Added::KeyReused));
    assert!(matches!(add_content(&storage, &id, b"file", content, Some("key")).await, Added::KeyReused));
    // The archive may have been damaged: another one is no retry of it.
    for _ in 0..4 {
        align(&storage, AlignmentState::Failed).await;
    }
    assert!(matches!(add_content(&storage, &id, b"zipped again", content, key).await, Added::KeyReused));
    // A key belongs to a home, and lives as long as its clip.
    let other = home("other");
    storage.put_home(&other, None, |_| true, at(0)).await.unwrap();
    assert!(matches!(add_with_key(&storage, &other, b"one", Some("key")).await, Added::New(_)));
    storage.delete_clip(&id, first.id, |_| true, at(500)).await.unwrap();
    assert!(matches!(add_with_key(&storage, &id, b"two", Some("key")).await, Added::New(_)));
}

async fn aligning_again_replaces_the_answer(storage: Storage) {
    let (id, clip) = one_job(&storage).await;
    // A clip with a queued or running job stays as it is.
    assert_eq!(storage.align_clip(&id, clip.id, at(0)).await.unwrap(), clip);
    let claim = storage.claim(LEASE, at(1)).await.unwrap().unwrap();
    storage.put_result(&claim, "overlay.png", b"a picture".to_vec()).await.unwrap();
    let ending = answer(AlignmentState::Ambiguous);
    assert!(storage.finish(&claim, &ending, &RetryPolicy::default(), at(2)).await.unwrap());
    let done = storage.clip(&id, clip.id).await.unwrap();
    let AttemptEnd::Answered(alignment) = ending else { unreachable!() };
    assert_eq!((done.state, &done.reasons), (ClipState::Ambiguous, &alignment.reasons));
    assert_eq!(done.alignment.as_ref(), Some(alignment.as_ref()));
    assert_eq!(done.job.as_ref().map(|job| (job.state, job.progress)), Some((JobState::Succeeded, 1.0)));
    assert_eq!(bytes_of(storage.clip_result(&done, "overlay.png").await.unwrap()).await, b"a picture");

    let again = storage.align_clip(&id, clip.id, at(3)).await.unwrap();
    assert_eq!((again.state, &again.alignment), (ClipState::Queued, &None));
    assert_ne!(again.job.as_ref().unwrap().id, claim.job.id);
    assert!(storage.clip_result(&again, "overlay.png").await.unwrap().is_some());
    let claim = storage.claim(LEASE, at(4)).await.unwrap().unwrap();
    storage.put_result(&claim, "scan.json", b"a scan".to_vec()).await.unwrap();
    assert!(end_attempt(&storage, &claim, answer(AlignmentState::Aligned), 5).await);
    let newer = storage.clip(&id, clip.id).await.unwrap();
    // Neither the new record nor the one read before finds the old picture.
    assert!(storage.clip_result(&newer, "overlay.png").await.unwrap().is_none());
    assert!(storage.clip_result(&done, "overlay.png").await.unwrap().is_none());
    assert_eq!(bytes_of(storage.clip_result(&newer, "scan.json").await.unwrap()).await, b"a scan");
}

async fn deleting_leaves_no_byte(storage: Storage) {
    let (id, clip) = one_job(&storage).await;
    let second = add(&storage, &id, b"second clip").await;
    let claim = storage.claim(LEASE, at(1)).await.unwrap().unwrap();
    storage.put_result(&claim, "cloud.ply", b"points".to_vec()).await.unwrap();
    assert!(end_attempt(&storage, &claim, answer(AlignmentState::Aligned), 2).await);
    let running = storage.claim(LEASE, at(3)).await.unwrap().unwrap();
    assert_eq!(running.job.clip, second.id);

    storage.delete_clip(&id, clip.id, |_| true, at(500)).await.unwrap();
    assert_eq!(storage.blobs_that_exist().await, storage.blob_keys_that_matter().await);
    storage.delete_home(&id, |_| true, at(500)).await.unwrap();
    assert_eq!(storage.blobs_that_exist().await, Vec::<String>::new());
    // The worker that was running meanwhile leaves nothing either.
    storage.put_result(&running, "cloud.ply", b"points".to_vec()).await.unwrap();
    assert!(!end_attempt(&storage, &running, answer(AlignmentState::Aligned), 4).await);
    assert_eq!(storage.blobs_that_exist().await, Vec::<String>::new());
}
