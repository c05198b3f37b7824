//! Depth that a sensor would measure without noise: glass and mirrors return something else than their
//! surface.

use super::finish::Optics;
use super::optics::{Sight, reflect};
use super::render::NOTHING;
use super::rng::{hash, unit};
use super::scene::{Primitive, Scene};
use super::sensor::Sensor;
use super::shade::texture_coordinates;
use rayon::prelude::*;
use viola_geometry::{Pinhole, Point3, Pose3, Vector3};

/// Side of a patch of glass or mirror that behaves alike, in metres.
const PATCH_M: f32 = 0.22;
/// Cosine of the angle of incidence below which all glass fails, and below which patches of it do.
const OBLIQUE: [f32; 2] = [0.12, 0.4];

/// A camera in a scene.
#[derive(Clone, Copy)]
pub(super) struct Shot<'a> {
    pub scene: &'a Scene,
    pub camera: &'a Pinhole,
    pub home_from_camera: &'a Pose3,
    /// Distinguishes clips and frames.
    pub clip_salt: u64,
    pub frame_salt: u64,
}

/// The echo of one pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Echo {
    /// Depth along z without noise, in metres; infinite without an echo.
    pub depth_m: f32,
    /// Solid whose surface returns the light, or [`NOTHING`].
    pub solid: u32,
    /// Cosine of the angle of incidence there.
    pub facing: f32,
    /// True if the light met glass or a mirror.
    pub strayed: bool,
}

const NO_ECHO: Echo = Echo { depth_m: f32::INFINITY, solid: NOTHING, facing: 0.0, strayed: false };

/// Behaviour of a pane in one clip.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Pane {
    Missing,
    /// The sensor measures the surface behind it.
    Through,
    /// Patches of the pane itself are measured, the rest is missing.
    Patches,
    /// Patches of the pane itself are measured, and through the rest the surface behind it.
    Mixed,
}

/// Behaviour of a mirror in one clip.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Mirror {
    Missing,
    /// The reflected surface appears behind the mirror.
    Image,
    Surface,
}

impl Pane {
    pub fn of(sensor: Sensor, pane: u32, clip_salt: u64) -> Pane {
        let draw = unit(hash(clip_salt ^ hash(u64::from(pane) ^ 0x9a3e)));
        match sensor {
            // Sunlight drowns the pattern, so windows are mostly holes.
            Sensor::StructuredLight => match draw {
                d if d < 0.40 => Pane::Missing,
                d if d < 0.75 => Pane::Through,
                d if d < 0.90 => Pane::Patches,
                _ => Pane::Mixed,
            },
            Sensor::PhoneLidar => match draw {
                d if d < 0.12 => Pane::Missing,
                d if d < 0.65 => Pane::Through,
                d if d < 0.75 => Pane::Patches,
                _ => Pane::Mixed,
            },
        }
    }
}

impl Mirror {
    pub fn of(mirror: u32, clip_salt: u64) -> Mirror {
        match unit(hash(clip_salt ^ hash(u64::from(mirror) ^ 0x3177))) {
            d if d < 0.2 => Mirror::Missing,
            d if d < 0.8 => Mirror::Image,
            _ => Mirror::Surface,
        }
    }
}

