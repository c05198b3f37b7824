//! Bare points as records of numbers, common to CSV, PLY and PCD files.

mod csv;
mod pcd;
mod ply;

pub(super) use csv::read_csv;
pub(super) use pcd::{is_pcd, read_pcd};
pub(super) use ply::read_ply;

use super::build::{MAX_DISTANCE_M, Parts, build};
use super::{LidarError, LidarMap, MAX_POINTS};
use viola_geometry::Point2;

/// Points with a greater coordinate, in metres, are dropped: it is twice the circumference of the earth.
const MAX_COORDINATE_M: f64 = 8e7;
/// If at least this fraction of the points is nearer than [`MAX_DISTANCE_M`], the others are dropped.
const MIN_NEAR_FRACTION: f64 = 0.99;

/// Maximum standard deviation of the heights of a 2D map's points. A scan at one height has nearly none; walls from
/// floor to ceiling, as a mesh or a 3D scan has them, have 0.7 m.
const MAX_HEIGHT_SPREAD_M: f64 = 0.25;

/// Indices of a record's coordinates.
#[derive(Clone, Copy)]
struct Columns {
    x: usize,
    y: usize,
    z: Option<usize>,
}

/// Points collected from a file.
#[derive(Default)]
struct Points {
    points: Vec<Point2>,
    /// Number of points that are not finite or far away, and were dropped.
    dropped: usize,
    heights: Heights,
}

/// The heights of the points so far, in metres: Welford's mean and sum of squared deviations, lowest and highest.
#[derive(Default)]
struct Heights {
    count: f64,
    mean: f64,
    squares: f64,
    ends: Option<(f64, f64)>,
}

impl Heights {
    fn add(&mut self, height: f64) {
        self.count += 1.0;
        let from_mean = height - self.mean;
        self.mean += from_mean / self.count;
        self.squares += from_mean * (height - self.mean);
        let (low, high) = self.ends.unwrap_or((height, height));
        self.ends = Some((low.min(height), high.max(height)));
    }

    fn spread(&self) -> f64 {
        (self.squares / self.count.max(1.0)).sqrt()
    }
}

impl Points {
    fn add(&mut self, columns: &Columns, value: impl Fn(usize) -> f64) -> Result<(), LidarError> {
        if let Some(height_m) = columns.z.map(&value).filter(|height_m| height_m.is_finite()) {
            self.heights.add(height_m);
        }
        let (x, y) = (value(columns.x), value(columns.y));
        // NaN fails the comparisons.
        if x.abs() < MAX_COORDINATE_M && y.abs() < MAX_COORDINATE_M {
            if self.points.len() == MAX_POINTS {
                return Err(LidarError::TooManyPoints { max: MAX_POINTS });
            }
            self.points.push(Point2::new(x, y));
        } else {
            self.dropped += 1;
        }
        Ok(())
    }

    /// Drops the points that are far from the origin if they are so few that they are faults of a sensor, and not the map.
    fn drop_strays(&mut self) {
        let is_near = |point: &Point2| point.x.abs() < MAX_DISTANCE_M && point.y.abs() < MAX_DISTANCE_M;
        let near = self.points.iter().filter(|point| is_near(point)).count();
        if near as f64 >= MIN_NEAR_FRACTION * self.points.len() as f64 {
            self.dropped += self.points.len() - near;
            self.points.retain(is_near);
        }
    }

    fn into_map(mut self, format: &'static str, mut notes: Vec<String>) -> Result<LidarMap, LidarError> {
        if let Some((low_m, high_m)) = self.heights.ends {
            if self.heights.spread() > MAX_HEIGHT_SPREAD_M {
                return Err(LidarError::ThreeDimensional { low_m, high_m });
            }
            if high_m > low_m {
                notes.push(format!(
                    "z was ignored: points from {low_m:.2} to {high_m:.2} m were all taken as hits"
                ));
            }
        }
        self.drop_strays();
        if self.dropped > 0 {
            notes.push(format!(
                "{} points that are not finite, or {} km away, were dropped",
                self.dropped,
                MAX_DISTANCE_M / 1000.0
            ));
        }
        build(Parts {
            format,
            frame: "metres, the file's own frame, x right, y up",
            occupied_m: self.points,
            notes,
            ..Parts::default()
        })
    }
}
