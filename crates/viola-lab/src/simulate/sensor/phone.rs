//! A phone's LiDAR: few laser dots, interpolated along the colour picture, with a confidence.

use super::Sensor;
use super::noise::SlowNoise;
use crate::simulate::echo::{Echo, Shot};
use crate::simulate::rng::{bell, hash};
use viola_geometry::Pinhole;

/// Difference of adjacent depths at an edge, as a fraction of the depth.
const EDGE: f32 = 0.08;
/// Standard deviation of the device's error of scale.
const SCALE: f32 = 0.003;

/// Returns the depth in metres, 0 where nothing was measured. Readings of low confidence are dropped, as
/// the readers of clips do.
pub(super) fn measure(shot: &Shot, echoes: &[Echo]) -> Vec<f32> {
    let Pinhole { width, height, .. } = *shot.camera;
    let (width, height) = (width as usize, height as usize);
    let salt = shot.frame_salt;
    let slow = SlowNoise::over(width, height, 10, hash(salt ^ 1));
    let trust = SlowNoise::over(width, height, 7, hash(salt ^ 2));
    let scale = 1.0 + SCALE * bell(hash(shot.clip_salt ^ 0x5ca1e));
    let mut out = vec![0f32; echoes.len()];
    for y in 0..height {
        for x in 0..width {
            let at = y * width + x;
            let echo = &echoes[at];
            if !echo.depth_m.is_finite() {
                continue;
            }
            let around = Around::of(echoes, x, y, width, height);
            if doubt(shot, echo, &around) > 0.6 + 0.22 * trust.at(x, y) {
                continue;
            }
            let depth = around.interpolated(echo.depth_m);
            let noise = 0.008 * slow.at(x, y) + 0.002 * bell(hash(salt ^ hash(at as u64)));
            let measured = depth * scale * (1.0 + noise) + 0.001 * noise.signum();
            if measured < Sensor::PhoneLidar.range_m() as f32 {
                out[at] = measured.max(0.0);
            }
        }
    }
    out
}

/// Depths of the 3 x 3 pixels around one.
struct Around {
    mean: f32,
    is_edge: bool,
}

impl Around {
    fn of(echoes: &[Echo], x: usize, y: usize, width: usize, height: usize) -> Around {
        let depth = echoes[y * width + x].depth_m;
        let (mut sum, mut count, mut low, mut high) = (0f32, 0f32, depth, depth);
        for row in y.saturating_sub(1)..(y + 2).min(height) {
            for echo in &echoes[row * width + x.saturating_sub(1)..row * width + (x + 2).min(width)] {
                if echo.depth_m.is_finite() {
                    sum += echo.depth_m;
                    count += 1.0;
                    low = low.min(echo.depth_m);
                    high = high.max(echo.depth_m);
                }
            }
        }
        Around { mean: sum / count, is_edge: high - low > EDGE * depth }
    }

    /// Returns a depth between foreground and background at an edge: the phone interpolates few laser dots.
    fn interpolated(&self, depth: f32) -> f32 {
        if self.is_edge { 0.4 * depth + 0.6 * self.mean } else { depth }
    }
}

/// Returns the doubt in a reading; the higher, the lower its confidence.
fn doubt(shot: &Shot, echo: &Echo, around: &Around) -> f32 {
    let finish = &shot.scene.primitives[echo.solid as usize].finish;
    let bright = (finish.rgb[0] + finish.rgb[1] + finish.rgb[2]) / 3.0;
    let edge = if around.is_edge { 0.5 } else { 0.0 };
    let stray = if echo.strayed { 0.35 } else { 0.0 };
    let grazing = 0.6 * ((0.3 - echo.facing) / 0.3).max(0.0);
    let far = 0.45 * ((echo.depth_m - 3.5) / 1.5).max(0.0);
    let dark = 0.4 * ((0.15 - bright) / 0.15).max(0.0) * (echo.depth_m / 3.0).min(1.0);
    let shiny = 0.35 * ((finish.gloss - 0.4) / 0.6).max(0.0);
    edge + stray + grazing + far + dark + shiny
}
