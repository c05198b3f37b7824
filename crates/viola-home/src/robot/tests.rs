//! A level with two rooms, drawn as Valetudo's JSON with known coordinates.

mod calibration;
mod matter;
mod nav2;
mod titles;

use super::area::{Rectangle, for_cells};
use super::drive::RADIUS_M;
use super::no_go::forbidden;
use super::places::{Place, places};
use super::*;
use crate::plan::{PlanImage, plan};
use serde_json::{Value, json};
use std::sync::LazyLock;
use viola_formats::lidar::{Cell, LidarError, valetudo_json};
use viola_geometry::{DistanceField, Grid, Point2};

/// Height of the sheet.
const SHEET_CM: i64 = 1000;
const PIXEL_CM: i64 = 5;

/// Returns a Valetudo map: a kitchen of 4 m x 3 m from (1 m, 1 m) on, a wall of 10 cm, a bedroom of 3 m x 3 m, and
/// walls around. A door of 1 m joins the rooms. The sheet is 10 m x 10 m.
fn valetudo_map() -> Vec<u8> {
    let rows = 60;
    let runs = |x: i64, width: i64| -> Vec<i64> { (0..rows).flat_map(|row| [x, 120 + row, width]).collect() };
    let segment = |id: &str, name: &str, pixels: Vec<i64>| {
        json!({"__class": "MapLayer", "type": "segment", "metaData": {"segmentId": id, "name": name, "area": 1},
            "pixels": [], "compressedPixels": pixels})
    };
    let mut walls = vec![19, 119, 144, 19, 180, 144];
    for row in 0..rows {
        walls.extend([19, 120 + row, 1, 162, 120 + row, 1]);
        // The door is in the middle.
        if !(20..40).contains(&row) {
            walls.extend([100, 120 + row, 2]);
        }
    }
    let door: Vec<i64> = (20..40).flat_map(|row| [100, 120 + row, 2]).collect();
    json!({
        "__class": "ValetudoMap",
        "metaData": {"version": 2, "nonce": "n"},
        "size": {"x": SHEET_CM, "y": SHEET_CM},
        "pixelSize": PIXEL_CM,
        "layers": [
            {"__class": "MapLayer", "type": "floor", "metaData": {}, "pixels": [], "compressedPixels": door},
            segment("16", "Room 16", runs(20, 80)),
            segment("17", "Room 17", runs(102, 60)),
            {"__class": "MapLayer", "type": "wall", "metaData": {}, "pixels": [], "compressedPixels": walls},
        ],
        "entities": [
            {"__class": "PointMapEntity", "type": "charger_location", "points": [150, 750], "metaData": {"angle": 90}},
            {"__class": "PolygonMapEntity", "type": "no_go_area", "points": [600, 700, 650, 700, 650, 750, 600, 750],
                "metaData": {}},
        ],
    })
    .to_string()
    .into_bytes()
}

static LIDAR: LazyLock<LidarMap> = LazyLock::new(|| LidarMap::read(&valetudo_map()).unwrap());

fn object(id: &str, class: Class, centre: [f64; 2], size_m: [f64; 3], room: &str) -> RobotObject {
    RobotObject {
        id: id.to_owned(),
        name: None,
        class,
        confidence: 0.8,
        bounds: UprightBox { centre_m: [centre[0], centre[1], size_m[2] / 2.0], size_m, yaw_rad: 0.0 },
        room: Some(room.to_owned()),
    }
}

/// Returns the level of [`valetudo_map`]: a dining table in the kitchen, a sofa at the upper wall of the bedroom.
fn level(lidar: &LidarMap) -> RobotLevel<'_> {
    let mut rooms =
        vec![Room::rectangle("16", [1.0, 1.0], [5.0, 4.0]), Room::rectangle("17", [5.1, 1.0], [8.1, 4.0])];
    rooms[0].name = Some("Kitchen".to_owned());
    rooms[1].name = Some("Bedroom".to_owned());
    let objects = vec![
        object("table-1", Class::Table, [3.0, 2.5], [1.6, 0.9, 0.75], "16"),
        object("sofa-1", Class::Sofa, [6.6, 3.55], [2.0, 0.9, 0.8], "17"),
    ];
    RobotLevel { level: LevelName::MAIN, lidar, rooms, objects }
}

fn valetudo(level: &RobotLevel, json: Option<&[u8]>) -> ValetudoFile {
    super::valetudo(level, &places(level), json)
}

fn calibration(level: &RobotLevel, image: &PlanImage) -> CalibrationFile {
    super::calibration(level, &places(level), image)
}

