//! A structured-light camera: triangulation of a projected pattern.

use super::Sensor;
use super::noise::SlowNoise;
use crate::simulate::echo::{Echo, Shot};
use crate::simulate::render::NOTHING;
use crate::simulate::rng::{bell, hash, unit};

/// Distance between projector and camera, in metres.
const BASELINE_M: f64 = 0.075;
/// Minimum range, in metres.
const NEAREST_M: f32 = 0.5;
/// Error of the device's calibration at 1 m as a fraction of the depth, for one standard deviation of its
/// field. The fraction grows with the depth.
const DISTORTION: f32 = 0.0025;
/// Maximum width of the borders without depth, in pixels: columns at the left, columns at the right, rows.
const BORDERS: [f32; 3] = [18.0, 8.0, 7.0];
/// Difference of adjacent depths at an edge, as a fraction of the depth.
const EDGE: f32 = 0.06;

/// Returns the depth in metres, 0 where nothing was measured.
pub(super) fn measure(shot: &Shot, echoes: &[Echo]) -> Vec<f32> {
    let (width, height) = (shot.camera.width as usize, shot.camera.height as usize);
    let scale = (BASELINE_M * shot.camera.fx) as f32;
    let salt = shot.frame_salt;
    let slow = SlowNoise::over(width, height, 6, hash(salt ^ 1));
    let device = Device::of(width, height, shot.clip_salt);
    let mut out = vec![0f32; echoes.len()];
    for y in 0..height {
        // The projector is to the right: nearer surface further right shadows the surface left of it.
        let mut shade = f32::INFINITY;
        for x in (0..width).rev() {
            let at = y * width + x;
            let echo = &echoes[at];
            if echo.solid == NOTHING {
                continue;
            }
            let column = x as f32 - scale / echo.depth_m;
            if column >= shade {
                continue;
            }
            shade = column;
            let in_range = (NEAREST_M..Sensor::StructuredLight.range_m() as f32).contains(&echo.depth_m);
            if !in_range || !device.borders.contains(x, y) || is_lost(shot, echo, x, y) {
                continue;
            }
            let Some(depth) = beside_edge(echoes, x, y, width, height, hash(salt ^ hash(at as u64 ^ 7)))
            else {
                continue;
            };
            let warped = depth * (1.0 + DISTORTION * depth * device.warp.at(x, y));
            let noise = 0.07 * slow.at(x, y) + 0.05 * bell(hash(salt ^ hash(at as u64)));
            // Quantised to an eighth of a pixel.
            let steps = ((scale / warped + noise) * 8.0).round();
            let measured = scale * 8.0 / steps;
            if measured > 0.0 && measured < Sensor::StructuredLight.range_m() as f32 {
                out[at] = measured;
            }
        }
    }
    out
}

/// Errors that a device has in all its pictures.
struct Device {
    warp: SlowNoise,
    borders: Borders,
}

/// The part of the picture with depth, in pixels.
struct Borders {
    columns: [usize; 2],
    rows: [usize; 2],
}

impl Device {
    fn of(width: usize, height: usize, clip_salt: u64) -> Device {
        let warp = SlowNoise::over(width, height, 160, hash(clip_salt ^ 0x3a29));
        let wide = |k: usize| (BORDERS[k] * unit(hash(clip_salt ^ hash(0xb0 + k as u64)))) as usize;
        let borders = Borders { columns: [wide(0), width - wide(1)], rows: [wide(2) / 2, height - wide(2)] };
        Device { warp, borders }
    }
}

impl Borders {
    fn contains(&self, x: usize, y: usize) -> bool {
        (self.columns[0]..self.columns[1]).contains(&x) && (self.rows[0]..self.rows[1]).contains(&y)
    }
}

/// Returns whether too little light returns: dark, shiny, grazing or far surfaces.
fn is_lost(shot: &Shot, echo: &Echo, x: usize, y: usize) -> bool {
    let finish = &shot.scene.primitives[echo.solid as usize].finish;
    let bright = (finish.rgb[0] + finish.rgb[1] + finish.rgb[2]) / 3.0;
    // Returned light relative to the light needed at this distance.
    let signal = echo.facing * bright * (1.0 - 0.8 * finish.gloss) * (4.5 / echo.depth_m).min(3.0);
    let patch = hash(shot.frame_salt ^ hash((((x / 3) as u64) << 32) | (y / 3) as u64));
    // A shiny surface returns a highlight that is too bright, or throws the pattern elsewhere.
    let dazzled = unit(hash(patch ^ 5)) < 0.8 * ((finish.gloss - 0.4) / 0.6).max(0.0);
    echo.facing < 0.12 || signal < 0.12 * (0.5 + unit(patch)) || dazzled
}

/// Returns the depth of a pixel. At an edge it is missing or one of the two surfaces, and rarely between them.
fn beside_edge(echoes: &[Echo], x: usize, y: usize, width: usize, height: usize, salt: u64) -> Option<f32> {
    let depth = echoes[y * width + x].depth_m;
    let neighbours = [
        (x > 0).then(|| y * width + x - 1),
        (x + 1 < width).then_some(y * width + x + 1),
        (y > 0).then(|| (y - 1) * width + x),
        (y + 1 < height).then_some((y + 1) * width + x),
    ];
    let mut others = neighbours.into_iter().flatten().map(|at| echoes[at].depth_m);
    let Some(other) = others.find(|other| (other - depth).abs() > EDGE * depth) else { return Some(depth) };
    match unit(salt) {
        draw if draw < 0.5 => None,
        draw if draw < 0.9 || !other.is_finite() => Some(depth),
        _ => Some(depth + (other - depth) * unit(hash(salt))),
    }
}
