//! Why a LiDAR map is refused.

use crate::container::ContainerError;

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
        "no known map format; looked for Valetudo JSON, a zip of a ROS map (yaml and image), \
         and points as CSV (x, y in metres) or PLY"
    )]
    UnknownFormat,
    #[error("this is a ROS map's image without its yaml file; send a zip of both")]
    ImageWithoutYaml,
    #[error("this is a ROS map's yaml file without its image; send a zip of both")]
    YamlWithoutImage,
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
    #[error("the map has more than {max} points")]
    TooManyPoints { max: usize },
    #[error("line {line}: {reason}")]
    BadPoints { line: usize, reason: String },
    #[error("the PLY file cannot be used: {reason}")]
    BadPly { reason: String },
    #[error("the map has no wall: nothing in it is occupied, so no clip can be aligned to it")]
    NoWalls,
}

impl LidarError {
    /// Stable name of the refusal, for programs.
    pub fn code(&self) -> &'static str {
        match self {
            LidarError::Unreadable { .. } => "unreadable",
            LidarError::Container(error) => error.code(),
            LidarError::Empty => "empty",
            LidarError::FileTooLarge { .. } => "file_too_large",
            LidarError::UnknownFormat => "unknown_format",
            LidarError::ImageWithoutYaml => "image_without_yaml",
            LidarError::YamlWithoutImage => "yaml_without_image",
            LidarError::BadJson { .. } => "bad_json",
            LidarError::BadYaml { .. } => "bad_yaml",
            LidarError::BadImage { .. } => "bad_image",
            LidarError::BadField { .. } => "bad_field",
            LidarError::TooManyCells { .. } => "too_many_cells",
            LidarError::TooManyPoints { .. } => "too_many_points",
            LidarError::BadPoints { .. } => "bad_points",
            LidarError::BadPly { .. } => "bad_ply",
            LidarError::NoWalls => "no_walls",
        }
    }
}
