//! A simulated clip, stored as its poses; frames are rendered on demand.

use super::echo::Shot;
use super::home::{Home, Set};
use super::optics::Sight;
use super::render::{NOTHING, View, render};
use super::rng::hash;
use super::scene::Scene;
use super::sensor::Sensor;
use super::shade::{Light, shade};
use super::survey::Survey;
use super::symmetry;
use super::walk::{home_from_clip, walk};
use nalgebra::{Translation3, UnitQuaternion};
use rustc_hash::FxHashSet;
use serde::Serialize;
use std::sync::Arc;
use viola_formats::clip::{Frame, FrameHeader};
use viola_geometry::taxonomy::Class;
use viola_geometry::{Pinhole, Point2, Point3, Pose2, Pose3, Vector3};

/// Parameters of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ClipParams {
    pub frames: usize,
    pub rate_hz: f64,
    pub sensor: Sensor,
    /// Width of the colour pictures, which are 4:3. The depth sensor's width is the cheapest.
    pub color_width: u32,
    /// Position error of the device's poses after one metre, in metres; it grows with the square root of the
    /// path. The heading error is 0.3 rad per metre of position error.
    pub drift: f64,
}

impl Default for ClipParams {
    fn default() -> ClipParams {
        ClipParams { frames: 60, rate_hz: 2.5, sensor: Sensor::PhoneLidar, color_width: 640, drift: 0.005 }
    }
}

/// Ground truth of a clip. Map frames: `map` is Valetudo's, `robot` is that of the ROS and CSV files.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ClipTruth {
    pub map_from_clip: Pose2,
    pub robot_from_clip: Pose2,
    pub home_from_clip: Pose2,
    /// All poses in `map` whose surroundings in the vacuum's map look like those of the true pose, within the
    /// clip's view; the true one first. More than one means that the clip is unknowable.
    pub equivalent_poses: Vec<Pose2>,
    pub unknowable: bool,
    /// Names of the rooms of the walk.
    pub rooms: Vec<String>,
    /// True poses of the frames. The device's drifting poses are in their own world frame.
    pub home_from_camera: Vec<Pose3>,
    pub world_from_home: Pose3,
}

/// Per-pixel truth, row-major from the top; 0 is nothing.
#[derive(Debug, Clone, PartialEq)]
pub struct LabelImage {
    pub width: u32,
    pub height: u32,
    /// [`Class::id`].
    pub classes: Vec<u16>,
    /// [`HomeObject::instance`](super::HomeObject); the building is 0, too.
    pub instances: Vec<u16>,
}

/// A clip in memory. Frames are rendered one at a time; they do not depend on order or thread count.
pub struct SimulatedClip {
    pub params: ClipParams,
    pub truth: ClipTruth,
    pub color_camera: Pinhole,
    pub depth_camera: Pinhole,
    headers: Vec<FrameHeader>,
    scene: Arc<Scene>,
    light: Light,
    seed: u64,
}

/// Returns points just before the surfaces in front of the cameras, at their heights.
fn seen_surfaces(scene: &Scene, home_from_camera: &[Pose3]) -> Vec<Point2> {
    const CAMERAS: usize = 24;
    const SIDEWAYS_RAD: [f64; 3] = [-0.4, 0.0, 0.4];
    const RANGE_M: f64 = 5.0;
    let step = home_from_camera.len().div_ceil(CAMERAS).max(1);
    let mut points = Vec::new();
    for pose in home_from_camera.iter().step_by(step) {
        let (eye, heading_rad) = (Point3::from(pose.translation.vector), home_from_clip(pose).yaw_rad);
        for sideways_rad in SIDEWAYS_RAD {
            let (s, c) = (heading_rad + sideways_rad).sin_cos();
            let toward = Vector3::new(c, s, 0.0);
            let hit = scene.cast(&eye, &toward, RANGE_M);
            points.extend(hit.map(|hit| (eye + toward * (0.95 * hit.distance)).xy()));
        }
    }
    points
}

