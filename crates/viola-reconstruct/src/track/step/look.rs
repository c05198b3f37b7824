//! Samples a frame at a key frame's points, and sums up the normal equations of the pose.

use super::state::State;
use super::sums::Sums;
use crate::track::picture::Layer;
use crate::track::reference::{Group, LANES, Lanes};
use rayon::prelude::*;

/// Groups for one thread. Fixed, so that sums do not depend on the number of threads.
const CHUNK: usize = 256;
/// Degrees of freedom of the t-distribution (Kerl et al.).
const FREEDOM: f32 = 5.0;

/// Returns the sums over all points of a layer.
pub(super) fn sum(groups: &[Group], layer: &Layer, state: &State, gate: f32) -> Sums {
    let look = Look::new(layer, state, gate);
    let parts: Vec<Sums> = groups.par_chunks(CHUNK).map(|chunk| look.sum(chunk)).collect();
    let mut sums = Sums::ZERO;
    parts.iter().for_each(|part| sums.add(part));
    sums
}

/// Constants for all points of a step.
struct Look<'a> {
    layer: &'a Layer,
    turn: [[f32; 3]; 3],
    shift: [f32; 3],
    focal: [f32; 2],
    centre: [f32; 2],
    gain: f32,
    offset: f32,
    gate: f32,
    /// Inverse of the squared spreads.
    grey_scale: f32,
    depth_scale: f32,
}

/// Samples of the frame at eight points.
struct Found {
    /// Offset of each reading from its point, in the camera's frame.
    gap_m: [Lanes; 3],
    grey: Lanes,
    seen: Lanes,
    has_grey: Lanes,
    has_depth: Lanes,
}

