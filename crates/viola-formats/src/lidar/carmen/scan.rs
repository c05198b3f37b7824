//! A laser scan of a log.

use viola_geometry::{Point2, Pose2};

pub struct Scan {
    /// Pose of the laser by the odometry.
    pub by_odometry: Pose2,
    /// Hits in the laser's frame, x ahead.
    pub hits_m: Vec<Point2>,
}
