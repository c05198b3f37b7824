mod features;
mod floors;
mod seen;
mod stop;
mod sums;

use super::*;
use crate::contribution::ClipContribution;
use nalgebra::Matrix3;
use proptest::prelude::*;
use seen::room;
use uuid::Uuid;
use viola_geometry::progress::Silent;
use viola_geometry::taxonomy::Class;
use viola_geometry::{LevelName, Pinhole, Pose3};
use viola_reconstruct::{Label, Readings, View};

fn member(name: &str, map_from_clip: Pose2) -> Member {
    Member {
        clip: Uuid::from_u128(name.bytes().map(u128::from).sum()),
        recorded_at_ms: None,
        sha256: name.to_owned(),
        contribution: format!("contribution of {name}"),
        verdict: Verdict::Aligned {
            level: LevelName::MAIN,
            map_from_clip,
            covariance: Matrix3::from_diagonal(&nalgebra::Vector3::new(4e-4, 4e-4, 1e-4)),
            probability: Some(0.99),
        },
    }
}

/// A clip, placed by its own alignment, and its contribution at the true pose.
struct Clip {
    member: Member,
    contribution: ClipContribution,
}

fn clips() -> Vec<Clip> {
    // Name, true pose, and error of its own alignment.
    let all = [
        ("d", Pose2::new(0.5, 0.5, 0.3), [0.02, -0.01, 0.01]),
        ("a", Pose2::new(3.0, 1.0, 2.0), [-0.02, 0.02, -0.01]),
        ("c", Pose2::new(2.0, 2.0, -1.0), [0.01, 0.02, 0.0]),
        ("b", Pose2::new(0.7, 2.5, -2.9), [-0.02, -0.02, 0.005]),
    ];
    all.into_iter()
        .map(|(name, truth, [x, y, yaw])| Clip {
            member: member(name, Pose2::new(truth.x_m + x, truth.y_m + y, truth.yaw_rad + yaw)),
            contribution: room(&truth, None),
        })
        .collect()
}

/// The same with times, two of them equal. Each has seen a crate somewhere else, and looked through other places.
fn timed_clips() -> Vec<Clip> {
    let mut clips = clips();
    let times = [Some(2000), Some(1000), None, Some(2000)];
    for (number, (clip, time)) in clips.iter_mut().zip(times).enumerate() {
        let Verdict::Aligned { map_from_clip, .. } = clip.member.verdict else { unreachable!() };
        clip.member.recorded_at_ms = time;
        clip.contribution = room(&map_from_clip, Some([2.2 + 0.3 * number as f64, 1.6]));
        let from = 2.0 + 0.4 * number as f64;
        clip.contribution.views =
            [0.0, 0.1, 0.2].map(|x| view(&map_from_clip, [from + x, 0.6], 2.4)).to_vec();
    }
    clips
}

fn contribution<'a>(clips: impl IntoIterator<Item = &'a Clip>, member: &Member) -> ClipContribution {
    clips.into_iter().find(|clip| clip.member == *member).unwrap().contribution.clone()
}

fn made(last: &Manifest, clips: &[&Clip]) -> Assembly {
    let members = clips.iter().map(|clip| clip.member.clone()).collect();
    let mut load = |member: &Member| Ok::<_, Cancelled>(contribution(clips.iter().copied(), member));
    assemble(last, members, &mut load, &Silent).unwrap()
}

type Tiles = BTreeMap<TileKey, Tile>;

fn applied(tiles: Tiles, assembly: &Assembly) -> Tiles {
    assembly.clone().label(tiles, None, &Silent).unwrap().tiles
}

/// Returns the map of `clips` after `last`, of which it reads the manifest and keeps the tiles.
fn labelled(last: &LabelledMap, clips: &[&Clip]) -> LabelledMap {
    made(&last.manifest, clips).label(last.tiles.clone(), None, &Silent).unwrap()
}

