//! The revisions of a home's map that are kept.

use super::home_maps::{align, tiles, two_aligned};
use super::*;

on_every_back_end!(corrections_displace_no_revision_of_other_clips);

/// Finishes the merge that is due, with one tile; returns the numbers of the kept revisions, newest first.
async fn merge(storage: &Storage, home: &HomeId, tile: &str, seconds: i64) -> Vec<i64> {
    super::home_maps::merge(storage, tile.as_bytes(), seconds).await;
    let all = Page { limit: 100, after: None };
    storage.home_map_revisions(home, &all).await.unwrap().iter().map(|map| map.revision).collect()
}

async fn corrections_displace_no_revision_of_other_clips(storage: Storage) {
    let (home, clips) = two_aligned(&storage).await;
    assert_eq!(merge(&storage, &home, "both", 10).await, [1]);
    storage.delete_clip(&home, clips[0], |_| true, at(500)).await.unwrap();
    assert_eq!(merge(&storage, &home, "one", 11).await, [2, 1]);
    // A new name of the home makes a revision of the same clips, as a correction does.
    for (n, kept) in [
        (3, vec![3, 2, 1]),
        (4, vec![4, 3, 2, 1]),
        (5, vec![5, 4, 3, 2, 1]),
        (6, vec![6, 5, 4, 3, 1]),
        (7, vec![7, 6, 5, 4, 1]),
        (8, vec![8, 7, 6, 5, 1]),
    ] {
        storage.put_home(&home, Some(&format!("Elm {n}")), |_| true, at(500)).await.unwrap();
        assert_eq!(merge(&storage, &home, &n.to_string(), 10 + n).await, kept);
    }
    for (revision, expected) in [(1, Some("both")), (2, None), (4, None), (5, Some("5")), (8, Some("8"))] {
        let expected = expected.map(|tile| vec![tile.as_bytes().to_vec()]);
        assert_eq!(tiles(&storage, &home, revision).await, expected, "{revision}");
    }
    let blobs = storage.blobs_that_exist().await;
    let of_map = blobs.iter().filter(|key| key.contains("home-maps")).count();
    assert_eq!(of_map, 10, "a tile and a manifest each");
    // Those of other clips go by their age.
    for (n, kept) in [
        (9, vec![9, 8, 7, 6, 1]),
        (10, vec![10, 9, 8, 7, 1]),
        (11, vec![11, 10, 9, 8, 1]),
        (12, vec![12, 11, 10, 9, 8]),
        (13, vec![13, 12, 11, 10, 9]),
    ] {
        add(&storage, &home, format!("clip {n}").as_bytes()).await;
        align(&storage, AlignmentState::Aligned).await;
        assert_eq!(merge(&storage, &home, &n.to_string(), 10 + n).await, kept);
    }
}
