//! Walk of a person with a phone in hand.

mod route;

use super::clearance::clearance;
use super::home::{Home, Set};
use super::rng::Rng;
use super::survey::Survey;
use nalgebra::{Matrix3, Rotation3, Translation3, UnitQuaternion};
use std::collections::VecDeque;
use std::f64::consts::{PI, TAU};
use viola_geometry::{Grid, Point2, Point3, Pose2, Pose3, Vector2, Vector3, wrap_angle};

const CELL_M: f64 = 0.1;
/// Minimum distance of the phone from obstacles.
const BODY_M: f64 = 0.24;
/// Heights of obstacles to a person.
const BAND_M: [f64; 2] = [0.03, 1.95];
const STEP_S: f64 = 0.1;
/// Minimum distance of the surface in a frame's middle: nearer surface fills the picture.
const TOO_NEAR_M: f64 = 0.45;
const TRIES: u64 = 14;

/// The path of a clip.
pub(super) struct Walk {
    /// In frame order; camera axes are x right, y down, z forward.
    pub home_from_camera: Vec<Pose3>,
    /// Rooms of the walk.
    pub rooms: Vec<usize>,
}

/// Walks for `frames` frames at `rate_hz`. Takes the first try without a bad frame, else the one with the
/// fewest.
pub(super) fn walk(home: &Home, survey: &Survey, rng: &Rng, frames: usize, rate_hz: f64) -> Walk {
    let clear = clearance(&home.clip_day.scene, &home.plan, CELL_M, BAND_M);
    let free = clear.grid().cells.iter().map(|&d| f64::from(d) > BODY_M).collect();
    let free = Grid { frame: *clear.frame(), cells: free };
    let mut best: Option<(usize, Walk)> = None;
    for attempt in 0..TRIES {
        let mut rng = rng.fork("attempt", attempt);
        let (region, rooms) = route::region(home, survey, &free, &mut rng);
        let Some(mut walker) = Walker::start(home, region, &rooms, &mut rng) else { continue };
        let poses = walker.record(frames, rate_hz);
        let faults = walker.faults(&poses);
        if best.as_ref().is_none_or(|(least, _)| faults < *least) {
            best = Some((faults, Walk { home_from_camera: poses, rooms }));
        }
        if faults == 0 {
            break;
        }
    }
    match best {
        Some((_, walk)) => walk,
        // No space to stand: look from the middle of the first room.
        None => {
            let middle = home.plan.rooms[0].inner.centre();
            let pose = look(&Point3::new(middle.x, middle.y, 1.5), 0.0, -0.3, 0.0);
            Walk { home_from_camera: vec![pose; frames], rooms: vec![0] }
        }
    }
}

struct Walker<'a> {
    home: &'a Home,
    rng: Rng,
    region: Grid<bool>,
    places: Vec<Point2>,
    targets: Vec<Point3>,
    /// Remaining path to the next goal.
    path: VecDeque<Point2>,
    at: Point2,
    yaw: f64,
    pitch: f64,
    base_pitch: f64,
    eye_m: f64,
    speed: f64,
    pause_s: f64,
    gaze: Point3,
    gaze_s: f64,
    time_s: f64,
    /// Phases of the sway.
    phases: [f64; 4],
    wander: [f64; 3],
}

