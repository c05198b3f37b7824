//! Error models of depth sensors.

use super::render::{NOTHING, View};
use super::rng::{bell, hash, unit};
use super::scene::Scene;
use serde::Serialize;
use std::str::FromStr;
use viola_formats::clip::DepthImage;
use viola_geometry::{Pinhole, Point3, Pose3};

/// A kind of depth sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Sensor {
    /// A phone's processed LiDAR: 256x192, up to 5 m, noise of about 1 % that varies slowly over the picture,
    /// edges smeared over a pixel, millimetres.
    PhoneLidar,
    /// A structured-light camera: 640x480, 0.5 to 4.5 m, noise and quantisation that grow with the square of
    /// the distance; holes at grazing angles, on dark and shiny surfaces, and in the projector's shadow.
    StructuredLight,
}

impl FromStr for Sensor {
    type Err = String;

    fn from_str(text: &str) -> Result<Sensor, String> {
        match text {
            "phone-lidar" => Ok(Sensor::PhoneLidar),
            "structured-light" => Ok(Sensor::StructuredLight),
            _ => Err(format!("no sensor is called {text:?}; there are phone-lidar and structured-light")),
        }
    }
}

impl Sensor {
    pub fn depth_camera(self) -> Pinhole {
        match self {
            Sensor::PhoneLidar => {
                Pinhole { width: 256, height: 192, fx: 193.1, fy: 193.1, cx: 127.8, cy: 95.1 }
            }
            Sensor::StructuredLight => {
                Pinhole { width: 640, height: 480, fx: 577.6, fy: 577.6, cx: 318.9, cy: 242.7 }
            }
        }
    }

    /// Returns the maximum range, in metres.
    pub fn range_m(self) -> f64 {
        match self {
            Sensor::PhoneLidar => 5.0,
            Sensor::StructuredLight => 4.5,
        }
    }

    /// Returns the measured depth of a view; `salt` distinguishes frames.
    pub(super) fn measure(
        self,
        scene: &Scene,
        camera: &Pinhole,
        home_from_camera: &Pose3,
        view: &View,
        salt: u64,
    ) -> DepthImage {
        let depth_m = match self {
            Sensor::PhoneLidar => phone_lidar(view, salt),
            Sensor::StructuredLight => structured_light(scene, camera, home_from_camera, view, salt),
        };
        let depth_m = depth_m.into_iter().map(|depth| (depth * 1000.0).round() / 1000.0).collect();
        DepthImage { width: view.width as u32, height: view.height as u32, depth_m }
    }
}

/// Noise that varies over `size` pixels: bilinear interpolation of normal values on a grid.
struct SlowNoise {
    size: usize,
    columns: usize,
    corners: Vec<f32>,
}

impl SlowNoise {
    fn over(view: &View, size: usize, salt: u64) -> SlowNoise {
        let (columns, rows) = (view.width / size + 2, view.height / size + 2);
        let corners = (0..columns * rows).map(|k| bell(hash(salt ^ hash(k as u64)))).collect();
        SlowNoise { size, columns, corners }
    }

    fn at(&self, x: usize, y: usize) -> f32 {
        let first = y / self.size * self.columns + x / self.size;
        let part = |value: usize| (value % self.size) as f32 / self.size as f32;
        let (fx, fy) = (part(x), part(y));
        let row = |k: usize| self.corners[k] * (1.0 - fx) + self.corners[k + 1] * fx;
        row(first) * (1.0 - fy) + row(first + self.columns) * fy
    }
}

fn phone_lidar(view: &View, salt: u64) -> Vec<f32> {
    let slow = SlowNoise::over(view, 10, hash(salt ^ 1));
    let mut out = vec![0f32; view.depth_m.len()];
    for y in 0..view.height {
        for x in 0..view.width {
            let at = y * view.width + x;
            let depth = view.depth_m[at];
            if !depth.is_finite() {
                continue;
            }
            let depth = smeared(view, x, y, depth);
            let noise = 0.008 * slow.at(x, y) + 0.002 * bell(hash(salt ^ hash(at as u64)));
            let measured = depth * (1.0 + noise) + 0.001 * noise.signum();
            if measured < Sensor::PhoneLidar.range_m() as f32 {
                out[at] = measured.max(0.0);
            }
        }
    }
    out
}

/// Returns the depth with smeared edges: the phone's software interpolates between few laser dots.
fn smeared(view: &View, x: usize, y: usize, depth: f32) -> f32 {
    if x == 0 || y == 0 || x + 1 >= view.width || y + 1 >= view.height {
        return depth;
    }
    let (mut sum, mut count, mut low, mut high) = (0f32, 0f32, depth, depth);
    for row in y - 1..=y + 1 {
        for &other in &view.depth_m[row * view.width + x - 1..=row * view.width + x + 1] {
            if other.is_finite() {
                sum += other;
                count += 1.0;
                low = low.min(other);
                high = high.max(other);
            }
        }
    }
    if high - low > 0.08 * depth { 0.4 * depth + 0.6 * sum / count } else { depth }
}

/// Distance between projector and camera of a structured-light sensor, in metres.
const BASELINE_M: f64 = 0.075;

fn structured_light(
    scene: &Scene,
    camera: &Pinhole,
    home_from_camera: &Pose3,
    view: &View,
    salt: u64,
) -> Vec<f32> {
    let scale = (BASELINE_M * camera.fx) as f32;
    let slow = SlowNoise::over(view, 6, hash(salt ^ 1));
    let eye = Point3::from(home_from_camera.translation.vector);
    let turn = home_from_camera.rotation.to_rotation_matrix();
    let mut out = vec![0f32; view.depth_m.len()];
    for y in 0..view.height {
        // The projector is to the right: nearer surface further right shadows the surface left of it.
        let mut shade = f32::INFINITY;
        for x in (0..view.width).rev() {
            let at = y * view.width + x;
            let depth = view.depth_m[at];
            if view.solid[at] == NOTHING {
                continue;
            }
            let column = x as f32 - scale / depth;
            if column >= shade {
                continue;
            }
            shade = column;
            if !(0.5..Sensor::StructuredLight.range_m() as f32).contains(&depth) {
                continue;
            }
            let ray = turn * camera.ray(x as f64, y as f64);
            let primitive = &scene.primitives[view.solid[at] as usize];
            let (_, normal) = primitive.surface(&(eye + ray * f64::from(depth)));
            let facing = (normal.dot(&ray) / ray.norm()).abs() as f32;
            let finish = &primitive.finish;
            let bright = (finish.rgb[0] + finish.rgb[1] + finish.rgb[2]) / 3.0;
            // Returned light relative to the light needed at this distance.
            let signal = facing * bright * (1.0 - 0.8 * finish.gloss) * (4.5 / depth).min(3.0);
            let patch = hash(salt ^ hash((((x / 3) as u64) << 32) | (y / 3) as u64));
            if facing < 0.12 || signal < 0.12 * (0.5 + unit(patch)) {
                continue;
            }
            let disparity = scale / depth + 0.07 * slow.at(x, y) + 0.05 * bell(hash(salt ^ hash(at as u64)));
            // Quantised to an eighth of a pixel.
            let steps = (disparity * 8.0).round();
            let measured = scale * 8.0 / steps;
            if measured > 0.0 && measured < Sensor::StructuredLight.range_m() as f32 {
                out[at] = measured;
            }
        }
    }
    out
}
