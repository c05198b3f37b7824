//! Candidates over the whole map: normalised cross-correlation of rasters at all rotations (paper III-C).
//!
//! The score is the correlation coefficient of the two rasters under the template (OpenCV's
//! `TM_CCOEFF_NORMED`). The template is the bounding box of the rotated hits; it moves over the map's raster,
//! whose margin lets clips extend beyond the map.

use super::PaperParams;
use super::fft2::{Bench, Fft2, Spectrum};
use rayon::prelude::*;
use viola_align::AlignError;
use viola_align::Candidate;
use viola_geometry::progress::{self, Progress};
use viola_geometry::{Point2, Pose2};

/// Side of the square that a point fills, in cells.
const DILATION: usize = 5;

/// Number of candidates to refine. Candidates within `APART_M` and `APART_RAD` of a better one are
/// suppressed.
const STARTS: usize = 200;
const APART_M: f64 = 0.2;
const APART_RAD: f64 = 8f64.to_radians();

/// Bounds the memory (about 20 bytes per cell and thread); larger maps get coarser cells.
const MAX_CELLS: f64 = 32e6;

/// Returns the best poses in the map, best first, no two of them close.
pub(super) fn correlate(
    hits_m: &[Point2],
    map_m: &[Point2],
    params: &PaperParams,
    progress: &dyn Progress,
) -> Result<Vec<Candidate>, AlignError> {
    let map = MapRaster::new(hits_m, map_m, params);
    let chunk = 4 * rayon::current_num_threads().max(1);
    let mut peaks = Vec::new();
    for first in (0..params.rotations).step_by(chunk) {
        progress::check(progress)?;
        progress.advance(first as f64 / params.rotations as f64);
        let last = (first + chunk).min(params.rotations);
        let found: Vec<Vec<Candidate>> = (first..last)
            .into_par_iter()
            .map_init(
                || map.fft.bench(),
                |bench, step| {
                    let yaw_rad = step as f64 * std::f64::consts::TAU / params.rotations as f64;
                    map.peaks(hits_m, yaw_rad, bench)
                },
            )
            .collect();
        peaks.extend(found.into_iter().flatten());
    }
    // A stable sort: ties keep the order of rotations and cells.
    peaks.sort_by(|a, b| b.score.total_cmp(&a.score));
    Ok(keep_apart(peaks))
}

/// Non-maximum suppression: keeps the best of each neighbourhood.
fn keep_apart(sorted: Vec<Candidate>) -> Vec<Candidate> {
    let mut kept: Vec<Candidate> = Vec::new();
    for candidate in sorted {
        if kept.len() == STARTS {
            break;
        }
        let pose = &candidate.map_from_clip;
        let is_close = kept.iter().any(|k| k.map_from_clip.is_within(pose, APART_M, APART_RAD));
        if !is_close {
            kept.push(candidate);
        }
    }
    kept
}

/// A binary raster.
struct Raster {
    width: usize,
    height: usize,
    cells: Vec<f32>,
}

impl Raster {
    /// Fills squares of `dilation` cells around `points`, given in cells from the lower-left corner, clipped
    /// to the raster.
    fn new(width: usize, height: usize, dilation: usize, points: impl Iterator<Item = [f64; 2]>) -> Raster {
        let mut cells = vec![0f32; width * height];
        let before = dilation / 2;
        for [x, y] in points {
            let (x, y) = (x as usize, y as usize);
            let columns = x.saturating_sub(before)..(x + dilation - before).min(width);
            for row in y.saturating_sub(before)..(y + dilation - before).min(height) {
                cells[row * width..][columns.clone()].fill(1.0);
            }
        }
        Raster { width, height, cells }
    }

    fn count(&self) -> f64 {
        self.cells.iter().map(|cell| f64::from(*cell)).sum()
    }

    /// Returns the integral image: `sums[y * (width + 1) + x]` is the count of ones left of x and below y.
    fn sums(&self) -> Vec<u32> {
        let stride = self.width + 1;
        let mut sums = vec![0; stride * (self.height + 1)];
        for y in 0..self.height {
            let mut line = 0;
            for x in 0..self.width {
                line += self.cells[y * self.width + x] as u32;
                sums[(y + 1) * stride + x + 1] = sums[y * stride + x + 1] + line;
            }
        }
        sums
    }
}

