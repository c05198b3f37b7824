//! Bare points, common to CSV, PLY and PCD files.

mod csv;
mod pcd;
mod ply;
mod records;

pub(super) use csv::read_csv;
pub(super) use pcd::{is_pcd, read_pcd};
pub(super) use ply::read_ply;

use super::build::{MAX_DISTANCE_M, Parts, build};
use super::{LidarError, LidarMap, MAX_POINTS, MapMarks};
use viola_geometry::Point2;

/// Points with a greater coordinate, in metres, are dropped: it is twice the circumference of the earth.
const MAX_COORDINATE_M: f64 = 8e7;
/// If at least this fraction of the points is nearer than [`MAX_DISTANCE_M`], the others are dropped.
const MIN_NEAR_FRACTION: f64 = 0.99;

/// Points collected from a file.
#[derive(Default)]
struct Cloud {
    points: Vec<Point2>,
    not_finite: usize,
}

fn is_near(point: &Point2) -> bool {
    point.x.abs() < MAX_DISTANCE_M && point.y.abs() < MAX_DISTANCE_M
}

impl Cloud {
    fn add(&mut self, x: f64, y: f64) -> Result<(), LidarError> {
        // NaN fails the comparisons.
        if x.abs() < MAX_COORDINATE_M && y.abs() < MAX_COORDINATE_M {
            if self.points.len() == MAX_POINTS {
                return Err(LidarError::TooManyPoints { max: MAX_POINTS });
            }
            self.points.push(Point2::new(x, y));
        } else {
            self.not_finite += 1;
        }
        Ok(())
    }

    /// Drops the points that are far from the origin if they are so few that they are faults of a sensor, and not the map.
    fn drop_strays(&mut self) {
        let near = self.points.iter().filter(|point| is_near(point)).count();
        let far = self.points.len() - near;
        if near as f64 >= MIN_NEAR_FRACTION * self.points.len() as f64 {
            self.points.retain(is_near);
            self.not_finite += far;
        }
    }

    fn into_map(mut self, format: &'static str, mut notes: Vec<String>) -> Result<LidarMap, LidarError> {
        self.drop_strays();
        if self.not_finite > 0 {
            notes.push(format!(
                "{} points that are not finite, or {} km away, were dropped",
                self.not_finite,
                MAX_DISTANCE_M / 1000.0
            ));
        }
        build(Parts {
            format,
            frame: "metres, the file's own frame, x right, y up",
            occupied_m: self.points,
            cells: None,
            rooms: Vec::new(),
            charger: None,
            marks: MapMarks::default(),
            carpet_m: Vec::new(),
            notes,
        })
    }
}
