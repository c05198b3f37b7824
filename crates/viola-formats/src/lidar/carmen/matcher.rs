//! Where each scan was taken: from the odometry's guess, the pose at which its hits lie best on those of the scans
//! before it (correlative scan matching after Olson, 2009: first on a lattice around the guess, then finer).

use super::raster::{self, CELL_M};
use super::scan::Scan;
use crate::lidar::LidarError;
use viola_geometry::{Grid, Point2, Pose2};

/// How a scan is matched.
#[derive(Debug, Clone, Copy)]
pub(super) struct MatcherParams {
    /// How far from the guess poses are looked for, in each direction.
    pub reach_m: f64,
    pub reach_rad: f64,
    /// Steps of the lattice.
    pub step_m: f64,
    pub step_rad: f64,
    /// The finest steps.
    pub fine_m: f64,
    pub fine_rad: f64,
    /// How often at most the pose is moved by finer steps.
    pub fine_steps: usize,
    /// How far a hit reaches, one standard deviation.
    pub spread_m: f64,
    /// Hits of a scan that are looked at on the lattice, and finer.
    pub coarse_hits: usize,
    pub fine_hits: usize,
    /// What a pose at the end of the reach loses, as a share of all hits: keeps a scan of which little is known
    /// where the odometry puts it.
    pub penalty: f64,
}

impl Default for MatcherParams {
    fn default() -> Self {
        MatcherParams {
            reach_m: 0.3,
            reach_rad: 12f64.to_radians(),
            step_m: 0.075,
            step_rad: 1.5f64.to_radians(),
            fine_m: 0.004,
            fine_rad: 0.05f64.to_radians(),
            fine_steps: 100,
            spread_m: 0.07,
            coarse_hits: 90,
            fine_hits: 180,
            penalty: 0.05,
        }
    }
}

/// The pose of every scan in the frame of the first one's odometry.
pub(super) fn align_scans(scans: &[Scan], params: &MatcherParams) -> Result<Vec<Pose2>, LidarError> {
    let frame = raster::frame_around(scans)?;
    let mut field = Field { near: Grid::filled(frame, 0u8), kernel: kernel(params.spread_m) };
    let mut poses: Vec<Pose2> = Vec::with_capacity(scans.len());
    for (index, scan) in scans.iter().enumerate() {
        let pose = match (poses.last(), index.checked_sub(1)) {
            (Some(last), Some(before)) => {
                let step = scans[before].by_odometry.inverse().compose(&scan.by_odometry);
                field.best_pose(scan, &last.compose(&step), params)
            }
            _ => scan.by_odometry,
        };
        field.add(scan, &pose);
        poses.push(pose);
    }
    Ok(poses)
}

/// How near each cell is to a hit, 255 on one.
struct Field {
    near: Grid<u8>,
    /// Offsets of cells around a hit and what they get.
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
    fn add(&mut self, scan: &Scan, pose: &Pose2) {
        let frame = self.near.frame;
        for hit in &scan.hits_m {
            let Some((x, y)) = frame.cell(&pose.apply(hit)) else { continue };
            for &(dx, dy, weight) in &self.kernel {
                let (x, y) = (x as i64 + dx, y as i64 + dy);
                if x >= 0 && y >= 0 && x < frame.width as i64 && y < frame.height as i64 {
                    let cell = &mut self.near.cells[y as usize * frame.width + x as usize];
                    *cell = (*cell).max(weight);
                }
            }
        }
    }

    fn best_pose(&self, scan: &Scan, guess: &Pose2, params: &MatcherParams) -> Pose2 {
        let thinned = |count: usize| -> Vec<Point2> {
            let every = scan.hits_m.len().div_ceil(count).max(1);
            scan.hits_m.iter().step_by(every).copied().collect()
        };
        let (coarse, fine) = (thinned(params.coarse_hits), thinned(params.fine_hits));
        let score = |hits: &[Point2], offset: [f64; 3]| {
            let pose = offset_by(guess, offset);
            let near: f64 = hits.iter().map(|hit| self.value(&pose.apply(hit))).sum();
            let [x, y, yaw] = offset;
            let way = (x * x + y * y) / (params.reach_m * params.reach_m)
                + yaw * yaw / (params.reach_rad * params.reach_rad);
            near / hits.len().max(1) as f64 - params.penalty * way
        };
        let mut best = ([0.0; 3], score(&coarse, [0.0; 3]));
        let steps = |reach: f64, step: f64| {
            let count = (reach / step).round() as i64;
            (-count..=count).map(move |index| index as f64 * step)
        };
        for yaw in steps(params.reach_rad, params.step_rad) {
            for x in steps(params.reach_m, params.step_m) {
                for y in steps(params.reach_m, params.step_m) {
                    let score = score(&coarse, [x, y, yaw]);
                    if score > best.1 {
                        best = ([x, y, yaw], score);
                    }
                }
            }
        }
        best.1 = score(&fine, best.0);
        let (mut step_m, mut step_rad) = (params.step_m / 2.0, params.step_rad / 2.0);
        for _ in 0..params.fine_steps {
            if step_m <= params.fine_m && step_rad <= params.fine_rad {
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

    /// Bilinear between the cells' centres, 0 to 1.
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
