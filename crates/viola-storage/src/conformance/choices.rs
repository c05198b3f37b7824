//! A person's choice beside the method's own answer.

use super::home_maps::merge_by;
use super::*;
use viola_align::Alternative;
use viola_geometry::Pose2;
use viola_home::{PlacedBy, Verdict};
use viola_reconstruct::FloorReport;

on_every_back_end!(
    an_alternative_is_chosen_and_withdrawn,
    a_pose_may_be_chosen_before_there_is_an_answer,
    a_choice_stands_through_new_answers,
    a_choice_moves_with_a_registered_lidar_map,
    a_chosen_alternative_keeps_its_floor,
    without_a_result_a_choice_waits,
    choices_that_cannot_be,
    a_choice_makes_the_map_due,
    a_choice_during_a_merge_stands,
    a_choice_during_a_claim_keeps_the_state_of_the_clip,
    a_choice_on_a_copy_takes_back_what_neighbours_decided,
);

fn pose(x_m: f64) -> Pose2 {
    Pose2 { x_m, y_m: 0.5, yaw_rad: -1.0 }
}

/// Returns an answer with two alternatives, at 1 m and at 2 m.
fn two_modes(state: AlignmentState) -> AttemptEnd {
    let AttemptEnd::Answered(mut alignment) = answer(state) else { unreachable!() };
    let alternative = |x_m| Alternative {
        level: LevelName::MAIN,
        map_from_clip: pose(x_m),
        rise_m: 0.0,
        loss_m: 0.1,
        inliers: 0.9,
        free_space: None,
        misplaced: None,
        probability: None,
        evidence: None,
    };
    alignment.alternatives = vec![alternative(1.0), alternative(2.0)];
    AttemptEnd::Answered(alignment)
}

/// Returns an answer above the upper one of two floors, which lie 0.5 m apart. Its second alternative is above the other one.
fn two_floors(camera_height_m: f64) -> AttemptEnd {
    let AttemptEnd::Answered(mut alignment) = two_modes(AlignmentState::Ambiguous) else { unreachable!() };
    alignment.floor =
        Some(FloorReport { assumed: false, camera_height_m, support_points: 9, gravity_angle_deg: None });
    alignment.alternatives[1].rise_m = 0.5;
    AttemptEnd::Answered(alignment)
}

/// Runs the clip's next job.
async fn end(storage: &Storage, ending: AttemptEnd) -> Clip {
    let claim = storage.claim(LEASE, at(900)).await.unwrap().expect("a job is due");
    storage.put_result(&claim, "cloud.ply", b"points".to_vec()).await.unwrap();
    assert!(end_attempt(storage, &claim, ending, 901).await);
    storage.clip(&claim.job.home, claim.job.clip).await.unwrap()
}

async fn choose(storage: &Storage, clip: &Clip, chosen: Chosen, seconds: i64) -> Clip {
    storage.choose(&clip.home, clip.id, chosen, |_| true, at(seconds)).await.unwrap()
}

fn codes(clip: &Clip) -> Vec<&str> {
    clip.reasons.iter().map(|reason| reason.code.as_str()).collect()
}

/// Returns the chosen pose and its source.
fn standing(clip: &Clip) -> Option<(f64, Option<u32>, i64)> {
    clip.choice.as_ref().map(|c| (c.map_from_clip.x_m, c.alternative, c.lidar_map_revision))
}

