use super::*;
use std::f64::consts::FRAC_PI_2;

fn chair(id: &str, x: f64, y: f64) -> Object {
    let bounds = UprightBox { centre_m: [x, y, 0.45], size_m: [0.6, 0.5, 0.9], yaw_rad: 0.4 };
    Object {
        id: id.to_owned(),
        room: Some("1".to_owned()),
        clips: vec![0],
        ..Object::new(Class::Chair, 0.8, &bounds, 100)
    }
}

fn seen(object: &Object) -> Seen {
    let Object { class, confidence, centre_m, size_m, yaw_rad, .. } = object.clone();
    Seen { class, confidence, centre_m, size_m, yaw_rad }
}

fn flat() -> Vec<Room> {
    let room = |id: &str, low_x: f64, high_x: f64| Room::rectangle(id, [low_x, 0.0], [high_x, 3.0]);
    vec![room("1", 0.0, 4.0), room("2", 4.1, 8.0), room("3", 8.1, 12.0)]
}

#[test]
fn each_property_is_corrected_by_itself() {
    use ObjectField::{CentreM, Class as OfClass, Name, Pinned, SizeM, YawRad};
    let found = chair("chair-1", 1.0, 1.0);
    let of = |change: fn(&mut ObjectCorrection)| {
        let mut correction = ObjectCorrection::of(seen(&found));
        change(&mut correction);
        correction
    };
    let cases: Vec<(ObjectCorrection, Object, Vec<ObjectField>)> = vec![
        (of(|c| c.class = Some(Class::Sofa)), Object { class: Class::Sofa, ..found.clone() }, vec![OfClass]),
        (of(|c| c.name = Some("Throne".to_owned())), found.clone(), vec![Name]),
        (
            of(|c| c.centre_m = Some([5.0, 1.0, 0.5])),
            Object { centre_m: [5.0, 1.0, 0.5], ..found.clone() },
            vec![CentreM],
        ),
        (of(|c| c.size_m = Some([1.0; 3])), Object { size_m: [1.0; 3], ..found.clone() }, vec![SizeM]),
        (of(|c| c.yaw_rad = Some(1.0)), Object { yaw_rad: 1.0, ..found.clone() }, vec![YawRad]),
        (of(|c| c.pinned = true), found.clone(), vec![Pinned]),
    ];
    for (correction, expected, fields) in cases {
        let name = correction.name.clone();
        let mut objects = vec![chair("chair-2", 7.0, 1.0), found.clone()];
        let (corrected, hidden) =
            correct_objects(&mut objects, &[("chair-1".to_owned(), correction.clone())]);
        assert_eq!(objects, [chair("chair-2", 7.0, 1.0), expected], "{fields:?}");
        let of_chair = &corrected["chair-1"];
        assert_eq!((&of_chair.name, &of_chair.fields, corrected.len()), (&name, &fields, 1));
        assert!(hidden.is_empty() && !correction.is_empty());
        // Without the object, only its place and a pin keep it in the map.
        let mut objects = Vec::new();
        correct_objects(&mut objects, &[("chair-1".to_owned(), correction)]);
        assert_eq!(objects.len(), usize::from([vec![CentreM], vec![Pinned]].contains(&fields)), "{fields:?}");
        assert!(objects.iter().all(|object| object.points == 0 && object.clips.is_empty()));
    }
}

#[test]
fn a_pinned_object_stays_as_it_was() {
    let found = chair("chair-1", 1.0, 1.0);
    let pin = ObjectCorrection { pinned: true, ..ObjectCorrection::of(seen(&found)) };
    let elsewhere =
        Object { class: Class::Sofa, centre_m: [1.3, 1.1, 0.4], size_m: [0.9; 3], ..found.clone() };
    let mut objects = vec![elsewhere];
    correct_objects(&mut objects, &[("chair-1".to_owned(), pin)]);
    assert_eq!(objects, [found]);
}

#[test]
fn a_moved_object_is_stated_with_both_places() {
    let mut moved = ObjectCorrection::of(seen(&chair("chair-1", 1.0, 1.0)));
    moved.centre_m = Some([5.0, 1.0, 0.45]);
    let hidden = ObjectCorrection { hidden: true, ..ObjectCorrection::of(seen(&chair("chair-2", 2.0, 1.0))) };
    let stated = stated(&[("chair-1".to_owned(), moved), ("chair-2".to_owned(), hidden)], [10, 20]);
    let told = |id: &str| {
        let statement = &stated[id];
        let from_m = statement.put_from.map(|from| from.centre_m[0]);
        (statement.bounds.centre_m[0], from_m, statement.is_hidden, statement.stated_at_ms)
    };
    assert_eq!(told("chair-1"), (5.0, Some(1.0), false, 10));
    assert_eq!(told("chair-2"), (2.0, None, true, 20));
}

