mod people;
mod rooms;

use super::super::assemble::{Extent, FloorCorrection, PlacedBy, PlacedClip};
use super::super::objects::{Sample, UprightBox};
use super::*;
use uuid::Uuid;

fn object(class: Class, centre_m: [f64; 3], size_m: [f64; 3]) -> Object {
    Object::new(class, 0.8, &UprightBox { centre_m, size_m, yaw_rad: 0.4 }, 100)
}

fn chair(x: f64, y: f64) -> Object {
    object(Class::Chair, [x, y, 0.45], [0.5, 0.5, 0.9])
}

/// An object that a person named where it was seen.
fn named_as(seen: &Object) -> Statement {
    Statement { bounds: seen.bounds(), put_from: None, is_hidden: false, stated_at_ms: 25 }
}

fn named(x: f64, y: f64) -> Statement {
    named_as(&chair(x, y))
}

fn stated(statements: &[(&str, Statement)]) -> Stated {
    statements.iter().map(|(id, statement)| ((*id).to_owned(), statement.clone())).collect()
}

/// Returns the objects of the next revision with their ids.
fn identified(history: &mut History, mut objects: Vec<Object>, looked: &LookedThrough) -> Vec<Object> {
    history.identify_objects(&mut objects, &Stated::new(), looked);
    objects
}

/// Returns the ids of the objects of the next revision.
fn next(history: &mut History, objects: Vec<Object>) -> Vec<String> {
    let identified = identified(history, objects, &LookedThrough::of_times(&[]));
    identified.into_iter().map(|object| object.id).collect()
}

#[test]
fn an_object_keeps_its_id_while_it_is_where_it_was() {
    let mut history = History::default();
    assert_eq!(next(&mut history, vec![chair(5.0, 1.0), chair(6.0, 1.0)]), ["chair-1", "chair-2"]);
    let cases = [
        ("a new one before the others", vec![chair(1.0, 1.0), chair(5.0, 1.0), chair(6.0, 1.0)], "3 1 2"),
        ("poses moved a little", vec![chair(1.04, 0.97), chair(5.06, 1.0), chair(6.0, 1.05)], "3 1 2"),
        ("in another order", vec![chair(6.0, 1.0), chair(5.0, 1.0), chair(1.0, 1.0)], "2 1 3"),
        ("one is not found", vec![chair(1.0, 1.0), chair(6.0, 1.0)], "3 2"),
        ("and found again", vec![chair(1.0, 1.0), chair(5.0, 1.0), chair(6.0, 1.0)], "3 1 2"),
        ("one in another place", vec![chair(1.0, 1.0), chair(5.0, 4.0), chair(6.0, 1.0)], "3 4 2"),
    ];
    for (name, objects, expected) in cases {
        let expected: Vec<String> = expected.split(' ').map(|n| format!("chair-{n}")).collect();
        assert_eq!(next(&mut history, objects), expected, "{name}");
    }
}

#[test]
fn a_class_that_changes_changes_no_id() {
    let at = [2.0, 3.0, 0.4];
    let mut history = History::default();
    assert_eq!(next(&mut history, vec![object(Class::Table, at, [1.4, 0.8, 0.8])]), ["table-1"]);
    assert_eq!(next(&mut history, vec![object(Class::Desk, at, [1.5, 0.8, 0.8])]), ["table-1"]);
    // A class of another family in the same space.
    assert_eq!(next(&mut history, vec![object(Class::Bed, at, [1.5, 0.8, 0.8])]), ["table-1"]);
    // A small thing on it is another one.
    let lamp = object(Class::Lamp, [2.0, 3.0, 1.0], [0.3, 0.3, 0.4]);
    assert_eq!(
        next(&mut history, vec![lamp, object(Class::Bed, at, [1.5, 0.8, 0.8])]),
        ["lamp-1", "table-1"]
    );
}

#[test]
fn half_a_sofa_becomes_the_whole_one() {
    let mut history = History::default();
    let half = object(Class::Sofa, [1.0, 0.5, 0.4], [0.9, 0.8, 0.8]);
    let whole = object(Class::Sofa, [1.6, 0.7, 0.4], [2.2, 0.9, 0.8]);
    assert_eq!(next(&mut history, vec![half]), next(&mut history, vec![whole]));
}