async fn an_alternative_is_chosen_and_withdrawn(storage: Storage) {
    one_job(&storage).await;
    let own = end(&storage, two_modes(AlignmentState::Ambiguous)).await;
    assert_eq!((own.state, standing(&own)), (ClipState::Ambiguous, None));
    let chosen = choose(&storage, &own, Chosen::Alternative(1), 1000).await;
    assert_eq!((chosen.state, codes(&chosen)), (ClipState::Aligned, vec!["chosen_by_person"]));
    assert_eq!(standing(&chosen), Some((2.0, Some(1), 1)));
    assert_eq!((&chosen.alignment, chosen.updated_at), (&own.alignment, at(1000)));
    // The same choice again changes nothing, not even its time; another one replaces it.
    assert_eq!(choose(&storage, &own, Chosen::Alternative(1), 1001).await, chosen);
    let other =
        choose(&storage, &own, Chosen::Pose(LevelName::MAIN, Pose2 { yaw_rad: 4.0, ..pose(2.0) }), 1002)
            .await;
    assert_eq!(standing(&other), Some((2.0, None, 1)));
    let choice = other.choice.unwrap();
    assert!((choice.map_from_clip.yaw_rad - (4.0 - std::f64::consts::TAU)).abs() < 1e-12);
    assert_eq!(choice.chosen_at, at(1002));

    let withdrawn = storage.withdraw_choice(&own.home, own.id, |_| true, at(1003)).await.unwrap();
    assert_eq!(withdrawn, Clip { updated_at: at(1003), ..own.clone() });
    assert_eq!(storage.withdraw_choice(&own.home, own.id, |_| true, at(1004)).await.unwrap(), withdrawn);
    assert_eq!(storage.clip(&own.home, own.id).await.unwrap(), withdrawn);
}

async fn a_pose_may_be_chosen_before_there_is_an_answer(storage: Storage) {
    let (home, clip) = one_job(&storage).await;
    let chosen = choose(&storage, &clip, Chosen::Pose(LevelName::MAIN, pose(3.0)), 1).await;
    assert_eq!((chosen.state, &chosen.reasons), (ClipState::Queued, &clip.reasons));
    assert_eq!(standing(&chosen), Some((3.0, None, 1)));
    let held = storage.claim(LEASE, at(2)).await.unwrap().unwrap();
    let aligning = storage.clip(&home, clip.id).await.unwrap();
    assert_eq!((aligning.state, codes(&aligning).len()), (ClipState::Aligning, 0));
    assert!(end_attempt(&storage, &held, two_modes(AlignmentState::Failed), 3).await);
    let settled = storage.clip(&home, clip.id).await.unwrap();
    assert_eq!((settled.state, codes(&settled)), (ClipState::Aligned, vec!["chosen_by_person"]));
    assert_eq!(settled.alignment.unwrap().state, AlignmentState::Failed);
    let withdrawn = storage.withdraw_choice(&home, clip.id, |_| true, at(4)).await.unwrap();
    assert_eq!((withdrawn.state, codes(&withdrawn)), (ClipState::Failed, vec!["two_modes"]));
}

async fn a_choice_stands_through_new_answers(storage: Storage) {
    let (home, _) = one_job(&storage).await;
    let clip = end(&storage, two_modes(AlignmentState::Ambiguous)).await;
    choose(&storage, &clip, Chosen::Alternative(0), 200).await;
    storage.align_clip(&home, clip.id, at(201)).await.unwrap();
    let again = end(&storage, two_modes(AlignmentState::Failed)).await;
    assert_eq!((again.state, codes(&again)), (ClipState::Aligned, vec!["chosen_by_person"]));
    assert_eq!(again.alignment.as_ref().unwrap().state, AlignmentState::Failed);

    put_map(&storage, &home, b"a map of another frame").await;
    let moved = end(&storage, two_modes(AlignmentState::Aligned)).await;
    let expected = vec!["chosen_by_person", "choice_of_earlier_lidar_map"];
    assert_eq!((moved.state, codes(&moved)), (ClipState::Aligned, expected));
    let told = &moved.reasons[1].detail;
    assert!(["was replaced", "aligned again"].iter().all(|part| told.contains(part)), "{told}");
    assert_eq!(standing(&moved), Some((1.0, Some(0), 1)));
    // Confirmed on the new map by choosing again.
    let confirmed = choose(&storage, &moved, Chosen::Alternative(0), 300).await;
    assert_eq!(
        (standing(&confirmed), codes(&confirmed)),
        (Some((1.0, Some(0), 2)), vec!["chosen_by_person"])
    );
}

