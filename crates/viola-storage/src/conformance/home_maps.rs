//! Merges of homes: their claims and their revisions.

use super::corrections::chair;
use super::*;
use viola_align::Alternative;
use viola_geometry::Pose2;
use viola_geometry::taxonomy::Class;
use viola_home::{Coverage, Extent, FloorCorrection, Manifest, PlacedBy, PlacedClip, TileKey, Verdict};

on_every_back_end!(
    a_home_is_merged_when_its_clips_have_settled,
    a_clip_that_rests_after_faults_keeps_no_merge_waiting,
    one_worker_merges_a_home_at_a_time,
    a_change_during_a_merge_makes_it_due_again,
    removing_a_clip_makes_a_new_revision,
    old_revisions_go,
    tiles_that_did_not_change_are_shared,
    a_merge_that_makes_nothing_new_makes_no_revision,
    neighbours_place_an_ambiguous_clip_and_take_it_back,
    objects_are_found_across_homes,
    a_lost_scene_is_that_of_an_earlier_revision,
);

/// Creates a home with two aligned clips.
pub(super) async fn two_aligned(storage: &Storage) -> (HomeId, Vec<Uuid>) {
    let (home, first) = one_job(storage).await;
    let second = add(storage, &home, b"other").await;
    for _ in 0..2 {
        align(storage, AlignmentState::Aligned).await;
    }
    (home, vec![first.id, second.id])
}

/// Runs the next job at second 100.
pub(super) async fn align(storage: &Storage, state: AlignmentState) {
    align_at(storage, state, 100).await;
}

/// Runs the next job: its clip, which is returned, gets an answer, with a cloud that holds its id.
pub(super) async fn align_at(storage: &Storage, state: AlignmentState, seconds: i64) -> Uuid {
    let claim = storage.claim(LEASE, at(seconds)).await.unwrap().expect("a job is due");
    let cloud = claim.job.clip.to_string().into_bytes();
    storage.put_result(&claim, result_file::CLOUD, cloud).await.unwrap();
    let AttemptEnd::Answered(mut alignment) = answer(state) else { unreachable!() };
    alignment.map_from_clip = Some(Pose2::new(1.0, 2.0, 0.5));
    alignment.alternatives = vec![Alternative {
        level: LevelName::MAIN,
        map_from_clip: Pose2::new(1.0, 2.0, 0.5),
        rise_m: 0.0,
        loss_m: 0.25,
        inliers: 0.9,
        free_space: None,
        misplaced: None,
        probability: Some(0.02),
        evidence: None,
    }];
    assert!(end_attempt(storage, &claim, AttemptEnd::Answered(alignment), seconds).await);
    claim.job.clip
}

pub(super) async fn due(storage: &Storage, seconds: i64) -> Option<MergeClaim> {
    storage.claim_merge("", LEASE, at(seconds)).await.unwrap()
}

/// Returns the clouds of a claim, one after the other.
async fn clouds(storage: &Storage, claim: &MergeClaim) -> Vec<u8> {
    let mut all = Vec::new();
    for member in &claim.members {
        let cloud = storage.member_file(member, result_file::CLOUD).await.unwrap();
        all.extend_from_slice(&cloud.expect("the cloud is there"));
    }
    all
}

const TILE: TileKey = TileKey { level: LevelName::MAIN, x: 1, y: -2 };

/// Returns a revision with the claim's clips, placed by `by`, and one tile.
pub(super) fn revision(claim: &MergeClaim, by: PlacedBy, tile: &[u8]) -> NewRevision {
    let place = |member: &viola_home::Member| PlacedClip {
        clip: member.clip,
        contribution: member.contribution.clone(),
        recorded_at_ms: member.recorded_at_ms,
        by,
        probability: Some(0.5),
        level: LevelName::MAIN,
        alone: Pose2::new(1.0, 2.0, 0.5),
        rise_m: 0.0,
        map_from_clip: Pose2::new(1.03, 2.04, 0.5),
        floor_correction: FloorCorrection::default(),
        with: Vec::new(),
        extent: Extent { min_m: [0.0; 2], max_m: [1.0; 2] },
        tiles: vec![TILE],
        points: 7,
    };
    NewRevision {
        manifest: Manifest { clips: claim.members.iter().map(place).collect(), ..Manifest::default() },
        tiles: vec![(TILE, Some(tile.to_vec()))],
        ..NewRevision::default()
    }
}