#[test]
fn a_number_is_never_used_again() {
    let mut history = History::default();
    assert_eq!(next(&mut history, vec![chair(0.0, 0.0)]), ["chair-1"]);
    for _ in 0..=REMEMBERED {
        assert!(next(&mut history, vec![]).is_empty());
    }
    assert!(history.objects.is_empty(), "nothing is remembered for ever");
    assert_eq!(next(&mut history, vec![chair(0.0, 0.0)]), ["chair-2"]);
    // A corrected object is remembered.
    let stated = stated(&[("chair-2", named(0.0, 0.0)), ("chair-9", named(20.0, 0.0))]);
    for _ in 0..20 {
        history.identify_objects(&mut vec![], &stated, &LookedThrough::of_times(&[]));
    }
    assert_eq!(next(&mut history, vec![chair(0.0, 0.0), chair(4.0, 0.0)]), ["chair-2", "chair-10"]);
}

#[test]
fn a_map_without_a_history_goes_on_with_its_ids() {
    let known = |id: &str, object: &Object| KnownObject::found(id.to_owned(), object.class, &object.bounds());
    let mut history =
        History::of(vec![known("chair-7", &chair(0.0, 0.0))], &[Room::rectangle("4", [0.0; 2], [2.0; 2])]);
    assert_eq!(next(&mut history, vec![chair(0.0, 0.0), chair(3.0, 0.0)]), ["chair-7", "chair-8"]);
    let mut rooms = [Room::rectangle("1", [9.0; 2], [12.0; 2])];
    history.identify_rooms(&mut rooms);
    assert_eq!(rooms[0].id, "5");
}

fn placed(clip: u128, map_from_clip: Pose2) -> PlacedClip {
    PlacedClip {
        clip: Uuid::from_u128(clip),
        contribution: clip.to_string(),
        recorded_at_ms: None,
        by: PlacedBy::Alignment,
        level: LevelName::MAIN,
        probability: None,
        alone: map_from_clip,
        rise_m: 0.0,
        map_from_clip,
        floor_correction: FloorCorrection::default(),
        with: Vec::new(),
        extent: Extent { min_m: [0.0; 2], max_m: [1.0; 2] },
        tiles: Vec::new(),
        points: 1,
    }
}

#[test]
fn the_frame_of_a_new_lidar_map_is_that_of_most_clips() {
    let change = Pose2::new(3.0, -2.0, 1.5);
    let earlier: Vec<PlacedClip> =
        (0..5).map(|n| placed(n, Pose2::new(n as f64, 1.0 - n as f64, 0.3 * n as f64))).collect();
    let mut now: Vec<PlacedClip> = earlier
        .iter()
        .rev()
        .map(|clip| placed(clip.clip.as_u128(), change.compose(&clip.map_from_clip)))
        .collect();
    // Two clips are elsewhere now, and one is new.
    now[0].map_from_clip = Pose2::new(9.0, 9.0, 0.0);
    now[3].map_from_clip = Pose2::new(-9.0, 2.0, 3.0);
    now.push(placed(77, Pose2::IDENTITY));
    let found = map_from_earlier(LevelName::MAIN, &earlier, &now).unwrap();
    assert!(found.distance_m(&change) < 1e-9 && (found.yaw_rad - change.yaw_rad).abs() < 1e-9, "{found:?}");
    assert_eq!(map_from_earlier(LevelName::MAIN, &earlier, &now[5..]), None);

    let mut history = History::default();
    assert_eq!(next(&mut history, vec![chair(1.0, 2.0), chair(4.0, 2.0)]), ["chair-1", "chair-2"]);
    history.move_by(&change);
    let there = |x: f64, y: f64| {
        let at = change.apply(&Point2::new(x, y));
        chair(at.x, at.y)
    };
    assert_eq!(next(&mut history, vec![there(4.0, 2.0), there(1.0, 2.0)]), ["chair-2", "chair-1"]);
}

/// A chair with points on its seat and back, seen by a clip.
fn seen_chair(x: f64, clip: u16) -> Object {
    let sample = |i: u16| Sample { at_m: [x as f32, 1.0, 0.04 * f32::from(i)], clip };
    Object { samples: (0..20).map(sample).collect(), ..chair(x, 1.0) }
}

/// The space of such a chair, and a part of it.
fn space(x: f64, high_m: f64, clip: u16) -> ([f64; 3], [f64; 3], u16) {
    ([x - 0.1, 0.9, 0.0], [x + 0.1, 1.1, high_m], clip)
}

