//! Main direction of a home's walls.

use super::raster::is_wall_surface;
use crate::map_point::MapPoint;
use rustc_hash::FxHashSet;
use viola_formats::lidar::LidarMap;
use viola_geometry::{Point2, Pose2, Vector2};

/// Side of the cells in which points are thinned.
const THIN_M: f64 = 0.04;
/// Points of a profile: more are thinned evenly.
const MAX_POINTS: usize = 20_000;
/// Fused wall cells that are needed; with fewer the LiDAR map's cells decide.
const MIN_FUSED: usize = 300;
/// Width of a profile's bins: exact points, and points of a raster.
const BIN_M: f64 = 0.02;
const RASTER_BIN_M: f64 = 0.06;

/// Returns the rotation of the upright plan into the map's frame: from -45 degrees on, and less than 45.
pub(super) fn map_from_plan(lidar: &LidarMap, points: &[MapPoint]) -> Pose2 {
    let mut seen = FxHashSet::default();
    let fused: Vec<Point2> = points
        .iter()
        .filter(|point| is_wall_surface(point))
        .map(|point| Point2::new(point.point.position_m[0].into(), point.point.position_m[1].into()))
        .filter(|p| seen.insert([p.x, p.y].map(|c| (c / THIN_M).floor() as i64)))
        .collect();
    let (points, bin_m) =
        if fused.len() >= MIN_FUSED { (&fused, BIN_M) } else { (&lidar.occupied_m, RASTER_BIN_M) };
    let step = points.len().div_ceil(MAX_POINTS).max(1);
    let points: Vec<Point2> = points.iter().step_by(step).copied().collect();
    let best = |degrees: &mut dyn Iterator<Item = f64>, bin_m: f64| {
        let scored = degrees.map(|degrees| (sharpness(&points, degrees.to_radians(), bin_m), degrees));
        scored
            .max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.abs().total_cmp(&a.1.abs())))
            .map_or(0.0, |best| best.1)
    };
    let coarse = best(&mut (-45..45).map(f64::from), 2.0 * bin_m);
    let fine = best(&mut (-15..=15).map(|i| coarse + f64::from(i) * 0.1), bin_m);
    // The fine search reaches beyond the coarse one; a quarter turn gives the same axes.
    let turn = (fine + 45.0).rem_euclid(90.0) - 45.0;
    Pose2::new(0.0, 0.0, turn.to_radians())
}

/// Returns the sum of the squared profiles along both axes: largest if walls fall into few bins.
fn sharpness(points: &[Point2], yaw_rad: f64, bin_m: f64) -> f64 {
    let axis = Vector2::new(yaw_rad.cos(), yaw_rad.sin());
    let profile = |axis: Vector2| {
        let at = |p: &Point2| p.coords.dot(&axis) / bin_m;
        let low = points.iter().map(at).fold(f64::INFINITY, f64::min).floor();
        let high = points.iter().map(at).fold(f64::NEG_INFINITY, f64::max);
        // Maps are bounded; a degenerate one has one bin.
        let count = if high > low { ((high - low) as usize).min(1 << 20) + 2 } else { 2 };
        let mut bins = vec![0.0f64; count];
        for point in points {
            let place = at(point) - low;
            let (bin, part) = ((place as usize).min(count - 2), place.fract());
            bins[bin] += 1.0 - part;
            bins[bin + 1] += part;
        }
        bins.iter().map(|count| count * count).sum::<f64>()
    };
    profile(axis) + profile(Vector2::new(-axis.y, axis.x))
}
