//! Plans of two rooms of bare LiDAR points.

mod corrected;
mod filmed;
mod furniture;
mod gaps;
mod oblique;
mod pages;
mod unfilmed;

use super::*;
use crate::rooms::RoomSource;
use crate::rooms::tests::flat;
use viola_geometry::taxonomy::Class;
use viola_reconstruct::{CloudPoint, Label};

/// Returns a map of walls as points 2.5 cm apart.
fn lidar_of(walls: &[[[f64; 2]; 2]]) -> LidarMap {
    let mut csv = String::new();
    for [from, to] in walls {
        let length = (to[0] - from[0]).hypot(to[1] - from[1]);
        for i in 0..=(length / 0.025) as usize {
            let t = i as f64 * 0.025 / length;
            csv += &format!("{},{}\n", from[0] + t * (to[0] - from[0]), from[1] + t * (to[1] - from[1]));
        }
    }
    LidarMap::read(csv.as_bytes()).unwrap()
}

/// Returns the walls between the corners of a room.
fn ring(corners: &[[f64; 2]]) -> Vec<[[f64; 2]; 2]> {
    (0..corners.len()).map(|i| [corners[i], corners[(i + 1) % corners.len()]]).collect()
}

/// Returns a plan of rooms alone.
pub(super) fn plan_of_rooms(rooms: Vec<PlanRoom>) -> Plan {
    Plan {
        level: LevelName::MAIN,
        home_name: None,
        map_from_plan: Pose2::IDENTITY,
        walls: Vec::new(),
        masonry: Vec::new(),
        unfilmed_masonry: Vec::new(),
        openings: Vec::new(),
        rooms,
        furniture: Vec::new(),
    }
}

/// Returns an object on the floor along x.
pub(super) fn standing(class: Class, confidence: f64, [x, y]: [f64; 2], size_m: [f64; 3]) -> Object {
    Object {
        id: format!("{}-1", class.name()),
        class,
        confidence,
        centre_m: [x, y, size_m[2] / 2.0],
        size_m,
        yaw_rad: 0.0,
        room: None,
        points: 100,
        clips: vec![0],
        samples: Vec::new(),
    }
}

fn object(class: Class, x: f64, yaw_rad: f64) -> Object {
    Object { yaw_rad, ..standing(class, 0.8, [x, 1.0], [0.9, 0.5, 0.8]) }
}

pub(super) fn point(position_m: [f64; 3], normal: [f32; 3], class: Class) -> MapPoint {
    let point = CloudPoint {
        position_m: position_m.map(|c| c as f32),
        normal,
        color: class.color(),
        label: Label::new(class, 0.9, 3),
        weight: 100,
    };
    MapPoint { point, clip: 0 }
}

/// Returns the points of an upright surface above a line: `step_m` apart along it, at heights 10 cm apart, of which the lowest one
/// and the number are given.
pub(super) fn upright(
    class: Class,
    [from_m, to_m]: [[f64; 2]; 2],
    normal: [f32; 3],
    step_m: f64,
    (lowest_m, heights): (f32, usize),
) -> Vec<MapPoint> {
    let length_m = (to_m[0] - from_m[0]).hypot(to_m[1] - from_m[1]);
    let count = (length_m / step_m).round() as usize;
    let at = |i: usize, j: usize| {
        let part = (i as f64 + 0.5) / count as f64;
        let [x, y] = [0, 1].map(|axis| from_m[axis] + part * (to_m[axis] - from_m[axis]));
        point([x, y, f64::from(lowest_m + 0.1 * j as f32)], normal, class)
    };
    (0..count).flat_map(|i| (0..heights).map(move |j| [i, j])).map(|[i, j]| at(i, j)).collect()
}