impl Shot<'_> {
    /// Returns the direction of a pixel in the home, with 1 m of depth.
    fn ray(&self, x: usize, y: usize) -> Vector3 {
        self.home_from_camera.rotation * self.camera.ray(x as f64, y as f64)
    }

    /// Returns the echoes of all pixels, row-major from the top.
    pub fn echoes(&self, sensor: Sensor, sight: &Sight) -> Vec<Echo> {
        let width = sight.first.width;
        let mut out = vec![NO_ECHO; sight.first.depth_m.len()];
        out.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
            for (x, echo) in row.iter_mut().enumerate() {
                *echo = self.echo(sensor, sight, x, y);
            }
        });
        out
    }

    fn echo(&self, sensor: Sensor, sight: &Sight, x: usize, y: usize) -> Echo {
        let (at, ray, behind) = (y * sight.first.width + x, self.ray(x, y), sight.behind());
        let solid = sight.first.solid[at];
        if solid == NOTHING {
            return NO_ECHO;
        }
        if solid == behind.solid[at] {
            return self.solid_echo(solid, sight.first.depth_m[at], &ray);
        }
        let pane = self.surface(solid, sight.first.depth_m[at], &ray, true);
        let through = || match behind.solid[at] {
            NOTHING => NO_ECHO,
            other => Echo { strayed: true, ..self.solid_echo(other, behind.depth_m[at], &ray) },
        };
        let patch = self.patch(solid, pane.depth_m, &ray);
        if pane.facing < OBLIQUE[0] + (OBLIQUE[1] - OBLIQUE[0]) * unit(hash(patch ^ 1)) {
            return NO_ECHO;
        }
        let on_it = unit(hash(patch ^ 2)) < 0.45;
        match Pane::of(sensor, solid, self.clip_salt) {
            Pane::Through => through(),
            Pane::Patches | Pane::Mixed if on_it => pane,
            Pane::Mixed => through(),
            Pane::Missing | Pane::Patches => NO_ECHO,
        }
    }

    /// Returns the echo of a solid that is not of glass.
    fn solid_echo(&self, solid: u32, depth_m: f32, ray: &Vector3) -> Echo {
        if self.scene.primitives[solid as usize].finish.optics != Optics::Mirror {
            return self.surface(solid, depth_m, ray, false);
        }
        let surface = self.surface(solid, depth_m, ray, true);
        let patch = unit(hash(self.patch(solid, depth_m, ray) ^ 3));
        match Mirror::of(solid, self.clip_salt) {
            Mirror::Image if patch < 0.8 => {
                let point = self.eye() + ray * f64::from(depth_m);
                reflect(self.scene, solid as usize, &point, ray).map_or(NO_ECHO, |image| {
                    // The depth of the image, because the reflected direction has the ray's length.
                    Echo { depth_m: depth_m + image.distance as f32, ..surface }
                })
            }
            Mirror::Image | Mirror::Surface if patch < 0.9 => surface,
            Mirror::Missing | Mirror::Image | Mirror::Surface => NO_ECHO,
        }
    }

    fn surface(&self, solid: u32, depth_m: f32, ray: &Vector3, strayed: bool) -> Echo {
        let point = self.eye() + ray * f64::from(depth_m);
        let normal = self.scene.normal(solid as usize, &point);
        let facing = (normal.dot(ray) / ray.norm()).abs() as f32;
        Echo { depth_m, solid, facing, strayed }
    }

    /// Returns the hash of a patch of a surface; the same in all frames of the clip.
    fn patch(&self, solid: u32, depth_m: f32, ray: &Vector3) -> u64 {
        let primitive: &Primitive = &self.scene.primitives[solid as usize];
        let (local, _) = primitive.surface(&(self.eye() + ray * f64::from(depth_m)));
        let (across, up) = texture_coordinates(primitive, &local);
        let cell = |value: f32| (value / PATCH_M).floor() as i64 as u64;
        hash(self.clip_salt ^ hash(u64::from(solid) ^ hash(cell(across) ^ hash(cell(up)))))
    }

    fn eye(&self) -> Point3 {
        Point3::from(self.home_from_camera.translation.vector)
    }
}

#[cfg(test)]
mod tests {
    use super::super::finish::{Finish, WHITE};
    use super::super::solid::Solid;
    use super::super::walk::look;
    use super::*;
    use viola_geometry::taxonomy::Class;

    /// Returns the echoes of the middle pixel in many clips: a board of the finish 2 m ahead, a wall 4 m
    /// ahead, and a wall 1 m behind.
    fn echoes(finish: Finish, sensor: Sensor) -> Vec<f32> {
        let board =
            |x: f64, finish: Finish| Solid::block(Class::Wall, [x, 0.0, -5.0], [0.02, 9.0, 10.0], finish);
        let plain = Finish::plain(WHITE);
        let scene = Scene::new([(board(2.01, finish), 1), (board(4.01, plain), 0), (board(-1.01, plain), 0)]);
        let camera = Pinhole { width: 5, height: 5, fx: 9.0, fy: 9.0, cx: 2.0, cy: 2.0 };
        let pose = look(&Point3::origin(), 0.0, 0.0, 0.0);
        let sight = Sight::of(&scene, &camera, &pose);
        let in_clip = |clip: u64| {
            let shot = Shot {
                scene: &scene,
                camera: &camera,
                home_from_camera: &pose,
                clip_salt: hash(clip),
                frame_salt: 0,
            };
            shot.echoes(sensor, &sight)[12].depth_m
        };
        (0..400).map(in_clip).collect()
    }

    fn count(depths: &[f32], depth_m: f32) -> usize {
        depths.iter().filter(|d| **d == depth_m || (**d - depth_m).abs() < 1e-3).count()
    }

    #[test]
    fn a_pane_is_measured_or_passed_or_missing() {
        for sensor in [Sensor::PhoneLidar, Sensor::StructuredLight] {
            let depths = echoes(Finish::glass(), sensor);
            let counts = [2.0, 4.0, f32::INFINITY].map(|depth_m| count(&depths, depth_m));
            assert!(counts.iter().all(|count| *count > 20), "{sensor:?}: {counts:?}");
            assert_eq!(counts.iter().sum::<usize>(), depths.len());
            assert!(sensor != Sensor::PhoneLidar || counts[1] > 200, "a phone mostly measures through");
        }
    }

    #[test]
    fn a_mirror_returns_the_length_of_the_reflected_ray() {
        let depths = echoes(Finish::mirror(), Sensor::PhoneLidar);
        // 2 m to the mirror, and 3 m from there to the wall behind the camera.
        let counts = [5.0, 2.0, f32::INFINITY].map(|depth_m| count(&depths, depth_m));
        assert!(counts[0] > 130 && counts[1] > 40 && counts[2] > 40, "{counts:?}");
        assert_eq!(counts.iter().sum::<usize>(), depths.len());
    }

    #[test]
    fn solids_echo_from_their_surface() {
        let depths = echoes(Finish::plain(WHITE), Sensor::StructuredLight);
        assert_eq!(count(&depths, 2.0), depths.len());
    }
}