/// Returns a pose of the clip in the home as the map has it. In a map with errors the clip lies where the map shows its
/// surroundings.
fn in_map(survey: &Survey, scene: &Scene, home_from_camera: &[Pose3], home_from_clip: &Pose2) -> Pose2 {
    survey.warp.mean(home_from_clip, seen_surfaces(scene, home_from_camera).into_iter())
}

impl SimulatedClip {
    pub(super) fn record(home: &Home, survey: &Survey, index: u64, params: &ClipParams) -> SimulatedClip {
        let mut rng = home.rng.fork("clip", index);
        let walk = walk(home, survey, &rng, params.frames, params.rate_hz);
        let map_from_home = survey.valetudo_from_home();
        let home_from_clip = walk.home_from_camera.first().map(home_from_clip).unwrap_or_default();
        let depth_camera = params.sensor.depth_camera();
        let equivalent: Vec<Pose2> = match home.params.set {
            Set::Repeated => symmetry::look_alikes(
                home,
                survey.vacuum_height_m,
                &walk.home_from_camera,
                &depth_camera,
                params.sensor.range_m(),
            ),
            _ => vec![Pose2::IDENTITY],
        };
        let mapped_from_clip = in_map(survey, &home.clip_day.scene, &walk.home_from_camera, &home_from_clip);
        let equivalent_poses: Vec<Pose2> = equivalent
            .iter()
            .map(|home_from_home| map_from_home.compose(home_from_home).compose(&mapped_from_clip))
            .collect();
        let world_from_home = Pose3::from_parts(
            Translation3::new(rng.between(-5.0, 5.0), rng.between(-5.0, 5.0), rng.between(-1.6, 0.2)),
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), rng.between(-3.1, 3.1)),
        );
        let mut drift = Drift { error: Pose3::identity(), last: None, rng: rng.fork("drift", 0) };
        let mut accelerometer = Accelerometer::new(rng.fork("accelerometer", 0));
        let headers = walk
            .home_from_camera
            .iter()
            .enumerate()
            .map(|(number, pose)| FrameHeader {
                number: number as u32,
                time_s: Some(number as f64 / params.rate_hz),
                world_from_camera: Some(world_from_home * drift.follow(pose, params.drift)),
                force_in_camera: Some(accelerometer.feel(&walk.home_from_camera, number, params.rate_hz)),
            })
            .collect();
        let (yaw, height) = (rng.between(-3.1, 3.1), rng.between(0.3, 1.2));
        let light = Light {
            toward: Vector3::new(yaw.cos(), yaw.sin(), height).normalize(),
            exposure: rng.between(0.8, 1.2) as f32,
            warmth: rng.between(0.93, 1.12) as f32,
            noise: rng.between(0.006, 0.02) as f32,
        };
        SimulatedClip {
            params: *params,
            truth: ClipTruth {
                map_from_clip: map_from_home.compose(&mapped_from_clip),
                robot_from_clip: survey.robot_from_home.compose(&mapped_from_clip),
                home_from_clip,
                unknowable: equivalent_poses.len() > 1,
                equivalent_poses,
                rooms: walk.rooms.iter().map(|&room| home.plan.rooms[room].name.clone()).collect(),
                home_from_camera: walk.home_from_camera,
                world_from_home,
            },
            color_camera: depth_camera.resized(params.color_width, params.color_width * 3 / 4),
            depth_camera,
            headers,
            scene: Arc::clone(&home.clip_day.scene),
            light,
            seed: rng.seed(),
        }
    }

    /// Returns the clip without device poses.
    pub fn without_poses(mut self) -> SimulatedClip {
        self.headers.iter_mut().for_each(|header| header.world_from_camera = None);
        self
    }

    pub fn headers(&self) -> &[FrameHeader] {
        &self.headers
    }

    /// Renders frame `index`.
    ///
    /// # Panics
    /// If the frame does not exist.
    pub fn frame(&self, index: usize) -> Frame {
        let pose = &self.truth.home_from_camera[index];
        let salt = hash(self.seed ^ hash(index as u64));
        let depth_sight = Sight::of(&self.scene, &self.depth_camera, pose);
        let shot = Shot {
            scene: &self.scene,
            camera: &self.depth_camera,
            home_from_camera: pose,
            clip_salt: hash(self.seed ^ 0xc11b),
            frame_salt: salt,
        };
        let depth = self.params.sensor.measure(&shot, &depth_sight);
        let same = (self.color_camera.width, self.color_camera.height) == (depth.width, depth.height);
        let color_sight = if same { depth_sight } else { Sight::of(&self.scene, &self.color_camera, pose) };
        let color = shade(&self.scene, &self.color_camera, pose, &color_sight, &self.light, hash(salt));
        Frame {
            header: self.headers[index].clone(),
            color_camera: self.color_camera,
            color: Some(color),
            depth_camera: self.depth_camera,
            depth,
        }
    }

    /// Renders the noise-free view of the depth camera: the first surfaces, panes included.
    ///
    /// # Panics
    /// If the frame does not exist.
    pub fn true_view(&self, index: usize) -> View {
        render(&self.scene, &self.depth_camera, &self.truth.home_from_camera[index])
    }

    /// Returns the true pose of the clip in the survey's map if the clip's frame is that of frame `index`.
    ///
    /// # Panics
    /// If the frame does not exist.
    pub fn map_from_frame(&self, survey: &Survey, index: usize) -> Pose2 {
        let home_from_camera = &self.truth.home_from_camera;
        let home_from_clip = home_from_clip(&home_from_camera[index]);
        survey.valetudo_from_home().compose(&in_map(survey, &self.scene, home_from_camera, &home_from_clip))
    }

    /// Returns whether the pictures show enough floor within the sensor's range to find it.
    pub fn shows_floor(&self) -> bool {
        /// Area that the method requires of a floor.
        const MIN_AREA_M2: f64 = 0.15;
        const CELL_M: f64 = 0.05;
        let mut cells: FxHashSet<[i32; 2]> = FxHashSet::default();
        for (index, home_from_camera) in self.truth.home_from_camera.iter().enumerate() {
            let view = self.true_view(index);
            for (pixel, (depth_m, solid)) in view.depth_m.iter().zip(&view.solid).enumerate() {
                let depth_m = f64::from(*depth_m);
                let is_floor = *solid != NOTHING && self.scene.class(*solid as usize) == Class::Floor;
                if is_floor && depth_m <= self.params.sensor.range_m() {
                    let (u, v) = ((pixel % view.width) as f64, (pixel / view.width) as f64);
                    let at = home_from_camera * self.depth_camera.unproject(u, v, depth_m);
                    cells.insert([at.x, at.y].map(|c| (c / CELL_M).floor() as i32));
                }
            }
            if cells.len() as f64 * CELL_M * CELL_M >= MIN_AREA_M2 {
                return true;
            }
        }
        false
    }

    /// Returns the class and the instance of the surface within `reach_m` of a measured point, if there is one.
    /// `normal` points away from the surface.
    pub fn label_at(&self, point_in_home: &Point3, normal: &Vector3, reach_m: f64) -> Option<(Class, u16)> {
        let hit = self.scene.cast(&(point_in_home + normal * reach_m), &-normal, 2.0 * reach_m)?;
        Some(self.scene.label(hit.solid))
    }

    /// Renders the labels of frame `index`, aligned with its colour picture.
    ///
    /// # Panics
    /// If the frame does not exist.
    pub fn labels(&self, index: usize) -> LabelImage {
        let view = render(&self.scene, &self.color_camera, &self.truth.home_from_camera[index]);
        let each = |pick: fn(Class, u16) -> u16| {
            let label = |&solid: &u32| match solid {
                NOTHING => 0,
                solid => {
                    let primitive = &self.scene.primitives[solid as usize];
                    pick(primitive.class, primitive.instance)
                }
            };
            view.solid.iter().map(label).collect()
        };
        LabelImage {
            width: view.width as u32,
            height: view.height as u32,
            classes: each(|class, _| class.id()),
            instances: each(|_, instance| instance),
        }
    }
}

