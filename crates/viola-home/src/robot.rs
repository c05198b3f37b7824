//! Files for robots and homes: Nav2 maps and masks, Valetudo names and zones, Matter areas, and the configuration
//! of a map card. Each format has a file; `places` holds the zones and goal poses that they share, `titles` the names.

mod area;
mod calibration;
mod drive;
mod ground;
mod labels;
mod matter;
mod nav2;
mod no_go;
mod places;
mod segments;
mod titles;
mod valetudo;

pub use calibration::{CalibrationFile, calibration};
pub use ground::Ground;
pub use matter::{MatterFile, matter};
pub use nav2::{nav2_files, nav2_zip};
pub use places::places as robot_places;
pub use valetudo::{ValetudoFile, valetudo};

use crate::objects::UprightBox;
use crate::rooms::Room;
use serde::Serialize;
use viola_formats::lidar::LidarMap;
use viola_geometry::LevelName;
use viola_geometry::taxonomy::Class;

/// One level of a home, as these files need it.
#[derive(Debug, Clone)]
pub struct RobotLevel<'a> {
    pub level: LevelName,
    pub lidar: &'a LidarMap,
    pub rooms: Vec<Room>,
    pub objects: Vec<RobotObject>,
}

/// An object of a level.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotObject {
    pub id: String,
    /// Name that a person gave it.
    pub name: Option<String>,
    pub class: Class,
    /// In 0..1.
    pub confidence: f64,
    pub bounds: UprightBox,
    /// Id of its room.
    pub room: Option<String>,
}

impl RobotLevel<'_> {
    /// Returns a room by its id.
    fn room(&self, id: Option<&str>) -> Option<&Room> {
        self.rooms.iter().find(|room| Some(room.id.as_str()) == id)
    }
}

impl RobotObject {
    /// Returns its name, by default that of its class in words.
    fn title(&self) -> String {
        self.name.clone().unwrap_or_else(|| self.class.name().replace('_', " "))
    }
}

/// A point in the coordinates of a robot or of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Xy {
    pub x: f64,
    pub y: f64,
}

impl From<[f64; 2]> for Xy {
    fn from([x, y]: [f64; 2]) -> Xy {
        Xy { x, y }
    }
}

/// Rounds to a millimetre.
fn round(metres: f64) -> f64 {
    // Adding zero makes -0 and 0 equal.
    (metres * 1e3).round() / 1e3 + 0.0
}

fn round_all(points_m: &[[f64; 2]]) -> Vec<[f64; 2]> {
    points_m.iter().map(|point| point.map(round)).collect()
}

#[cfg(test)]
mod tests;
