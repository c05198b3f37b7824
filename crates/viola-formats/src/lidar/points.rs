//! Bare points, common to CSV, PLY and PCD files.

mod csv;
mod pcd;
mod ply;
mod records;

pub(super) use csv::read_csv;
pub(super) use pcd::{is_pcd, read_pcd};
pub(super) use ply::read_ply;

use super::build::{Parts, build};
use super::{LidarError, LidarMap, MAX_POINTS, MapMarks};
use viola_geometry::Point2;

/// Points further than this from the origin, in metres, are dropped.
const MAX_DISTANCE_M: f64 = 1e5;

/// Points collected from a file.
#[derive(Default)]
struct Cloud {
    points: Vec<Point2>,
    not_finite: usize,
}

impl Cloud {
    fn add(&mut self, x: f64, y: f64) -> Result<(), LidarError> {
        // NaN fails the comparisons.
        if x.abs() < MAX_DISTANCE_M && y.abs() < MAX_DISTANCE_M {
            if self.points.len() == MAX_POINTS {
                return Err(LidarError::TooManyPoints { max: MAX_POINTS });
            }
            self.points.push(Point2::new(x, y));
        } else {
            self.not_finite += 1;
        }
        Ok(())
    }

    fn into_map(self, format: &'static str, mut notes: Vec<String>) -> Result<LidarMap, LidarError> {
        if self.not_finite > 0 {
            notes.push(format!("{} points that are not finite were dropped", self.not_finite));
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