pub(super) async fn finish(storage: &Storage, claim: &MergeClaim, tile: &[u8], seconds: i64) -> bool {
    let new = revision(claim, PlacedBy::Alignment, tile);
    storage.finish_merge(claim, Some(&new), at(seconds)).await.unwrap()
}

/// Runs the merge that is due: the map gets a revision with one tile.
pub(super) async fn merge(storage: &Storage, tile: &[u8], seconds: i64) -> MergeClaim {
    merge_by(storage, PlacedBy::Alignment, tile, seconds).await
}

/// [`merge`] whose clips are placed by `by`.
pub(super) async fn merge_by(storage: &Storage, by: PlacedBy, tile: &[u8], seconds: i64) -> MergeClaim {
    let claim = due(storage, seconds).await.expect("the home is due");
    let new = revision(&claim, by, tile);
    assert!(storage.finish_merge(&claim, Some(&new), at(seconds)).await.unwrap());
    claim
}

pub(super) async fn current(storage: &Storage, home: &HomeId) -> HomeMap {
    storage.home_map(home, None).await.unwrap().expect("there is a map")
}

fn clips_of(map: &HomeMap) -> Vec<Uuid> {
    map.clips.iter().map(|clip| clip.clip).collect()
}

/// Returns the bytes of a revision's tiles; `None` if it is not kept.
pub(super) async fn tiles(storage: &Storage, home: &HomeId, revision: i64) -> Option<Vec<Vec<u8>>> {
    storage.home_map(home, Some(revision)).await.unwrap()?;
    let mut all = Vec::new();
    for file in storage.home_map_files(home, revision, LevelName::MAIN, map_file::TILE).await.unwrap() {
        all.push(storage.map_file_bytes(&file).await.unwrap().expect("the tile is there").to_vec());
    }
    Some(all)
}

async fn a_home_is_merged_when_its_clips_have_settled(storage: Storage) {
    let (home, first) = one_job(&storage).await;
    assert!(due(&storage, 1).await.is_none(), "nothing is aligned");
    let second = add(&storage, &home, b"other").await;
    align(&storage, AlignmentState::Aligned).await;
    assert!(due(&storage, 2).await.is_none(), "a clip is on its way");
    assert_eq!(storage.home_map(&home, None).await.unwrap(), None);
    align(&storage, AlignmentState::Aligned).await;
    let claim = due(&storage, 3).await.expect("the home is due");
    assert!(claim.has_new_lidar_map() && claim.lidar_maps.len() == 1);
    assert_eq!(clouds(&storage, &claim).await, format!("{}{}", first.id, second.id).into_bytes());
    let aligned = |verdict: &Verdict| matches!(verdict, Verdict::Aligned { map_from_clip, .. } if map_from_clip.x_m == 1.0);
    assert!(claim.members.iter().all(|member| aligned(&member.verdict)));
    assert!(finish(&storage, &claim, b"both", 4).await);
    let map = current(&storage, &home).await;
    assert_eq!((map.revision, map.lidar_map_revision, map.created_at), (1, 1, at(4)));
    assert_eq!((clips_of(&map), map.clips[0].points), (vec![first.id, second.id], 7));
    assert!((map.clips[0].moved_m - 0.05).abs() < 1e-9);
    assert_eq!(tiles(&storage, &home, 1).await, Some(vec![b"both".to_vec()]));
    let placement = storage.clip(&home, first.id).await.unwrap().placement.expect("it is in the map");
    assert_eq!((placement.map_revision, placement.map_from_clip.x_m), (1, 1.03));
    assert!(due(&storage, 5).await.is_none());
    // A clip that cannot be aligned changes no map.
    let third = add(&storage, &home, b"third").await;
    let held = storage.claim(LEASE, at(6)).await.unwrap().unwrap();
    assert!(end_attempt(&storage, &held, AttemptEnd::Refused(reason("unreadable")), 6).await);
    assert!(due(&storage, 7).await.is_none());
    let left_out = storage.clips_left_out(&home).await.unwrap();
    assert_eq!((left_out.len(), left_out[0].clip, left_out[0].state), (1, third.id, ClipState::Failed));
    assert_eq!(left_out[0].reasons, [reason("unreadable")]);
}

