//! The reference of an alignment: points of a key frame with their normals and grey slopes.

use super::picture::{Layer, Pyramid};
use rayon::prelude::*;

/// Number of points in a group, so that the compiler can vectorise.
pub(super) const LANES: usize = 8;
pub(super) type Lanes = [f32; LANES];

/// Neighbours whose depth differs by more than this fraction belong to another surface ...
const JUMP: f32 = 0.25;
/// ... and so do neighbours further from the fitted plane than this fraction of their depth.
const OFF_PLANE: f32 = 0.015;
/// Minimum grey slope, a pixel, of points whose grey is used.
const PLAIN: f32 = 0.012;
/// Pixels to each side that a point's normal is fitted to, the finest layer first, because depth errors are
/// correlated over several pixels. The fallback is fewer pixels if these are not of one surface.
const REACH: [usize; 4] = [4, 3, 2, 1];
/// Stride in columns and rows of the finest layer's points without grey slope.
const EVERY: usize = 2;

/// Eight points in the key frame's camera frame. Missing values are zero.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Group {
    pub point_m: [Lanes; 3],
    /// Unit length.
    pub normal: [Lanes; 3],
    /// Gradient of the grey by the point's position, a metre.
    pub slope: [Lanes; 3],
    pub grey: Lanes,
    /// Inverse of the expected depth error, a metre; 0 at grazing angles.
    pub sharpness: Lanes,
    /// 1 if the grey is used.
    pub has_slope: Lanes,
}

#[derive(Debug, Clone)]
pub(super) struct Reference {
    /// The finest first, as in the frame's [`Pyramid`].
    pub layers: Vec<Vec<Group>>,
    /// Points in each layer.
    pub counts: Vec<usize>,
    pub median_depth_m: f32,
}

/// Returns the expected depth error, which grows with the range for all sensors. Its scale is estimated for
/// each frame.
pub(super) fn expected_error_m(depth_m: f32) -> f32 {
    0.001 + 0.002 * depth_m + 0.001 * depth_m * depth_m
}

impl Reference {
    pub fn new(pyramid: &Pyramid) -> Reference {
        let layers: Vec<Vec<Point>> = pyramid
            .layers
            .iter()
            .enumerate()
            .map(|(i, layer)| points(layer, if i == 0 { EVERY } else { 1 }, REACH[i.min(REACH.len() - 1)]))
            .collect();
        let counts = layers.iter().map(Vec::len).collect();
        let coarsest = pyramid.layers.last().map_or(&[][..], |layer| &layer.depth_m);
        let mut depths: Vec<f32> = coarsest.iter().copied().filter(|depth| *depth > 0.0).collect();
        depths.sort_by(f32::total_cmp);
        let median_depth_m = depths.get(depths.len() / 2).copied().unwrap_or(0.0);
        Reference { layers: layers.iter().map(|points| group(points)).collect(), counts, median_depth_m }
    }
}

#[derive(Clone, Copy)]
struct Point {
    point_m: [f32; 3],
    normal: [f32; 3],
    slope: [f32; 3],
    grey: f32,
    sharpness: f32,
    has_slope: f32,
}

fn group(points: &[Point]) -> Vec<Group> {
    points
        .chunks(LANES)
        .map(|chunk| {
            let mut group = Group::default();
            // Lanes without a point are behind the camera, where nothing is seen.
            group.point_m[2] = [-1.0; LANES];
            for (lane, point) in chunk.iter().enumerate() {
                for axis in 0..3 {
                    group.point_m[axis][lane] = point.point_m[axis];
                    group.normal[axis][lane] = point.normal[axis];
                    group.slope[axis][lane] = point.slope[axis];
                }
                group.grey[lane] = point.grey;
                group.sharpness[lane] = point.sharpness;
                group.has_slope[lane] = point.has_slope;
            }
            group
        })
        .collect()
}

/// Returns the usable points of a layer, row by row.
fn points(layer: &Layer, every: usize, reach: usize) -> Vec<Point> {
    let (width, height) = (layer.width(), layer.height());
    let rows: Vec<Vec<Point>> = (1..height.saturating_sub(1))
        .into_par_iter()
        .map(|y| {
            let mut row = Vec::new();
            for x in 1..width.saturating_sub(1) {
                let (dx, dy) = grey_slope(layer, x, y);
                let is_sloped = dx.hypot(dy) > PLAIN;
                if (is_sloped || (x % every == 0 && y % every == 0))
                    && let Some(point) = point(layer, x, y, reach, is_sloped.then_some((dx, dy)))
                {
                    row.push(point);
                }
            }
            row
        })
        .collect();
    rows.concat()
}

