//! The room of an object.

use super::fit::{UprightBox, middle};
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
    let centre = middle(bounds);
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
        let to_border_m = border.iter().map(|at| room.distance_m(at)).fold(f64::INFINITY, f64::min);
        (to_border_m <= REACH_M).then_some((to_border_m, to_centre_m, room))
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
}
