//! Simulated vacuum: it drives wherever it fits and maps its LiDAR hits at turret height.

use super::clearance::{clearance, largest_region};
use super::home::{Home, Set};
use super::piece::Footprint;
use super::plan::{OpeningKind, Rect, Room};
use super::rng::{Rng, bell, hash, unit};
use super::scene::{Hit, Scene};
use super::warp::Warp;
use rayon::prelude::*;
use std::f64::consts::TAU;
use viola_formats::lidar::Cell;
use viola_geometry::{DistanceField, Grid, GridFrame, Point2, Point3, Pose2, Vector2, Vector3};

/// Cell of the raster of drivable floor.
const DRIVE_CELL_M: f64 = 0.025;
const BODY_RADIUS_M: f64 = 0.17;
/// Maximum height that it climbs: rugs.
const CLIMB_M: f64 = 0.02;
const RANGE_M: f64 = 8.0;
const RAYS: usize = 720;
const RANGE_NOISE_M: f64 = 0.01;
const DROP_OUT: f32 = 0.1;
/// Fraction of the rays that glass reflects, and the minimum cosine of their angle of incidence.
const GLASS_ECHO: f32 = 0.2;
const GLASS_FACING: f64 = 0.97;
/// Side of a map cell, as of all vacuums in the Valetudo fixtures.
pub(super) const CELL_M: f64 = 0.05;
/// Distance between scans.
const SCAN_STEP_M: f64 = 0.45;
/// Minimum hits of a wall cell, and minimum fraction of hits among the rays that reach it.
const WALL_HITS: u32 = 2;
const WALL_FRACTION: f64 = 0.2;

/// A vacuum's map of a home. Its frame `robot` has the dock at its origin, with any heading.
#[derive(Debug, Clone)]
pub struct Survey {
    pub vacuum_height_m: f64,
    /// The frame of the map, without the map's errors.
    pub robot_from_home: Pose2,
    /// The map's errors over metres.
    pub warp: Warp,
    /// The map, in the frame `robot`.
    pub cells: Grid<Cell>,
    /// Segment of every cell of `cells`, from 1; 0 is none.
    pub segments: Vec<u16>,
    /// Names of the segments; the first is segment 1.
    pub segment_names: Vec<String>,
    /// Mean of the hits in every wall cell, in the frame `robot`.
    pub points_m: Vec<Point2>,
    /// Pose of the docked robot, in the frame `robot`.
    pub charger: Pose2,
    /// Scan poses in order, in the frame `home`.
    pub scans: Vec<Pose2>,
}

impl Survey {
    /// Returns the approximate fraction of a room's floor that the robot scanned from within.
    pub(super) fn coverage(&self, room: &Room) -> f64 {
        let inside = |scan: &&Pose2| room.inner.contains(&Point2::new(scan.x_m, scan.y_m));
        let scans = self.scans.iter().filter(inside).count();
        scans as f64 * SCAN_STEP_M * SCAN_STEP_M / room.inner.area_m2()
    }

    pub(super) fn drive(home: &Home) -> Survey {
        let mut rng = home.rng.fork("survey", 0);
        let vacuum_height_m = rng.between(0.07, 0.12);
        let floor = Drivable::new(home, vacuum_height_m + 0.015);
        let charger = floor.charger(&mut rng);
        let yaw = rng.between(-std::f64::consts::PI, std::f64::consts::PI);
        let robot_from_home =
            Pose2::new(0.0, 0.0, yaw).compose(&Pose2::new(charger.x_m, charger.y_m, 0.0).inverse());
        let scans = floor.scans(&mut rng);
        let warp = match home.params.set {
            Set::Drifted => Warp::draw(&home.plan, &mut rng.fork("warp", 0)),
            _ => Warp::none(),
        };
        let beams = beams(home, &scans, vacuum_height_m, &warp, rng.seed());
        let mut raster = Raster::over(home, &robot_from_home);
        for beam in &beams {
            raster.add(&robot_from_home, beam);
        }
        for point in floor.reached() {
            let believed = warp.believed(&Pose2::new(point.x, point.y, 0.0));
            raster.drive(&robot_from_home.apply(&Point2::new(believed.x_m, believed.y_m)));
        }
        let (cells, points_m) = raster.finish();
        let (segments, segment_names) = segment(home, &robot_from_home, &cells);
        let charger = robot_from_home.compose(&warp.believed(&charger));
        Survey {
            vacuum_height_m,
            robot_from_home,
            warp,
            cells,
            segments,
            segment_names,
            points_m,
            charger,
            scans,
        }
    }
}