/// Returns the slope of grey, a pixel, to the right and down; zero if unknown.
fn grey_slope(layer: &Layer, x: usize, y: usize) -> (f32, f32) {
    let at = |dx: usize, dy: usize| layer.grey[(y + dy - 1) * layer.width() + x + dx - 1];
    // Scharr's weights.
    let across = |dy: usize| at(2, dy) - at(0, dy);
    let down = |dx: usize| at(dx, 2) - at(dx, 0);
    let dx = (3.0 * across(0) + 10.0 * across(1) + 3.0 * across(2)) / 32.0;
    let dy = (3.0 * down(0) + 10.0 * down(1) + 3.0 * down(2)) / 32.0;
    if dx.is_finite() && dy.is_finite() { (dx, dy) } else { (0.0, 0.0) }
}

/// Returns the plane of inverse depth around a pixel: its middle value, and its slopes right and down; `None`
/// if the pixels within `reach` are not of one surface. Inverse depth is linear over the picture of a plane.
fn inverse_plane(layer: &Layer, x: usize, y: usize, reach: usize) -> Option<[f32; 3]> {
    let width = layer.width();
    if x < reach || y < reach || x + reach >= width || y + reach >= layer.height() {
        return None;
    }
    let middle_m = layer.depth_m[y * width + x];
    if middle_m <= 0.0 {
        return None;
    }
    let (mut sum, mut by_x, mut by_y) = (0.0, 0.0, 0.0);
    for row in 0..=2 * reach {
        let first = (y + row - reach) * width + x - reach;
        for (column, &depth_m) in layer.depth_m[first..=first + 2 * reach].iter().enumerate() {
            if (depth_m - middle_m).abs() > JUMP * middle_m {
                return None;
            }
            let inverse = 1.0 / depth_m;
            sum += inverse;
            by_x += inverse * (column as f32 - reach as f32);
            by_y += inverse * (row as f32 - reach as f32);
        }
    }
    let side = (2 * reach + 1) as f32;
    let squares: f32 = (1..=reach).map(|k| 2.0 * (k * k) as f32).sum();
    let [middle, by_x, by_y] = [sum / (side * side), by_x / (squares * side), by_y / (squares * side)];
    for row in 0..=2 * reach {
        let first = (y + row - reach) * width + x - reach;
        for (column, &depth_m) in layer.depth_m[first..=first + 2 * reach].iter().enumerate() {
            let plane = middle + by_x * (column as f32 - reach as f32) + by_y * (row as f32 - reach as f32);
            if (depth_m * plane - 1.0).abs() > OFF_PLANE {
                return None;
            }
        }
    }
    Some([middle, by_x, by_y])
}

/// Returns a point with its normal, and its grey slope if there is one; `None` without a normal.
fn point(layer: &Layer, x: usize, y: usize, reach: usize, grey_slope: Option<(f32, f32)>) -> Option<Point> {
    let camera = &layer.camera;
    let mut reaches = (1..=reach).rev().step_by(2);
    let [inverse, by_x, by_y] = reaches.find_map(|reach| inverse_plane(layer, x, y, reach))?;
    let depth_m = 1.0 / inverse;
    let (fx, fy) = (camera.fx as f32, camera.fy as f32);
    let (right, down) = (x as f32 - camera.cx as f32, y as f32 - camera.cy as f32);
    let point_m = [right / fx * depth_m, down / fy * depth_m, depth_m];
    // If 1/z = a u + b v + c, the plane is a fx X + b fy Y + (a cx + b cy + c) Z = 1.
    let across = [by_x * fx, by_y * fy, inverse - by_x * right - by_y * down];
    let length = across.iter().map(|c| c * c).sum::<f32>().sqrt();
    if !(length > 0.0 && length.is_finite()) {
        return None;
    }
    let normal = across.map(|c| -c / length);
    let range_m = point_m.iter().map(|c| c * c).sum::<f32>().sqrt();
    let facing = -(0..3).map(|i| normal[i] * point_m[i]).sum::<f32>() / range_m;
    // At grazing angles, depth is unreliable.
    let sharpness = if facing > 0.15 { 1.0 / expected_error_m(depth_m) } else { 0.0 };
    let slope = grey_slope.map_or([0.0; 3], |(dx, dy)| {
        let (gx, gy) = (dx * fx / depth_m, dy * fy / depth_m);
        [gx, gy, -(gx * point_m[0] + gy * point_m[1]) / depth_m]
    });
    let has_slope = if grey_slope.is_some() { 1.0 } else { 0.0 };
    let grey = layer.grey[y * layer.width() + x];
    let grey = if grey.is_finite() { grey } else { 0.0 };
    Some(Point { point_m, normal, slope, grey, sharpness, has_slope })
}
