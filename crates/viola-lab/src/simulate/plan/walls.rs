//! Walls between adjacent rectangles.

use super::{Room, Wall};

/// Returns every wall segment with the room on either side.
pub(super) fn between(rooms: &[Room]) -> Vec<Wall> {
    let mut walls = vec![];
    for along_x in [true, false] {
        // Coordinates across and along the walls of this direction.
        let (across, along) = if along_x { (1, 0) } else { (0, 1) };
        let mut lines: Vec<f64> =
            rooms.iter().flat_map(|r| [r.outline.min[across], r.outline.max[across]]).collect();
        lines.sort_by(f64::total_cmp);
        lines.dedup();
        for line in lines {
            let side = |room: &Room, low: bool| {
                let edge = if low { room.outline.max[across] } else { room.outline.min[across] };
                edge == line
            };
            let mut stops: Vec<f64> = rooms
                .iter()
                .filter(|room| side(room, true) || side(room, false))
                .flat_map(|room| [room.outline.min[along], room.outline.max[along]])
                .collect();
            stops.sort_by(f64::total_cmp);
            stops.dedup();
            let mut last: Option<Wall> = None;
            for pair in stops.windows(2) {
                let middle = (pair[0] + pair[1]) / 2.0;
                let on = |low: bool| {
                    rooms.iter().position(|room| {
                        side(room, low)
                            && room.outline.min[along] < middle
                            && middle < room.outline.max[along]
                    })
                };
                let sides = [on(true), on(false)];
                if sides == [None, None] {
                    walls.extend(last.take());
                    continue;
                }
                match &mut last {
                    Some(wall) if wall.rooms == sides => wall.to = pair[1],
                    _ => {
                        walls.extend(last.take());
                        last = Some(Wall { along_x, line, from: pair[0], to: pair[1], rooms: sides });
                    }
                }
            }
            walls.extend(last);
        }
    }
    walls
}
