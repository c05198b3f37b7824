//! Candidates over the whole map: cross-correlation of rasters at all rotations (paper III-C).

use super::fft2::{Fft2, Spectrum};
use crate::align::search::Candidate;
use crate::align::{AlignError, Hit, Target};
use crate::geometry::{GridFrame, Point2, Pose2, angle_between};
use crate::progress::{self, Progress};
use rayon::prelude::*;

/// How candidates are searched.
#[derive(Debug, Clone, PartialEq)]
pub struct CorrelateParams {
    /// Side of a raster cell.
    pub cell_m: f64,
    /// Scale of the likelihood that a hit belongs to a map point, by their distance.
    pub sigma_m: f64,
    pub rotations: usize,
    /// Candidates returned (the paper's k).
    pub candidates: usize,
    /// Candidates nearer than this, and turned less than `apart_rad` from each other, are one.
    pub apart_m: f64,
    pub apart_rad: f64,
}

impl Default for CorrelateParams {
    fn default() -> Self {
        CorrelateParams {
            cell_m: 0.08,
            sigma_m: 0.10,
            rotations: 180,
            candidates: 100,
            apart_m: 0.2,
            apart_rad: 8f64.to_radians(),
        }
    }
}

/// The best poses of the whole map, best first, no two of them close.
pub fn correlate(
    hits: &[Hit],
    target: &Target,
    params: &CorrelateParams,
    progress: &dyn Progress,
) -> Result<Vec<Candidate>, AlignError> {
    let raster = Raster::new(hits, target, params);
    let total: f64 = hits.iter().map(|hit| hit.weight).sum();
    let chunk = 2 * rayon::current_num_threads().max(1);
    let mut peaks = Vec::new();
    for first in (0..params.rotations).step_by(chunk) {
        progress::check(progress)?;
        progress.advance(first as f64 / params.rotations as f64);
        let last = (first + chunk).min(params.rotations);
        let found: Vec<Vec<Candidate>> = (first..last)
            .into_par_iter()
            .map(|step| {
                let yaw_rad = step as f64 * std::f64::consts::TAU / params.rotations as f64;
                raster.peaks(hits, yaw_rad, total, params.candidates)
            })
            .collect();
        peaks.extend(found.into_iter().flatten());
    }
    // A stable sort keeps the order of rotations and cells among equals.
    peaks.sort_by(|a, b| b.score.total_cmp(&a.score));
    Ok(keep_apart(peaks, params))
}

/// Non-maximum suppression: the best of each neighbourhood.
fn keep_apart(sorted: Vec<Candidate>, params: &CorrelateParams) -> Vec<Candidate> {
    let mut kept: Vec<Candidate> = Vec::new();
    for candidate in sorted {
        if kept.len() == params.candidates {
            break;
        }
        let pose = &candidate.map_from_clip;
        let close = kept.iter().any(|k| {
            k.map_from_clip.distance_m(pose) < params.apart_m
                && angle_between(k.map_from_clip.yaw_rad, pose.yaw_rad) < params.apart_rad
        });
        if !close {
            kept.push(candidate);
        }
    }
    kept
}

/// The map's likelihood as a picture, with room for the hits to stick out on every side.
struct Raster {
    fft: Fft2,
    map: Spectrum,
    frame: GridFrame,
    /// The hits' reach from their own origin, in cells.
    reach: usize,
    /// The map's size in cells; shifts beyond it put the clip's origin outside.
    width: usize,
    height: usize,
}

impl Raster {
    fn new(hits: &[Hit], target: &Target, params: &CorrelateParams) -> Raster {
        let cell_m = params.cell_m;
        let reach_m = hits.iter().map(|hit| hit.point_m.coords.norm()).fold(0.0, f64::max);
        let reach = (reach_m / cell_m).ceil() as usize + 1;
        let field = target.field.frame();
        let max_m = [
            field.origin_m[0] + field.width as f64 * field.cell_m,
            field.origin_m[1] + field.height as f64 * field.cell_m,
        ];
        let frame = GridFrame::covering(field.origin_m, max_m, 0.0, cell_m);
        let fft = Fft2::at_least(frame.width + 2 * reach, frame.height + 2 * reach);
        let mut picture = vec![0f32; fft.width * fft.height];
        for y in 0..frame.height {
            for x in 0..frame.width {
                let distance_m = target.field.value(&frame.centre(x, y));
                let likelihood = (-0.5 * (distance_m / params.sigma_m).powi(2)).exp();
                picture[y * fft.width + x] = likelihood as f32;
            }
        }
        let map = fft.forward(&mut picture);
        Raster { map, width: frame.width, height: frame.height, frame, reach, fft }
    }

    /// Local maxima over all shifts at one rotation, the best `most` of them.
    fn peaks(&self, hits: &[Hit], yaw_rad: f64, total: f64, most: usize) -> Vec<Candidate> {
        let turn = Pose2::new(0.0, 0.0, yaw_rad);
        let mut template = vec![0f32; self.fft.width * self.fft.height];
        for hit in hits {
            // Spread over four cells, so that the score is smooth in the hit's place.
            let p = turn.apply(&hit.point_m);
            let (u, v) = (p.x / self.frame.cell_m, p.y / self.frame.cell_m);
            let (x, y) = (u.floor(), v.floor());
            for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
                let share = (1.0 - (u - x - dx).abs()) * (1.0 - (v - y - dy).abs());
                let column = (x + dx) as i64 + self.reach as i64;
                let row = (y + dy) as i64 + self.reach as i64;
                template[row as usize * self.fft.width + column as usize] += (share * hit.weight) as f32;
            }
        }
        let scores = self.fft.correlate(&self.map, self.fft.forward(&mut template));
        // The template's origin sits `reach` cells in, so shift (sx, sy) puts the clip at s + reach, cyclic.
        let score = |x: i64, y: i64| -> f32 {
            let sx = (x - self.reach as i64).rem_euclid(self.fft.width as i64) as usize;
            let sy = (y - self.reach as i64).rem_euclid(self.fft.height as i64) as usize;
            scores[sy * self.fft.width + sx]
        };
        let mut peaks = Vec::new();
        for y in 0..self.height as i64 {
            for x in 0..self.width as i64 {
                let here = score(x, y);
                if f64::from(here) < 0.2 * total {
                    continue;
                }
                let highest = (-1..=1)
                    .flat_map(|dy| (-1..=1).map(move |dx| (dx, dy)))
                    .all(|(dx, dy)| score(x + dx, y + dy) <= here);
                if highest {
                    let at: Point2 = self.frame.centre(x as usize, y as usize);
                    let map_from_clip = Pose2::new(at.x, at.y, yaw_rad);
                    peaks.push(Candidate { map_from_clip, score: f64::from(here) / total });
                }
            }
        }
        peaks.sort_by(|a, b| b.score.total_cmp(&a.score));
        peaks.truncate(most);
        peaks
    }
}