fn plan_of(name: &str) -> Plan {
    let lidar = flat(0.0);
    let mut rooms = crate::rooms(&lidar, &[]);
    rooms[0].name = Some(name.into());
    let objects =
        [object(Class::Table, 1.5, 0.1), object(Class::Cabinet, 1.6, 0.0), object(Class::Sofa, 90.0, 0.0)];
    plan(&lidar, &[], &rooms, &objects)
}

#[test]
fn two_rooms_have_their_walls_and_a_door_between_them() {
    let lidar = flat(0.0);
    let rooms = crate::rooms(&lidar, &[]);
    let plan = plan(&lidar, &[], &rooms, &[]);
    assert!(plan.map_from_plan.yaw_rad.to_degrees().abs() < 0.6);
    assert_eq!(plan.rooms.len(), 2);
    for (room, area_m2) in plan.rooms.iter().zip([12.0, 9.0]) {
        assert_eq!(room.outline.ring_m.len(), 4);
        // Points of a raster of 5 cm.
        assert!((room.area_m2 / area_m2 - 1.0).abs() < 0.05, "{}", room.area_m2);
    }
    assert_eq!(plan.openings.len(), 1);
    let door = &plan.openings[0];
    assert!(door.kind == OpeningKind::Door && (door.width_m() - 0.8).abs() < 0.16, "{door:?}");
    let between: Vec<&Wall> = plan.walls.iter().filter(|wall| wall.is_measured).collect();
    assert_eq!(between.len(), 1);
    assert!(between[0].rooms == [0, 1] && (between[0].length_m() - 3.0).abs() < 0.15);
    assert!((between[0].thickness_m - 0.1).abs() < 0.06);
}

#[test]
fn furniture_does_not_overlap_and_stays_in_the_home() {
    let plan = plan_of("Kitchen");
    let classes: Vec<Class> = plan.furniture.iter().map(|piece| piece.class).collect();
    assert!(!classes.contains(&Class::Sofa) && !classes.is_empty(), "{classes:?}");
    assert!(plan.furniture.iter().all(|piece| piece.yaw_rad == 0.0));
    for (at, a) in plan.furniture.iter().enumerate() {
        for b in &plan.furniture[at + 1..] {
            let apart = (0..2).any(|axis| {
                let off = (a.centre_m[axis] - b.centre_m[axis]).abs();
                off >= (a.size_m[axis] + b.size_m[axis]) / 2.0 - 1e-6
            });
            assert!(apart, "{a:?} {b:?}");
        }
    }
}

/// No clip sees the outer faces of a home's walls.
#[test]
fn dimension_lines_have_inner_sizes() {
    let plan = plan_of("Kitchen");
    let svg = plan_svg(&plan);
    let (low, high) = plan.bounds_m();
    let corners = || plan.rooms.iter().flat_map(|room| &room.outline.ring_m);
    for axis in 0..2 {
        let ends = [f64::min, f64::max].map(|pick: fn(f64, f64) -> f64| {
            corners().map(|corner| corner[axis]).reduce(pick).expect("a room has corners")
        });
        let (inner_m, outer_m) = (ends[1] - ends[0], high[axis] - low[axis]);
        assert!(outer_m - inner_m > 0.3, "{outer_m} {inner_m}");
        assert!(svg.contains(&format!(">{inner_m:.2}</text>")), "{inner_m}");
        assert!(!svg.contains(&format!(">{outer_m:.2}</text>")), "{outer_m}");
    }
}

#[test]
fn hostile_names_stay_text() {
    let svg = plan_svg(&plan_of("<script>alert('x')</script>&\u{0}\""));
    assert!(!svg.contains("<script") && !svg.contains('\u{0}'));
    assert!(svg.contains("&lt;script&gt;") && svg.contains("&amp;"));
    for name in ["", "\u{202e}evil", "K\u{fc}che", &"long ".repeat(1000), "0\nEOF\n0"] {
        let plan = plan_of(name);
        assert!(image::load_from_memory(&plan_png(&plan)).is_ok(), "{name:?}");
        assert!(plan_svg(&plan).ends_with("</svg>\n"));
        assert!(plan_pdf(&plan).starts_with(b"%PDF-1.4") && plan_pdf(&plan).ends_with(b"%%EOF\n"));
        let dxf = plan_dxf(&plan);
        assert!(
            dxf.is_ascii() && dxf.ends_with("0\nEOF\n") && dxf.lines().count().is_multiple_of(2),
            "{name:?}"
        );
    }
}

