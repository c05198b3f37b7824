//! The room of an object.

use super::fit::UprightBox;
use crate::rooms::Room;
use viola_geometry::Point2;

/// An object this far from a room belongs to it: objects stand at walls.
const REACH_M: f64 = 1.0;
/// Largest distance of the compared places on the border of a footprint, and the largest number of them on a side.
const STEP_M: f64 = 0.1;
const MAX_STEPS: f64 = 40.0;

/// Returns the room around the centre of a box. A box whose centre is in no room, such as one on floor that the robot
/// does not see, is in the room nearest to its footprint; of several that it reaches, in the one nearest to its centre.
pub fn room_of<'a>(rooms: &'a [Room], bounds: &UprightBox) -> Option<&'a Room> {
    let centre = bounds.centre();
    if let Some(room) = rooms.iter().find(|room| room.contains(&centre)) {
        return Some(room);
    }
    let border = border(bounds);
    let radius_m = bounds.size_m[0].hypot(bounds.size_m[1]) / 2.0;
    let near = rooms.iter().filter_map(|room| {
        let to_centre_m = room.distance_m(&centre);
        // Only the rooms that may be near enough are compared with the border.
        if to_centre_m > REACH_M + radius_m {
            return None;
        }
        if !border.iter().any(|at| room.distance_m(at) <= REACH_M) {
            return None;
        }
        // A room may lie in a hole of another one.
        let off_m = border.iter().map(|at| room.off_m(at)).fold(f64::INFINITY, f64::min);
        Some((off_m, room.off_m(&centre), room))
    });
    let nearest = near.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    nearest.map(|(_, _, room)| room)
}

/// Returns places on the border of a footprint.
fn border(bounds: &UprightBox) -> Vec<Point2> {
    let corners = bounds.corners();
    let mut places = Vec::new();
    for (side, from) in corners.iter().enumerate() {
        let to = corners[(side + 1) % corners.len()];
        let length_m = (to[0] - from[0]).hypot(to[1] - from[1]);
        let steps = (length_m / STEP_M).ceil().clamp(1.0, MAX_STEPS) as usize;
        places.extend((0..steps).map(|step| {
            let t = step as f64 / steps as f64;
            Point2::new(from[0] + t * (to[0] - from[0]), from[1] + t * (to[1] - from[1]))
        }));
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn an_object_at_a_wall_is_in_the_room_that_it_stands_in() {
        // A bed with a closed base between the floor at its foot and a wall at its side, behind which is the hall.
        let rooms = [
            Room::rectangle("hall", [0.0, 0.9], [6.0, 3.0]),
            Room::rectangle("bedroom", [1.05, -3.0], [4.0, 0.0]),
        ];
        for (name, centre_m, size_m, want) in [
            ("at a wall", [0.0, 0.0, 0.3], [2.0, 1.6, 0.6], Some("bedroom")),
            ("larger than the reach", [-0.5, -0.7, 0.3], [2.6, 2.4, 0.6], Some("bedroom")),
            ("on the floor of a room", [2.0, 1.0, 0.3], [2.0, 1.6, 0.6], Some("hall")),
            ("far from both", [-3.0, -3.0, 0.3], [2.0, 1.6, 0.6], None),
        ] {
            let bounds = UprightBox { centre_m, size_m, yaw_rad: 0.0 };
            let room = room_of(&rooms, &bounds).map(|room| room.id.as_str());
            assert_eq!(room, want, "{name}");
        }
    }

    #[test]
    fn an_object_at_the_wall_of_a_room_within_a_room_is_in_the_nearer_one() {
        let around = Room {
            holes_m: vec![vec![[1.8, 1.8], [1.8, 4.2], [4.2, 4.2], [4.2, 1.8]]],
            ..Room::rectangle("around", [0.0, 0.0], [6.0, 6.0])
        };
        let rooms = [around, Room::rectangle("within", [2.0, 2.0], [4.0, 4.0])];
        for (x, want) in [(1.95, "within"), (1.85, "around"), (3.0, "within"), (1.0, "around")] {
            let bounds = UprightBox { centre_m: [x, 3.0, 0.5], size_m: [0.6, 0.04, 0.6], yaw_rad: FRAC_PI_2 };
            assert_eq!(room_of(&rooms, &bounds).map(|room| room.id.as_str()), Some(want), "{x}");
        }
    }
}