struct MapRaster {
    fft: Fft2,
    spectrum: Spectrum,
    sums: Vec<u32>,
    width: usize,
    height: usize,
    /// Lower-left corner, margin included.
    corner_m: Point2,
    cell_m: f64,
}

impl MapRaster {
    fn new(hits_m: &[Point2], map_m: &[Point2], params: &PaperParams) -> MapRaster {
        let (min, max) = bounds(map_m);
        // The margin also fits templates larger than the map, at any rotation.
        let pairs = hits_m.iter().flat_map(|a| hits_m.iter().map(move |b| (a - b).norm()));
        let diameter_m = pairs.fold(0.0, f64::max);
        let margin_m = |extent_m: f64| params.margin_m + f64::max(0.0, 0.5 * (diameter_m - extent_m));
        let extent = max - min;
        let corner_m = Point2::new(min.x - margin_m(extent.x), min.y - margin_m(extent.y));
        let size_m = extent + (min - corner_m) * 2.0;
        let mut cell_m = params.cell_m;
        while size_m.x * size_m.y / (cell_m * cell_m) > MAX_CELLS {
            cell_m *= 2.0;
        }
        let cells = |length_m: f64| (length_m / cell_m) as usize + 1 + DILATION;
        let (width, height) = (cells(size_m.x), cells(size_m.y));
        let points = map_m.iter().map(|p| ((p - corner_m) / cell_m).into());
        let raster = Raster::new(width, height, DILATION, points);
        let fft = Fft2::at_least(width, height);
        let spectrum = fft.forward(&raster.cells, width);
        MapRaster { spectrum, sums: raster.sums(), width, height, corner_m, cell_m, fft }
    }

    /// Returns the best `STARTS` shifts at one rotation, at most one in each square of side `APART_M`.
    fn peaks(&self, hits_m: &[Point2], yaw_rad: f64, bench: &mut Bench) -> Vec<Candidate> {
        let turn = Pose2::new(0.0, 0.0, yaw_rad);
        let turned: Vec<Point2> = hits_m.iter().map(|hit| turn.apply(hit)).collect();
        let (min, _) = bounds(&turned);
        let template = self.template(&turned, DILATION);
        let border = (DILATION / 2) as f64;
        let square = ((APART_M / self.cell_m) as usize).max(1);
        let squares_wide = self.width / square + 1;
        let mut best = vec![Peak::NONE; squares_wide * (self.height / square + 1)];
        self.scores(&template, bench, |x, y, score| {
            let slot = &mut best[y / square * squares_wide + x / square];
            if score > slot.score {
                *slot = Peak { score, x, y };
            }
        });
        let mut peaks: Vec<Candidate> = best
            .into_iter()
            .filter(|peak| peak.score > 0.0)
            .map(|Peak { score, x, y }| {
                let at = |corner_m: f64, cells: usize, min_m: f64| {
                    corner_m + (cells as f64 + border) * self.cell_m - min_m
                };
                let (x_m, y_m) = (at(self.corner_m.x, x, min.x), at(self.corner_m.y, y, min.y));
                Candidate { map_from_clip: Pose2::new(x_m, y_m, yaw_rad), score: signed_root(score) }
            })
            .collect();
        peaks.sort_by(|a, b| b.score.total_cmp(&a.score));
        peaks.truncate(STARTS);
        peaks
    }

    /// Returns the raster of the rotated hits' bounding box, with room for the dilation.
    fn template(&self, turned_m: &[Point2], dilation: usize) -> Raster {
        let (min, max) = bounds(turned_m);
        let cells = |length_m: f64| (length_m / self.cell_m) as usize + dilation;
        let border = (dilation / 2) as f64;
        let points = turned_m
            .iter()
            .map(|p| [(p.x - min.x) / self.cell_m + border, (p.y - min.y) / self.cell_m + border]);
        Raster::new(cells(max.x - min.x), cells(max.y - min.y), dilation, points)
    }