#[test]
fn rings_of_geojson_are_closed_and_turn_the_right_way() {
    let json = plan_geojson(&plan_of("Kitchen"));
    assert_eq!(json["type"], "FeatureCollection");
    assert!(json["frame"].as_str().unwrap().contains("metres"));
    // GDAL takes coordinates without it for longitude and latitude.
    assert_eq!(json["crs"]["properties"]["name"], "LOCAL_CS[\"LiDAR map\",UNIT[\"metre\",1]]");
    let features = json["features"].as_array().unwrap();
    for feature in features.iter().filter(|feature| feature["geometry"]["type"] == "Polygon") {
        let rings = feature["geometry"]["coordinates"].as_array().unwrap();
        for (place, ring) in rings.iter().enumerate() {
            let ring: Vec<[f64; 2]> = serde_json::from_value(ring.clone()).unwrap();
            assert!(ring.len() >= 4 && ring.first() == ring.last(), "{feature}");
            let area = crate::rooms::outline::signed_area_m2(&ring);
            assert!((area > 0.0) == (place == 0), "{feature}");
        }
    }
    let kinds: Vec<&str> = features.iter().filter_map(|f| f["properties"]["kind"].as_str()).collect();
    for kind in ["room", "wall", "wall_line", "object", "opening"] {
        assert!(kinds.contains(&kind), "{kind}");
    }
    let json = plan_json(&plan_of("Kitchen"));
    assert_eq!((&json["rooms"][0]["name"], &json["rooms"][0]["id"]), (&"Kitchen".into(), &"1".into()));
    assert!(json["walls"].as_array().unwrap().len() >= 5);
}

#[test]
fn a_map_of_one_point_has_a_plan() {
    for csv in [&b"1,2\n"[..], b"0,0\n200,200\n", b"0,0\n0,0\n"] {
        let lidar = LidarMap::read(csv).unwrap();
        let plan = plan(&lidar, &[], &[], &[]);
        assert!(plan.rooms.is_empty() && image::load_from_memory(&plan_png(&plan)).is_ok());
    }
}

#[test]
fn the_robots_rooms_divide_an_open_plan() {
    let mut lidar = flat(0.0);
    let cells = |from: f64, to: f64| {
        let columns = ((to - from) / 0.05) as usize;
        let cell =
            move |i: usize, j: usize| Point2::new(from + (i as f64 + 0.5) * 0.05, 0.1 + j as f64 * 0.05);
        (0..columns).flat_map(move |i| (0..56).map(move |j| cell(i, j))).collect()
    };
    let room = |id: &str, from: f64, to: f64| viola_formats::lidar::Room {
        id: id.into(),
        name: Some(id.to_uppercase()),
        cells_m: cells(from, to),
        material: None,
    };
    lidar.rooms = vec![room("a", 0.1, 2.0), room("b", 2.0, 3.9), room("c", 4.2, 7.0)];
    let rooms = crate::rooms(&lidar, &[]);
    assert!(rooms.iter().all(|room| room.source == RoomSource::LidarMap));
    let plan = plan(&lidar, &[], &rooms, &[]);
    let mut ids: Vec<_> = plan.rooms.iter().filter_map(|room| room.id.as_deref()).collect();
    ids.sort_unstable();
    assert_eq!(ids, ["a", "b", "c"]);
    // No wall stands where only the robot's software divides.
    assert!(
        !plan.walls.iter().any(|wall| (wall.from_m[0] - 2.0).abs() < 0.3 && wall.from_m[0] == wall.to_m[0])
    );
}