#[test]
fn a_hidden_object_is_not_shown() {
    let found = chair("chair-1", 1.0, 1.0);
    let hide = ObjectCorrection { hidden: true, pinned: true, ..ObjectCorrection::of(seen(&found)) };
    let mut objects = vec![found, chair("chair-2", 3.0, 1.0)];
    let (corrected, hidden) = correct_objects(&mut objects, &[("chair-1".to_owned(), hide)]);
    assert_eq!((objects.len(), objects[0].id.as_str(), corrected.len()), (1, "chair-2", 0));
    assert_eq!(hidden.into_iter().collect::<Vec<_>>(), ["chair-1"]);
}

#[test]
fn places_move_with_the_frame() {
    let change = Pose2::new(10.0, 0.0, FRAC_PI_2);
    let mut correction = ObjectCorrection::of(seen(&chair("chair-1", 1.0, 2.0)));
    correction.centre_m = Some([3.0, 0.0, 0.5]);
    correction.yaw_rad = Some(2.0);
    correction.move_by(&change);
    let near = |a: [f64; 3], b: [f64; 3]| (0..3).all(|axis| (a[axis] - b[axis]).abs() < 1e-9);
    assert!(near(correction.centre_m.unwrap(), [10.0, 3.0, 0.5]), "{correction:?}");
    assert!(near(correction.seen.centre_m, [8.0, 1.0, 0.45]), "{correction:?}");
    let yaw_rad = correction.yaw_rad.unwrap();
    assert!((yaw_rad - (2.0 + FRAC_PI_2 - std::f64::consts::PI)).abs() < 1e-9);
    let mut correction = RoomCorrection {
        name: None,
        merge: Some(RoomMerge { with_m: vec![[1.0, 0.0]], order: 1 }),
        split: Some(RoomSplit { from_m: [2.0, 0.0], to_m: [3.0, 0.0], order: 2 }),
        at_m: [4.0, 0.0],
    };
    correction.move_by(&change);
    let split = correction.split.unwrap();
    let places = [correction.merge.unwrap().with_m[0], split.from_m, split.to_m, correction.at_m];
    for (n, place) in places.into_iter().enumerate() {
        assert!((place[0] - 10.0).abs() < 1e-9 && (place[1] - (n + 1) as f64).abs() < 1e-9, "{place:?}");
    }
}

/// Frames may differ by rounding, and a client may send -1e-17.
#[test]
fn a_yaw_is_never_a_half_turn() {
    let mut objects = vec![Object { yaw_rad: 0.0, ..chair("chair-1", 1.0, 1.0) }];
    let mut correction = ObjectCorrection::of(seen(&objects[0]));
    correction.move_by(&Pose2::new(0.0, 0.0, -1e-17));
    assert_eq!(correction.seen.yaw_rad, 0.0);
    correction.yaw_rad = Some((-1e-17_f64).rem_euclid(std::f64::consts::PI));
    correct_objects(&mut objects, &[("chair-1".to_owned(), correction)]);
    assert_eq!(objects[0].yaw_rad, 0.0);
}

fn at(x: f64) -> RoomCorrection {
    RoomCorrection { name: None, merge: None, split: None, at_m: [x, 1.5] }
}

fn keyed(corrections: &[(&str, RoomCorrection)]) -> Vec<(String, RoomCorrection)> {
    corrections.iter().map(|(key, one)| ((*key).to_owned(), one.clone())).collect()
}

/// Returns the id, the name, the area and the corrected fields of each room.
fn rooms_with(corrections: &[(&str, RoomCorrection)]) -> Vec<(String, Option<String>, f64, Vec<RoomField>)> {
    let mut rooms = flat();
    let corrected = correct_rooms(&mut rooms, &keyed(corrections)).by_id;
    let fields = |id: &str| corrected.get(id).map(|one| one.fields.clone()).unwrap_or_default();
    rooms
        .into_iter()
        .map(|room| (room.id.clone(), room.name, room.area_m2.round(), fields(&room.id)))
        .collect()
}

fn row(
    id: &str,
    name: Option<&str>,
    area_m2: f64,
    fields: &[RoomField],
) -> (String, Option<String>, f64, Vec<RoomField>) {
    (id.to_owned(), name.map(str::to_owned), area_m2, fields.to_vec())
}