/// One measured ray in the frame `home`; `hit` is false beyond the range.
struct Beam {
    from: Point2,
    toward: Vector2,
    range_m: f64,
    hit: bool,
}

/// Returns the robot's believed poses: an error of about a centimetre and a quarter of a degree varies
/// slowly, so the map's walls are as thick as real ones. The map's `warp` is added.
fn believed_poses(scans: &[Pose2], warp: &Warp, rng: &mut Rng) -> Vec<Pose2> {
    let sigma = [0.008, 0.008, 0.2f64.to_radians()];
    let mut error = [0.0; 3];
    let keep = 0.9f64;
    let believe = |(index, scan): (usize, &Pose2)| {
        for (value, sigma) in error.iter_mut().zip(sigma) {
            *value = keep * *value + (1.0 - keep * keep).sqrt() * sigma * rng.gaussian();
        }
        let scan = warp.believed_of_scan(index, scan);
        Pose2::new(scan.x_m + error[0], scan.y_m + error[1], scan.yaw_rad + error[2])
    };
    scans.iter().enumerate().map(believe).collect()
}

/// Returns the rays of all scans with noise: 1 cm along the ray, dropout, and the robot's pose error.
fn beams(home: &Home, scans: &[Pose2], height_m: f64, warp: &Warp, seed: u64) -> Vec<Beam> {
    let scene = &home.vacuum_day.scene.slice(height_m);
    let believed = believed_poses(scans, warp, &mut Rng::new(hash(seed)));
    scans
        .par_iter()
        .zip(&believed)
        .enumerate()
        .flat_map_iter(|(index, (scan, believed))| {
            let salt = hash(seed ^ hash(index as u64));
            let origin = Point3::new(scan.x_m, scan.y_m, height_m);
            (0..RAYS).filter_map(move |ray| {
                let salt = hash(salt ^ hash(1000 + ray as u64));
                if unit(hash(salt ^ 1)) < DROP_OUT {
                    return None;
                }
                let angle = (ray as f64 + f64::from(unit(salt))) / RAYS as f64 * TAU;
                let (s, c) = angle.sin_cos();
                let toward = Vector3::new(c, s, 0.0);
                let echo = scene.cast(&origin, &toward, RANGE_M).filter(|hit| {
                    let glass = !scene.primitives[hit.solid].is_solid();
                    !glass || echoes_on_glass(scene, hit, &origin, &toward, hash(salt ^ 3))
                });
                let hit = echo.or_else(|| scene.cast_through_glass(&origin, &toward, RANGE_M));
                let range_m = match hit {
                    Some(hit) => {
                        warp.scale() * hit.distance + RANGE_NOISE_M * f64::from(bell(hash(salt ^ 2)))
                    }
                    None => RANGE_M,
                };
                Some(Beam {
                    from: Point2::new(believed.x_m, believed.y_m),
                    toward: Pose2::new(0.0, 0.0, believed.yaw_rad - scan.yaw_rad).rotate(&Vector2::new(c, s)),
                    range_m,
                    hit: hit.is_some(),
                })
            })
        })
        .collect()
}

/// Returns whether a pane reflects a ray back: rarely, and only if it is hit nearly at a right angle.
fn echoes_on_glass(scene: &Scene, hit: &Hit, origin: &Point3, toward: &Vector3, salt: u64) -> bool {
    let normal = scene.normal(hit.solid, &(origin + toward * hit.distance));
    unit(salt) < GLASS_ECHO && normal.dot(toward).abs() > GLASS_FACING
}

