//! Transforms, cameras, planes, grids and distance fields, classes, names of levels, progress and cancellation, and
//! arithmetic that several crates share. No I/O; metres and radians throughout.
//!
//! Transforms are named by their spaces so that they cancel: `map_from_clip * clip_from_camera` is a
//! `map_from_camera`. The spaces: `camera` is x right, y down, z forward; `world` is the frame of the
//! device's poses; `clip` is z up with its origin on the floor below the first used camera and x along that
//! camera's heading; `map` is the LiDAR map's own frame, x right, y up.

mod camera;
mod conjugate_gradients;
mod distance_field;
mod grid;
pub mod groups;
mod level_name;
mod plane;
mod pose2;
pub mod progress;
pub mod stopwatch;
pub mod taxonomy;

pub use camera::Pinhole;
pub use conjugate_gradients::conjugate_gradients;
pub use distance_field::DistanceField;
pub use grid::{Grid, GridFrame, cell_of, cells_around, voxels_around};
pub use level_name::{InvalidLevelName, LevelName, MAX_LEVELS};
pub use plane::Plane;
pub use pose2::{Pose2, angle_between, wrap_angle};

pub type Point2 = nalgebra::Point2<f64>;
pub type Point3 = nalgebra::Point3<f64>;
pub type Vector2 = nalgebra::Vector2<f64>;
pub type Vector3 = nalgebra::Vector3<f64>;
/// A rigid motion in space.
pub type Pose3 = nalgebra::Isometry3<f64>;

/// Returns whether a member of a file is 0, and may be left out.
pub fn is_zero(value: &f64) -> bool {
    *value == 0.0
}