    /// Calls `each(x, y, score)` for every shift that keeps the template on the map's raster. The score is
    /// the square of the correlation coefficient with the coefficient's sign: the order is the same, without
    /// millions of square roots.
    fn scores(&self, template: &Raster, bench: &mut Bench, mut each: impl FnMut(usize, usize, f64)) {
        let (Some(columns), Some(rows)) =
            ((self.width + 1).checked_sub(template.width), (self.height + 1).checked_sub(template.height))
        else {
            return;
        };
        let area = (template.width * template.height) as f64;
        let ones = template.count();
        let template_variance = ones - ones * ones / area;
        let stride = self.width + 1;
        self.fft.correlate(&self.spectrum, &template.cells, template.width, rows, bench, |y, both| {
            let low = &self.sums[y * stride..];
            let high = &self.sums[(y + template.height) * stride..];
            for x in 0..columns {
                let right = x + template.width;
                let under = f64::from(high[right] + low[x] - high[x] - low[right]);
                // The overlap is a number of cells, so rounding removes the transform's error.
                let common = f64::from(both[x].round());
                let covariance = common - ones * under / area;
                let variance = template_variance * (under - under * under / area);
                if variance > 0.0 {
                    each(x, y, covariance * covariance.abs() / variance);
                }
            }
        });
    }
}

#[derive(Clone, Copy)]
struct Peak {
    score: f64,
    x: usize,
    y: usize,
}

impl Peak {
    const NONE: Peak = Peak { score: 0.0, x: 0, y: 0 };
}

fn signed_root(square: f64) -> f64 {
    square.abs().sqrt().copysign(square)
}

fn bounds(points_m: &[Point2]) -> (Point2, Point2) {
    let inf = f64::INFINITY;
    points_m.iter().fold((Point2::new(inf, inf), Point2::new(-inf, -inf)), |(min, max), p| {
        (Point2::new(min.x.min(p.x), min.y.min(p.y)), Point2::new(max.x.max(p.x), max.y.max(p.y)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use viola_geometry::angle_between;

    /// Pseudo-random points with a fixed seed.
    fn scattered(count: usize, seed: u64, size_m: f64) -> Vec<Point2> {
        use rand::{RngExt, SeedableRng};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        (0..count)
            .map(|_| Point2::new(rng.random_range(0.0..size_m), rng.random_range(0.0..size_m)))
            .collect()
    }

    #[test]
    fn equals_the_definition() {
        let params = PaperParams { cell_m: 0.05, margin_m: 0.2, ..PaperParams::default() };
        let (map_m, hits_m) = (scattered(30, 1, 1.6), scattered(12, 2, 0.7));
        let map = MapRaster::new(&hits_m, &map_m, &params);
        let template = map.template(&hits_m, DILATION);
        let points = map_m.iter().map(|p| ((p - map.corner_m) / map.cell_m).into());
        let picture = Raster::new(map.width, map.height, DILATION, points);
        let mut count = 0;
        map.scores(&template, &mut map.fft.bench(), |dx, dy, score| {
            count += 1;
            let under = |i: usize| {
                let (x, y) = (dx + i % template.width, dy + i / template.width);
                f64::from(picture.cells[y * picture.width + x])
            };
            let area = template.cells.len();
            let mean_t = template.count() / area as f64;
            let mean_i = (0..area).map(under).sum::<f64>() / area as f64;
            let (mut covariance, mut variance_t, mut variance_i) = (0.0, 0.0, 0.0);
            for i in 0..area {
                let (t, p) = (f64::from(template.cells[i]) - mean_t, under(i) - mean_i);
                covariance += t * p;
                variance_t += t * t;
                variance_i += p * p;
            }
            let want = covariance / (variance_t * variance_i).sqrt();
            assert!((signed_root(score) - want).abs() < 1e-9, "{dx} {dy}: {} {want}", signed_root(score));
        });
        let shifts = (map.width + 1 - template.width) * (map.height + 1 - template.height);
        assert!(count > shifts / 2 && count <= shifts, "{count} of {shifts}");
    }

    #[test]
    fn a_part_of_the_map_is_found_where_it_was_cut() {
        let params = PaperParams { rotations: 36, ..PaperParams::default() };
        let map_m = scattered(150, 3, 4.0);
        let truth = Pose2::new(1.5, 2.0, 70f64.to_radians());
        let hits_m: Vec<Point2> =
            map_m.iter().map(|p| truth.inverse().apply(p)).filter(|p| p.coords.norm() < 1.3).collect();
        let starts = correlate(&hits_m, &map_m, &params, &viola_geometry::progress::Silent).unwrap();
        let best = &starts[0];
        assert!(best.map_from_clip.distance_m(&truth) < 0.02, "{best:?}");
        assert!(angle_between(best.map_from_clip.yaw_rad, truth.yaw_rad) < 1e-9, "{best:?}");
        assert!(best.score > 0.8 && starts.windows(2).all(|w| w[0].score >= w[1].score), "{best:?}");
    }
}