fn nothing() -> LabelledMap {
    made(&Manifest::default(), &[]).label(Tiles::new(), None, &Silent).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]
    /// The map is a function of the set: only the remaining clips determine it, not the history of additions
    /// and removals.
    #[test]
    fn any_history_gives_the_same_map(
        order in Just(vec![0usize, 1, 2, 3]).prop_shuffle(), gone in 0usize..4, timed in any::<bool>(),
    ) {
        let clips = if timed { timed_clips() } else { clips() };
        let all: Vec<&Clip> = clips.iter().collect();
        let at_once = labelled(&nothing(), &all);
        let (mut last, mut there): (LabelledMap, Vec<&Clip>) = (nothing(), Vec::new());
        for place in &order {
            there.push(&clips[*place]);
            last = labelled(&last, &there);
        }
        prop_assert_eq!(&last.manifest.clips, &at_once.manifest.clips);
        prop_assert!(last.tiles == at_once.tiles);
        // Remove one clip and add it again.
        let without: Vec<&Clip> = there.iter().copied().filter(|clip| clip.member != clips[gone].member).collect();
        let less = labelled(&last, &without);
        prop_assert!(less.tiles == labelled(&nothing(), &without).tiles);
        let back = labelled(&less, &there);
        prop_assert!(back.tiles == at_once.tiles);
        prop_assert_eq!(back.manifest.tiles, at_once.manifest.tiles);
        // An unchanged set changes no tile.
        prop_assert!(labelled(&last, &there).changed.is_empty());
    }
}

/// One clip saw the crate in parts as a box, in parts as a chair: its surface is one segment.
#[test]
fn the_whole_surface_of_an_object_votes() {
    let pose = Pose2::new(1.0, 0.5, 0.2);
    let mut contribution = room(&pose, Some([2.8, 1.6]));
    let boxes = contribution.cloud_in_clip.points.iter_mut().filter(|point| point.label.class == Class::Box);
    boxes.step_by(3).for_each(|point| point.label = Label::new(Class::Chair, 0.9, 3));
    let clip = Clip { member: member("one", pose), contribution };
    let assembly = made(&Manifest::default(), &[&clip]);
    let labels = |tiles: Vec<&Tile>| {
        let count = |class: Class| {
            let points = tiles.iter().flat_map(|tile| &tile.points);
            points.filter(|point| point.point.label.class == class).count()
        };
        [Class::Box, Class::Chair].map(count)
    };
    let [boxes, chairs] = labels(assembly.changed.values().flatten().collect());
    assert!(chairs > 300 && boxes > chairs, "{boxes} {chairs}");
    let map = assembly.label(Tiles::new(), None, &Silent).unwrap();
    assert_eq!(labels(map.tiles.values().collect()), [boxes + chairs, 0]);
    // The summaries are those of the map's labels.
    let infos: Vec<TileInfo> = map.manifest.tiles.iter().map(|(_, info)| info.clone()).collect();
    assert_eq!(infos, map.tiles.iter().map(|(key, tile)| tile.info(key)).collect::<Vec<_>>());
}

fn on_main(map_from_clip: Pose2, probability: f64) -> Mode {
    Mode { level: LevelName::MAIN, map_from_clip, rise_m: 0.0, probability }
}

/// Clip "c" is ambiguous: the room looks the same to the vacuum after half a turn about its centre. The
/// others looked through the place of the pillar in the turned room.
fn clips_with_an_ambiguous_one() -> Vec<Clip> {
    let mut clips = clips();
    for clip in &mut clips {
        let Verdict::Aligned { map_from_clip, .. } = clip.member.verdict else { unreachable!() };
        clip.contribution.views = [2.4, 2.5, 2.6].map(|x| view(&map_from_clip, [x, 0.6], 2.4)).to_vec();
    }
    let truth = Pose2::new(2.0, 2.0, -1.0);
    let turned = Pose2::new(4.0, 3.0, std::f64::consts::PI).compose(&truth);
    clips[2].member.verdict =
        Verdict::Ambiguous { alternatives: vec![on_main(turned, 0.3), on_main(truth, 0.65)] };
    clips
}

#[test]
fn ambiguous_clips_are_placed_alike_in_any_order() {
    let clips = clips_with_an_ambiguous_one();
    let at_once = made(&Manifest::default(), &clips.iter().collect::<Vec<_>>()).manifest;
    for order in [[2, 0, 1, 3], [3, 1, 2, 0], [1, 3, 0, 2]] {
        let (mut last, mut there): (_, Vec<&Clip>) = (Manifest::default(), Vec::new());
        for place in order {
            there.push(&clips[place]);
            last = made(&last, &there).manifest;
        }
        assert_eq!(last, at_once);
    }
}

/// A manifest of an older version is read; missing parts are computed again.
#[test]
fn an_old_manifest_is_no_cache() {
    let clips = clips_with_an_ambiguous_one();
    let all: Vec<&Clip> = clips.iter().collect();
    let new = made(&Manifest::default(), &all).manifest;
    let mut old = serde_json::to_value(&new).unwrap();
    let fields = old.as_object_mut().unwrap();
    fields.remove("known");
    fields.remove("comparisons");
    fields.insert(
        "opinions".to_owned(),
        serde_json::json!([{ "asked": "contribution of c", "alternative": 0 }]),
    );
    let old: Manifest = serde_json::from_value(old).unwrap();
    assert_eq!(made(&old, &all).manifest, new);
}