#[test]
fn a_room_without_a_name_is_called_by_its_number_in_its_level() {
    let mut plan = plan_of("");
    plan.rooms[0].id = Some("upper~3".to_owned());
    plan.rooms[1].id = None;
    let (svg, dxf) = (plan_svg(&plan), plan_dxf(&plan));
    assert!(svg.contains("<title>Room 3</title>") && svg.contains("<title>Room</title>"));
    assert!(svg.contains(">Room 3</text>") && svg.contains(">Room</text>"));
    assert!(dxf.contains("\nRoom 3\n") && dxf.contains("\nRoom\n"));
    assert!(!svg.contains("upper") && !dxf.contains("upper"));
}

#[test]
fn a_plan_is_turned_by_less_than_half_a_quarter() {
    for degrees in [-45.0f64, -44.9, 44.4, 44.6, 44.8, 45.0, 45.3] {
        let turned = super::direction::map_from_plan(&flat(degrees.to_radians()), &[]).yaw_rad.to_degrees();
        assert!((-45.0..45.0).contains(&turned), "{degrees}: {turned}");
        let off = (turned - degrees + 45.0).rem_euclid(90.0) - 45.0;
        assert!(off.abs() < 0.6, "{degrees}: {turned}");
    }
}

/// A corridor around a corner, 90 m each way and 1.2 m wide.
#[test]
fn the_label_of_a_long_corridor_is_in_it() {
    let ring_m = vec![[0.0, 0.0], [90.0, 0.0], [90.0, 1.2], [1.2, 1.2], [1.2, 90.0], [0.0, 90.0]];
    let corridor = room(Outline { ring_m, holes_m: Vec::new() }, 0, &[]);
    let label = Point2::from(corridor.label_at_m);
    let off_m = crate::rooms::outline::distance_m(&corridor.outline.ring_m, &label);
    assert!(corridor.contains(corridor.label_at_m) && off_m > 0.3, "{label:?}");
}

/// A gap of 1 cm around a corner, with 40 000 corners: all rasters miss it.
#[test]
fn the_label_of_a_room_with_very_many_corners_is_found_soon() {
    let along = |y: f64| (0..20_000).map(move |at| [f64::from(at) * 0.0045, y]);
    let right = along(0.0).chain([[90.0, 0.0], [90.0, 0.01]]);
    let left = along(0.01).skip(3).rev().chain([[0.01, 0.01], [0.01, 90.0], [0.0, 90.0]]);
    let outline = Outline { ring_m: right.chain(left).collect(), holes_m: Vec::new() };
    assert_eq!(inner_point(&outline), [0.0, 0.0]);
}

/// Two computed rooms of 5 m by 4 m and 3 m by 4 m without a wall between them.
#[test]
fn a_room_that_a_person_named_is_one_without_a_wall() {
    let corners = [[0.0, 0.0], [8.0, 0.0], [8.0, 4.0], [0.0, 4.0]];
    let lidar = lidar_of(&ring(&corners));
    for (name, want) in [(None, vec![("1", 32.0)]), (Some("Kitchen"), vec![("1", 20.0), ("2", 12.0)])] {
        let mut rooms =
            [Room::rectangle("1", [0.0, 0.0], [5.0, 4.0]), Room::rectangle("2", [5.0, 0.0], [8.0, 4.0])];
        rooms[1].name = name.map(str::to_owned);
        let plan = plan(&lidar, &[], &rooms, &[]);
        assert_eq!(plan.rooms.len(), want.len(), "{:?}", plan.rooms);
        for (drawn, (id, area_m2)) in plan.rooms.iter().zip(want) {
            assert_eq!(drawn.id.as_deref(), Some(id));
            assert!((drawn.area_m2 - area_m2).abs() < 1.0, "{drawn:?}");
        }
    }
}