/// An accelerometer with a mounting error.
struct Accelerometer {
    felt_from_camera: UnitQuaternion<f64>,
    rng: super::rng::Rng,
}

impl Accelerometer {
    /// Standard deviations: mounting error about each axis, and sample noise.
    const MOUNTED_RAD: f64 = 0.015;
    const NOISE_MPS2: f64 = 0.05;
    const GRAVITY_MPS2: f64 = 9.81;

    fn new(mut rng: super::rng::Rng) -> Accelerometer {
        let askew = Vector3::from_fn(|_, _| rng.gaussian()) * Accelerometer::MOUNTED_RAD;
        Accelerometer { felt_from_camera: UnitQuaternion::from_scaled_axis(askew), rng }
    }

    /// Returns the specific force: gravity's reaction and the walk's acceleration from adjacent frames.
    fn feel(&mut self, home_from_camera: &[Pose3], index: usize, rate_hz: f64) -> Vector3 {
        let at = |index: usize| home_from_camera[index].translation.vector;
        let bend = match index {
            // The walk starts and ends at rest.
            0 => Vector3::zeros(),
            index if index + 1 >= home_from_camera.len() => Vector3::zeros(),
            index => at(index + 1) - 2.0 * at(index) + at(index - 1),
        };
        let force_in_home = Vector3::z() * Accelerometer::GRAVITY_MPS2 + bend * (rate_hz * rate_hz);
        let noise = Vector3::from_fn(|_, _| self.rng.gaussian()) * Accelerometer::NOISE_MPS2;
        self.felt_from_camera * (home_from_camera[index].rotation.inverse() * force_in_home) + noise
    }
}