/// Renamed fields keep their names in stored manifests.
#[test]
fn the_names_in_a_manifest_stay() {
    let clips = clips();
    let json = serde_json::to_value(made(&Manifest::default(), &[&clips[0]]).manifest).unwrap();
    let (placed, known) = (&json["clips"][0], &json["known"][0]);
    assert!(placed["share"].is_string() && placed["level"]["z_m"].is_number(), "{placed}");
    assert!(known["share"].is_string() && json["ties"].is_array(), "{known}");
}

/// Returns the distance of a clip from its true place.
fn error_m(placed: &PlacedClip, clips: &[Clip], alone: bool) -> f64 {
    let places = [(0.5, 0.5), (3.0, 1.0), (2.0, 2.0), (0.7, 2.5)];
    let i = clips.iter().position(|clip| clip.member.clip == placed.clip).unwrap();
    let pose = if alone { placed.alone } else { placed.map_from_clip };
    pose.distance_m(&Pose2::new(places[i].0, places[i].1, 0.0))
}

#[test]
fn clips_that_overlap_agree_better_together() {
    let clips = clips();
    let map = made(&Manifest::default(), &clips.iter().collect::<Vec<_>>());
    let sum = |alone: bool| map.manifest.clips.iter().map(|p| error_m(p, &clips, alone)).sum::<f64>();
    assert!(sum(false) < 0.5 * sum(true), "{} {}", sum(false), sum(true));
    assert!(map.manifest.clips.iter().all(|placed| placed.with.len() == 3));
}

/// A new clip loads only the clips that it overlaps.
#[test]
fn a_clip_elsewhere_is_not_read_again() {
    let far = Pose2::new(40.0, 0.0, 0.0);
    let mut all = clips();
    for (i, clip) in clips().into_iter().enumerate() {
        let Verdict::Aligned { map_from_clip, .. } = clip.member.verdict else { unreachable!() };
        let moved = member(["w", "x", "y", "z"][i], far.compose(&map_from_clip));
        all.push(Clip { member: moved, contribution: clip.contribution });
    }
    let newest = all.remove(0);
    let before = made(&Manifest::default(), &all.iter().collect::<Vec<_>>());
    all.push(newest);
    let members = all.iter().map(|clip| clip.member.clone()).collect();
    let mut read = Vec::new();
    let mut load = |member: &Member| -> Result<ClipContribution, Cancelled> {
        read.push(member.sha256.clone());
        Ok(contribution(&all, member))
    };
    assemble(&before.manifest, members, &mut load, &Silent).unwrap();
    read.sort();
    assert_eq!(read, ["a", "b", "c", "d"], "each clip of its room once, and none of the other");
}

#[test]
fn a_chosen_clip_stays_where_it_was_put() {
    let mut clips = clips();
    let chosen = Pose2::new(0.53, 0.5, 0.31);
    clips[0].member.verdict = Verdict::Chosen { level: LevelName::MAIN, map_from_clip: chosen, rise_m: 0.0 };
    let map = made(&Manifest::default(), &clips.iter().collect::<Vec<_>>());
    let placed = map.manifest.clips.iter().find(|placed| placed.by == PlacedBy::Person).unwrap();
    assert_eq!((placed.map_from_clip, placed.probability), (chosen, None));
}

/// An ambiguous clip with two alternatives that the LiDAR map cannot distinguish.
#[test]
fn neighbours_decide_between_alternatives() {
    let clips = clips_with_an_ambiguous_one();
    let truth = Pose2::new(2.0, 2.0, -1.0);
    let map = made(&Manifest::default(), &clips.iter().collect::<Vec<_>>());
    let placed = map.manifest.clips.iter().find(|placed| placed.by == PlacedBy::Neighbours).unwrap();
    assert!(placed.map_from_clip.distance_m(&truth) < 0.03, "{placed:?}");
    assert!(placed.probability.unwrap() >= super::poses::MIN_PLACED_PROBABILITY);
    // Alone it is not placed.
    let alone = made(&Manifest::default(), &[&clips[2]]);
    assert!(alone.manifest.clips.is_empty() && alone.changed.is_empty());
}

