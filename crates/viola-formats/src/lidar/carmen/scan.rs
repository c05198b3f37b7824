//! A laser scan of a log.

use viola_geometry::{Point2, Pose2};

/// A scan that is used.
pub struct Scan {
    /// Where the odometry puts the laser.
    pub by_odometry: Pose2,
    /// What it hit, from the laser, x ahead.
    pub hits_m: Vec<Point2>,
}
