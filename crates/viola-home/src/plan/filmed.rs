//! Fraction of a wall that clips filmed: walls that are in the LiDAR map only are drawn lighter.

use super::evidence::Evidence;
use super::model::{Opening, Wall};
use super::raster::directions_of;
use viola_geometry::{Point2, Vector2};

/// Step along a wall.
const STEP_M: f64 = 0.05;
/// Maximum distance of surface from a face of its wall, as for the coverage of the LiDAR map.
const REACH_M: f64 = 0.1;

/// Returns the fraction of a wall's length where clips saw upright surface at one of its faces: 0 to 1, rounded to thousandths.
/// Doors and passages (`ways`) count only if the wall has no other length.
pub(super) fn fraction(wall: &Wall, ways: &[Opening], evidence: &Evidence) -> f64 {
    let (from, length_m) = (Point2::from(wall.from_m), wall.length_m());
    let along = (Point2::from(wall.to_m) - from) / length_m.max(1e-9);
    let across = Vector2::new(-along.y, along.x);
    let span = |way: &Opening| {
        let offsets = [way.from_m, way.to_m].map(|end| Point2::from(end) - from);
        let [a, b] = offsets.map(|offset| offset.dot(&along));
        let half_m = wall.thickness_m.max(way.thickness_m) / 2.0;
        let is_in_wall = offsets.iter().all(|offset| offset.dot(&across).abs() <= half_m);
        is_in_wall.then(|| [a.min(b), a.max(b)])
    };
    let spans: Vec<[f64; 2]> = ways.iter().filter_map(span).collect();
    let count = ((length_m / STEP_M).round() as usize).max(1);
    let step_m = length_m / count as f64;
    let is_in_way = |step: usize| {
        let middle_m = (step as f64 + 0.5) * step_m;
        spans.iter().any(|[low_m, high_m]| (*low_m..*high_m).contains(&middle_m))
    };
    let mut steps: Vec<usize> = (0..count).filter(|step| !is_in_way(*step)).collect();
    if steps.is_empty() {
        steps = (0..count).collect();
    }

    // The raster is in the map's frame.
    let origin = evidence.map_from_plan.apply(&from);
    let [along, across] = [along, across].map(|direction| evidence.map_from_plan.rotate(&direction));
    let directions = directions_of(&across);
    let rows_m = rows_m(wall.thickness_m, evidence.cell_m());
    let samples = (step_m / evidence.cell_m()).round().max(1.0) as usize;
    let is_filmed = |step: usize| {
        (0..samples).any(|sample| {
            let along_m = (step as f64 + (sample as f64 + 0.5) / samples as f64) * step_m;
            let centre = origin + along * along_m;
            rows_m.iter().any(|row_m| evidence.has_upright(&(centre + across * *row_m), directions))
        })
    };
    let filmed = steps.iter().filter(|step| is_filmed(**step)).count();
    (filmed as f64 / steps.len() as f64 * 1e3).round() / 1e3
}

/// Returns the coordinates across a wall of the cells at its two faces.
fn rows_m(thickness_m: f64, cell_m: f64) -> Vec<f64> {
    let cells = (REACH_M / cell_m).ceil().max(1.0) as i32;
    let mut rows_m = Vec::new();
    for face_m in [-thickness_m / 2.0, thickness_m / 2.0] {
        rows_m.extend((-cells..=cells).map(|cell| face_m + f64::from(cell) / f64::from(cells) * REACH_M));
    }
    rows_m
}
