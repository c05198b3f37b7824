//! The rooms of a LiDAR map whose names state their purpose.

use viola_formats::lidar::{LidarMap, MAX_ROOMS};
use viola_geometry::taxonomy::Purposes;
use viola_geometry::{Grid, Point2};

/// The purpose of the room of each cell of a map.
#[derive(Debug, Clone)]
pub struct NamedRooms {
    /// [`NOWHERE`], [`UNNAMED`], or the index in `purposes` plus two.
    cells: Grid<u8>,
    purposes: Vec<Purposes>,
}

/// The cell belongs to no room: a wall, furniture, or an area that is not divided into rooms.
const NOWHERE: u8 = 0;
/// The cell belongs to a room whose name states no purpose.
const UNNAMED: u8 = 1;

/// Maximum distance of furniture at a wall from its room's free floor: the depth of a bed.
const REACH_M: f64 = 2.0;

impl NamedRooms {
    /// Returns the rooms of a map; `None` if no room's name states its purpose.
    pub fn new(lidar: &LidarMap) -> Option<NamedRooms> {
        let frame = lidar.cells.as_ref()?.frame;
        let mut cells = Grid::filled(frame, NOWHERE);
        let mut known: Vec<Purposes> = Vec::new();
        for room in lidar.rooms.iter().take(MAX_ROOMS) {
            let purposes = room.name.as_deref().map_or(Purposes::NONE, Purposes::of_name);
            let place = known.iter().position(|other| *other == purposes).unwrap_or(known.len());
            // There are fewer kinds of rooms than numbers; further kinds count as unnamed.
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
    /// [`Purposes::NONE`] if it is unknown.
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