async fn a_choice_moves_with_a_registered_lidar_map(storage: Storage) {
    let (home, _) = one_job(&storage).await;
    let clip = end(&storage, two_modes(AlignmentState::Ambiguous)).await;
    choose(&storage, &clip, Chosen::Alternative(0), 200).await;
    let put = async |file: &[u8], revision| {
        let from = FromEarlier { revision, map_from_earlier: Pose2::new(10.0, 0.0, 0.0) };
        put_registered(&storage, &home, LevelName::MAIN, file, Some(from)).await.unwrap().0
    };
    // The same frame is kept with its revision, and read again.
    let second = put(b"second", 1).await;
    assert_eq!(second.from_earlier.map(|from| from.revision), Some(1));
    assert_eq!(storage.lidar_map(&home, LevelName::MAIN).await.unwrap(), second);
    let moved = end(&storage, two_modes(AlignmentState::Ambiguous)).await;
    assert_eq!(standing(&moved), Some((11.0, Some(0), 2)));
    assert_eq!(codes(&moved), ["chosen_by_person", "choice_carried_over"]);
    // The revision that it was compared with was replaced meanwhile: nothing is known.
    let third = put(b"third", 1).await;
    assert_eq!(third.from_earlier, None);
    let stayed = end(&storage, two_modes(AlignmentState::Ambiguous)).await;
    assert_eq!(standing(&stayed), Some((11.0, Some(0), 2)));
    assert_eq!(codes(&stayed), ["chosen_by_person", "choice_of_earlier_lidar_map"]);
    // A choice of an earlier map than the replaced one stays where it is.
    put(b"fourth", 3).await;
    assert_eq!(
        standing(&end(&storage, two_modes(AlignmentState::Ambiguous)).await),
        Some((11.0, Some(0), 2))
    );
}

/// A new answer may be above another floor, or find the same one a little higher.
async fn a_chosen_alternative_keeps_its_floor(storage: Storage) {
    let (home, clip) = one_job(&storage).await;
    end(&storage, two_floors(1.0)).await;
    let cases = [(0, 1.0, 0.0), (0, 1.5, -0.5), (1, 1.0, 0.5), (1, 1.5, 0.0), (1, 1.45, 0.0)];
    for (seconds, (index, next_m, expected_m)) in (902..).zip(cases) {
        storage.align_clip(&home, clip.id, at(201)).await.unwrap();
        let clip = end(&storage, two_floors(1.0)).await;
        choose(&storage, &clip, Chosen::Alternative(index), 202).await;
        storage.align_clip(&home, clip.id, at(203)).await.unwrap();
        end(&storage, two_floors(next_m)).await;
        let claim = merge_by(&storage, PlacedBy::Person, b"tile", seconds).await;
        let Verdict::Chosen { rise_m, .. } = claim.members[0].verdict else { panic!("{:?}", claim.members) };
        assert!((rise_m - expected_m).abs() < 1e-9, "{index} {next_m}: {rise_m}");
        assert!(storage.clip(&home, clip.id).await.unwrap().placement.is_some());
    }
}

async fn without_a_result_a_choice_waits(storage: Storage) {
    let (home, clip) = one_job(&storage).await;
    choose(&storage, &clip, Chosen::Pose(LevelName::MAIN, pose(1.0)), 1).await;
    let failed = end(&storage, AttemptEnd::Refused(reason("bad_picture"))).await;
    assert_eq!(
        (failed.state, codes(&failed)),
        (ClipState::Failed, vec!["bad_picture", "choice_without_result"])
    );
    // Another choice adds its reason once.
    let failed = choose(&storage, &clip, Chosen::Pose(LevelName::MAIN, pose(2.0)), 200).await;
    assert_eq!(
        (failed.state, codes(&failed)),
        (ClipState::Failed, vec!["bad_picture", "choice_without_result"])
    );
    let withdrawn = storage.withdraw_choice(&home, clip.id, |_| true, at(201)).await.unwrap();
    assert_eq!((withdrawn.state, codes(&withdrawn)), (ClipState::Failed, vec!["bad_picture"]));

    storage.align_clip(&home, clip.id, at(202)).await.unwrap();
    choose(&storage, &clip, Chosen::Pose(LevelName::MAIN, pose(1.0)), 203).await;
    let job = storage.clip(&home, clip.id).await.unwrap().job.unwrap();
    storage.cancel_job(job.id, at(204)).await.unwrap();
    let cancelled = storage.clip(&home, clip.id).await.unwrap();
    assert_eq!(
        (cancelled.state, codes(&cancelled)),
        (ClipState::Uploaded, vec!["cancelled", "choice_without_result"])
    );
    storage.align_clip(&home, clip.id, at(205)).await.unwrap();
    assert_eq!(end(&storage, two_modes(AlignmentState::Failed)).await.state, ClipState::Aligned);
}