fn nav2_files(level: &RobotLevel, ground: &Ground) -> Result<Vec<(&'static str, Vec<u8>)>, LidarError> {
    super::nav2_files(level, &places(level), ground)
}

/// Returns the picture of a level's plan.
fn image(level: &RobotLevel) -> PlanImage {
    PlanImage::of(&plan(level.lidar, &[], &level.rooms, &[]))
}

fn json_of(value: &impl serde::Serialize) -> Value {
    serde_json::to_value(value).unwrap()
}

#[test]
fn the_map_comes_back_with_the_names_of_rooms() {
    let file = valetudo_map();
    let answer = valetudo(&level(&LIDAR), valetudo_json(&file).as_deref());
    assert_eq!(answer.map_absent, None);
    let mut want: Value = serde_json::from_slice(&file).unwrap();
    want["layers"][1]["metaData"]["name"] = json!("Kitchen");
    want["layers"][2]["metaData"]["name"] = json!("Bedroom");
    assert_eq!(answer.map.as_ref(), Some(&want));
    // The robot's state has the map in it.
    let state = json!({"attributes": [], "map": serde_json::from_slice::<Value>(&file).unwrap()}).to_string();
    let of_state = valetudo(&level(&LIDAR), valetudo_json(state.as_bytes()).as_deref());
    assert_eq!(of_state.map, answer.map);
    // Our reader takes the names.
    let read = LidarMap::read(answer.map.unwrap().to_string().as_bytes()).unwrap();
    let names: Vec<_> = read.rooms.iter().map(|room| (room.id.as_str(), room.name.as_deref())).collect();
    assert_eq!(names, [("16", Some("Kitchen")), ("17", Some("Bedroom"))]);
    assert_eq!(read.cells, LIDAR.cells);
}

#[test]
fn a_segment_belongs_to_the_room_with_most_of_its_cells() {
    let file = valetudo_map();
    let mut level = level(&LIDAR);
    // The first room has a quarter of segment 16, the second one the rest and all of 17.
    level.rooms =
        vec![Room::rectangle("a", [1.0, 1.0], [2.0, 4.0]), Room::rectangle("b", [2.0, 1.0], [8.1, 4.0])];
    level.rooms[0].name = Some("A".to_owned());
    let answer = valetudo(&level, Some(&file));
    let found: Vec<_> =
        answer.segments.iter().map(|s| (s.segment.as_str(), s.room.as_deref(), s.overlap)).collect();
    assert_eq!(found, [("16", Some("b"), 0.75), ("17", Some("b"), 1.0)]);
    // A room without a name leaves the segment's.
    assert_eq!(answer.map.unwrap()["layers"][1]["metaData"]["name"], "Room 16");
}

#[test]
fn all_layers_of_a_segment_have_its_name() {
    for has_id in [true, false] {
        let mut map: Value = serde_json::from_slice(&valetudo_map()).unwrap();
        let layers = map["layers"].as_array_mut().unwrap();
        let part = layers[1].clone();
        layers.insert(2, part);
        if !has_id {
            layers[3]["metaData"].as_object_mut().unwrap().remove("segmentId");
        }
        let file = map.to_string().into_bytes();
        let lidar = LidarMap::read(&file).unwrap();
        assert_eq!(lidar.rooms.len(), 2);
        let named = valetudo(&level(&lidar), Some(&file)).map.unwrap();
        let names = [1, 2, 3].map(|layer: usize| named["layers"][layer]["metaData"]["name"].clone());
        assert_eq!(names, ["Kitchen", "Kitchen", "Bedroom"], "{has_id}");
    }
}

/// A room's corners in Valetudo's coordinates: (1 m, 4 m) is 100 cm from the left and 1000 - 400 cm from the top.
#[test]
fn zones_and_goals_are_bodies_for_valetudo() {
    let file = valetudo_map();
    let answer = json_of(&valetudo(&level(&LIDAR), Some(&file)));
    assert_eq!(
        answer["coordinates"],
        json!({"format": "valetudo", "is_valetudo": true, "unit": "cm", "is_y_down": true})
    );
    let point = |x: f64, y: f64| json!({"x": x, "y": y});
    let zone = |left: f64, top: f64, right: f64, bottom: f64| {
        json!({"action": "clean", "zones": [{"iterations": 1, "points": {
            "pA": point(left, top), "pB": point(right, top), "pC": point(right, bottom), "pD": point(left, bottom)
        }}]})
    };
    assert_eq!(answer["rooms"][0]["zone_cleaning"], zone(100.0, 600.0, 500.0, 900.0));
    // The table with half a metre around: 1.7 to 4.3 m and 1.55 to 3.45 m.
    let table = &answer["objects"][0];
    assert_eq!(
        (&table["id"], &table["room"], &table["covered"]),
        (&json!("table-1"), &json!("16"), &json!(1.0))
    );
    assert_eq!(table["zone_cleaning"], zone(170.0, 655.0, 430.0, 845.0));
    let go_to = &table["go_to"];
    assert_eq!(go_to["action"], "goto");
    let (x_m, y_m) = (table["goal"]["x_m"].as_f64().unwrap(), table["goal"]["y_m"].as_f64().unwrap());
    let cm = |axis: &str| go_to["coordinates"][axis].as_f64().unwrap();
    assert!((cm("x") - 100.0 * x_m).abs() <= 0.5 && (cm("y") - (1000.0 - 100.0 * y_m)).abs() <= 0.5);
    // The sofa's zone ends at the bedroom's upper wall.
    assert_eq!(answer["objects"][1]["zone_cleaning"], zone(510.0, 600.0, 810.0, 740.0));
}

