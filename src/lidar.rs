//! A home's 2D LiDAR map: what is occupied, what is free, which rooms it has.
//!
//! The map's frame has x right and y up, in metres: that of the file for CSV, PLY and ROS; for Valetudo the
//! origin is the lower-left corner of `size`.

use crate::geometry::{Grid, Point2, Pose2};
use serde::{Deserialize, Serialize};

/// What a robot knows of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cell {
    Unknown,
    /// The robot drove there or saw through it.
    Free,
    Occupied,
}

/// A LiDAR map as the method uses it.
#[derive(Debug, Clone)]
pub struct LidarMap {
    pub info: LidarInfo,
    /// Points on what the LiDAR hit: measured points, or the centres of occupied cells.
    pub occupied_m: Vec<Point2>,
    /// The cells as the file has them; none for formats that are bare points.
    pub cells: Option<Grid<Cell>>,
    pub rooms: Vec<Room>,
    /// The dock, when the file has it; yaw is where the robot faces when docked.
    pub charger: Option<Pose2>,
}

/// A room (segment) that the robot's software made out.
#[derive(Debug, Clone, PartialEq)]
pub struct Room {
    pub id: String,
    pub name: Option<String>,
    /// Centres of its cells.
    pub cells_m: Vec<Point2>,
}

/// What was understood of a map, told to whoever sent it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct LidarInfo {
    /// Format by name: `valetudo`, `ros_map_server`, `csv_points`, `ply_points`.
    pub format: String,
    /// The map's frame in words.
    pub frame: String,
    /// Side of a cell in metres, for formats with cells.
    pub cell_m: Option<f64>,
    pub occupied_points: usize,
    pub free_cells: usize,
    pub free_area_m2: f64,
    /// Lower-left corner of the box around everything known, in the map's frame.
    pub min_m: [f64; 2],
    /// Upper-right corner of that box.
    pub max_m: [f64; 2],
    pub rooms: Vec<RoomInfo>,
    pub charger: Option<Pose2>,
    /// Anything else worth telling: assumptions made, entities ignored.
    pub notes: Vec<String>,
}

/// A room in [`LidarInfo`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct RoomInfo {
    pub id: String,
    pub name: Option<String>,
    pub area_m2: f64,
    /// Mean of its cells, in the map's frame.
    pub centre_m: [f64; 2],
}
