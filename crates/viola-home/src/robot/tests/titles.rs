//! Names of rooms and objects.

use super::*;
use crate::robot::titles::Titles;

/// Returns the level with objects of the same classes, and with things on the walls.
fn furnished() -> RobotLevel<'static> {
    let mut level = level(&LIDAR);
    level.objects.extend([
        object("table-2", Class::Table, [2.0, 1.5], [0.8, 0.8, 0.75], "16"),
        object("table-3", Class::Table, [7.0, 1.5], [0.8, 0.8, 0.75], "17"),
        object("picture-1", Class::Picture, [5.1, 1.5], [0.5, 0.02, 0.5], "17"),
        object("window-1", Class::Window, [8.1, 2.5], [1.0, 0.1, 1.5], "17"),
        object("cabinet-1", Class::Cabinet, [1.3, 1.5], [0.6, 0.3, 0.7], "16"),
        object("plant-1", Class::Plant, [7.8, 1.3], [0.3, 0.3, 1.0], "elsewhere"),
        object("plant-2", Class::Plant, [7.8, 2.0], [0.3, 0.3, 1.0], "elsewhere"),
    ]);
    level.objects[1].name = Some("Grandma's sofa".to_owned());
    // The cabinet hangs on the wall. The better table is the second one.
    level.objects[6].bounds.centre_m[2] = 1.6;
    level.objects[2].confidence = 0.9;
    level
}

const OBJECTS: [&str; 9] = [
    "Kitchen: table",
    "Bedroom: Grandma's sofa",
    "Kitchen: table 2",
    "Bedroom: table",
    "Bedroom: picture",
    "Bedroom: window",
    "Kitchen: cabinet",
    "plant",
    "plant 2",
];

#[test]
fn all_files_have_the_same_names() {
    let level = furnished();
    let name_of: std::collections::BTreeMap<&str, &str> =
        level.objects.iter().map(|object| object.id.as_str()).zip(OBJECTS).collect();

    let answer = valetudo(&level, None);
    let found: Vec<_> = answer.objects.iter().map(|target| target.name.as_deref().unwrap()).collect();
    assert_eq!(found, OBJECTS);

    let files = nav2_files(&level, &Ground::new(&LIDAR)).unwrap();
    let goals = files.iter().find(|(name, _)| *name == "goals.json").map(|(_, bytes)| bytes).unwrap();
    let goals: Value = serde_json::from_slice(goals).unwrap();
    let goals = goals["goals"].as_array().unwrap();
    let of_objects = goals.iter().filter(|goal| goal["class"] != Value::Null);
    for goal in of_objects.clone() {
        assert_eq!(goal["name"], name_of[goal["id"].as_str().unwrap()], "{goal}");
    }
    assert!(of_objects.count() > 2, "{goals:?}");

    // The best object comes first, and its name is the same.
    let file = matter(std::slice::from_ref(&level));
    let areas = file.supported_areas.iter().zip(&file.sources).skip(2);
    let found: Vec<_> = areas
        .map(|(area, source)| {
            (source.object.as_deref().unwrap(), area.info.location_info.location_name.as_str())
        })
        .collect();
    let want = ["table-2", "table-1", "sofa-1", "table-3"].map(|id| (id, name_of[id]));
    assert_eq!(found, want);
}

#[test]
fn the_card_shows_no_things_on_walls() {
    let level = furnished();
    let file = calibration(&level, &image(&level));
    let labels = |mode: usize| -> Vec<&str> {
        file.map_modes[mode].predefined_selections.iter().map(|one| one.label.text.as_str()).collect()
    };
    let mut want = vec!["Kitchen", "Bedroom"];
    want.extend(OBJECTS[..4].iter().chain(&OBJECTS[7..]));
    assert_eq!(labels(1), want);
    // An object may have no goal.
    assert!(labels(2).len() > 2 && labels(2).iter().all(|label| want.contains(label)), "{:?}", labels(2));
}