#[test]
fn rooms_are_named_joined_and_divided() {
    use RoomField::{MergeWith, Name, SplitBy};
    let named = |x, name: &str| RoomCorrection { name: Some(name.to_owned()), ..at(x) };
    let joined = |x, with: &[f64], order| RoomCorrection {
        merge: Some(RoomMerge { with_m: with.iter().map(|x| [*x, 1.5]).collect(), order }),
        ..at(x)
    };
    let divided = |x: f64, line: f64, order| RoomCorrection {
        split: Some(RoomSplit { from_m: [line, 0.0], to_m: [line, 1.0], order }),
        ..at(x)
    };
    let [one, two, three] = [row("1", None, 12.0, &[]), row("2", None, 12.0, &[]), row("3", None, 12.0, &[])];
    let cases = [
        (vec![], vec![one.clone(), two.clone(), three.clone()]),
        (
            vec![("2", named(6.0, "Bath"))],
            vec![one.clone(), row("2", Some("Bath"), 12.0, &[Name]), three.clone()],
        ),
        // Held by place: the key does not matter.
        (
            vec![("9", named(6.0, "Bath"))],
            vec![one.clone(), row("2", Some("Bath"), 12.0, &[Name]), three.clone()],
        ),
        (vec![("1", joined(2.0, &[6.0], 1))], vec![row("1", None, 24.0, &[MergeWith]), three.clone()]),
        (vec![("1", joined(2.0, &[6.0, 10.0], 1))], vec![row("1", None, 36.0, &[MergeWith])]),
        // Rooms that do not meet stay as they are.
        (vec![("1", joined(2.0, &[10.0, 99.0], 1))], vec![one.clone(), two.clone(), three.clone()]),
        (
            vec![("1", divided(1.0, 3.0, 1)), ("1-b", named(3.5, "Nook"))],
            vec![
                row("1", None, 9.0, &[SplitBy]),
                row("1-b", Some("Nook"), 3.0, &[Name]),
                two.clone(),
                three.clone(),
            ],
        ),
        // The line was withdrawn, or the part joined with the rest of its room.
        (vec![("1-b", named(3.5, "Nook"))], vec![one.clone(), two.clone(), three.clone()]),
        (
            vec![
                ("1", RoomCorrection { split: divided(1.0, 3.0, 1).split, ..joined(1.0, &[3.5], 2) }),
                ("1-b", named(3.5, "Nook")),
            ],
            vec![row("1", Some("Nook"), 12.0, &[SplitBy, MergeWith, Name]), two.clone(), three.clone()],
        ),
        // The name of both is that of the room that was joined with another, if it has one.
        (
            vec![
                ("1", RoomCorrection { name: Some("Kitchen".to_owned()), ..joined(2.0, &[6.0], 1) }),
                ("2", named(6.0, "Dining")),
            ],
            vec![row("1", Some("Kitchen"), 24.0, &[MergeWith, Name]), three.clone()],
        ),
        (
            vec![("1", joined(2.0, &[6.0], 1)), ("2", named(6.0, "Dining"))],
            vec![row("1", Some("Dining"), 24.0, &[MergeWith, Name]), three.clone()],
        ),
        // Each property once, although two of the joined rooms have a name.
        (
            vec![("1", named(2.0, "Hall")), ("2", joined(6.0, &[2.0, 10.0], 1)), ("3", named(10.0, "Den"))],
            vec![row("2", Some("Den"), 36.0, &[MergeWith, Name])],
        ),
        // Joined and then divided elsewhere.
        (
            vec![("1", joined(2.0, &[6.0], 1)), ("2", divided(7.0, 5.0, 2))],
            vec![row("1", None, 9.0, &[MergeWith, SplitBy]), row("1-b", None, 15.0, &[]), three.clone()],
        ),
        // Divided and then joined: the part becomes one with the next room.
        (
            vec![("1", divided(1.0, 3.0, 1)), ("2", joined(6.0, &[3.5], 2))],
            vec![row("1", None, 9.0, &[SplitBy]), row("2", None, 15.0, &[MergeWith]), three.clone()],
        ),
    ];
    for (corrections, expected) in cases {
        assert_eq!(rooms_with(&corrections), expected, "{corrections:?}");
    }
}