impl<'a> Walker<'a> {
    fn start(home: &'a Home, region: Grid<bool>, rooms: &[usize], rng: &mut Rng) -> Option<Walker<'a>> {
        let frame = region.frame;
        let places: Vec<Point2> = (0..frame.len())
            .filter(|&index| region.cells[index])
            .map(|index| frame.centre(index % frame.width, index / frame.width))
            .collect();
        let at = *rng.any(&places)?;
        let upper = home.params.set == Set::Upper;
        // Half of the upper clips look up; the others look level from the chest.
        let looks_up = rng.chance(0.5);
        let (base_pitch, eye_m) = match (upper, looks_up) {
            (false, _) => (rng.between(-30.0, -10.0), rng.between(1.25, 1.68)),
            (true, true) => (rng.between(5.0, 22.0), rng.between(1.2, 1.6)),
            (true, false) => (rng.between(-4.0, 6.0), rng.between(1.1, 1.35)),
        };
        let mut walker = Walker {
            home,
            rng: rng.fork("walk", 0),
            targets: targets(home, rooms),
            path: VecDeque::new(),
            at,
            yaw: 0.0,
            pitch: f64::to_radians(base_pitch),
            base_pitch: f64::to_radians(base_pitch),
            eye_m,
            speed: 0.3,
            pause_s: 0.0,
            gaze: Point3::origin(),
            gaze_s: 0.0,
            time_s: 0.0,
            phases: [0; 4].map(|_: i32| rng.between(0.0, TAU)),
            wander: [0.0; 3],
            region,
            places,
        };
        walker.look_somewhere(PI);
        let to = walker.gaze - Point3::new(at.x, at.y, walker.eye_m);
        walker.yaw = to.y.atan2(to.x);
        Some(walker)
    }

    fn record(&mut self, frames: usize, rate_hz: f64) -> Vec<Pose3> {
        let mut out = Vec::with_capacity(frames);
        for frame in 0..frames {
            let due = frame as f64 / rate_hz;
            while self.time_s + STEP_S / 2.0 < due {
                self.step();
            }
            out.push(self.pose());
        }
        out
    }

    fn step(&mut self) {
        self.time_s += STEP_S;
        self.walk();
        self.gaze_s -= STEP_S;
        let ahead = self.open_m(self.yaw, self.pitch);
        if self.gaze_s <= 0.0 {
            self.look_somewhere(1.9);
        } else if ahead < 0.7 {
            // Turn away from surfaces that fill the picture.
            self.look_somewhere(PI);
        }
        let to = self.gaze - Point3::new(self.at.x, self.at.y, self.eye_m);
        let turn = wrap_angle(to.y.atan2(to.x) - self.yaw);
        self.yaw = wrap_angle(self.yaw + (1.6 * turn).clamp(-1.0, 1.0) * STEP_S);
        let elevation = to.z.atan2(to.xy().norm().max(0.8));
        let wanted = if self.home.params.set == Set::Upper {
            (self.base_pitch + 0.3 * (elevation + 0.1)).clamp((-5f64).to_radians(), 25f64.to_radians())
        } else {
            (self.base_pitch + 0.35 * (elevation - self.base_pitch)).clamp(-0.75, 0.1)
        };
        self.pitch += (wanted - self.pitch) * 1.2 * STEP_S;
        for value in &mut self.wander {
            *value += -0.4 * *value * STEP_S + self.rng.gaussian() * 0.9 * STEP_S.sqrt();
        }
    }

    /// Moves along the path; at its end pauses and chooses a new goal.
    fn walk(&mut self) {
        if self.pause_s > 0.0 {
            self.pause_s -= STEP_S;
            return;
        }
        let mut left = self.speed * STEP_S;
        while left > 0.0 {
            let Some(next) = self.path.front() else {
                self.pause_s = if self.rng.chance(0.5) { self.rng.between(0.0, 1.5) } else { 0.0 };
                self.speed = self.rng.between(0.2, 0.65);
                if let Some(&goal) = self.rng.any(&self.places) {
                    self.path = route::path(&self.region, &self.at, &goal);
                }
                return;
            };
            let way: Vector2 = next - self.at;
            if way.norm() > left {
                self.at += way.normalize() * left;
                return;
            }
            left -= way.norm();
            self.at = *next;
            self.path.pop_front();
        }
    }

    /// Chooses a gaze target that is not too near, within `widest` of the current heading.
    fn look_somewhere(&mut self, widest: f64) {
        self.gaze_s = self.rng.between(1.2, 3.5);
        let eye = Point3::new(self.at.x, self.at.y, self.eye_m);
        let mut best = (f64::MIN, self.gaze);
        for _ in 0..8 {
            let Some(&target) = self.rng.any(&self.targets) else { break };
            let to = target - eye;
            let yaw = to.y.atan2(to.x);
            let open = self.open_m(yaw, self.base_pitch);
            let turn = wrap_angle(yaw - self.yaw).abs();
            let mut score = open.min(2.5) - (turn - widest).max(0.0) * 2.0;
            if open < 0.9 {
                score -= 3.0;
            }
            score += self.rng.between(0.0, 1.0);
            if score > best.0 {
                best = (score, target);
            }
        }
        self.gaze = best.1;
    }

    /// Returns the distance to the first surface in a direction.
    fn open_m(&self, yaw: f64, pitch: f64) -> f64 {
        let eye = Point3::new(self.at.x, self.at.y, self.eye_m);
        let toward = Vector3::new(yaw.cos() * pitch.cos(), yaw.sin() * pitch.cos(), pitch.sin());
        self.home.clip_day.scene.cast(&eye, &toward, 10.0).map_or(10.0, |hit| hit.distance)
    }

    /// Returns the camera pose with the sway of hand and step.
    fn pose(&self) -> Pose3 {
        let stride = if self.pause_s > 0.0 { 0.3 } else { 1.0 };
        let wave = |k: usize, hz: f64| (TAU * hz * self.time_s + self.phases[k]).sin();
        let side = 0.012 * stride * wave(0, 0.9);
        let up = 0.01 * stride * wave(1, 1.8) + 0.015 * wave(2, 0.15);
        let eye = Point3::new(
            self.at.x - self.yaw.sin() * side,
            self.at.y + self.yaw.cos() * side,
            self.eye_m + up,
        );
        let shake = |k: usize| self.wander[k].clamp(-2.5, 2.5).to_radians();
        look(&eye, self.yaw + 0.8 * shake(0), self.pitch + 0.8 * shake(1), shake(2))
    }

    /// Returns the number of frames that show almost nothing; a bad first frame counts more than all others.
    fn faults(&self, poses: &[Pose3]) -> usize {
        let near = |pose: &Pose3| {
            let eye = Point3::from(pose.translation.vector);
            let toward = pose.rotation * Vector3::z();
            let scene = &self.home.clip_day.scene;
            scene.is_inside(&eye) || scene.cast(&eye, &toward, TOO_NEAR_M).is_some()
        };
        let first = poses.first().is_some_and(|pose| near(pose) || self.blind(pose));
        poses.iter().filter(|pose| near(pose)).count() + if first { poses.len() } else { 0 }
    }

    /// Returns whether most rays across the picture hit a surface within 0.7 m of depth.
    fn blind(&self, pose: &Pose3) -> bool {
        let eye = Point3::from(pose.translation.vector);
        let open = (-2..=2).filter(|k| {
            let toward = pose.rotation * Vector3::new(0.25 * f64::from(*k), 0.0, 1.0);
            self.home.clip_day.scene.cast(&eye, &toward, 0.7).is_none()
        });
        open.count() < 3
    }
}

/// Returns gaze targets: furniture, and the walls of the rooms.
fn targets(home: &Home, rooms: &[usize]) -> Vec<Point3> {
    let furniture = home.clip_day.pieces.iter().filter(|piece| rooms.contains(&piece.room));
    let mut out: Vec<Point3> = furniture
        .map(|piece| {
            let pose = &piece.home_from_piece;
            Point3::new(pose.x_m, pose.y_m, (piece.size[2] * 0.7).min(1.6))
        })
        .collect();
    for &room in rooms {
        let inner = home.plan.rooms[room].inner;
        for fraction in [0.0, 0.2, 0.5, 0.8, 1.0] {
            let x = inner.min[0] + fraction * inner.size(0);
            let y = inner.min[1] + fraction * inner.size(1);
            for (x, y) in [(x, inner.min[1]), (x, inner.max[1]), (inner.min[0], y), (inner.max[0], y)] {
                out.push(Point3::new(x, y, 1.1));
            }
        }
    }
    out
}

/// Returns a camera pose; positive pitch looks up, positive roll turns the picture's content clockwise.
pub(super) fn look(eye: &Point3, yaw: f64, pitch: f64, roll: f64) -> Pose3 {
    let forward = Vector3::new(yaw.cos() * pitch.cos(), yaw.sin() * pitch.cos(), pitch.sin());
    let right = Vector3::new(yaw.sin(), -yaw.cos(), 0.0);
    let down = forward.cross(&right);
    let axes = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[right, down, forward]));
    let turn = axes * Rotation3::from_axis_angle(&Vector3::z_axis(), roll);
    Pose3::from_parts(Translation3::from(eye.coords), UnitQuaternion::from_rotation_matrix(&turn))
}

/// Returns the clip's frame of a first camera: on the floor below it, x along its heading. A camera that
/// looks nearly straight down has the heading of its picture's upper edge.
pub(super) fn home_from_clip(home_from_camera: &Pose3) -> Pose2 {
    let axis = |v: Vector3| (home_from_camera.rotation * v).xy();
    let forward = axis(Vector3::z());
    let heading = if forward.norm() > 0.17 { forward } else { axis(-Vector3::y()) };
    let at = home_from_camera.translation.vector;
    Pose2::new(at.x, at.y, heading.y.atan2(heading.x))
}