#[test]
fn rooms_of_one_name_have_numbers_and_so_have_their_objects() {
    let mut level = level(&LIDAR);
    level.rooms[0].name = Some("Bedroom".to_owned());
    level.objects[0].class = Class::Sofa;
    let titles = Titles::of(&level);
    assert_eq!(titles.rooms, ["Bedroom", "Bedroom 2"]);
    assert_eq!(titles.objects, ["Bedroom: sofa", "Bedroom 2: sofa"]);
    // A person's name may be one with a number.
    level.rooms[0].name = Some("Bedroom 2".to_owned());
    level.rooms.push(Room { id: "18".to_owned(), ..level.rooms[1].clone() });
    assert_eq!(Titles::of(&level).rooms, ["Bedroom 2", "Bedroom", "Bedroom 3"]);
}

#[test]
fn no_number_takes_the_name_of_another_room() {
    for (given, want) in [
        (&["Kammer", "Kammer", "Kammer 2"][..], &["Kammer", "Kammer 3", "Kammer 2"][..]),
        (&["Kammer 2", "Kammer", "Kammer"], &["Kammer 2", "Kammer", "Kammer 3"]),
        (&["A", "A", "A 2", "A 2", "A 3"], &["A", "A 4", "A 2", "A 2 2", "A 3"]),
        (&["A", "A", "A"], &["A", "A 2", "A 3"]),
        (&["A", "B", "C"], &["A", "B", "C"]),
        (&["Flur ", "Flur", " Flur "], &["Flur", "Flur 2", "Flur 3"]),
    ] {
        let room = |(number, name): (usize, &&str)| Room {
            name: Some((*name).to_owned()),
            ..Room::rectangle(&number.to_string(), [1.0, 1.0], [5.0, 4.0])
        };
        let rooms = given.iter().enumerate().map(room).collect();
        let level = RobotLevel { rooms, objects: vec![], ..level(&LIDAR) };
        assert_eq!(Titles::of(&level).rooms, want);
    }
}

#[test]
fn no_number_takes_the_name_of_another_object() {
    let mut level = level(&LIDAR);
    level.rooms[1].name = Some("Kitchen: table 3".to_owned());
    level.objects = (0..4).map(|n| object(&n.to_string(), Class::Table, [2.0; 2], [0.5; 3], "16")).collect();
    // A person gave the last table the number that the second one would get.
    level.objects[3].name = Some("table 2".to_owned());
    let want = ["Kitchen: table", "Kitchen: table 4", "Kitchen: table 5", "Kitchen: table 2"];
    assert_eq!(Titles::of(&level).objects, want);
}

#[test]
fn the_segments_of_a_room_are_told_apart() {
    let mut level = level(&LIDAR);
    level.rooms =
        vec![Room::rectangle("16", [1.0, 1.0], [8.1, 4.0]), Room::rectangle("9", [20.0; 2], [21.0; 2])];
    level.rooms[0].name = Some("Flat".to_owned());
    level.rooms[1].name = Some("Flat 2".to_owned());
    let answer = valetudo(&level, Some(&valetudo_map()));
    let names: Vec<_> = answer.segments.iter().map(|segment| segment.name.as_deref()).collect();
    assert_eq!(names, [Some("Flat"), Some("Flat 3")]);
    let map = answer.map.unwrap();
    let shown = [1, 2].map(|layer: usize| map["layers"][layer]["metaData"]["name"].clone());
    assert_eq!(shown, [json!("Flat"), json!("Flat 3")]);
    let card = calibration(&level, &image(&level));
    let labels: Vec<_> = card.map_modes[0].predefined_selections.iter().map(|one| &one.label.text).collect();
    assert_eq!(labels, ["Flat", "Flat 3"]);
    // Without a name the segments keep their own.
    level.rooms[0].name = None;
    let answer = valetudo(&level, Some(&valetudo_map()));
    assert!(answer.segments.iter().all(|segment| segment.name.is_none()));
    assert_eq!(answer.map.unwrap()["layers"][2]["metaData"]["name"], "Room 17");
}