/// Random-walk error of a device's pose. The first frame is exact.
struct Drift {
    /// Transform from true to believed poses.
    error: Pose3,
    last: Option<Vector3>,
    rng: super::rng::Rng,
}

impl Drift {
    fn follow(&mut self, home_from_camera: &Pose3, drift: f64) -> Pose3 {
        let at = home_from_camera.translation.vector;
        if let Some(last) = self.last {
            let scale = drift * (at - last).norm().max(0.01).sqrt();
            let mut noise = |sigma: f64| self.rng.gaussian() * sigma;
            let step = Vector3::new(noise(scale), noise(scale), noise(0.4 * scale)) / 3f64.sqrt();
            // Gravity keeps the tilt error small.
            let turn = Vector3::new(noise(0.04 * scale), noise(0.04 * scale), noise(0.3 * scale));
            let here = Translation3::from(at);
            let turn = here * UnitQuaternion::from_scaled_axis(turn) * here.inverse();
            self.error = self.error * Translation3::from(step) * turn;
        }
        self.last = Some(at);
        self.error * home_from_camera
    }
}

impl Home {
    /// Records clip number `index`. The survey defines the map's frame of the truth.
    pub fn clip(&self, survey: &Survey, index: u64, params: &ClipParams) -> SimulatedClip {
        SimulatedClip::record(self, survey, index, params)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::HomeParams;

    #[test]
    fn the_true_pose_follows_the_frame_of_the_clip() {
        for (set, near_m) in [(Set::Normal, 1e-9), (Set::Drifted, 0.3)] {
            let home = Home::generate(&HomeParams::new(set, 4));
            let survey = home.survey();
            let clip = home.clip(&survey, 0, &ClipParams { frames: 30, ..ClipParams::default() });
            let first = clip.map_from_frame(&survey, 0);
            assert!(first.distance_m(&clip.truth.map_from_clip) < 1e-9, "{set:?}");
            let last = clip.map_from_frame(&survey, 29);
            let walked_m =
                home_from_clip(&clip.truth.home_from_camera[29]).distance_m(&clip.truth.home_from_clip);
            assert!(walked_m > 0.0 && (last.distance_m(&first) - walked_m).abs() < near_m, "{set:?}");
        }
    }

    #[test]
    fn the_floor_is_shown_by_cameras_that_look_down() {
        let home = Home::generate(&HomeParams::new(Set::Normal, 4));
        let mut clip = home.clip(&home.survey(), 0, &ClipParams { frames: 2, ..ClipParams::default() });
        let down = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
        for (rotation, shows_floor) in [(down, true), (UnitQuaternion::identity(), false)] {
            clip.truth.home_from_camera.iter_mut().for_each(|pose| pose.rotation = rotation);
            assert_eq!(clip.shows_floor(), shows_floor, "{rotation}");
        }
    }
}