/// Counts of hits and passes per cell.
struct Raster {
    frame: GridFrame,
    hits: Vec<u32>,
    passes: Vec<u32>,
    sums: Vec<Vector2>,
    driven: Vec<bool>,
}

impl Raster {
    fn over(home: &Home, robot_from_home: &Pose2) -> Raster {
        let bounds = home.plan.bounds();
        let reach = 1.5;
        let corners = Footprint::of_rect(&bounds).grown(reach).corners().map(|p| robot_from_home.apply(&p));
        let around = Rect::around(corners);
        // Align cells with multiples of their side.
        let low = around.min.map(|v| (v / CELL_M).floor() * CELL_M);
        let frame = GridFrame::covering(low, around.max, 0.0, CELL_M);
        let n = frame.len();
        Raster {
            frame,
            hits: vec![0; n],
            passes: vec![0; n],
            sums: vec![Vector2::zeros(); n],
            driven: vec![false; n],
        }
    }

    fn index(&self, point: &Point2) -> Option<usize> {
        self.frame.cell(point).map(|(x, y)| y * self.frame.width + x)
    }

    fn add(&mut self, robot_from_home: &Pose2, beam: &Beam) {
        let from = robot_from_home.apply(&beam.from);
        let toward = robot_from_home.rotate(&beam.toward);
        self.pass(&from, &toward, beam.range_m);
        let end = from + toward * beam.range_m;
        if let (true, Some(cell)) = (beam.hit, self.index(&end)) {
            // `pass` counted the last cell as passed.
            self.passes[cell] = self.passes[cell].saturating_sub(1);
            self.hits[cell] += 1;
            self.sums[cell] += end.coords;
        }
    }

    /// Counts the cells along a ray (Amanatides and Woo, 1987) until it ends or leaves the raster.
    fn pass(&mut self, from: &Point2, toward: &Vector2, range_m: f64) {
        let Some((x, y)) = self.frame.cell(from) else { return };
        let mut cell = [x as i64, y as i64];
        let count = [self.frame.width as i64, self.frame.height as i64];
        let at = [0, 1].map(|axis| (from[axis] - self.frame.origin_m[axis]) / CELL_M);
        let step = [0, 1].map(|axis| if toward[axis] > 0.0 { 1i64 } else { -1 });
        // Distances along the ray between cell borders, and to the first border.
        let stride = [0, 1].map(|axis| CELL_M / toward[axis].abs());
        let mut next = [0, 1].map(|axis| {
            let inside = at[axis] - cell[axis] as f64;
            (if toward[axis] > 0.0 { 1.0 - inside } else { inside }) * stride[axis]
        });
        loop {
            self.passes[(cell[1] * count[0] + cell[0]) as usize] += 1;
            let axis = usize::from(next[1] < next[0]);
            if next[axis] > range_m {
                return;
            }
            cell[axis] += step[axis];
            next[axis] += stride[axis];
            if cell[axis] < 0 || cell[axis] >= count[axis] {
                return;
            }
        }
    }

    fn drive(&mut self, point: &Point2) {
        if let Some(cell) = self.index(point) {
            self.driven[cell] = true;
        }
    }

    fn finish(self) -> (Grid<Cell>, Vec<Point2>) {
        let mut grid = Grid::filled(self.frame, Cell::Unknown);
        let mut points = vec![];
        for (index, cell) in grid.cells.iter_mut().enumerate() {
            let (hits, passes) = (self.hits[index], self.passes[index]);
            let wall = hits >= WALL_HITS && f64::from(hits) > WALL_FRACTION * f64::from(hits + passes);
            if wall && !self.driven[index] {
                *cell = Cell::Occupied;
                points.push(Point2::from(self.sums[index] / f64::from(hits)));
            } else if self.driven[index] || passes >= 2 {
                *cell = Cell::Free;
            }
        }
        (grid, points)
    }
}

/// Floor that the robot reaches.
struct Drivable {
    clearance: DistanceField,
    reached: Grid<bool>,
}

