//! Ids of rooms.

use super::*;

#[test]
fn rooms_keep_their_ids_when_their_order_changes() {
    let mut history = History::default();
    let mut next = |mut rooms: Vec<Room>| -> Vec<String> {
        history.identify_rooms(&mut rooms);
        rooms.into_iter().map(|room| room.id).collect()
    };
    let [kitchen, hall, study] = [[0.0, 0.0], [4.0, 0.0], [8.0, 0.0]]
        .map(|low: [f64; 2]| move |id: &str, width_m: f64| Room::rectangle(id, low, [low[0] + width_m, 3.0]));
    assert_eq!(next(vec![kitchen("1", 4.0), hall("2", 3.0)]), ["1", "2"]);
    assert_eq!(next(vec![hall("1", 3.8), kitchen("2", 3.7)]), ["2", "1"]);
    assert_eq!(next(vec![study("1", 5.0), hall("2", 3.8), kitchen("3", 3.7)]), ["3", "2", "1"]);
    // A room that was divided: the larger part is the room.
    assert_eq!(
        next(vec![
            study("1", 5.0),
            hall("2", 3.8),
            kitchen("3", 2.5),
            Room::rectangle("4", [2.6, 0.0], [3.7, 3.0])
        ]),
        ["3", "2", "1", "4"]
    );
    // The robot's ids stay as they are.
    let named = Room { source: RoomSource::LidarMap, ..kitchen("17", 4.0) };
    assert_eq!(next(vec![named]), ["17"]);
    assert_eq!(next(vec![kitchen("1", 4.0), hall("2", 3.8)]), ["1", "2"]);
}

#[test]
fn computed_rooms_get_no_id_of_the_robots_rooms() {
    for level in ["main", "upper"] {
        let level: LevelName = level.parse().unwrap();
        let id = |own: &str| on_level(level, own.to_owned());
        let mut history = History::of_level(level);
        let of_robot = |id: &str, low_x: f64| Room {
            source: RoomSource::LidarMap,
            ..Room::rectangle(id, [low_x, 0.0], [low_x + 4.0, 3.0])
        };
        history.identify_rooms(&mut [of_robot("1", 0.0), of_robot("16", 4.0), of_robot("4294967295", 8.0)]);
        // The next LiDAR map has no segments.
        let mut rooms =
            [Room::rectangle("1", [4.0, 0.0], [8.0, 3.0]), Room::rectangle("2", [0.0; 2], [4.0, 3.0])];
        history.identify_rooms(&mut rooms);
        assert_eq!(rooms.map(|room| room.id), [id("17"), id("18")]);
    }
}

/// A room in the middle of another one, of which nobody knew when that one was found.
#[test]
fn a_room_within_a_room_does_not_take_its_id() {
    let around = |id: &str| Room {
        area_m2: 36.0,
        holes_m: vec![vec![[1.0, 1.0], [1.0, 9.0], [9.0, 9.0], [9.0, 1.0]]],
        ..Room::rectangle(id, [0.0; 2], [10.0; 2])
    };
    for (now_from_then, shift_m) in [(Pose2::IDENTITY, 0.0), (Pose2::new(20.0, 20.0, 0.0), 20.0)] {
        let mut history = History::default();
        history.identify_rooms(&mut [around("1")]);
        history.move_by(&now_from_then);
        let mut rooms = [Room::rectangle("1", [1.1; 2], [8.9; 2]), around("2")];
        for corner in rooms
            .iter_mut()
            .flat_map(|room| room.polygon_m.iter_mut().chain(room.holes_m.iter_mut().flatten()))
        {
            *corner = corner.map(|metres| metres + shift_m);
        }
        history.identify_rooms(&mut rooms);
        assert_eq!(rooms.map(|room| room.id), ["2", "1"]);
    }
}