#[test]
fn goals_are_in_free_space_beside_the_object_and_face_it() {
    let level = level(&LIDAR);
    let cells = LIDAR.cells.as_ref().unwrap();
    let occupied =
        Grid { frame: cells.frame, cells: cells.cells.iter().map(|cell| *cell != Cell::Free).collect() };
    let field = DistanceField::new(&occupied);
    let all: Vec<Place> = places(&level).all;
    assert_eq!(all.len(), 4);
    for place in &all {
        let goal = place.goal.unwrap();
        let at = Point2::new(goal.x_m, goal.y_m);
        // From the obstacle's nearest cell, half a cell wide.
        assert!(field.value(&at) - 0.025 >= RADIUS_M, "{place:?}");
        assert!(level.room(place.room.as_deref()).unwrap().contains(&at), "{place:?}");
        let Some(object) = level.objects.iter().find(|object| object.id == place.id) else { continue };
        let local = object.bounds.local(at.x, at.y);
        let off: Vec<f64> =
            (0..2).map(|axis| (local[axis].abs() - object.bounds.size_m[axis] / 2.0).max(0.0)).collect();
        let off_m = off[0].hypot(off[1]);
        assert!((RADIUS_M..0.35).contains(&off_m), "{off_m} {place:?}");
        let towards = (object.bounds.centre_m[1] - at.y).atan2(object.bounds.centre_m[0] - at.x);
        assert!((goal.yaw_rad.unwrap() - towards).abs() < 2e-3, "{place:?}");
    }
    // The sofa stands at the wall, so its goal is before its front, beside the user's zone that ends at 6.5 m.
    let sofa = all[3].goal.unwrap();
    assert!(sofa.y_m < 3.1 - RADIUS_M && (6.5 + RADIUS_M..6.9).contains(&sofa.x_m), "{sofa:?}");
}

/// Robots' maps enlarge obstacles to whole cells, so doors look narrower than they are.
#[test]
fn goals_are_on_both_sides_of_a_door_that_looks_just_too_narrow() {
    let mut lidar = LidarMap::read(&valetudo_map()).unwrap();
    let cells = lidar.cells.as_mut().unwrap();
    // Of the door from 2 to 3 m, 0.4 m remain.
    for row in (0..20).filter(|row| !(6..14).contains(row)) {
        for x_m in [5.025, 5.075] {
            let (x, y) = cells.frame.cell(&Point2::new(x_m, 2.025 + 0.05 * f64::from(row))).unwrap();
            cells.set(x, y, Cell::Occupied);
        }
    }
    let found = places(&level(&lidar));
    assert!(found.goal_area.is_at_dock, "{:?}", found.goal_area);
    assert!(found.all.iter().all(|place| place.goal.is_some()), "{:?}", found.all);
}

#[test]
fn no_goal_is_where_the_robot_may_not_go() {
    let mut level = level(&LIDAR);
    level.objects.push(object("desk-1", Class::Desk, [1.8, 3.6], [1.4, 0.7, 0.7], "16"));
    level.objects.push(object("chair-1", Class::Chair, [1.8, 3.3], [0.4, 0.4, 0.9], "16"));
    let frame = LIDAR.cells.as_ref().unwrap().frame;
    let mut mask = Grid::filled(frame, false);
    for zone in forbidden(&level) {
        for_cells(&frame, &zone.rings(), |index| mask.cells[index] = true);
    }
    let field = DistanceField::new(&mask);
    for place in places(&level).all {
        let goal = place.goal.unwrap();
        let off_m = field.value(&Point2::new(goal.x_m, goal.y_m));
        assert!(off_m - 0.025 >= RADIUS_M, "{off_m} {place:?}");
    }
}

