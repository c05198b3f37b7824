//! Homes with several LiDAR maps, one for each level.

use super::home_maps::{align, due, revision};
use super::*;
use viola_geometry::{MAX_LEVELS, Pose2};
use viola_home::{PlacedBy, TileKey};

on_every_back_end!(
    each_level_has_its_own_revisions,
    a_job_gets_the_current_map_of_each_level,
    a_home_has_so_many_levels,
    the_map_of_a_home_has_the_files_of_each_level,
    a_choice_names_its_level,
    a_level_is_removed,
);

fn level(name: &str) -> LevelName {
    name.parse().unwrap()
}

fn is_of_lidar_map(key: &str) -> bool {
    key.starts_with("lidar-maps")
}

/// Creates a home with a map of `main` and one of `upper`, and one queued clip.
async fn two_levels(storage: &Storage) -> (HomeId, Clip) {
    let (home, clip) = one_job(storage).await;
    put_level(storage, &home, level("upper"), b"upper map").await.unwrap();
    (home, clip)
}

async fn each_level_has_its_own_revisions(storage: Storage) {
    let (home, _) = two_levels(&storage).await;
    // The same file on another level is another map.
    let (attic, is_new) = put_level(&storage, &home, level("attic"), b"map").await.unwrap();
    assert_eq!((attic.revision, attic.level, is_new), (3, level("attic"), true));
    let (again, is_new) = put_level(&storage, &home, level("upper"), b"upper map").await.unwrap();
    assert_eq!((again.revision, is_new), (2, false));
    let (newer, _) = put_map(&storage, &home, b"another map").await;
    assert_eq!((newer.revision, newer.level), (4, LevelName::MAIN));
    let maps = storage.lidar_maps(&home).await.unwrap();
    let current: Vec<(&str, i64)> = maps.iter().map(|map| (map.level.as_str(), map.revision)).collect();
    assert_eq!(current, [("attic", 3), ("main", 4), ("upper", 2)]);
    let page = Page { limit: 9, after: None };
    for (name, revisions) in [("main", vec![4, 1]), ("upper", vec![2]), ("cellar", vec![])] {
        let listed = storage.lidar_map_revisions(&home, level(name), &page).await.unwrap();
        assert_eq!(listed.iter().map(|map| map.revision).collect::<Vec<_>>(), revisions, "{name}");
    }
    assert_eq!(storage.lidar_map(&home, level("upper")).await.unwrap().revision, 2);
    assert!(matches!(storage.lidar_map(&home, level("cellar")).await, Err(StorageError::NoLidarMap)));
    assert_eq!(storage.home(&home).await.unwrap().lidar_map_revision, Some(4));
    assert_eq!(storage.blob_keys_that_matter().await.iter().filter(|key| is_of_lidar_map(key)).count(), 8);
    storage.delete_home(&home, |_| true, at(500)).await.unwrap();
    assert!(storage.blobs_that_exist().await.is_empty());
}

async fn a_job_gets_the_current_map_of_each_level(storage: Storage) {
    let (home, clip) = one_job(&storage).await;
    let late = storage.claim(LEASE, at(1)).await.unwrap().unwrap();
    put_level(&storage, &home, level("upper"), b"upper map").await.unwrap();
    // A new level queues the clip again, like a new map.
    assert!(!storage.holds(&late).await.unwrap());
    let claim = storage.claim(LEASE, at(2)).await.unwrap().unwrap();
    assert_eq!((claim.job.clip, claim.job.lidar_map_revision), (clip.id, 2));
    let mut files = Vec::new();
    for map in &claim.lidar_maps {
        files.push((map.level, storage.lidar_map_file(map.id()).await.unwrap().to_vec()));
    }
    assert_eq!(files, [(level("main"), b"map".to_vec()), (level("upper"), b"upper map".to_vec())]);
}

async fn a_home_has_so_many_levels(storage: Storage) {
    let home = home("h");
    storage.put_home(&home, None, |_| true, at(0)).await.unwrap();
    for n in 0..MAX_LEVELS {
        put_level(&storage, &home, level(&format!("level-{n}")), b"map").await.unwrap();
    }
    let refused = put_level(&storage, &home, level("one-more"), b"map").await;
    assert!(matches!(refused, Err(StorageError::TooManyLevels)), "{refused:?}");
    // The refused file leaves nothing, and a new map of a known level is taken.
    assert_eq!(storage.blobs_that_exist().await.len(), 2 * MAX_LEVELS);
    let (newer, _) = put_level(&storage, &home, level("level-3"), b"newer").await.unwrap();
    assert_eq!(newer.revision, MAX_LEVELS as i64 + 1);
}

