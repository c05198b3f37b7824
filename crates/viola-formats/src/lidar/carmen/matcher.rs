//! Pose of each scan by correlative scan matching (after Olson, 2009): the pose near the odometry's guess at
//! which its hits fit those of earlier scans best, searched first on a lattice around the guess, then finer.

use super::raster::{self, CELL_M};
use super::scan::Scan;
use crate::lidar::LidarError;
use viola_geometry::{Grid, Point2, Pose2};

/// Search range around the guess, in each direction.
const REACH_M: f64 = 0.3;
const REACH_RAD: f64 = 12f64.to_radians();
/// Steps of the lattice.
const STEP_M: f64 = 0.075;
const STEP_RAD: f64 = 1.5f64.to_radians();
/// The finest steps.
const FINE_M: f64 = 0.004;
const FINE_RAD: f64 = 0.05f64.to_radians();
/// Maximum number of refinement iterations.
const FINE_STEPS: usize = 100;
/// Standard deviation of the kernel around a hit.
const SPREAD_M: f64 = 0.07;
/// Maximum number of a scan's hits that are scored, on the lattice and in the refinement.
const COARSE_HITS: usize = 90;
const FINE_HITS: usize = 180;
/// Penalty of a pose at the end of the search range, as a fraction of all hits: a scan with few matches stays
/// at its odometry pose.
const PENALTY: f64 = 0.05;

/// Returns the pose of every scan in the first scan's odometry frame.
pub(super) fn align_scans(scans: &[Scan]) -> Result<Vec<Pose2>, LidarError> {
    let by_odometry: Vec<Pose2> = scans.iter().map(|scan| scan.by_odometry).collect();
    let frame = raster::frame_around(scans, &by_odometry)?;
    let mut field = Field { near: Grid::filled(frame, 0u8), kernel: kernel(SPREAD_M) };
    let mut poses: Vec<Pose2> = Vec::with_capacity(scans.len());
    for (index, scan) in scans.iter().enumerate() {
        let pose = match (poses.last(), index.checked_sub(1)) {
            (Some(last), Some(before)) => {
                let step = scans[before].by_odometry.inverse().compose(&scan.by_odometry);
                field.best_pose(scan, &last.compose(&step))
            }
            _ => scan.by_odometry,
        };
        field.add(scan, &pose)?;
        poses.push(pose);
    }
    Ok(poses)
}

/// Closeness of each cell to a hit, 255 at a hit.
struct Field {
    near: Grid<u8>,
    /// Offsets of cells around a hit, and their values.
    kernel: Vec<(i64, i64, u8)>,
}

fn kernel(spread_m: f64) -> Vec<(i64, i64, u8)> {
    let reach = (3.0 * spread_m / CELL_M).ceil() as i64;
    let cells = (-reach..=reach).flat_map(|y| (-reach..=reach).map(move |x| (x, y)));
    let weighed = cells.map(|(x, y)| {
        let squared_m = ((x * x + y * y) as f64) * CELL_M * CELL_M;
        (x, y, (255.0 * (-squared_m / (2.0 * spread_m * spread_m)).exp()) as u8)
    });
    weighed.filter(|(_, _, weight)| *weight > 0).collect()
}

impl Field {
    /// Adds the scan's hits. Corrected poses can leave the odometry's extent, so the grid grows with them.
    fn add(&mut self, scan: &Scan, pose: &Pose2) -> Result<(), LidarError> {
        let hits_m: Vec<Point2> = scan.hits_m.iter().map(|hit| pose.apply(hit)).collect();
        if hits_m.iter().any(|hit| self.near.frame.cell(hit).is_none()) {
            self.near = raster::grown(&self.near, &hits_m)?;
        }
        let frame = self.near.frame;
        for (x, y) in hits_m.iter().filter_map(|hit| frame.cell(hit)) {
            for &(dx, dy, weight) in &self.kernel {
                let (x, y) = (x as i64 + dx, y as i64 + dy);
                if x >= 0 && y >= 0 && x < frame.width as i64 && y < frame.height as i64 {
                    let cell = &mut self.near.cells[y as usize * frame.width + x as usize];
                    *cell = (*cell).max(weight);
                }
            }
        }
        Ok(())
    }