async fn a_clip_that_rests_after_faults_keeps_no_merge_waiting(storage: Storage) {
    let (home, clips) = two_aligned(&storage).await;
    let third = add(&storage, &home, b"third").await;
    let mut now_s = 200;
    // The merge waits for pauses of 5 s, 10 s, 20 s and 40 s, but not for the next one, of 80 s.
    for pause_s in [5, 10, 20, 40, 80] {
        assert!(due(&storage, now_s).await.is_none(), "a clip is on its way");
        let held = storage.claim(LEASE, at(now_s)).await.unwrap().expect("the job is due");
        assert_eq!(held.job.clip, third.id);
        assert!(end_attempt(&storage, &held, AttemptEnd::Fault(Fault::Storage), now_s).await);
        now_s += pause_s;
    }
    merge(&storage, b"both", now_s - 79).await;
    assert_eq!(clips_of(&current(&storage, &home).await), clips);
}

async fn one_worker_merges_a_home_at_a_time(storage: Storage) {
    let (home, _) = two_aligned(&storage).await;
    let late = due(&storage, 10).await.expect("the home is due");
    assert!(due(&storage, 39).await.is_none(), "its lease runs");
    assert!(storage.renew_merge(&late, LEASE, at(39)).await.unwrap());
    assert!(due(&storage, 68).await.is_none(), "its lease was renewed");
    let next = due(&storage, 69).await.expect("its worker is dead");
    assert!(!storage.renew_merge(&late, LEASE, at(70)).await.unwrap());
    assert!(!finish(&storage, &late, b"late", 70).await);
    assert_eq!(storage.home_map(&home, None).await.unwrap(), None, "a late worker changes nothing");
    assert!(finish(&storage, &next, b"next", 71).await);
    assert!(!finish(&storage, &late, b"late", 72).await);
    assert_eq!(current(&storage, &home).await.revision, 1);
    assert_eq!(tiles(&storage, &home, 1).await, Some(vec![b"next".to_vec()]));
    assert_eq!(storage.blobs_that_exist().await.iter().filter(|key| key.contains("home-maps")).count(), 2);
}

async fn a_change_during_a_merge_makes_it_due_again(storage: Storage) {
    let (home, clips) = two_aligned(&storage).await;
    let claim = due(&storage, 10).await.expect("the home is due");
    storage.delete_clip(&home, clips[0], |_| true, at(500)).await.unwrap();
    let gone = storage.member_file(&claim.members[0], result_file::CLOUD).await.unwrap();
    assert!(gone.is_none(), "its cloud is gone");
    storage.give_back_merge(&claim, at(15)).await.unwrap();
    assert!(due(&storage, 14).await.is_none());
    let again = due(&storage, 15).await.expect("the home is due");
    assert_eq!(again.members.len(), 1);
    // A change after the clouds were read: the merge is kept, and the next one follows.
    let third = add(&storage, &home, b"third").await;
    align(&storage, AlignmentState::Aligned).await;
    assert!(finish(&storage, &again, b"one", 16).await);
    assert_eq!(clips_of(&current(&storage, &home).await), [clips[1]]);
    let last = due(&storage, 17).await.expect("the home is due");
    assert!(finish(&storage, &last, b"two", 18).await);
    let map = current(&storage, &home).await;
    assert_eq!((map.revision, clips_of(&map)), (2, vec![clips[1], third.id]));
}

async fn removing_a_clip_makes_a_new_revision(storage: Storage) {
    let (home, clips) = two_aligned(&storage).await;
    merge(&storage, b"both", 10).await;
    // While a clip is aligned again the old map stays.
    storage.align_clip(&home, clips[1], at(11)).await.unwrap();
    assert!(due(&storage, 11).await.is_none());
    assert_eq!(clips_of(&current(&storage, &home).await), clips);
    // Without an answer it is in no map any more.
    let held = storage.claim(LEASE, at(12)).await.unwrap().unwrap();
    assert!(end_attempt(&storage, &held, AttemptEnd::Refused(reason("unreadable")), 12).await);
    merge(&storage, b"less", 12).await;
    assert_eq!(storage.clip(&home, clips[1]).await.unwrap().placement, None);
    for id in &clips {
        storage.delete_clip(&home, *id, |_| true, at(500)).await.unwrap();
    }
    let claim = due(&storage, 13).await.expect("the home is due");
    assert!(claim.members.is_empty());
    let mut empty = revision(&claim, PlacedBy::Alignment, b"");
    empty.tiles[0].1 = None;
    assert!(storage.finish_merge(&claim, Some(&empty), at(13)).await.unwrap());
    assert!(current(&storage, &home).await.clips.is_empty());
    assert_eq!(tiles(&storage, &home, 3).await, Some(vec![]));
    assert_eq!(tiles(&storage, &home, 2).await, Some(vec![b"less".to_vec()]));
    storage.delete_home(&home, |_| true, at(500)).await.unwrap();
    assert!(storage.blob_keys_that_matter().await.is_empty());
    assert!(storage.blobs_that_exist().await.is_empty(), "nothing is left of the home");
}

