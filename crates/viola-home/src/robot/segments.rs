//! Segments of the robot's software and the rooms to which they belong.

use super::RobotLevel;
use super::area::owners;
use super::round;
use crate::rooms::Room;
use viola_geometry::{Grid, Point2};

/// A segment of the robot's map and its room.
#[derive(Debug, Clone, PartialEq)]
pub struct Segment<'a> {
    /// The robot's id.
    pub id: &'a str,
    /// The room with which it shares the most cells; none if it shares no cell with a room.
    pub room: Option<&'a Room>,
    /// Fraction of the segment's cells in this room.
    pub overlap: f64,
}

/// Returns the segments of a level's LiDAR map, in its order. Maps without cells have none.
pub fn segments<'a>(level: &'a RobotLevel) -> Vec<Segment<'a>> {
    let Some(cells) = &level.lidar.cells else { return Vec::new() };
    let owners = owners(cells.frame, &level.rooms);
    level.lidar.rooms.iter().map(|segment| owner(&segment.id, &segment.cells_m, level, &owners)).collect()
}

fn owner<'a>(id: &'a str, cells_m: &[Point2], level: &'a RobotLevel, owners: &Grid<u16>) -> Segment<'a> {
    let mut counts = vec![0usize; level.rooms.len() + 1];
    for cell in cells_m {
        counts[usize::from(owners.at(cell).unwrap_or(0))] += 1;
    }
    // Of equal counts the first room is taken.
    let most = (1..counts.len()).max_by(|a, b| counts[*a].cmp(&counts[*b]).then(b.cmp(a)));
    let most = most.filter(|number| counts[*number] > 0);
    let fraction = most.map_or(0.0, |number| counts[number] as f64 / cells_m.len() as f64);
    Segment { id, room: most.and_then(|number| level.rooms.get(number - 1)), overlap: round(fraction) }
}