    fn best_pose(&self, scan: &Scan, guess: &Pose2) -> Pose2 {
        let thinned = |count: usize| -> Vec<Point2> {
            let every = scan.hits_m.len().div_ceil(count).max(1);
            scan.hits_m.iter().step_by(every).copied().collect()
        };
        let (coarse, fine) = (thinned(COARSE_HITS), thinned(FINE_HITS));
        let score = |hits: &[Point2], offset: [f64; 3]| {
            let pose = offset_by(guess, offset);
            let near: f64 = hits.iter().map(|hit| self.value(&pose.apply(hit))).sum();
            let [x, y, yaw] = offset;
            let way = (x * x + y * y) / (REACH_M * REACH_M) + yaw * yaw / (REACH_RAD * REACH_RAD);
            near / hits.len().max(1) as f64 - PENALTY * way
        };
        let mut best = ([0.0; 3], score(&coarse, [0.0; 3]));
        let steps = |reach: f64, step: f64| {
            let count = (reach / step).round() as i64;
            (-count..=count).map(move |index| index as f64 * step)
        };
        for yaw in steps(REACH_RAD, STEP_RAD) {
            for x in steps(REACH_M, STEP_M) {
                for y in steps(REACH_M, STEP_M) {
                    let score = score(&coarse, [x, y, yaw]);
                    if score > best.1 {
                        best = ([x, y, yaw], score);
                    }
                }
            }
        }
        best.1 = score(&fine, best.0);
        let (mut step_m, mut step_rad) = (STEP_M / 2.0, STEP_RAD / 2.0);
        for _ in 0..FINE_STEPS {
            if step_m <= FINE_M && step_rad <= FINE_RAD {
                break;
            }
            let from = best.1;
            for (axis, step) in [(0, step_m), (1, step_m), (2, step_rad)] {
                for step in [step, -step] {
                    let mut offset = best.0;
                    offset[axis] += step;
                    let score = score(&fine, offset);
                    if score > best.1 {
                        best = (offset, score);
                    }
                }
            }
            if best.1 <= from {
                (step_m, step_rad) = (step_m / 2.0, step_rad / 2.0);
            }
        }
        offset_by(guess, best.0)
    }

    /// Returns the closeness at a point, bilinear between the cells' centres, 0 to 1.
    fn value(&self, point: &Point2) -> f64 {
        let frame = &self.near.frame;
        let x = (point.x - frame.origin_m[0]) / CELL_M - 0.5;
        let y = (point.y - frame.origin_m[1]) / CELL_M - 0.5;
        // NaN fails the comparisons.
        if !(x >= 0.0 && y >= 0.0 && x < frame.width as f64 - 1.0 && y < frame.height as f64 - 1.0) {
            return 0.0;
        }
        let (column, row) = (x as usize, y as usize);
        let (right, up) = (x - column as f64, y - row as f64);
        let at = |x: usize, y: usize| f64::from(self.near.get(column + x, row + y));
        let low = at(0, 0) * (1.0 - right) + at(1, 0) * right;
        let high = at(0, 1) * (1.0 - right) + at(1, 1) * right;
        (low * (1.0 - up) + high * up) / 255.0
    }
}

fn offset_by(guess: &Pose2, [x, y, yaw]: [f64; 3]) -> Pose2 {
    Pose2::new(guess.x_m + x, guess.y_m + y, guess.yaw_rad + yaw)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hits_outside_the_odometrys_extent_are_matched() {
        let hits_m = vec![Point2::new(2.0, 0.0), Point2::new(0.0, 1.0)];
        let scan = Scan { by_odometry: Pose2::new(0.0, 0.0, 0.0), hits_m };
        let frame = raster::frame_around(std::slice::from_ref(&scan), &[scan.by_odometry]).unwrap();
        let mut field = Field { near: Grid::filled(frame, 0u8), kernel: kernel(SPREAD_M) };
        for pose in [scan.by_odometry, Pose2::new(10.0, -9.0, 0.5)] {
            field.add(&scan, &pose).unwrap();
        }
        for pose in [scan.by_odometry, Pose2::new(10.0, -9.0, 0.5)] {
            for hit in &scan.hits_m {
                // At a corner of the hit's cell it is the mean of 1, 0.77, 0.77 and 0.60.
                assert!(field.value(&pose.apply(hit)) > 0.7, "{pose:?}");
            }
        }
    }
}
