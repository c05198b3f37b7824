//! Rendering of colour pictures: texture, simple lighting, and the noise of a phone's camera.

use super::finish::Optics;
use super::optics::{Sight, reflect};
use super::render::NOTHING;
use super::rng::{bell, hash};
use super::scene::{Primitive, Scene};
use super::solid::Shape;
use rayon::prelude::*;
use viola_geometry::{Pinhole, Point3, Pose3, Vector3};

/// Lighting and exposure of a clip.
#[derive(Debug, Clone, Copy)]
pub(super) struct Light {
    /// Direction of the main light.
    pub toward: Vector3,
    pub exposure: f32,
    /// Gain of red and blue against green.
    pub warmth: f32,
    /// Standard deviation of the noise, 0..1.
    pub noise: f32,
}

/// Colour of the sky.
const SKY: [f32; 3] = [0.86, 0.92, 0.98];
/// Fraction of the light that a pane lets through, and that a mirror reflects.
const CLEAR: f32 = 0.9;
const MIRRORED: f32 = 0.88;

/// Returns the picture of what a camera sees; `salt` distinguishes frames.
pub(super) fn shade(
    scene: &Scene,
    camera: &Pinhole,
    home_from_camera: &Pose3,
    sight: &Sight,
    light: &Light,
    salt: u64,
) -> image::RgbImage {
    let (view, behind) = (&sight.first, sight.behind());
    let mut picture = image::RgbImage::new(view.width as u32, view.height as u32);
    let eye = Point3::from(home_from_camera.translation.vector);
    let turn = home_from_camera.rotation.to_rotation_matrix();
    picture.par_chunks_mut(3 * view.width).enumerate().for_each(|(y, row)| {
        for (x, pixel) in row.chunks_exact_mut(3).enumerate() {
            let at = y * view.width + x;
            let ray = turn * camera.ray(x as f64, y as f64);
            let through = seen(scene, behind.solid[at], &eye, &ray, behind.depth_m[at], light);
            let rgb = if view.solid[at] == behind.solid[at] {
                through
            } else {
                let pane = &scene.primitives[view.solid[at] as usize];
                behind_pane(pane, &(eye + ray * f64::from(view.depth_m[at])), &ray, through)
            };
            let (dx, dy) = (x as f32 / view.width as f32 - 0.5, y as f32 / view.height as f32 - 0.5);
            let vignette = 1.0 - 0.35 * (dx * dx + dy * dy);
            let tint = [light.warmth, 1.0, 1.0 / light.warmth];
            for (k, value) in pixel.iter_mut().enumerate() {
                let noise = light.noise * bell(hash(salt ^ hash((at * 3 + k) as u64)));
                let linear = rgb[k] * tint[k] * light.exposure * vignette + noise;
                *value = (linear.clamp(0.0, 1.0) * 255.0) as u8;
            }
        }
    });
    picture
}

/// Returns the colour of a solid surface, or of the reflection if it is a mirror.
fn seen(scene: &Scene, solid: u32, eye: &Point3, ray: &Vector3, depth_m: f32, light: &Light) -> [f32; 3] {
    if solid == NOTHING {
        return SKY;
    }
    let point = eye + ray * f64::from(depth_m);
    let primitive = &scene.primitives[solid as usize];
    if primitive.finish.optics != Optics::Mirror {
        return lit(primitive, &point, ray, light, solid);
    }
    let image = reflect(scene, solid as usize, &point, ray).map_or(SKY, |image| {
        let at = point + image.direction * image.distance;
        lit(&scene.primitives[image.solid], &at, &image.direction, light, image.solid as u32)
    });
    image.map(|c| c * MIRRORED + 0.02)
}

/// Returns a colour behind a pane. Glass reflects more of the sky at a flat angle (Schlick, 1994).
fn behind_pane(pane: &Primitive, point: &Point3, ray: &Vector3, rgb: [f32; 3]) -> [f32; 3] {
    let (_, normal) = pane.surface(point);
    let facing = (normal.dot(ray) / ray.norm()).abs() as f32;
    let mirrored = 0.06 + 0.94 * (1.0 - facing).powi(5);
    std::array::from_fn(|k| {
        let clear = rgb[k] * CLEAR * (0.9 + 0.1 * pane.finish.rgb[k]);
        clear * (1.0 - mirrored) + 0.75 * SKY[k] * mirrored
    })
}

fn lit(primitive: &Primitive, point: &Point3, ray: &Vector3, light: &Light, solid: u32) -> [f32; 3] {
    let (local, normal) = primitive.surface(point);
    let (across, up) = texture_coordinates(primitive, &local);
    let colour = primitive.finish.colour(across, up, u64::from(solid));
    let facing = (normal.dot(ray) / ray.norm()).abs();
    let sun = normal.dot(&light.toward).max(0.0);
    let sky = 0.5 + 0.5 * normal.z;
    // Corners near the floor get less light.
    let corner = if normal.z.abs() < 0.5 { (0.75 + 0.5 * point.z).min(1.0) } else { 1.0 };
    let bright = (0.42 + 0.26 * sun + 0.16 * sky + 0.16 * facing) * corner;
    let sheen = f64::from(primitive.finish.gloss) * 0.25 * facing.powi(12);
    colour.map(|c| c * bright as f32 + sheen as f32)
}

/// Returns surface coordinates in metres, across and up.
pub(super) fn texture_coordinates(primitive: &Primitive, local: &Vector3) -> (f32, f32) {
    let metres = local.component_mul(&primitive.half);
    match primitive.shape {
        Shape::Block | Shape::Cushion | Shape::Mesh(_) => match local.iamax() {
            0 => (metres.y as f32, metres.z as f32),
            1 => (metres.x as f32, metres.z as f32),
            _ => (metres.x as f32, metres.y as f32),
        },
        Shape::Cylinder | Shape::Ball => {
            ((local.y.atan2(local.x) * primitive.half.x) as f32, metres.z as f32)
        }
    }
}
