//! Corners of a picture at several sizes (Shi and Tomasi, 1994), with the depth of the nearer surface.

use crate::track::corners::{blurred, change};
use crate::track::picture::Layer;
use viola_geometry::Pinhole;

/// Side of the cells with at most one corner each, in pixels of their layer.
const CELL: usize = 8;
/// Corners kept of each layer, the finest first: coarser layers have fewer cells.
const MAX_CORNERS: [usize; 3] = [160, 80, 40];
/// Minimum change of grey around a corner, a pixel, in every direction.
const MIN_CHANGE: f32 = 0.006;
/// Maximum depth: farther patches have fewer pixels than samples.
const MAX_DEPTH_M: f32 = 5.0;

/// Blurred grey of one layer.
pub(super) struct Smooth {
    pub camera: Pinhole,
    pub grey: Vec<f32>,
}

impl Smooth {
    pub fn of(layer: &Layer) -> Smooth {
        Smooth { camera: layer.camera, grey: blurred(&layer.grey, layer.width(), layer.height()) }
    }
}

/// A corner in pixels of the finest layer.
#[derive(Debug, Clone, Copy)]
pub(super) struct Corner {
    pub u: f64,
    pub v: f64,
    pub depth_m: f64,
    pub strength: f32,
}

/// Returns the corners of all layers.
pub(super) fn corners(finest: &Layer, smooth: &[Smooth]) -> Vec<Corner> {
    let mut corners = Vec::new();
    for (level, (layer, most)) in smooth.iter().zip(MAX_CORNERS).enumerate() {
        let scale = f64::from(1 << level);
        let mut of_layer: Vec<Corner> = strongest(layer)
            .into_iter()
            .filter_map(|(strength, x, y)| {
                // Pixels have their centres at whole numbers.
                let [u, v] = [x, y].map(|c| (c as f64 + 0.5) * scale - 0.5);
                let depth_m = nearer(finest, u, v, 1 << level)?;
                Some(Corner { u, v, depth_m: f64::from(depth_m), strength })
            })
            .collect();
        of_layer.sort_by(|a, b| {
            b.strength.total_cmp(&a.strength).then(a.v.total_cmp(&b.v)).then(a.u.total_cmp(&b.u))
        });
        of_layer.truncate(most);
        corners.extend(of_layer);
    }
    corners
}

/// Returns the strongest corner of each cell: strength, column and row.
fn strongest(layer: &Smooth) -> Vec<(f32, usize, usize)> {
    const MARGIN: usize = 6;
    let (width, height) = (layer.camera.width as usize, layer.camera.height as usize);
    let mut found = Vec::new();
    for top in (MARGIN..height.saturating_sub(MARGIN)).step_by(CELL) {
        for left in (MARGIN..width.saturating_sub(MARGIN)).step_by(CELL) {
            let mut best = (MIN_CHANGE * MIN_CHANGE, 0, 0);
            for y in top..(top + CELL).min(height - MARGIN) {
                for x in left..(left + CELL).min(width - MARGIN) {
                    let strength = change(&layer.grey, width, x, y);
                    if strength > best.0 {
                        best = (strength, x, y);
                    }
                }
            }
            if best.1 > 0 {
                found.push(best);
            }
        }
    }
    found
}

/// Returns the depth of the nearest surface around a pixel: corners at an edge belong to the front.
fn nearer(layer: &Layer, u: f64, v: f64, reach: i64) -> Option<f32> {
    let (width, height) = (layer.width() as i64, layer.height() as i64);
    let (x, y) = (u.round() as i64, v.round() as i64);
    let mut nearest = f32::INFINITY;
    for y in (y - reach).max(0)..=(y + reach).min(height - 1) {
        for x in (x - reach).max(0)..=(x + reach).min(width - 1) {
            let depth_m = layer.depth_m[(y * width + x) as usize];
            if depth_m > 0.0 {
                nearest = nearest.min(depth_m);
            }
        }
    }
    (nearest <= MAX_DEPTH_M).then_some(nearest)
}
