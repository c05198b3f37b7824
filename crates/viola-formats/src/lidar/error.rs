//! Errors of reading a LiDAR map.

use crate::container::{ContainerError, is_machine_fault};

/// A refusal: its `Display` is for people, [`LidarError::code`] for programs.
#[derive(Debug, thiserror::Error)]
pub enum LidarError {
    #[error("{name} cannot be read: {source}")]
    Unreadable { name: String, source: std::io::Error },
    #[error(transparent)]
    Container(#[from] ContainerError),
    #[error("the file is empty")]
    Empty,
    #[error("the map has more than {max_bytes} bytes")]
    FileTooLarge { max_bytes: u64 },
    #[error(
        "no known map format; looked for Valetudo JSON and PNG, the files of Roborock, Dreame and Viomi, a zip of a \
         ROS map (yaml and image), points as CSV (x, y in metres), PLY or PCD, and CARMEN logs"
    )]
    UnknownFormat,
    #[error("this is a picture without a map: a ROS map's image needs its yaml file in one zip with it")]
    ImageWithoutYaml,
    #[error("this is a ROS map's yaml file without its image; send a zip of both")]
    YamlWithoutImage,
    #[error("the archive has no image {image}, which its yaml file {yaml} names; send a zip of both")]
    MissingImage { yaml: String, image: String },
    #[error("the map is not valid JSON of a Valetudo map: {reason}")]
    BadJson { reason: String },
    #[error("the map's yaml file {name}: {reason}")]
    BadYaml { name: String, reason: String },
    #[error("the map's image {name}: {reason}")]
    BadImage { name: String, reason: String },
    #[error("{field} is {value}, and must be {expected}")]
    BadField { field: String, value: String, expected: String },
    #[error("the map has {cells} cells, and at most {max} are taken")]
    TooManyCells { cells: u64, max: usize },
    #[error(
        "the map extends over {width_m:.1} m by {height_m:.1} m, and may have {max_m} m a side; check that it is in metres"
    )]
    TooLarge { width_m: f64, height_m: f64, max_m: f64 },
    #[error(
        "the map is at x {x_m:.1} m, y {y_m:.1} m, and all coordinates must be below {max_m} m; subtract the same offset from \
         all of them"
    )]
    FarFromOrigin { x_m: f64, y_m: f64, max_m: f64 },
    #[error("the map has more than {max} points")]
    TooManyPoints { max: usize },
    #[error(
        "the points are at heights from {low_m:.2} to {high_m:.2} m: this is a 3D scan or mesh; send the robot's 2D map, or \
         the points of one height"
    )]
    ThreeDimensional { low_m: f64, high_m: f64 },
    #[error("line {line}: {reason}")]
    BadPoints { line: usize, reason: String },
    #[error("the PLY file cannot be used: {reason}")]
    BadPly { reason: String },
    #[error("the PCD file cannot be used: {reason}")]
    BadPcd { reason: String },
    #[error("line {line} of the log: {reason}")]
    BadLog { line: usize, reason: String },
    #[error("the {format} map cannot be used: {reason}")]
    BadRobotMap { format: &'static str, reason: String },
    #[error("the file holds only what changed since another one; send a whole map")]
    PartialMap,
    #[error("the file cannot be inflated: {reason}")]
    BadCompression { reason: String },
    #[error("the map has no wall: nothing in it is occupied, so no clip can be aligned to it")]
    NoWalls,
}

impl LidarError {
    /// Returns whether the machine, not the map, is at fault: a retry may succeed.
    pub fn is_service_fault(&self) -> bool {
        match self {
            LidarError::Unreadable { source, .. } => is_machine_fault(source),
            LidarError::Container(error) => error.is_service_fault(),
            _ => false,
        }
    }

    /// Returns the stable name of the refusal, for programs.
    pub fn code(&self) -> &'static str {
        match self {
            LidarError::Unreadable { .. } => "unreadable",
            LidarError::Container(error) => error.code(),
            LidarError::Empty => "empty",
            LidarError::FileTooLarge { .. } => "file_too_large",
            LidarError::UnknownFormat => "unknown_format",
            LidarError::ImageWithoutYaml => "image_without_yaml",
            // One code for both: the yaml file is there, and its image is not.
            LidarError::YamlWithoutImage | LidarError::MissingImage { .. } => "yaml_without_image",
            LidarError::BadJson { .. } => "bad_json",
            LidarError::BadYaml { .. } => "bad_yaml",
            LidarError::BadImage { .. } => "bad_image",
            LidarError::BadField { .. } => "bad_field",
            LidarError::TooManyCells { .. } => "too_many_cells",
            LidarError::TooLarge { .. } => "map_too_large",
            LidarError::FarFromOrigin { .. } => "map_far_from_origin",
            LidarError::TooManyPoints { .. } => "too_many_points",
            LidarError::ThreeDimensional { .. } => "three_dimensional_map",
            LidarError::BadPoints { .. } => "bad_points",
            LidarError::BadPly { .. } => "bad_ply",
            LidarError::BadPcd { .. } => "bad_pcd",
            LidarError::BadLog { .. } => "bad_log",
            LidarError::BadRobotMap { .. } => "bad_robot_map",
            LidarError::PartialMap => "partial_map",
            LidarError::BadCompression { .. } => "bad_compression",
            LidarError::NoWalls => "no_walls",
        }
    }
}
