//! The classes and the rooms of a level as rasters of numbers.

use super::RobotLevel;
use super::area::{for_cells, owners};
use serde::Serialize;
use viola_formats::lidar::{Cell, LidarError};
use viola_geometry::taxonomy::Class;
use viola_geometry::{Grid, GridFrame};

/// Number of an unknown cell. In a map of the mode `raw` numbers above 100 are unknown.
pub const UNKNOWN: u8 = 255;
/// Maximum number of rooms in the mask: the largest value of a known cell.
const MAX_ROOMS: usize = 100;
/// Objects whose lower side is above this do not concern a robot.
pub const REACH_M: f64 = 1.0;

/// The rasters of a level, with the cells of its LiDAR map.
pub struct Labels {
    /// Class ids; [`UNKNOWN`] outside of the robot's map.
    pub classes: Grid<u8>,
    /// Numbers of rooms from 1, in their order; 0 elsewhere.
    pub rooms: Grid<u8>,
}

/// The meaning of the numbers.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Legend {
    pub unknown: u8,
    pub classes: Vec<ClassLabel>,
    pub rooms: Vec<RoomLabel>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ClassLabel {
    pub value: u8,
    pub class: Class,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RoomLabel {
    pub value: u8,
    pub room: String,
    pub name: Option<String>,
}

impl Labels {
    /// Floor and walls are those of the robot's map; the footprints of objects lie over them, small ones on top.
    pub fn new(level: &RobotLevel) -> Result<Labels, LidarError> {
        let cells = level.lidar.raster()?;
        let frame = cells.frame;
        let class = |class: Class| class.id() as u8;
        let of_cell = |cell: &Cell| match cell {
            Cell::Free => class(Class::Floor),
            Cell::Occupied => class(Class::Wall),
            Cell::Unknown => UNKNOWN,
        };
        let mut classes = Grid { frame, cells: cells.cells.iter().map(of_cell).collect() };
        let mut objects: Vec<_> =
            level.objects.iter().filter(|object| object.bounds.bottom_m() < REACH_M).collect();
        let area = |size_m: [f64; 3]| size_m[0] * size_m[1];
        objects.sort_by(|a, b| area(b.bounds.size_m).total_cmp(&area(a.bounds.size_m)));
        for object in objects {
            let footprint = object.bounds.corners();
            for_cells(&frame, &[&footprint], |index| classes.cells[index] = class(object.class));
        }
        Ok(Labels { classes, rooms: room_numbers(frame, level) })
    }
}

fn room_numbers(frame: GridFrame, level: &RobotLevel) -> Grid<u8> {
    let owners = owners(frame, &level.rooms[..level.rooms.len().min(MAX_ROOMS)]);
    Grid { frame, cells: owners.cells.iter().map(|number| *number as u8).collect() }
}

impl Legend {
    pub fn of(level: &RobotLevel) -> Legend {
        let class = |class: &Class| ClassLabel { value: class.id() as u8, class: *class };
        let rooms = (1..).zip(level.rooms.iter().take(MAX_ROOMS));
        Legend {
            unknown: UNKNOWN,
            classes: Class::ALL.iter().map(class).collect(),
            rooms: rooms
                .map(|(value, room)| RoomLabel { value, room: room.id.clone(), name: room.name.clone() })
                .collect(),
        }
    }
}