#[test]
fn an_object_is_new_only_if_its_place_was_empty_before() {
    let times = [None, Some(10), Some(10), Some(20)];
    let all = space(1.0, 0.8, 1);
    let cases = [
        ("looked through before", 3, vec![all], true),
        ("nobody looked there", 3, vec![], false),
        ("somebody looked elsewhere", 3, vec![space(2.0, 0.8, 1)], false),
        ("looked through at the same time", 2, vec![all], false),
        ("looked through later", 1, vec![space(1.0, 0.8, 3)], false),
        ("seen at an unknown time", 0, vec![all], false),
        ("a small part was looked through", 3, vec![space(1.0, 0.2, 1)], false),
    ];
    for (name, clip, empty, is_new) in cases {
        let mut history = History::default();
        let looked = LookedThrough::of_boxes(&times, &empty);
        identified(&mut history, vec![seen_chair(1.0, clip)], &looked);
        assert_eq!(history.objects[0].is_new, is_new, "{name}");
    }
}

#[test]
fn an_object_is_gone_only_if_its_place_is_empty_since() {
    let times = [Some(10), Some(20), Some(30), Some(40)];
    let looked = |empty: &[_]| LookedThrough::of_boxes(&times, empty);
    let mut history = History::default();
    identified(&mut history, vec![seen_chair(1.0, 1)], &looked(&[]));
    for (name, looked, is_gone) in [
        ("nobody looked", looked(&[]), false),
        ("an earlier clip looked", looked(&[space(1.0, 0.8, 0)]), false),
        ("a small part was looked through", looked(&[space(1.0, 0.2, 2)]), false),
        ("a later clip looked", looked(&[space(1.0, 0.8, 2)]), true),
        ("the tile did not change", LookedThrough::of_times(&times), true),
    ] {
        identified(&mut history, vec![], &looked);
        assert_eq!(history.objects[0].is_gone, is_gone, "{name}");
    }
    assert_eq!(history.objects[0].missing, 4);
    for (name, empty, clip, is_new) in [
        ("it came back", vec![space(1.0, 0.8, 2)], 3, true),
        ("the clip that looked through its place is deleted", vec![], 1, false),
    ] {
        let mut history = history.clone();
        identified(&mut history, vec![seen_chair(1.0, clip)], &looked(&empty));
        let known = &history.objects[0];
        assert_eq!((known.id.as_str(), known.is_new, known.is_gone), ("chair-1", is_new, false), "{name}");
    }
}

#[test]
fn the_inside_of_an_object_tells_where_its_surface_does_not() {
    let times = [Some(10), Some(20), Some(30)];
    // Views look through a quarter of the points' places, and on both sides of them.
    let around = |clip| {
        [
            space(1.0, 0.2, clip),
            ([0.7, 0.7, 0.0], [0.93, 1.3, 0.9], clip),
            ([1.07, 0.7, 0.0], [1.3, 1.3, 0.9], clip),
        ]
    };
    let beside = |clip| around(clip)[1..].to_vec();
    let cases = [
        ("it was taken away", around(2).to_vec(), [false, true]),
        ("it came", around(0).to_vec(), [true, false]),
        ("it let views through while it was there", [around(1), around(2)].concat(), [false, false]),
        ("all of its surface is still there", beside(2), [false, false]),
        ("only its surface was looked through", vec![space(1.0, 0.2, 2)], [false, false]),
    ];
    for (name, empty, is_new_or_gone) in cases {
        let looked = LookedThrough::of_boxes(&times, &empty);
        let mut history = History::default();
        identified(&mut history, vec![seen_chair(1.0, 1)], &looked);
        let is_new = history.objects[0].is_new;
        identified(&mut history, vec![], &looked);
        assert_eq!([is_new, history.objects[0].is_gone], is_new_or_gone, "{name}");
    }
}

#[test]
fn an_object_that_was_pushed_aside_moved_and_one_that_was_seen_better_did_not() {
    let times = [Some(10), Some(20)];
    for (empty, moves) in [(vec![space(1.0, 0.8, 1)], 1), (vec![], 0)] {
        let mut history = History::default();
        identified(&mut history, vec![seen_chair(1.0, 0)], &LookedThrough::of_boxes(&times, &[]));
        let later =
            identified(&mut history, vec![seen_chair(1.3, 1)], &LookedThrough::of_boxes(&times, &empty));
        assert_eq!((later[0].id.as_str(), history.objects[0].moves), ("chair-1", moves));
    }
}