/// The part was merged with the next room, and then the room was divided by another line.
#[test]
fn a_part_stays_merged_when_its_room_is_divided_anew() {
    let split = Some(RoomSplit { from_m: [3.0, 0.0], to_m: [3.0, 1.0], order: 2 });
    let merge = Some(RoomMerge { with_m: vec![[6.0, 1.5]], order: 1 });
    let rooms = rooms_with(&[
        ("1", RoomCorrection { split, ..at(1.0) }),
        ("1-b", RoomCorrection { merge, ..at(3.5) }),
    ]);
    let merged = row("1-b", None, 15.0, &[RoomField::MergeWith]);
    assert_eq!(rooms, [row("1", None, 9.0, &[RoomField::SplitBy]), merged, row("3", None, 12.0, &[])]);
}

#[test]
fn a_correction_holds_while_furniture_stands_on_its_point() {
    let named = RoomCorrection { name: Some("Den".to_owned()), ..at(3.5) };
    let joined = RoomCorrection { merge: Some(RoomMerge { with_m: vec![[6.0, 1.5]], order: 1 }), ..at(2.0) };
    let hole = |x: f64| vec![vec![[x - 0.4, 1.1], [x - 0.4, 1.9], [x + 0.4, 1.9], [x + 0.4, 1.1]]];
    // (key, correction, holes of room 1, its eastern wall, names of the rooms that result)
    for (key, correction, holes_m, east_m, want) in [
        ("1", &named, hole(3.5), 4.0, vec![Some("Den"), None, None]),
        // Furniture along the wall: the room with the key is meant, although the next one is nearer.
        ("1", &named, Vec::new(), 2.8, vec![Some("Den"), None, None]),
        ("9", &named, Vec::new(), 2.8, vec![None, Some("Den"), None]),
        // Room 1 is too far away.
        ("1", &named, Vec::new(), 2.4, vec![None, Some("Den"), None]),
        ("1", &joined, hole(2.0), 4.0, vec![None, None]),
    ] {
        let mut rooms = flat();
        rooms[0] =
            Room { holes_m, label_at_m: [0.8, 1.5], ..Room::rectangle("1", [0.0, 0.0], [east_m, 3.0]) };
        correct_rooms(&mut rooms, &keyed(&[(key, correction.clone())]));
        let names: Vec<Option<&str>> = rooms.iter().map(|room| room.name.as_deref()).collect();
        assert_eq!(names, want, "{key} {east_m}");
    }
}

#[test]
fn a_room_with_the_id_of_another_rooms_correction_has_a_key_of_its_own() {
    let named = |x: f64| RoomCorrection { name: Some("Den".to_owned()), ..at(x) };
    // Corrections by key and place; key and corrected fields of room 3, which has the place 10.
    for (corrections, want) in [
        (vec![("1", named(2.0))], None),
        (vec![("3", named(10.0))], Some(("3", vec![RoomField::Name]))),
        (vec![("3", named(2.0))], Some(("3-2", vec![]))),
        (vec![("3", named(90.0))], Some(("3-2", vec![]))),
        (vec![("3", named(2.0)), ("3-2", named(6.0))], Some(("3-3", vec![]))),
        (vec![("3", named(2.0)), ("3-2", named(10.0))], Some(("3-2", vec![RoomField::Name]))),
    ] {
        let corrected = correct_rooms(&mut flat(), &keyed(&corrections)).by_id;
        let found = corrected.get("3").map(|one| (one.key.as_str(), one.fields.clone()));
        assert_eq!(found, want, "{corrections:?}");
    }
}

#[test]
fn a_line_divides_the_rooms_that_are_on_its_sides_after_all_corrections() {
    let line = RoomSplit { from_m: [3.0, 0.0], to_m: [3.5, 3.0], order: 1 };
    let divided = RoomCorrection { split: Some(line), ..at(1.0) };
    let with_part = Some(RoomMerge { with_m: vec![[3.7, 1.5]], order: 2 });
    let joined = RoomCorrection { merge: with_part.clone(), ..at(6.0) };
    let again = RoomCorrection { merge: with_part, ..divided.clone() };
    for (corrections, want) in [
        (vec![("1", divided.clone())], vec![["1", "1-b"]]),
        (vec![("1", divided), ("2", joined)], vec![["1", "2"]]),
        (vec![("1", again)], vec![]),
    ] {
        let divisions = correct_rooms(&mut flat(), &keyed(&corrections)).divisions;
        let rooms: Vec<[&str; 2]> =
            divisions.iter().map(|division| [0, 1].map(|side| division.rooms[side].as_str())).collect();
        assert_eq!(rooms, want, "{corrections:?}");
        assert!(divisions.iter().all(|one| [one.from_m, one.to_m] == [[3.0, 0.0], [3.5, 3.0]]));
    }
}
