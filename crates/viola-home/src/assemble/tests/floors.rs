//! Clips whose frame is not on the floor of the home: their answer took a bed for it, and an alternative knows better.

use super::*;

const BED_M: f64 = 0.4;

/// Puts the origin of a clip's frame on the bed.
fn put_on_bed(clip: &mut Clip) {
    let lower = Pose3::translation(0.0, 0.0, -BED_M);
    let mut views = clip.contribution.views.clone();
    views.iter_mut().for_each(|view| view.clip_from_camera = lower * view.clip_from_camera);
    let cloud_in_clip = clip.contribution.cloud_in_clip.clone().transformed(&lower);
    clip.contribution = ClipContribution::new(cloud_in_clip, views);
}

fn all(clips: &[Clip]) -> Vec<&Clip> {
    clips.iter().collect()
}

fn lowest_m(map: &Assembly) -> f32 {
    let points = map.changed.values().flatten().flat_map(|tile| &tile.points);
    points.map(|point| point.point.position_m[2]).fold(f32::INFINITY, f32::min)
}

#[test]
fn a_chosen_alternative_above_another_floor_is_raised() {
    let truth = Pose2::new(0.5, 0.5, 0.3);
    let chosen = |rise_m: f64| {
        let mut clips = clips();
        put_on_bed(&mut clips[0]);
        clips[0].member.verdict = Verdict::Chosen { level: LevelName::MAIN, map_from_clip: truth, rise_m };
        clips
    };
    let (low, raised) = (chosen(0.0), chosen(BED_M));
    let alone = |clips: &[Clip]| made(&Manifest::default(), &[&clips[0]]);
    assert!((f64::from(lowest_m(&alone(&low))) + BED_M).abs() < 0.04);
    assert!(lowest_m(&alone(&raised)).abs() < 0.04);

    // With other clips, and after a map that has it at the height of the bed.
    let before = made(&Manifest::default(), &all(&low));
    let map = made(&before.manifest, &all(&raised));
    assert_eq!(map.manifest, made(&Manifest::default(), &all(&raised)).manifest);
    let placed = map.manifest.clips.iter().find(|placed| placed.by == PlacedBy::Person).unwrap();
    assert_eq!((placed.map_from_clip, placed.rise_m, placed.with.len()), (truth, BED_M, 3));
    assert!((placed.floor_correction.z_m - BED_M).abs() < 0.02, "{placed:?}");
    assert!(made(&map.manifest, &all(&raised)).changed.is_empty());
}

#[test]
fn neighbours_that_decide_for_another_floor_raise_the_clip() {
    let mut clips = clips_with_an_ambiguous_one();
    put_on_bed(&mut clips[2]);
    let Verdict::Ambiguous { alternatives } = &mut clips[2].member.verdict else { unreachable!() };
    alternatives[1].rise_m = BED_M;
    let map = made(&Manifest::default(), &all(&clips));
    let placed = map.manifest.clips.iter().find(|placed| placed.by == PlacedBy::Neighbours).unwrap();
    assert!(placed.map_from_clip.distance_m(&Pose2::new(2.0, 2.0, -1.0)) < 0.03, "{placed:?}");
    assert!((placed.floor_correction.z_m - BED_M).abs() < 0.02, "{placed:?}");
    // The next merge reads the heights.
    let json = serde_json::to_string(&map.manifest).unwrap();
    let next = made(&serde_json::from_str(&json).unwrap(), &all(&clips));
    assert!(next.changed.is_empty() && next.manifest == map.manifest);
}

#[test]
fn a_manifest_without_another_floor_is_as_in_earlier_versions() {
    let json = serde_json::to_string(&made(&Manifest::default(), &all(&clips())).manifest).unwrap();
    assert!(!json.contains("rise"), "{json}");
}