async fn choices_that_cannot_be(storage: Storage) {
    let bare = home("bare");
    storage.put_home(&bare, None, |_| true, at(0)).await.unwrap();
    let lost = add(&storage, &bare, b"clip").await;
    let refused =
        storage.choose(&bare, lost.id, Chosen::Pose(LevelName::MAIN, pose(0.0)), |_| true, at(1)).await;
    assert!(matches!(refused, Err(ChoiceError::Storage(StorageError::NoLidarMap))));
    let refused = storage
        .choose(&bare, Uuid::now_v7(), Chosen::Pose(LevelName::MAIN, pose(0.0)), |_| true, at(1))
        .await;
    assert!(matches!(refused, Err(ChoiceError::Storage(StorageError::NoSuchClip))));

    let (home, clip) = one_job(&storage).await;
    let refused = storage.choose(&home, clip.id, Chosen::Alternative(0), |_| true, at(1)).await;
    assert!(matches!(refused, Err(ChoiceError::NoAnswerYet(ClipState::Queued))));
    let clip = end(&storage, two_modes(AlignmentState::Ambiguous)).await;
    for index in [2, u64::from(u32::MAX) + 1, u64::MAX] {
        let refused = storage.choose(&home, clip.id, Chosen::Alternative(index), |_| true, at(1)).await;
        assert!(matches!(refused, Err(ChoiceError::NoSuchAlternative { count: 2 })), "{index}");
    }
    // The map spans x 0..4 and y -1..2.5; 10 m more is allowed to each side.
    let at_m = |x_m, y_m| Chosen::Pose(LevelName::MAIN, Pose2 { x_m, y_m, yaw_rad: 0.0 });
    for (x_m, y_m, field) in [
        (14.01, 0.0, "map_from_clip.x_m"),
        (-10.01, 0.0, "map_from_clip.x_m"),
        (0.0, 12.51, "map_from_clip.y_m"),
        (0.0, -11.01, "map_from_clip.y_m"),
        (f64::NAN, 0.0, "map_from_clip.x_m"),
        (0.0, f64::INFINITY, "map_from_clip.y_m"),
    ] {
        match storage.choose(&home, clip.id, at_m(x_m, y_m), |_| true, at(1)).await {
            Err(ChoiceError::OutOfReach { field: named, .. }) => assert_eq!(named, field, "{x_m} {y_m}"),
            other => panic!("{x_m} {y_m}: {other:?}"),
        }
    }
    assert_eq!(storage.clip(&home, clip.id).await.unwrap(), clip);
    choose(&storage, &clip, at_m(14.0, -11.0), 2).await;
}

/// The merge began before the choice, and must not tell the clip what it was then.
async fn a_choice_during_a_merge_stands(storage: Storage) {
    one_job(&storage).await;
    let clip = end(&storage, two_modes(AlignmentState::Ambiguous)).await;
    let claim = storage.claim_merge("", LEASE, at(100)).await.unwrap().expect("its neighbours may decide");
    let chosen = choose(&storage, &clip, Chosen::Alternative(1), 101).await;
    assert!(storage.finish_merge(&claim, Some(&NewRevision::default()), at(102)).await.unwrap());
    assert_eq!(storage.clip(&clip.home, clip.id).await.unwrap(), chosen);
    let claim = storage.claim_merge("", LEASE, at(103)).await.unwrap().expect("the choice is not in the map");
    assert!(matches!(claim.members[0].verdict, Verdict::Chosen { .. }));
}