/// A view along y from `from` in the room; every pixel reads `depth_m`.
fn view(map_from_clip: &Pose2, from: [f64; 2], depth_m: f64) -> View {
    let camera = Pinhole { width: 64, height: 48, fx: 60.0, fy: 60.0, cx: 31.5, cy: 23.5 };
    let forward = nalgebra::Rotation3::from_matrix_unchecked(Matrix3::new(
        1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0,
    ));
    let map_from_camera = Pose3::from_parts(
        nalgebra::Translation3::new(from[0], from[1], 1.0),
        nalgebra::UnitQuaternion::from_rotation_matrix(&forward),
    );
    let clip_from_camera = floor_correction::pose_in_space(map_from_clip, &FloorCorrection::default())
        .inverse()
        * map_from_camera;
    let depth_mm = vec![(depth_m * 1000.0) as u16; 64 * 48];
    View { clip_from_camera, readings: Readings::new(camera, 64, 1, depth_mm).unwrap() }
}

#[test]
fn later_clips_win_where_the_world_changed() {
    let pose = Pose2::new(1.0, 0.5, 0.2);
    let clip = |name: &str, at: Option<i64>, box_m: Option<[f64; 2]>, reach_m: f64| {
        let mut contribution = room(&pose, box_m);
        contribution.views = vec![view(&pose, [3.0, 0.6], reach_m), view(&pose, [3.1, 0.6], reach_m)];
        let verdict = Verdict::Chosen { level: LevelName::MAIN, map_from_clip: pose, rise_m: 0.0 };
        Clip { member: Member { recorded_at_ms: at, verdict, ..member(name, pose) }, contribution }
    };
    let crate_points = |clips: &[&Clip]| {
        let tiles = applied(Tiles::new(), &made(&Manifest::default(), clips));
        let points = tiles.values().flat_map(|tile| &tile.points);
        points.filter(|point| point.point.label.class == Class::Box).count()
    };
    let there = Some([2.8, 1.6]);
    // The crate's front is 1 m before the cameras, the wall 2.4 m.
    let first = clip("with", Some(1000), there, 1.0);
    let gone = clip("without", Some(2000), None, 2.4);
    let all = crate_points(&[&first]);
    assert!(all > 300);
    let left = crate_points(&[&first, &gone]);
    // Both views reach 38 % of the crate; at the rim of the view 5 cm stay.
    assert!(left < all * 3 / 4, "what the views reach is gone: {left} of {all}");
    // Later points stay, and without times no points are removed.
    let early = clip("without", Some(500), None, 2.4);
    let timeless = clip("without", None, None, 2.4);
    assert_eq!(crate_points(&[&first, &early]), all);
    assert_eq!(crate_points(&[&first, &timeless]), all);
}

#[test]
fn people_and_animals_are_not_part_of_a_home() {
    let pose = Pose2::new(1.0, 0.5, 0.2);
    let points_of = |class: Option<Class>| {
        let mut contribution = room(&pose, class.map(|_| [2.8, 1.6]));
        let boxes =
            contribution.cloud_in_clip.points.iter_mut().filter(|point| point.label.class == Class::Box);
        boxes.for_each(|point| point.label.class = class.unwrap_or(Class::Box));
        let clip = Clip { member: member("one", pose), contribution };
        let tiles = applied(Tiles::new(), &made(&Manifest::default(), &[&clip]));
        tiles.values().map(|tile| tile.points.len()).sum::<usize>()
    };
    let empty = points_of(None);
    assert_eq!([Class::Person, Class::Animal].map(|class| points_of(Some(class))), [empty; 2]);
    assert!(points_of(Some(Class::Chair)) > empty + 300);
}

/// The cost of a merge grows with the number of clips, not with that of pairs of them.
#[test]
fn timed_clips_are_read_as_often_as_others() {
    let pose = Pose2::new(1.0, 0.5, 0.2);
    let read = |timed: bool| {
        let contribution = room(&pose, None);
        let clips: Vec<Member> = (0..20)
            .map(|number| Member {
                recorded_at_ms: timed.then_some(number),
                verdict: Verdict::Chosen { level: LevelName::MAIN, map_from_clip: pose, rise_m: 0.0 },
                clip: Uuid::from_u128(number as u128),
                ..member(&format!("{number:02}"), pose)
            })
            .collect();
        let mut read = 0;
        let mut load = |_: &Member| -> Result<ClipContribution, Cancelled> {
            read += 1;
            Ok(contribution.clone())
        };
        assemble(&Manifest::default(), clips, &mut load, &Silent).unwrap();
        read
    };
    assert_eq!(read(true), read(false));
}