#[test]
fn small_steps_add_up_to_a_move() {
    let times = [Some(10), Some(20), Some(30), Some(40)];
    // Clips look through the place of the first find last.
    for (empty, moves) in [(vec![space(1.0, 0.8, 3)], [0, 0, 1]), (vec![], [0, 0, 0])] {
        let mut history = History::default();
        let looked = LookedThrough::of_boxes(&times, &empty);
        identified(&mut history, vec![seen_chair(1.0, 0)], &looked);
        for (clip, moves) in (1..).zip(moves) {
            let found =
                identified(&mut history, vec![seen_chair(1.0 + 0.1 * f64::from(clip), clip)], &looked);
            assert_eq!((found[0].id.as_str(), history.objects[0].moves), ("chair-1", moves));
        }
    }
}

#[test]
fn the_place_of_the_first_find_moves_with_the_frame_and_ends_with_its_clip() {
    let looked = LookedThrough::of_times(&[Some(10), Some(20)]);
    let mut history = History::default();
    identified(&mut history, vec![seen_chair(1.0, 0)], &looked);
    identified(&mut history, vec![seen_chair(1.1, 1)], &looked);
    history.move_by(&Pose2::new(2.0, 0.0, 0.0));
    let from = history.objects[0].moves_from.as_ref().unwrap();
    assert!((from.centre_m[0] - 3.0).abs() < 1e-9 && (from.points[0].0[0] - 3.0).abs() < 1e-6, "{from:?}");
    let looked = LookedThrough::of_times(&[None, Some(20)]);
    identified(&mut history, vec![seen_chair(3.1, 1)], &looked);
    assert_eq!(history.objects[0].moves_from, None);
}

#[test]
fn only_revisions_that_could_show_an_object_count() {
    let times = [Some(10), Some(20)];
    for (name, looked, missing) in [
        ("its tile stays as it was", LookedThrough::of_times(&times), [1, 1, 1]),
        ("its tile is rebuilt", LookedThrough::of_boxes(&times, &[]), [1, 2, 3]),
        ("its clip is deleted", LookedThrough::of_times(&[None, Some(20)]), [1, 2, 3]),
    ] {
        let mut history = History::default();
        identified(&mut history, vec![seen_chair(1.0, 0)], &LookedThrough::of_times(&times));
        for missing in missing {
            identified(&mut history, vec![], &looked);
            assert_eq!(history.objects[0].missing, missing, "{name}");
        }
    }
}

#[test]
fn what_is_left_of_an_object_that_is_gone_is_no_object() {
    let times = [Some(10), Some(20)];
    let looked = |empty: &[_]| LookedThrough::of_boxes(&times, empty);
    // (clip that sees what is found in its place, what the later clip looked through, found)
    for (clip, empty, is_found) in [
        (0, vec![space(1.0, 0.8, 1)], false),
        (1, vec![space(1.0, 0.8, 1)], true),
        (0, vec![space(1.0, 0.2, 1)], true),
    ] {
        let mut history = History::default();
        identified(&mut history, vec![seen_chair(1.0, 0)], &looked(&[]));
        let left = identified(&mut history, vec![seen_chair(1.0, clip)], &looked(&empty));
        assert_eq!((left.len() == 1, history.objects[0].is_gone), (is_found, !is_found), "{empty:?}");
        // It stays so as long as its tile does not change, and what a person corrected stays in any case.
        for _ in 0..2 * REMEMBERED {
            let left =
                identified(&mut history, vec![seen_chair(1.0, clip)], &LookedThrough::of_times(&times));
            assert_eq!(left.len() == 1, is_found, "{empty:?}");
        }
        let stated = stated(&[("chair-1", named(1.0, 1.0))]);
        let mut left = vec![seen_chair(1.0, clip)];
        history.identify_objects(&mut left, &stated, &looked(&empty));
        assert_eq!(left.len(), 1);
        // The clip that looked through it is deleted.
        let back = identified(&mut history, vec![seen_chair(1.0, 0)], &looked(&[]));
        assert_eq!(back[0].id, "chair-1", "{empty:?}");
    }
}