async fn the_map_of_a_home_has_the_files_of_each_level(storage: Storage) {
    let (home, clip) = two_levels(&storage).await;
    align(&storage, AlignmentState::Aligned).await;
    let claim = due(&storage, 10).await.unwrap();
    assert_eq!(
        claim.lidar_maps.iter().map(|map| map.level).collect::<Vec<_>>(),
        [level("main"), level("upper")]
    );
    assert!(claim.last_levels.is_empty());
    let mut new = revision(&claim, PlacedBy::Alignment, b"main tile");
    let upper = TileKey { level: level("upper"), x: 1, y: -2 };
    new.tiles.push((upper, Some(b"upper tile".to_vec())));
    new.files = ["main", "upper"].map(|name| (level(name), map_file::PLAN_SVG, name.into())).to_vec();
    new.manifest.clips[0].level = level("upper");
    assert!(storage.finish_merge(&claim, Some(&new), at(10)).await.unwrap());

    let map = storage.home_map(&home, None).await.unwrap().unwrap();
    let levels: Vec<(&str, i64)> =
        map.levels.iter().map(|level| (level.level.as_str(), level.lidar_map_revision)).collect();
    assert_eq!((levels, map.lidar_map_revision), (vec![("main", 1), ("upper", 2)], 2));
    assert_eq!(map.clips[0].level, level("upper"));
    let placement = storage.clip(&home, clip.id).await.unwrap().placement.unwrap();
    assert_eq!(placement.level, level("upper"));
    let mut tiles = Vec::new();
    for name in ["main", "upper", "attic"] {
        for file in storage.home_map_files(&home, 1, level(name), map_file::TILE).await.unwrap() {
            tiles.push((file.tile.unwrap(), storage.map_file_bytes(&file).await.unwrap().unwrap().to_vec()));
        }
        let plan = storage.home_map_files(&home, 1, level(name), map_file::PLAN_SVG).await.unwrap();
        assert_eq!(plan.len(), usize::from(name != "attic"));
    }
    let main = TileKey { level: LevelName::MAIN, ..upper };
    assert_eq!(tiles, [(main, b"main tile".to_vec()), (upper, b"upper tile".to_vec())]);

    // A new map of one level: the next merge knows which one changed.
    put_level(&storage, &home, level("upper"), b"newer").await.unwrap();
    align(&storage, AlignmentState::Aligned).await;
    let claim = due(&storage, 20).await.unwrap();
    let left: Vec<Option<i64>> = claim.lidar_maps.iter().map(|map| claim.left_lidar_map(map)).collect();
    assert_eq!((left, claim.has_new_lidar_map()), (vec![None, Some(2)], true));
    assert_eq!(storage.last_tiles(&claim).await.unwrap().len(), 2);
}

async fn a_choice_names_its_level(storage: Storage) {
    let (home, clip) = two_levels(&storage).await;
    let on = |name: &str| Chosen::Pose(level(name), Pose2::IDENTITY);
    let chosen = storage.choose(&home, clip.id, on("upper"), |_| true, at(1)).await.unwrap().choice.unwrap();
    assert_eq!((chosen.level, chosen.lidar_map_revision), (level("upper"), 2));
    let refused = storage.choose(&home, clip.id, on("attic"), |_| true, at(2)).await;
    assert!(matches!(refused, Err(ChoiceError::NoSuchLevel(name)) if name == level("attic")), "{refused:?}");
    // A newer map of another level does not make the choice an old one.
    put_map(&storage, &home, b"another map").await;
    align(&storage, AlignmentState::Ambiguous).await;
    let codes = async || {
        let clip = storage.clip(&home, clip.id).await.unwrap();
        clip.reasons.into_iter().map(|reason| reason.code).collect::<Vec<_>>()
    };
    assert_eq!(codes().await, ["chosen_by_person"]);
    put_level(&storage, &home, level("upper"), b"newer").await.unwrap();
    align(&storage, AlignmentState::Ambiguous).await;
    assert_eq!(codes().await, ["chosen_by_person", "choice_of_earlier_lidar_map"]);
}

async fn a_level_is_removed(storage: Storage) {
    let (home, clip) = two_levels(&storage).await;
    align(&storage, AlignmentState::Aligned).await;
    let on_upper = Chosen::Pose(level("upper"), Pose2::IDENTITY);
    storage.choose(&home, clip.id, on_upper, |_| true, at(1)).await.unwrap();
    storage.delete_lidar_map(&home, level("upper"), |_| true, at(2)).await.unwrap();
    let gone = storage.delete_lidar_map(&home, level("upper"), |_| true, at(3)).await;
    assert!(matches!(gone, Err(StorageError::NoLidarMap)), "{gone:?}");
    let last = storage.delete_lidar_map(&home, LevelName::MAIN, |_| true, at(3)).await;
    assert!(matches!(last, Err(StorageError::LastLevel)), "{last:?}");
    assert_eq!(storage.home(&home).await.unwrap().lidar_map_revision, Some(1));
    // The clip is aligned again, without the choice whose frame is gone.
    let waiting = storage.clip(&home, clip.id).await.unwrap();
    assert_eq!((waiting.state, waiting.choice), (ClipState::Queued, None));
    let claim = storage.claim(LEASE, at(4)).await.unwrap().unwrap();
    assert_eq!(claim.lidar_maps.iter().map(|map| map.level).collect::<Vec<_>>(), [LevelName::MAIN]);
    for keys in [storage.blob_keys_that_matter().await, storage.blobs_that_exist().await] {
        assert_eq!(keys.iter().filter(|key| is_of_lidar_map(key)).count(), 2, "{keys:?}");
    }
    // Its name may be used again; no revision has its number twice.
    let (again, _) = put_level(&storage, &home, level("upper"), b"upper map").await.unwrap();
    assert_eq!(again.revision, 3);
    let page = Page { limit: 9, after: None };
    assert_eq!(storage.lidar_map_revisions(&home, level("upper"), &page).await.unwrap(), [again]);
}