impl<'a> Look<'a> {
    fn new(layer: &'a Layer, state: &State, gate: f32) -> Look<'a> {
        let turn = state.camera_from_key.rotation.to_rotation_matrix();
        let shift = state.camera_from_key.translation.vector;
        let camera = &layer.camera;
        Look {
            layer,
            turn: std::array::from_fn(|r| std::array::from_fn(|c| turn[(r, c)] as f32)),
            shift: std::array::from_fn(|i| shift[i] as f32),
            focal: [camera.fx as f32, camera.fy as f32],
            centre: [camera.cx as f32, camera.cy as f32],
            gain: state.gain as f32,
            offset: state.offset as f32,
            gate,
            grey_scale: (1.0 / (state.grey_sigma * state.grey_sigma)) as f32,
            depth_scale: (1.0 / (state.depth_sigma * state.depth_sigma)) as f32,
        }
    }

    fn find(&self, group: &Group) -> Found {
        let [[a, b, c], [d, e, f], [g, h, i]] = self.turn;
        let (mut x, mut y, mut z) = ([0f32; LANES], [0f32; LANES], [0f32; LANES]);
        let (mut u, mut v) = ([0f32; LANES], [0f32; LANES]);
        for l in 0..LANES {
            let [px, py, pz] = [group.point_m[0][l], group.point_m[1][l], group.point_m[2][l]];
            x[l] = a * px + b * py + c * pz + self.shift[0];
            y[l] = d * px + e * py + f * pz + self.shift[1];
            z[l] = g * px + h * py + i * pz + self.shift[2];
            let inverse = 1.0 / z[l];
            u[l] = self.focal[0] * x[l] * inverse + self.centre[0];
            v[l] = self.focal[1] * y[l] * inverse + self.centre[1];
        }
        let width = self.layer.width();
        let (right, bottom) = (width as f32 - 1.0, self.layer.height() as f32 - 1.0);
        let mut found = Found {
            gap_m: [[0.0; LANES]; 3],
            grey: [0.0; LANES],
            seen: [0.0; LANES],
            has_grey: [0.0; LANES],
            has_depth: [0.0; LANES],
        };
        for l in 0..LANES {
            let is_inside = z[l] > 0.1
                && group.point_m[2][l] > 0.0
                && u[l] >= 0.0
                && v[l] >= 0.0
                && u[l] < right
                && v[l] < bottom;
            if !is_inside {
                continue;
            }
            found.seen[l] = 1.0;
            let (x0, y0) = (u[l] as usize, v[l] as usize);
            let first = y0 * width + x0;
            let nearest = (v[l] + 0.5) as usize * width + (u[l] + 0.5) as usize;
            let depth_m = self.layer.depth_m[nearest];
            let gap_m = depth_m - z[l];
            let is_near = gap_m.abs() < self.gate * z[l];
            if depth_m > 0.0 {
                if !is_near {
                    continue;
                }
                // The reading lies on the ray of its own pixel, not of the point's.
                let ray_x = ((u[l] + 0.5).floor() - self.centre[0]) / self.focal[0];
                let ray_y = ((v[l] + 0.5).floor() - self.centre[1]) / self.focal[1];
                found.has_depth[l] = 1.0;
                found.gap_m[0][l] = ray_x * depth_m - x[l];
                found.gap_m[1][l] = ray_y * depth_m - y[l];
                found.gap_m[2][l] = gap_m;
            }
            let (fu, fv) = (u[l] - x0 as f32, v[l] - y0 as f32);
            let grey = &self.layer.grey;
            let top = grey[first] + fu * (grey[first + 1] - grey[first]);
            let low = grey[first + width] + fu * (grey[first + width + 1] - grey[first + width]);
            let value = top + fv * (low - top);
            if value.is_finite() {
                found.grey[l] = value;
                found.has_grey[l] = group.has_slope[l];
            }
        }
        found
    }

    fn sum(&self, groups: &[Group]) -> Sums {
        let mut squares = [[0f32; LANES]; 36];
        let mut gradient = [[0f32; LANES]; 8];
        let mut counts = [[0f32; LANES]; 6];
        for group in groups {
            let errors = self.errors(group, &mut counts);
            errors.add_to(group, &mut squares, &mut gradient);
        }
        let total = |lanes: &Lanes| lanes.iter().map(|value| f64::from(*value)).sum::<f64>();
        Sums {
            squares: std::array::from_fn(|k| total(&squares[k])),
            gradient: std::array::from_fn(|k| total(&gradient[k])),
            seen: total(&counts[0]),
            agree: total(&counts[1]),
            grey: [total(&counts[2]), total(&counts[3])],
            depth: [total(&counts[4]), total(&counts[5])],
        }
    }

    /// Returns the errors of eight points, with their weights and slopes, and adds to `counts`.
    #[inline]
    fn errors(&self, group: &Group, counts: &mut [Lanes; 6]) -> Errors {
        let [[a, b, c], [d, e, f], [g, h, i]] = self.turn;
        let mut errors = Errors::default();
        let found = self.find(group);
        let Errors { grey_error, grey_weight, depth_error, depth_weight, by_grey, by_depth } = &mut errors;
        for l in 0..LANES {
            let (x, y, z) = (group.point_m[0][l], group.point_m[1][l], group.point_m[2][l]);
            let (nx, ny, nz) = (group.normal[0][l], group.normal[1][l], group.normal[2][l]);
            let (sx, sy, sz) = (group.slope[0][l], group.slope[1][l], group.slope[2][l]);
            let sharp = group.sharpness[l];
            // The gap along the normal, rotated into the camera's frame.
            let along = (a * nx + b * ny + c * nz) * found.gap_m[0][l]
                + (d * nx + e * ny + f * nz) * found.gap_m[1][l]
                + (g * nx + h * ny + i * nz) * found.gap_m[2][l];
            depth_error[l] = along * sharp;
            grey_error[l] = (found.grey[l] - self.gain * group.grey[l] - self.offset) * found.has_grey[l];
            let t = |squared: f32| (FREEDOM + 1.0) / (FREEDOM + squared);
            let is_sharp = if sharp > 0.0 { found.has_depth[l] } else { 0.0 };
            let in_sigmas = depth_error[l] * depth_error[l] * self.depth_scale;
            let robust = t(in_sigmas) * is_sharp;
            depth_weight[l] = robust * self.depth_scale;
            let grey_robust = t(grey_error[l] * grey_error[l] * self.grey_scale) * found.has_grey[l];
            grey_weight[l] = grey_robust * self.grey_scale;
            by_depth[0][l] = -nx * sharp;
            by_depth[1][l] = -ny * sharp;
            by_depth[2][l] = -nz * sharp;
            by_depth[3][l] = -(y * nz - z * ny) * sharp;
            by_depth[4][l] = -(z * nx - x * nz) * sharp;
            by_depth[5][l] = -(x * ny - y * nx) * sharp;
            by_grey[0][l] = sx * self.gain;
            by_grey[1][l] = sy * self.gain;
            by_grey[2][l] = sz * self.gain;
            by_grey[3][l] = (y * sz - z * sy) * self.gain;
            by_grey[4][l] = (z * sx - x * sz) * self.gain;
            by_grey[5][l] = (x * sy - y * sx) * self.gain;
            counts[0][l] += found.seen[l];
            counts[1][l] += if in_sigmas < 9.0 { found.has_depth[l] } else { 0.0 };
            counts[2][l] += grey_robust * grey_error[l] * grey_error[l];
            counts[3][l] += found.has_grey[l];
            counts[4][l] += robust * depth_error[l] * depth_error[l];
            counts[5][l] += is_sharp;
        }
        errors
    }
}

/// Errors of eight points, with their weights and their slopes by the pose.
#[derive(Default)]
struct Errors {
    grey_error: Lanes,
    grey_weight: Lanes,
    depth_error: Lanes,
    depth_weight: Lanes,
    by_grey: [Lanes; 6],
    by_depth: [Lanes; 6],
}

impl Errors {
    /// Adds the products of the slopes and the errors to the normal equations.
    #[inline]
    fn add_to(&self, group: &Group, squares: &mut [Lanes; 36], gradient: &mut [Lanes; 8]) {
        let Errors { grey_error, grey_weight, depth_error, depth_weight, by_grey, by_depth } = self;
        let mut k = 0;
        for row in 0..6 {
            let (mut weighted_grey, mut weighted_depth) = ([0f32; LANES], [0f32; LANES]);
            for l in 0..LANES {
                weighted_grey[l] = grey_weight[l] * by_grey[row][l];
                weighted_depth[l] = depth_weight[l] * by_depth[row][l];
            }
            for column in row..6 {
                for l in 0..LANES {
                    squares[k][l] +=
                        weighted_grey[l] * by_grey[column][l] + weighted_depth[l] * by_depth[column][l];
                }
                k += 1;
            }
            for l in 0..LANES {
                gradient[row][l] += weighted_grey[l] * grey_error[l] + weighted_depth[l] * depth_error[l];
                squares[21 + row][l] -= weighted_grey[l] * group.grey[l];
                squares[27 + row][l] -= weighted_grey[l];
            }
        }
        for l in 0..LANES {
            let weighted = grey_weight[l] * group.grey[l];
            squares[33][l] += weighted * group.grey[l];
            squares[34][l] += weighted;
            squares[35][l] += grey_weight[l];
            gradient[6][l] -= weighted * grey_error[l];
            gradient[7][l] -= grey_weight[l] * grey_error[l];
        }
    }
}