impl Drivable {
    fn new(home: &Home, body_height_m: f64) -> Drivable {
        let band = [CLIMB_M, body_height_m];
        let clearance = clearance(&home.vacuum_day.scene, &home.plan, DRIVE_CELL_M, band);
        let fits = clearance.grid().cells.iter().map(|&d| f64::from(d) > BODY_RADIUS_M).collect();
        let reached = largest_region(&Grid { frame: *clearance.frame(), cells: fits });
        Drivable { clearance, reached }
    }

    fn reached(&self) -> impl Iterator<Item = Point2> + '_ {
        let frame = self.reached.frame;
        let cells = self.reached.cells.iter().enumerate().filter(|(_, reached)| **reached);
        cells.map(move |(index, _)| frame.centre(index % frame.width, index / frame.width))
    }

    /// Returns a random pose at a wall, facing away from it.
    fn charger(&self, rng: &mut Rng) -> Pose2 {
        let at_walls: Vec<Point2> =
            self.reached().filter(|point| self.clearance.value(point) < BODY_RADIUS_M + 0.05).collect();
        let point = rng.any(&at_walls).copied().or_else(|| self.reached().next()).unwrap_or_default();
        let (_, away) = self.clearance.value_and_gradient(&point);
        Pose2::new(point.x, point.y, away.y.atan2(away.x))
    }

    /// Returns scan poses over the reached floor, one per square, in alternating lanes.
    fn scans(&self, rng: &mut Rng) -> Vec<Pose2> {
        let mut squares: std::collections::BTreeMap<(i64, i64), (f64, Point2)> = Default::default();
        for point in self.reached() {
            let (x, y) = ((point.x / SCAN_STEP_M).floor(), (point.y / SCAN_STEP_M).floor());
            let middle = Point2::new((x + 0.5) * SCAN_STEP_M, (y + 0.5) * SCAN_STEP_M);
            let off = (point - middle).norm();
            // Every other lane is driven backwards.
            let lane = y as i64;
            let along = if lane % 2 == 0 { x as i64 } else { -(x as i64) };
            let best = squares.entry((lane, along)).or_insert((off, point));
            if off < best.0 {
                *best = (off, point);
            }
        }
        let turn = |rng: &mut Rng| rng.between(-std::f64::consts::PI, std::f64::consts::PI);
        squares.into_values().map(|(_, point)| Pose2::new(point.x, point.y, turn(rng))).collect()
    }
}

/// Returns the robot's rooms: rooms joined by an open plan are one segment.
fn segment(home: &Home, robot_from_home: &Pose2, cells: &Grid<Cell>) -> (Vec<u16>, Vec<String>) {
    let rooms = &home.plan.rooms;
    let mut group: Vec<usize> = (0..rooms.len()).collect();
    for opening in home.plan.openings.iter().filter(|o| o.kind == OpeningKind::Wide) {
        if let [Some(a), Some(b)] = opening.rooms {
            let (low, high) = (group[a].min(group[b]), group[a].max(group[b]));
            group.iter_mut().filter(|g| **g == high).for_each(|g| *g = low);
        }
    }
    let home_from_robot = robot_from_home.inverse();
    let mut numbers: std::collections::BTreeMap<usize, u16> = Default::default();
    let mut names = vec![];
    let segments = cells
        .cells
        .iter()
        .enumerate()
        .map(|(index, cell)| {
            if *cell != Cell::Free {
                return 0;
            }
            let centre = cells.frame.centre(index % cells.frame.width, index / cells.frame.width);
            let point = home_from_robot.apply(&centre);
            let Some(room) = rooms.iter().position(|room| room.outline.contains(&point)) else { return 0 };
            *numbers.entry(group[room]).or_insert_with(|| {
                names.push(rooms[group[room]].name.clone());
                names.len() as u16
            })
        })
        .collect();
    (segments, names)
}

impl Home {
    /// Drives the vacuum through the home.
    pub fn survey(&self) -> Survey {
        Survey::drive(self)
    }
}
