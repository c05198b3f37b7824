use super::*;
use crate::assemble::joint::tests::{aligned, candidate, member, on_main};
use crate::assemble::members::{Member, Verdict};
use proptest::prelude::*;
use viola_reconstruct::Descriptor;

/// A feature with a description of its own.
fn feature(salt: u64, position_m: [f64; 3], heading_rad: f64) -> Feature {
    let noise = |k: u64| (salt * 128 + k + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40;
    // Few large values: descriptions of different places are far apart.
    let raw: [f64; 128] = std::array::from_fn(|k| f64::from((noise(k as u64) & 0xff) as u8 > 224));
    let length = raw.iter().map(|value| value * value).sum::<f64>().sqrt().max(1.0);
    let descriptor = Descriptor(raw.map(|value| (value / length * 400.0).round().min(255.0) as u8));
    Feature { position_m: position_m.map(|c| c as f32), heading_rad: heading_rad as f32, descriptor }
}

/// Places on the walls of a room of 4 x 3 m, in the frame of a clip.
fn room(map_from_clip: &Pose2, salt: u64, count: u64) -> Vec<Feature> {
    let clip_from_map = map_from_clip.inverse();
    let place = |k: u64| {
        let (along, up) = ((k * 37 % 40) as f64 * 0.1, 0.4 + (k * 13 % 17) as f64 * 0.1);
        let (x, y, heading) = if k.is_multiple_of(2) { (along, 0.0, 1.57) } else { (0.0, 0.75 * along, 0.0) };
        let at = clip_from_map.apply(&viola_geometry::Point2::new(x, y));
        feature(salt + k, [at.x, at.y, up], heading + clip_from_map.yaw_rad)
    };
    (0..count).map(place).collect()
}

/// Returns features on the walls of the room of the tests of the assembly.
pub(in crate::assemble) fn room_of_features(map_from_clip: &Pose2) -> Vec<Feature> {
    room(map_from_clip, 0, 60)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]
    /// Half of the features of each clip are of places that the other does not show.
    #[test]
    fn two_clips_of_a_room_find_their_motion(
        x in -5.0..5.0f64, y in -5.0..5.0f64, yaw in -3.1..3.1f64, turn in -3.1..3.1f64,
    ) {
        let (map_from_a, map_from_b) = (Pose2::new(x, y, yaw), Pose2::new(1.0, 2.0, turn));
        let (mut a, mut b) = (room(&map_from_a, 0, 60), room(&map_from_b, 0, 60));
        a.extend(room(&map_from_a, 1_000, 60));
        b.extend(room(&map_from_b, 2_000, 60));
        let found = motion::motion(&a, &b).unwrap();
        let truth = map_from_b.inverse().compose(&map_from_a);
        prop_assert!(found.b_from_a.distance_m(&truth) < 0.02, "{found:?} {truth:?}");
        prop_assert!(viola_geometry::angle_between(found.b_from_a.yaw_rad, truth.yaw_rad) < 0.01);
        prop_assert!(found.rise_m.abs() < 1e-3 && found.places > 40);
        prop_assert_eq!(motion::motion(&a, &room(&map_from_b, 3_000, 120)), None);
    }
}

/// A match of many places: `a` is `x_m` to the right of `b`.
fn clip_match(a: u128, b: u128, x_m: f64, places: usize) -> ClipMatch {
    ClipMatch {
        a: a.to_string(),
        b: b.to_string(),
        motion: Motion { b_from_a: Pose2::new(x_m, 0.0, 0.0), rise_m: 0.0, places, spread_m: 1.0 },
        surfaces: Some(Surfaces {
            b_from_a: Pose2::new(x_m, 0.0, 0.0),
            agreement: Agreement { agree: 40, recolored: 0, differ: 0 },
            overlap: None,
        }),
    }
}

/// Returns the last clip's likeliest pose and its probability.
fn last(members: &[Member], clip_matches: &[ClipMatch]) -> Option<(Pose2, f64)> {
    let mut candidates: Vec<Candidate> = members.iter().map(candidate).collect();
    let forest = forest(&candidates, clip_matches);
    pass_poses(&mut candidates, &forest.branches);
    let marginals = crate::assemble::joint::tests::marginals(&candidates, &[], &forest);
    let (candidate, marginal) = (candidates.last()?, marginals.last().copied().flatten()?);
    Some((candidate.modes[marginal.mode].map_from_clip, marginal.probability))
}

/// Eight clips in one place and their matches, which show that matches can be trusted in this home.
fn agreeing() -> (Vec<Member>, Vec<ClipMatch>) {
    let members = (0..8).map(|number| aligned(number, 5.0)).collect();
    (members, (0..8).flat_map(|b| (0..b).map(move |a| clip_match(a, b, 0.0, 60))).collect())
}

#[test]
fn a_clip_without_a_pose_is_placed_along_a_chain_of_matches() {
    let (mut members, trusted) = agreeing();
    members.extend([member(8, Verdict::Unplaced), member(9, Verdict::Unplaced)]);
    let with = |more: &[ClipMatch]| last(&members, &[&trusted, more].concat());
    let (pose, probability) = with(&[clip_match(0, 8, -1.0, 60), clip_match(8, 9, -1.0, 60)]).unwrap();
    assert!(
        pose.distance_m(&Pose2::new(7.0, 0.0, 0.0)) < 1e-9 && probability > 0.9,
        "{pose:?} {probability}"
    );
    assert_eq!(with(&[clip_match(0, 8, -1.0, 60)]), None, "no match, no pose");
    let (_, doubtful) = with(&[clip_match(0, 8, -1.0, 60), clip_match(8, 9, -1.0, 10)]).unwrap();
    assert!(doubtful < 0.9, "{doubtful}");
}

#[test]
fn a_match_decides_between_alternatives_unless_rooms_look_alike() {
    let rooms = vec![on_main(0.0, 0.0, 0.5), on_main(5.0, 0.0, 0.45)];
    let open = member(9, Verdict::Ambiguous { alternatives: rooms });
    let (mut members, mut clip_matches) = agreeing();
    members.push(aligned(8, 0.0));
    members.push(open);
    clip_matches.push(clip_match(0, 9, 0.0, 60));
    let (pose, probability) = last(&members, &clip_matches).unwrap();
    assert!(pose.x_m == 5.0 && probability > 0.95, "{pose:?} {probability}");
    // A clip that is 5 m away looks alike.
    clip_matches.extend((0..5).map(|a| clip_match(a, 8, 0.0, 60)));
    let (_, probability) = last(&members, &clip_matches).unwrap();
    assert!(probability < 0.9, "{probability}");
}

/// A clip that comes last changes no comparison of two others, and adds at most six.
#[test]
fn the_later_clip_chooses_what_is_compared() {
    let places = |a: usize, b: usize| 8 + (a * 7 + b * 13) % 31;
    let compared = |clips: usize| {
        let pairs = (0..clips).flat_map(|b| (0..b).map(move |a| (a, b)));
        let found = |(a, b): (usize, usize)| ((a, b), clip_match(a as u128, b as u128, 0.0, places(a, b)));
        let mut compared: Vec<(usize, usize)> =
            most_places(clips, &pairs.map(found).collect()).into_iter().collect();
        compared.sort_unstable_by_key(|(a, b)| (*b, *a));
        compared
    };
    for clips in 1..24 {
        let (before, now) = (compared(clips - 1), compared(clips));
        assert!(now.starts_with(&before), "{clips} clips: {before:?} {now:?}");
        assert_eq!(now.len() - before.len(), MAX_COMPARED.min(clips - 1));
    }
}