async fn a_choice_makes_the_map_due(storage: Storage) {
    let (home, _) = one_job(&storage).await;
    let clip = end(&storage, two_modes(AlignmentState::Ambiguous)).await;
    let claim = storage.claim_merge("", LEASE, at(100)).await.unwrap().expect("its neighbours may decide");
    assert!(matches!(claim.members[0].verdict, Verdict::Ambiguous { .. }));
    assert!(storage.finish_merge(&claim, None, at(100)).await.unwrap());
    choose(&storage, &clip, Chosen::Alternative(1), 200).await;
    let claim = storage.claim_merge("", LEASE, at(300)).await.unwrap().expect("a clip was placed by hand");
    assert!(matches!(claim.members[0].verdict, Verdict::Chosen { .. }));
    storage.give_back_merge(&claim, at(300)).await.unwrap();
    storage.withdraw_choice(&home, clip.id, |_| true, at(301)).await.unwrap();
    let claim = storage.claim_merge("", LEASE, at(302)).await.unwrap().expect("the choice was withdrawn");
    assert!(matches!(claim.members[0].verdict, Verdict::Ambiguous { .. }));
}

async fn a_choice_during_a_claim_keeps_the_state_of_the_clip(storage: Storage) {
    let (home, clip) = one_job(&storage).await;
    // As in a claim: the job is locked, and then the clip changes.
    let mut claiming = storage.database.begin().await.unwrap();
    crate::jobs::lock_of_clip(&mut claiming, clip.id).await.unwrap();
    let chosen = Chosen::Pose(LevelName::MAIN, pose(1.0));
    let mut choosing = std::pin::pin!(storage.choose(&home, clip.id, chosen, |_| true, at(1)));
    let waited = tokio::time::timeout(Duration::from_millis(200), &mut choosing).await;
    assert!(waited.is_err(), "a choice waits for the claim");
    crate::database::query("UPDATE clips SET state = 'aligning' WHERE id = $1")
        .bind(clip.id.to_string())
        .execute(&mut claiming)
        .await
        .unwrap();
    claiming.commit().await.unwrap();
    let clip = choosing.await.unwrap();
    assert_eq!((clip.state, standing(&clip)), (ClipState::Aligning, Some((1.0, None, 1))));
}

async fn a_choice_on_a_copy_takes_back_what_neighbours_decided(storage: Storage) {
    let (home, _) = one_job(&storage).await;
    let first = end(&storage, two_modes(AlignmentState::Ambiguous)).await;
    merge_by(&storage, PlacedBy::Neighbours, b"first", 902).await;
    let placed = storage.clip(&home, first.id).await.unwrap();
    assert_eq!((placed.state, codes(&placed)), (ClipState::Aligned, vec!["decided_by_neighbours"]));
    // The same recording again. A merge takes the one that a person placed.
    add(&storage, &home, b"clip").await;
    let copy = end(&storage, two_modes(AlignmentState::Ambiguous)).await;
    choose(&storage, &copy, Chosen::Alternative(0), 903).await;
    let claim = merge_by(&storage, PlacedBy::Person, b"copy", 904).await;
    assert_eq!(claim.members.iter().map(|member| member.clip).collect::<Vec<_>>(), [copy.id]);
    let left = storage.clip(&home, first.id).await.unwrap();
    assert_eq!((left.state, codes(&left)), (ClipState::Ambiguous, vec!["two_modes"]));
    assert_eq!(left.placement, None);
    let copy = storage.clip(&home, copy.id).await.unwrap();
    assert_eq!((copy.state, codes(&copy)), (ClipState::Aligned, vec!["chosen_by_person"]));
}
