//! Meshes, and homes that were removed and made again under the same id.

use super::home_maps::{align, current, due, finish, merge, revision, two_aligned};
use super::*;
use viola_home::PlacedBy;

on_every_back_end!(
    a_mesh_is_of_the_current_revision,
    a_mesh_stays_while_its_tiles_and_objects_do,
    a_damaged_mesh_is_replaced_once,
    a_map_is_settled_when_no_work_is_ahead_that_may_replace_it,
    a_home_that_was_made_again_gets_no_mesh_of_the_removed_one,
    a_home_that_was_made_again_gets_no_map_of_the_removed_one,
);

async fn a_mesh_is_of_the_current_revision(storage: Storage) {
    let (home, clips) = two_aligned(&storage).await;
    let main = LevelName::MAIN;
    let meshes = async |revision: i64| {
        let mut all = Vec::new();
        for file in storage.home_map_files(&home, revision, main, map_file::MESH).await.unwrap() {
            all.push(storage.map_file_bytes(&file).await.unwrap().expect("the mesh is there").to_vec());
        }
        all
    };
    let add = async |revision: i64, glb: &[u8]| {
        let map = storage.home_map(&home, Some(revision)).await.unwrap().unwrap();
        storage.add_mesh(&home, &map, main, glb.to_vec()).await.unwrap()
    };
    let next = async |seconds: i64, has_scene: bool| {
        storage.align_clip(&home, clips[0], at(seconds)).await.unwrap();
        align(&storage, AlignmentState::Aligned).await;
        let claim = due(&storage, seconds).await.expect("the home is due");
        let mut new = revision(&claim, PlacedBy::Alignment, &[seconds as u8]);
        new.files.extend(has_scene.then(|| (main, map_file::SCENE, b"{}".to_vec())));
        assert!(storage.finish_merge(&claim, Some(&new), at(seconds)).await.unwrap());
    };
    merge(&storage, b"tile", 10).await;
    assert!(add(1, b"first").await);
    assert!(!add(1, b"again").await, "a revision has one mesh");
    assert_eq!(meshes(1).await, [b"first"]);
    // A level that is as it was keeps its mesh.
    next(20, false).await;
    assert_eq!(meshes(2).await, [b"first"]);
    next(21, true).await;
    assert!(!add(2, b"late").await, "the revision is not the current one any more");
    assert!(meshes(3).await.is_empty() && meshes(2).await.is_empty(), "earlier revisions have none");
    assert!(add(3, b"third").await);
    assert_eq!(meshes(3).await, [b"third"]);
    storage.check_no_blob_is_left("a mesh").await;
}

async fn a_mesh_stays_while_its_tiles_and_objects_do(storage: Storage) {
    let (home, clips) = two_aligned(&storage).await;
    let main = LevelName::MAIN;
    for (seconds, has_tiles, has_same_parts, is_kept) in [
        (10, true, false, false),
        (20, false, true, true),
        (30, true, true, false),
        (40, false, false, false),
    ] {
        storage.align_clip(&home, clips[0], at(seconds)).await.unwrap();
        align(&storage, AlignmentState::Aligned).await;
        let claim = due(&storage, seconds).await.expect("the home is due");
        let mut new = revision(&claim, PlacedBy::Alignment, &[seconds as u8]);
        new.files.push((main, map_file::SCENE, b"{}".to_vec()));
        new.tiles.retain(|_| has_tiles);
        new.same_mesh_parts.extend(has_same_parts.then_some(main));
        assert!(storage.finish_merge(&claim, Some(&new), at(seconds)).await.unwrap());
        let map = current(&storage, &home).await;
        let files = storage.home_map_files(&home, map.revision, main, map_file::MESH).await.unwrap();
        assert_eq!(files.len(), usize::from(is_kept), "{seconds}");
        let added = storage.add_mesh(&home, &map, main, b"mesh".to_vec()).await.unwrap();
        assert_eq!(added, !is_kept, "{seconds}");
    }
    storage.check_no_blob_is_left("a mesh").await;
}

