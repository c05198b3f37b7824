//! The rooms of a LiDAR map whose names tell what they are for.

use crate::geometry::{Grid, Point2};
use crate::lidar::{LidarMap, MAX_ROOMS};
use crate::taxonomy::Purposes;

/// Which room each cell of a map belongs to, as far as that says what may stand there.
#[derive(Debug, Clone)]
pub struct NamedRooms {
    /// [`NOWHERE`], [`UNNAMED`], or the place in `purposes` after those two.
    cells: Grid<u8>,
    purposes: Vec<Purposes>,
}

/// The cell belongs to no room: a wall, furniture, or what nobody divided into rooms.
const NOWHERE: u8 = 0;
/// To a room whose name does not tell.
const UNNAMED: u8 = 1;

/// What stands at a wall is so far from the floor that belongs to its room: the depth of a bed.
const REACH_M: f64 = 2.0;

impl NamedRooms {
    /// None when no room's name tells what it is for.
    pub fn new(lidar: &LidarMap) -> Option<NamedRooms> {
        let frame = lidar.cells.as_ref()?.frame;
        let mut cells = Grid::filled(frame, NOWHERE);
        let mut known: Vec<Purposes> = Vec::new();
        for room in lidar.rooms.iter().take(MAX_ROOMS) {
            let purposes = room.name.as_deref().map_or(Purposes::NONE, Purposes::of_name);
            let place = known.iter().position(|other| *other == purposes).unwrap_or(known.len());
            // There are fewer kinds of rooms than that; names of more are as good as none.
            let number = u8::try_from(place + 2).ok().filter(|_| !purposes.is_none()).unwrap_or(UNNAMED);
            if number != UNNAMED && place == known.len() {
                known.push(purposes);
            }
            for (x, y) in room.cells_m.iter().filter_map(|cell| frame.cell(cell)) {
                cells.set(x, y, number);
            }
        }
        (!known.is_empty()).then_some(NamedRooms { cells, purposes: known })
    }

    /// What the room is for in which something stands that was seen from `from`: the last one that the light came through.
    /// None where nobody knows.
    pub fn around(&self, thing: &Point2, from: &Point2) -> Purposes {
        let back = from - thing;
        let range_m = back.norm();
        let steps = (range_m.min(REACH_M) / self.cells.frame.cell_m).floor();
        let step = back / range_m.max(1e-9) * self.cells.frame.cell_m;
        let rooms = (0..=steps as usize).filter_map(|i| self.cells.at(&(thing + step * i as f64)));
        match rooms.into_iter().find(|room| *room != NOWHERE) {
            None | Some(UNNAMED) => Purposes::NONE,
            Some(number) => self.purposes[usize::from(number) - 2],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lidar::Room;
    use crate::simulate::{Home, HomeParams, Set};

    #[test]
    fn furniture_stands_in_its_room_for_whoever_looks_from_there() {
        let (mut right, mut wrong) = (0, Vec::new());
        for seed in 0..6 {
            let home = Home::generate(&HomeParams::new(Set::Normal, seed));
            let (truth, survey) = (home.truth(), home.survey());
            let rooms = NamedRooms::new(&survey.lidar_map()).unwrap();
            let map_from_home = survey.valetudo_from_home();
            let on_map = |x: f64, y: f64| map_from_home.apply(&Point2::new(x, y));
            for thing in &truth.objects {
                let room = truth.rooms.iter().find(|room| room.name == thing.room).unwrap();
                let purposes = Purposes::of_name(&room.name);
                if purposes.suit(thing.class).is_some() {
                    let middle = room.inner.centre();
                    let [x, y, _] = thing.centre_m;
                    let around = rooms.around(&on_map(x, y), &on_map(middle.x, middle.y));
                    right += usize::from(around == purposes);
                    if !around.is_none() && around != purposes {
                        wrong.push((seed, thing.class, around, purposes));
                    }
                }
            }
        }
        // In front of a bed that fills a room there may be no floor at all, and where a kitchen is open to the living room
        // what stands between them may belong to either.
        assert!(right > 90 && 20 * wrong.len() < right, "{right} right, but {wrong:?}");
    }

    #[test]
    fn rooms_without_a_telling_name_say_nothing() {
        let mut lidar = Home::generate(&HomeParams::new(Set::Normal, 1)).survey().lidar_map();
        let inside = lidar.rooms[0].cells_m[0];
        assert!(!NamedRooms::new(&lidar).unwrap().around(&inside, &inside).is_none());
        lidar.rooms[0].name = Some("Anna".to_owned());
        assert!(NamedRooms::new(&lidar).unwrap().around(&inside, &inside).is_none());
        lidar.rooms.iter_mut().for_each(|room| room.name = None);
        assert!(NamedRooms::new(&lidar).is_none());
        // Nobody has so many rooms, and every name costs time.
        let named = Room { name: Some("Kitchen".to_owned()), ..lidar.rooms[0].clone() };
        lidar.rooms[0].name = None;
        lidar.rooms.resize(MAX_ROOMS, lidar.rooms[0].clone());
        lidar.rooms.push(named);
        assert!(NamedRooms::new(&lidar).is_none());
    }
}
