//! A home's 2D LiDAR map: occupied and free cells, and rooms.
//!
//! The map's frame has x right and y up, in metres. It is the file's for CSV, PLY, PCD and ROS; for Valetudo
//! and the robots' own files the origin is the lower-left corner of the sheet (`size`).

mod build;
mod carmen;
mod drawing;
mod error;
mod marks;
mod points;
mod robot;
mod robot_frame;
mod ros;
mod sheet;
mod strays;
mod utf16;
mod valetudo;
mod write;

pub use build::MAX_DISTANCE_M;
pub use error::LidarError;
pub use marks::{Line, LineKind, MapMarks, Obstacle, Zone, ZoneKind};
pub use robot_frame::{RobotFrame, RobotFrames};
pub use valetudo::json_of as valetudo_json;
pub use write::{RosFiles, Written};

use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use viola_geometry::{Grid, Point2, Pose2};

/// Maximum size of one map file, in bytes.
pub const MAX_FILE_BYTES: u64 = 64 << 20;
/// Maximum number of cells of one map, checked before allocation.
pub const MAX_CELLS: usize = 64 << 20;
/// Maximum number of occupied points of one map, and of the cells of all its rooms together.
pub const MAX_POINTS: usize = 5_000_000;

/// Maximum side of a map in metres: six times that of the largest known vacuum map, and less than that of a
/// map in centimetres.
pub const MAX_SIDE_M: f64 = 250.0;

/// Maximum number of rooms of one map that are used: more than a home has.
pub const MAX_ROOMS: usize = 200;

/// State of a cell.
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
    /// Points on obstacles: measured points, or the centres of occupied cells.
    pub occupied_m: Vec<Point2>,
    /// The cells of the file; `None` for formats of bare points.
    pub cells: Option<Grid<Cell>>,
    pub rooms: Vec<Room>,
    /// The dock, if the file has it; yaw is the heading of the docked robot, unless `unknown_yaw` names it.
    pub charger: Option<Pose2>,
    /// Centres of the cells in which the robot detected carpet.
    pub carpet_m: Vec<Point2>,
    /// The robot's own coordinates.
    pub frames: RobotFrames,
    /// Width and height of the robot's sheet in centimetres (Valetudo's `size`); `None` for other formats.
    pub sheet_cm: Option<[i64; 2]>,
    pub unknown_yaw: UnknownYaw,
}

/// The poses of a robot's map whose direction the file does not tell. Their yaw is that of the top of the map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct UnknownYaw {
    pub charger: bool,
    pub robot: bool,
}

/// A room (segment) that the robot's software detected.
#[derive(Debug, Clone, PartialEq)]
pub struct Room {
    pub id: String,
    pub name: Option<String>,
    /// Floor material in the terms of the robot's software: `wood`, `tile`, `carpet_low`, ...
    pub material: Option<String>,
    /// Centres of its cells.
    pub cells_m: Vec<Point2>,
}

/// Summary of a map for its sender.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LidarInfo {
    /// Name of the format: `valetudo`, `roborock`, `dreame`, `viomi`, `ros_map_server`, `csv_points`,
    /// `ply_points`, `pcd_points`, `carmen_log`.
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
    /// Other marks on the map.
    #[serde(default)]
    pub marks: MapMarks,
    /// Notes for the sender: assumptions made, entities ignored.
    pub notes: Vec<String>,
}

/// A room in [`LidarInfo`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RoomInfo {
    pub id: String,
    pub name: Option<String>,
    /// Floor material, if the robot's software knows it.
    #[serde(default)]
    pub material: Option<String>,
    pub area_m2: f64,
    /// Mean of its cells, in the map's frame.
    pub centre_m: [f64; 2],
}

impl LidarMap {
    /// Opens a map file; the format is detected by content. A ROS map is a zip of the `.yaml` file and its
    /// image, or the `.yaml` file itself with the image beside it.
    pub fn open(path: &Path) -> Result<LidarMap, LidarError> {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let bytes = read_file(path, &name)?;
        if ros::is_yaml(&name) {
            let read = |image: &str| read_image(&path.with_file_name(image), image);
            return ros::read(&bytes, &name, ros::Images::Anywhere, read);
        }
        LidarMap::read(&bytes)
    }

    /// Reads a map from the bytes of its file; the format is detected by content. A ROS map is a zip; other maps may be
    /// the only file of one.
    pub fn read(bytes: &[u8]) -> Result<LidarMap, LidarError> {
        if bytes.len() as u64 > MAX_FILE_BYTES {
            return Err(LidarError::FileTooLarge { max_bytes: MAX_FILE_BYTES });
        }
        match bytes {
            _ if ros::is_zip(bytes) => return ros::read_zip(bytes),
            _ if robot::is_gzip(bytes) => return robot::read_gzip(bytes),
            [0x89, b'P', b'N', b'G', ..] => return valetudo::read_png(bytes),
            [b'r', b'r', ..] if robot::is_roborock(bytes) => return robot::read_roborock(bytes),
            _ if robot::is_zlib(bytes) => return robot::read_zlib(bytes),
            _ if robot::is_inflated_dreame(bytes) => return robot::read_inflated_dreame(bytes),
            _ if utf16::is(bytes) => return LidarMap::read_text(utf16::to_utf8(bytes)?.as_bytes()),
            _ => {}
        }
        LidarMap::read_text(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes))
    }

    /// Reads a map that begins with text.
    fn read_text(text: &[u8]) -> Result<LidarMap, LidarError> {
        let text = text.trim_ascii_start();
        match text {
            [] => Err(LidarError::Empty),
            [b'{', ..] => valetudo::read(text),
            [b'P', b'2' | b'5', ..] => Err(LidarError::ImageWithoutYaml),
            [b'p', b'l', b'y', b'\r' | b'\n', ..] => points::read_ply(text),
            _ if points::is_pcd(text) => points::read_pcd(text),
            _ if carmen::is_log(text) => carmen::read(text),
            _ if robot::is_text(text) => robot::read_text(text),
            _ => points::read_csv(text),
        }
    }
}

/// Reads a file, or else one beside it whose name differs only in the case of its letters.
fn read_image(path: &Path, name: &str) -> Result<Vec<u8>, LidarError> {
    match read_file(path, name) {
        Err(error) if ros::is_absent(&error) => match in_any_case(path) {
            Some(other) => read_file(&other, name),
            None => Err(error),
        },
        read => read,
    }
}

/// Returns the first file beside a path whose name differs from the path's only in the case of its letters.
fn in_any_case(path: &Path) -> Option<PathBuf> {
    let name = path.file_name()?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let files = folder.read_dir().ok()?.filter_map(|entry| Some(entry.ok()?.path()));
    files.filter(|file| file.file_name().is_some_and(|own| own.eq_ignore_ascii_case(name))).min()
}

fn read_file(path: &Path, name: &str) -> Result<Vec<u8>, LidarError> {
    use std::io::Read;
    let unreadable = |source| LidarError::Unreadable { name: name.to_string(), source };
    let file = std::fs::File::open(path).map_err(unreadable)?;
    let mut bytes = Vec::new();
    file.take(MAX_FILE_BYTES + 1).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() as u64 > MAX_FILE_BYTES {
        return Err(LidarError::FileTooLarge { max_bytes: MAX_FILE_BYTES });
    }
    Ok(bytes)
}
