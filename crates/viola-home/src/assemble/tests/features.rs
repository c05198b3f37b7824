use super::*;
use crate::assemble::clip_matches;

/// The clips of [`clips`], of which "c" has no pose of its own, and their features on the walls.
struct WithFeatures(Vec<Clip>);

impl LoadClips<Cancelled> for WithFeatures {
    fn contributions(&mut self, members: &[&Member]) -> Result<Vec<ClipContribution>, Cancelled> {
        Ok(members.iter().map(|member| contribution(&self.0, member)).collect())
    }

    fn features(&mut self, members: &[&Member]) -> Result<Vec<Vec<viola_reconstruct::Feature>>, Cancelled> {
        let truth = |member: &Member| match &*member.sha256 {
            "d" | "e" => Pose2::new(0.5, 0.5, 0.3),
            "a" | "f" => Pose2::new(3.0, 1.0, 2.0),
            "c" => Pose2::new(2.0, 2.0, -1.0),
            _ => Pose2::new(0.7, 2.5, -2.9),
        };
        Ok(members.iter().map(|member| clip_matches::room_of_features(&truth(member))).collect())
    }
}

/// Matches place a clip that the map does not know, in any order of the clips, and leave nothing of a deleted one.
#[test]
fn a_clip_without_a_pose_is_placed_by_its_features() {
    let mut all = WithFeatures(clips());
    all.0[2].member.verdict = Verdict::Unplaced;
    // More clips that are aligned by themselves show that matches can be trusted in this home.
    for (again, name) in [(0, "e"), (1, "f"), (3, "g")] {
        let Verdict::Aligned { map_from_clip, .. } = all.0[again].member.verdict else { unreachable!() };
        let contribution = all.0[again].contribution.clone();
        all.0.push(Clip { member: member(name, map_from_clip), contribution });
    }
    let members: Vec<Member> = all.0.iter().map(|clip| clip.member.clone()).collect();
    let mut made = |last: &Manifest, members: &[Member]| {
        assemble(last, members.to_vec(), &mut all, &Silent).unwrap().manifest
    };
    let at_once = made(&Manifest::default(), &members);
    let placed = at_once.clips.iter().find(|placed| placed.by == PlacedBy::Neighbours).unwrap();
    assert!(placed.map_from_clip.distance_m(&Pose2::new(2.0, 2.0, 0.0)) < 0.03, "{placed:?}");
    assert_eq!(at_once.clip_matches.len(), 21);
    for order in [[2, 0, 6, 1, 3, 5, 4], [6, 4, 3, 1, 5, 2, 0]] {
        let (mut last, mut there) = (Manifest::default(), Vec::new());
        for place in order {
            there.push(members[place].clone());
            last = made(&last, &there);
        }
        assert_eq!(last, at_once);
    }
    let without: Vec<Member> = members[1..].to_vec();
    assert_eq!(made(&at_once, &without), made(&Manifest::default(), &without));
}

/// A match is of the earlier clip to the later one, and a corrected time changes which is which.
#[test]
fn a_corrected_time_gives_the_map_of_the_new_order() {
    let remade = |all: &mut WithFeatures, last: &Manifest| {
        let members = all.0.iter().map(|clip| clip.member.clone()).collect();
        assemble(last, members, all, &Silent).unwrap().manifest
    };
    let mut all = WithFeatures(clips());
    let before = remade(&mut all, &Manifest::default());
    assert_eq!(before.clip_matches.len(), 6);
    // The first clip becomes the last one.
    all.0[1].member.recorded_at_ms = Some(1_000);
    let corrected = remade(&mut all, &before);
    assert_eq!(corrected, remade(&mut all, &Manifest::default()));
}