async fn a_damaged_mesh_is_replaced_once(storage: Storage) {
    let (home, _) = two_aligned(&storage).await;
    let main = LevelName::MAIN;
    let claim = due(&storage, 10).await.unwrap();
    assert!(finish(&storage, &claim, b"tile", 10).await);
    let map = current(&storage, &home).await;
    assert!(storage.add_mesh(&home, &map, main, b"mesh".to_vec()).await.unwrap());
    let file = async || {
        let mut files = storage.home_map_files(&home, 1, main, map_file::MESH).await.unwrap();
        files.pop().expect("the revision has a mesh")
    };
    let bytes = async || storage.tenant_bytes(&Tenant::default()).await.unwrap();
    let (damaged, before) = (file().await, bytes().await);
    storage.blobs.put(damaged.key(), b"m".to_vec()).await.unwrap();
    let replace = async |seconds: i64| {
        storage.replace_mesh(&home, &damaged, b"mesh of 15 byte".to_vec(), at(seconds)).await.unwrap()
    };
    assert!(replace(11).await);
    assert!(!replace(12).await, "another request replaced it");
    assert_eq!(bytes_of(storage.read_map_file(&file().await).await.unwrap()).await, b"mesh of 15 byte");
    assert_eq!(bytes().await, before + 11);
    storage.check_no_blob_is_left("a mesh").await;
}

async fn a_map_is_settled_when_no_work_is_ahead_that_may_replace_it(storage: Storage) {
    let (home, _) = two_aligned(&storage).await;
    let is_settled = async |seconds: i64| storage.has_settled_map(&home, at(seconds)).await.unwrap();
    assert!(!is_settled(10).await, "the home is due");
    let claim = due(&storage, 10).await.unwrap();
    assert!(!is_settled(10).await, "its merge runs");
    assert!(finish(&storage, &claim, b"both", 10).await);
    assert!(is_settled(10).await);
    add(&storage, &home, b"third").await;
    let mut now_s = 200;
    assert!(!is_settled(now_s).await, "a clip is queued");
    let run = async |ending: AttemptEnd, seconds: i64| {
        let held = storage.claim(LEASE, at(seconds)).await.unwrap().expect("the job is due");
        assert!(!is_settled(seconds).await, "a clip is aligned");
        assert!(end_attempt(&storage, &held, ending, seconds).await);
        is_settled(seconds).await
    };
    // A merge would not wait for the last pause.
    for pause_s in [5, 10, 20, 40, 80] {
        assert_eq!(run(AttemptEnd::Fault(Fault::Storage), now_s).await, pause_s == 80, "{pause_s}");
        now_s += pause_s;
    }
    assert!(run(AttemptEnd::Refused(reason("unreadable")), now_s).await, "no merge follows");
    storage.delete_home(&home, |_| true, at(500)).await.unwrap();
    assert!(!is_settled(501).await, "the home was removed");
}

/// Removes the home of [`two_aligned`] and makes it again, with one aligned clip.
async fn made_again(storage: &Storage, home: &HomeId) -> Uuid {
    storage.delete_home(home, |_| true, at(500)).await.unwrap();
    storage.put_home(home, None, |_| true, at(501)).await.unwrap();
    put_map(storage, home, b"map").await;
    let clip = add(storage, home, b"clip").await;
    align(storage, AlignmentState::Aligned).await;
    clip.id
}

async fn a_home_that_was_made_again_gets_no_mesh_of_the_removed_one(storage: Storage) {
    let (home, _) = two_aligned(&storage).await;
    merge(&storage, b"removed", 10).await;
    let removed = current(&storage, &home).await;
    made_again(&storage, &home).await;
    merge(&storage, b"new", 510).await;
    let new = current(&storage, &home).await;
    assert_eq!(removed.revision, new.revision);
    assert!(!storage.add_mesh(&home, &removed, LevelName::MAIN, b"mesh".to_vec()).await.unwrap());
    assert!(storage.add_mesh(&home, &new, LevelName::MAIN, b"mesh".to_vec()).await.unwrap());
    storage.check_no_blob_is_left("a mesh").await;
}

async fn a_home_that_was_made_again_gets_no_map_of_the_removed_one(storage: Storage) {
    let (home, _) = two_aligned(&storage).await;
    let late = due(&storage, 10).await.unwrap();
    let clip = made_again(&storage, &home).await;
    // Both are the first claims of their homes.
    let claim = due(&storage, 510).await.unwrap();
    assert!(!storage.renew_merge(&late, LEASE, at(511)).await.unwrap());
    storage.give_back_merge(&late, at(511)).await.unwrap();
    assert!(due(&storage, 511).await.is_none(), "the merge of the new home goes on");
    assert!(!finish(&storage, &late, b"removed", 511).await);
    assert_eq!(storage.home_map(&home, None).await.unwrap(), None);
    assert!(storage.renew_merge(&claim, LEASE, at(512)).await.unwrap());
    assert!(finish(&storage, &claim, b"new", 512).await);
    let map = current(&storage, &home).await;
    assert_eq!(map.clips.iter().map(|placed| placed.clip).collect::<Vec<_>>(), [clip]);
}
