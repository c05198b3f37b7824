//! The LiDAR maps of a home.

use super::answer;
use super::names::{LevelName, Pose2};
use jiff::Timestamp;

answer! {
    /// Summary of a map's file.
    struct LidarInfo from viola_formats::lidar::LidarInfo {
        /// Format by name: `valetudo`, `roborock`, `dreame`, `viomi`, `ros_map_server`, `csv_points`, `ply_points`,
        /// `pcd_points`, `carmen_log`.
        format: String,
        /// The map's frame in words.
        frame: String,
        /// Side of a cell in metres, for formats with cells.
        cell_m: Option<f64>,
        occupied_points: usize,
        free_cells: usize,
        free_area_m2: f64,
        /// Lower-left corner of the box around everything known, in the map's frame.
        min_m: [f64; 2],
        /// Upper-right corner of that box.
        max_m: [f64; 2],
        rooms: Vec<RoomInfo>,
        charger: Option<Pose2>,
        /// Other marks on the map.
        #[schema(required = false)]
        marks: MapMarks,
        /// Notes of the reader: assumptions made, entities ignored.
        notes: Vec<String>,
    }
}

answer! {
    /// A room in [`LidarInfo`].
    struct RoomInfo from viola_formats::lidar::RoomInfo {
        id: String,
        name: Option<String>,
        /// Material of its floor, if the robot's software knows it.
        #[schema(required = false)]
        material: Option<String>,
        area_m2: f64,
        /// Mean of its cells, in the map's frame.
        centre_m: [f64; 2],
    }
}

answer! {
    /// Marks on a map, in the map's frame.
    struct MapMarks from viola_formats::lidar::MapMarks {
        /// Pose of the robot when the map was written; yaw is its heading.
        robot: Option<Pose2>,
        zones: Vec<Zone>,
        lines: Vec<Line>,
        obstacles: Vec<Obstacle>,
        /// Area of the cells in which the robot felt carpet, in square metres.
        carpet_m2: f64,
    }
}

answer! {
    /// An area that a person drew or that the robot detected.
    struct Zone from viola_formats::lidar::Zone {
        kind: ZoneKind,
        /// Its corners in order, in metres.
        outline_m: Vec<[f64; 2]>,
    }
}

answer! {
    enum ZoneKind from viola_formats::lidar::ZoneKind {
        /// The robot must not enter.
        NoGo,
        /// It may vacuum there, but not mop.
        NoMop,
        /// It may mop there, but not vacuum.
        NoVacuum,
        Carpet,
        Ramp,
    }
}

answer! {
    /// A line on the floor.
    struct Line from viola_formats::lidar::Line {
        kind: LineKind,
        /// Its two ends, in metres.
        ends_m: [[f64; 2]; 2],
    }
}

answer! {
    enum LineKind from viola_formats::lidar::LineKind {
        /// The robot must not cross it.
        VirtualWall,
        Threshold,
        Curtain,
    }
}

answer! {
    /// Something that the robot's camera saw on the floor.
    struct Obstacle from viola_formats::lidar::Obstacle {
        /// Class that the robot gave it, with its confidence, in the words of the robot's software.
        label: String,
        /// In metres.
        at_m: [f64; 2],
    }
}

answer! {
    /// Position of a picture in the map's frame: x to the right, y up, the same scale in both directions.
    struct PictureFrame from viola_home::PictureFrame {
        /// The upper left corner of the picture: x and y in metres.
        corner_m: [f64; 2],
        #[schema(example = 96.5)]
        px_per_m: f64,
        width_px: u32,
        height_px: u32,
    }
}

answer! {
    /// An uploaded LiDAR map and the summary of its file.
    struct LidarMapRevision from viola_storage::LidarMapRevision {
        level: LevelName,
        /// Counts from 1 over all levels of the home; the highest of a level is its current one.
        #[schema(minimum = 1, example = 2)]
        revision: i64,
        #[schema(example = 15540)]
        size_bytes: u64,
        /// SHA-256 of the file, in lower-case hexadecimal.
        sha256: String,
        /// Name of the file, if its sender gave one.
        #[schema(example = "valetudo.json")]
        file_name: Option<String>,
        info: LidarInfo,
        /// The frame of the revision that this one replaced; null for the first revision, and if the maps do not tell it.
        #[schema(required = false)]
        from_earlier: Option<FromEarlier>,
        created_at: Timestamp,
    }
}

answer! {
    /// The frame of a revision, from that of the one that it replaced.
    struct FromEarlier from viola_storage::FromEarlier {
        /// The replaced revision.
        #[schema(minimum = 1, example = 1)]
        revision: i64,
        /// By registering the two maps to each other; 0, 0, 0 or nearly so if the robot kept its frame.
        map_from_earlier: Pose2,
    }
}