async fn old_revisions_go(storage: Storage) {
    let (home, clips) = two_aligned(&storage).await;
    for n in 0..7 {
        storage.align_clip(&home, clips[0], at(20 + n)).await.unwrap();
        align(&storage, AlignmentState::Aligned).await;
        merge(&storage, &[n as u8], 20 + n).await;
    }
    assert_eq!(current(&storage, &home).await.revision, 7);
    for revision in 1..=7i64 {
        let kept = (revision > 2).then(|| vec![vec![revision as u8 - 1]]);
        let found = tiles(&storage, &home, revision).await;
        assert_eq!(found, kept, "of equal ones the newest are kept: {revision}");
    }
    let page = Page { limit: 3, after: Some(6) };
    let listed = storage.home_map_revisions(&home, &page).await.unwrap();
    assert_eq!(listed.iter().map(|map| map.revision).collect::<Vec<_>>(), [5, 4, 3]);
    let kept: Vec<String> = storage.blobs_that_exist().await;
    assert_eq!(kept.iter().filter(|key| key.contains("home-maps")).count(), 10, "a tile and a manifest each");
}

async fn tiles_that_did_not_change_are_shared(storage: Storage) {
    let (home, clips) = two_aligned(&storage).await;
    let claim = due(&storage, 10).await.unwrap();
    let mut first = revision(&claim, PlacedBy::Alignment, b"here");
    first.tiles.push((TileKey { level: LevelName::MAIN, x: 4, y: 4 }, Some(b"there".to_vec())));
    assert!(storage.finish_merge(&claim, Some(&first), at(10)).await.unwrap());
    for n in 0..8 {
        storage.align_clip(&home, clips[0], at(20 + n)).await.unwrap();
        align(&storage, AlignmentState::Aligned).await;
        merge(&storage, &[n as u8], 20 + n).await;
    }
    assert_eq!(tiles(&storage, &home, 9).await, Some(vec![vec![7], b"there".to_vec()]));
    assert_eq!(tiles(&storage, &home, 5).await, Some(vec![vec![3], b"there".to_vec()]));
}

async fn a_merge_that_makes_nothing_new_makes_no_revision(storage: Storage) {
    let (home, _) = two_aligned(&storage).await;
    merge(&storage, b"both", 10).await;
    let third = add(&storage, &home, b"third").await;
    align(&storage, AlignmentState::Ambiguous).await;
    let claim = due(&storage, 11).await.expect("its neighbours may decide");
    let verdict = &claim.members.iter().find(|member| member.clip == third.id).unwrap().verdict;
    assert!(matches!(verdict, Verdict::Ambiguous { .. }));
    assert!(storage.finish_merge(&claim, None, at(11)).await.unwrap());
    assert!(due(&storage, 12).await.is_none());
    assert_eq!(current(&storage, &home).await.revision, 1);
}

async fn neighbours_place_an_ambiguous_clip_and_take_it_back(storage: Storage) {
    let (home, first) = one_job(&storage).await;
    align(&storage, AlignmentState::Ambiguous).await;
    let own = storage.clip(&home, first.id).await.unwrap().alignment.unwrap();
    assert_ne!(own.probability, Some(0.5), "that of its place is another");
    let claim = due(&storage, 10).await.unwrap();
    let placed = revision(&claim, PlacedBy::Neighbours, b"with");
    assert!(storage.finish_merge(&claim, Some(&placed), at(10)).await.unwrap());
    let clip = storage.clip(&home, first.id).await.unwrap();
    assert_eq!((clip.state, clip.reasons[0].code.as_str()), (ClipState::Aligned, "decided_by_neighbours"));
    let placement = clip.placement.unwrap();
    assert_eq!((placement.by, placement.probability), (PlacedBy::Neighbours, Some(0.5)));
    let answer = clip.alignment.unwrap();
    assert_eq!((answer.probability, answer.map_from_clip), (Some(0.5), Some(placement.map_from_clip)));
    assert_eq!(answer.alternatives, own.alternatives, "the method's own explanations stay");
    // For a merge it is still ambiguous.
    let second = add(&storage, &home, b"other").await;
    align(&storage, AlignmentState::Aligned).await;
    let claim = due(&storage, 11).await.unwrap();
    assert!(matches!(claim.members[0].verdict, Verdict::Ambiguous { .. }));
    let mut alone = revision(&claim, PlacedBy::Alignment, b"without");
    alone.manifest.clips.retain(|placed| placed.clip == second.id);
    assert!(storage.finish_merge(&claim, Some(&alone), at(11)).await.unwrap());
    let clip = storage.clip(&home, first.id).await.unwrap();
    assert_eq!((clip.state, clip.reasons), (ClipState::Ambiguous, vec![reason("two_modes")]));
    assert_eq!((clip.placement, clip.alignment.unwrap()), (None, own));
    assert!(due(&storage, 12).await.is_none(), "what a merge says does not make one due");
}