#[test]
fn an_object_without_free_space_around_has_no_goal() {
    let mut level = level(&LIDAR);
    level.objects.push(object("plant-1", Class::Plant, [20.0, 20.0], [0.4, 0.4, 1.0], "elsewhere"));
    let plant = places(&level).all.pop().unwrap();
    assert_eq!((plant.goal, plant.room), (None, None));
    // Without a room the zone is the whole box.
    let Rectangle { low_m, high_m } = plant.zone.rectangles[0];
    assert!((low_m[0] - 19.3).abs() < 1e-9 && (high_m[1] - 20.7).abs() < 1e-9);
}

#[test]
fn a_map_of_points_has_metres_and_no_segments() {
    let mut csv = String::new();
    for i in 0..=120 {
        let t = f64::from(i) * 0.05;
        for [x, y] in [[t, 0.0], [t, 6.0], [0.0, t], [6.0, t]] {
            csv += &format!("{x},{y}\n");
        }
    }
    let lidar = LidarMap::read(csv.as_bytes()).unwrap();
    let rooms = vec![Room::rectangle("room-1", [0.05, 0.05], [5.95, 5.95])];
    let table = object("table-1", Class::Table, [3.0, 3.0], [1.0, 1.0, 0.7], "room-1");
    let level = RobotLevel { level: LevelName::MAIN, lidar: &lidar, rooms, objects: vec![table] };
    let answer = valetudo(&level, valetudo_json(csv.as_bytes()).as_deref());
    assert_eq!((answer.map, answer.segments), (None, vec![]));
    assert_eq!(answer.map_absent.unwrap().code, "not_valetudo");
    assert_eq!((answer.coordinates.is_valetudo, answer.coordinates.unit), (false, "m"));
    let points = answer.objects[0].zone_cleaning.as_ref().unwrap().zones[0].points;
    assert_eq!([points.p_a.x, points.p_a.y, points.p_c.x, points.p_c.y], [2.0, 4.0, 4.0, 2.0]);
    assert!(answer.objects[0].go_to.is_some());
}

#[test]
fn three_points_calibrate_the_plan() {
    let level = level(&LIDAR);
    let plan = plan(&LIDAR, &[], &level.rooms, &[]);
    let image = PlanImage::of(&plan);
    let file = calibration(&level, &image);
    assert_eq!((file.vacuum.unit, file.vacuum.is_y_down), ("cm", true));
    let picture = image::load_from_memory(&crate::plan::plan_png(&plan)).unwrap().to_rgb8();
    assert_eq!([picture.width(), picture.height()], file.image_px);
    // The affine transform of the three pairs, as the card calibrates, finds the walls in the picture.
    let [a, b, c] = file.calibration_points;
    let scale =
        [(b.map.x - a.map.x) / (b.vacuum.x - a.vacuum.x), (c.map.y - a.map.y) / (c.vacuum.y - a.vacuum.y)];
    let skew =
        [(c.map.x - a.map.x) / (c.vacuum.y - a.vacuum.y), (b.map.y - a.map.y) / (b.vacuum.x - a.vacuum.x)];
    let pixel = |x_cm: f64, y_cm: f64| {
        let (dx, dy) = (x_cm - a.vacuum.x, y_cm - a.vacuum.y);
        [a.map.x + scale[0] * dx + skew[0] * dy, a.map.y + scale[1] * dy + skew[1] * dx]
    };
    let is_wall = |[x, y]: [f64; 2]| picture.get_pixel(x as u32, y as u32).0 == [0x2f, 0x34, 0x3d];
    // The middle of the wall between the rooms is 505 cm from the left; below the door, 120 cm above the lower wall.
    assert!(is_wall(pixel(505.0, 880.0)));
    assert!(!is_wall(pixel(505.0, 750.0)), "the door");
    assert!(!is_wall(pixel(520.0, 880.0)) && !is_wall(pixel(490.0, 880.0)));
    let rooms = &file.map_modes[0];
    assert_eq!((rooms.template, rooms.predefined_selections.len()), ("vacuum_clean_segment", 2));
    let kitchen = json_of(&rooms.predefined_selections[0]);
    assert_eq!((&kitchen["id"], &kitchen["label"]["text"]), (&json!("16"), &json!("Kitchen")));
    assert_eq!(kitchen["outline"], json!([[100.0, 900.0], [500.0, 900.0], [500.0, 600.0], [100.0, 600.0]]));
    let zones = json_of(&file.map_modes[1]);
    assert_eq!(zones["predefined_selections"][2]["zones"], json!([[170.0, 655.0, 430.0, 845.0]]));
    assert_eq!(zones["predefined_selections"][2]["label"]["text"], "Kitchen: table");
}
