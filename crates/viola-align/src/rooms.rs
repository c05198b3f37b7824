//! The rooms of a LiDAR map whose names tell what they are for.

use viola_formats::lidar::{LidarMap, MAX_ROOMS};
use viola_geometry::taxonomy::Purposes;
use viola_geometry::{Grid, Point2};

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

/// Furniture at a wall lies within this distance of its room's free floor: the depth of a bed.
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

    /// Returns the purpose of the room of a landmark seen from `from`: the last room on the line of sight.
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