async fn objects_are_found_across_homes(storage: Storage) {
    for id in ["a", "b"] {
        let home = home(id);
        storage.put_home(&home, None, |_| true, at(0)).await.unwrap();
        put_map(&storage, &home, b"map").await;
        add(&storage, &home, b"clip").await;
        align(&storage, AlignmentState::Aligned).await;
        let claim = due(&storage, 10).await.unwrap();
        let mut new = revision(&claim, PlacedBy::Alignment, b"tile");
        for (n, class) in [Class::Chair, Class::Table, Class::Chair].into_iter().enumerate() {
            new.objects.push(MapObject { class, last_seen: Some(at(3)), ..chair(&n.to_string(), 1.0) });
        }
        assert!(storage.finish_merge(&claim, Some(&new), at(10)).await.unwrap());
    }
    let page = |after: Option<&str>| Page { limit: 2, after: after.map(str::to_owned) };
    let cases = [
        (None, None, None, vec![("a", "0"), ("a", "1")]),
        (None, None, Some("a 1"), vec![("a", "2"), ("b", "0")]),
        (Some("chair"), None, Some("a 0"), vec![("a", "2"), ("b", "0")]),
        (Some("table"), Some("b"), None, vec![("b", "1")]),
        (Some("bed"), None, None, vec![]),
    ];
    for (class, of_home, after, expected) in cases {
        let filter = ObjectFilter { class: class.map(str::to_owned), home: of_home.map(home) };
        let found = storage.objects(&Tenant::default(), &filter, &page(after)).await.unwrap();
        let found: Vec<(&str, &str)> =
            found.iter().map(|o| (o.home.as_str(), o.object.id.as_str())).collect();
        assert_eq!(found, expected, "{class:?} {of_home:?} {after:?}");
    }
    storage.delete_home(&home("a"), |_| true, at(500)).await.unwrap();
    let left = storage.objects(&Tenant::default(), &ObjectFilter::default(), &page(None)).await.unwrap();
    assert!(left.iter().all(|object| object.home == home("b")));
}

async fn a_lost_scene_is_that_of_an_earlier_revision(storage: Storage) {
    let (home, clips) = two_aligned(&storage).await;
    let scene = |name: &str| {
        let history = MapHistory { corrections: 3, hidden: vec![name.to_owned()], ..MapHistory::default() };
        let coverage = Coverage { seen: 0.0, floor_seen: 0.0, by_room: Vec::new() };
        MapScene { rooms: Vec::new(), objects: Vec::new(), coverage, history: Some(history) }
    };
    let files = ["first", "second"].map(|name| serde_json::to_vec(&scene(name)).unwrap());
    let mut claim = due(&storage, 10).await.unwrap();
    for (n, scene) in files.iter().cloned().chain([b"damaged".to_vec()]).enumerate() {
        let mut new = revision(&claim, PlacedBy::Alignment, &[n as u8]);
        new.files = vec![(LevelName::MAIN, map_file::SCENE, scene)];
        assert!(storage.finish_merge(&claim, Some(&new), at(20)).await.unwrap());
        storage.align_clip(&home, clips[0], at(21)).await.unwrap();
        align(&storage, AlignmentState::Aligned).await;
        claim = due(&storage, 22).await.unwrap();
        let scenes = storage.last_scenes(&claim).await.unwrap();
        let history = scenes[&LevelName::MAIN].history();
        let expected = [("first", 3), ("second", 3), ("second", -1)][n];
        assert_eq!((history.hidden[0].as_str(), history.corrections), expected);
    }
    for left in [1, 0] {
        let reader = &mut storage.database.reader().await.unwrap();
        for key in crate::home_maps::blob_keys(reader, &home).await.unwrap() {
            let bytes = storage.blobs.read_if_there(&key).await.unwrap();
            if bytes.is_some_and(|bytes| bytes == files[left]) {
                storage.blobs.remove_all(&[key]).await.unwrap();
            }
        }
        assert_eq!(storage.last_scenes(&claim).await.unwrap().len(), left);
    }
}
