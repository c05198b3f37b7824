//! Tints of rooms.

use crate::plan::model::Plan;
use rustc_hash::{FxHashMap, FxHashSet};

/// Light and distinct.
const TINTS: [&str; 8] =
    ["#fbf5e9", "#edf4fb", "#eef7ee", "#fbeff2", "#f3f0fb", "#ebf6f6", "#fcf2e9", "#f5f7e6"];

/// Returns the tint of each room. A room has another tint than its neighbours, unless they have all.
pub fn tints(plan: &Plan) -> Vec<&'static str> {
    let near = neighbours(plan);
    let mut chosen: Vec<usize> = Vec::new();
    for (place, near) in near.iter().enumerate() {
        let uses = |tint: &usize| near.iter().filter(|room| chosen.get(**room) == Some(tint)).count();
        let tint = (place..).map(|tint| tint % TINTS.len()).take(TINTS.len()).min_by_key(uses);
        chosen.push(tint.unwrap_or(0));
    }
    chosen.into_iter().map(|tint| TINTS[tint]).collect()
}

/// Returns the rooms with which each room shares a wall, or a corner where no wall is between them.
fn neighbours(plan: &Plan) -> Vec<FxHashSet<usize>> {
    let mut near = vec![FxHashSet::default(); plan.rooms.len()];
    let mut join = |rooms: &[usize]| {
        for room in rooms {
            near.get_mut(*room).into_iter().for_each(|near| near.extend(rooms));
        }
    };
    plan.walls.iter().for_each(|wall| join(&wall.rooms));
    let mut corners: FxHashMap<[i64; 2], Vec<usize>> = FxHashMap::default();
    for (place, room) in plan.rooms.iter().enumerate() {
        for corner_m in room.outline.holes_m.iter().flatten().chain(&room.outline.ring_m) {
            corners.entry(corner_m.map(|c| (c * 1e3).round() as i64)).or_default().push(place);
        }
    }
    corners.values().for_each(|rooms| join(rooms));
    near
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::model::PlanRoom;
    use crate::plan::tests::plan_of_rooms;
    use crate::rooms::outline::Outline;

    /// Returns a plan of square rooms of 1 m at these places, without walls.
    fn plan_of(places: &[[f64; 2]]) -> Plan {
        let room = |&[x, y]: &[f64; 2]| PlanRoom {
            id: None,
            name: None,
            outline: Outline {
                ring_m: vec![[x, y], [x + 1.0, y], [x + 1.0, y + 1.0], [x, y + 1.0]],
                holes_m: vec![],
            },
            area_m2: 1.0,
            label_at_m: [x + 0.5, y + 0.5],
        };
        plan_of_rooms(places.iter().map(room).collect())
    }

    #[test]
    fn a_room_has_another_tint_than_its_neighbours() {
        // The ninth room is between the first and the second, the tenth by itself, the last at the second and the third.
        let mut places: Vec<[f64; 2]> = (0..8).map(|x| [2.0 * f64::from(x), 0.0]).collect();
        places.extend([[1.0, 0.0], [0.0, 7.0], [3.0, 1.0]]);
        let tints = tints(&plan_of(&places));
        assert_eq!(tints[..8], TINTS);
        assert_eq!(tints[8], TINTS[2], "the first two are those of its neighbours");
        assert_eq!(tints[9], TINTS[1]);
        assert_eq!(tints[10], TINTS[3]);
    }
}
