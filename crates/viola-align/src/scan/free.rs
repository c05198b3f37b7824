//! Free space: cells through which the camera's readings passed at the vacuum's height.

use super::hit::{FREE_CELL_M, RaycastParams};
use rustc_hash::FxHashMap;
use viola_geometry::{Point2, Pose3, cell_of};
use viola_reconstruct::KeyFrame;

/// Returns the cells that the cameras' rays crossed near the vacuum's height before their hits.
pub(super) fn free_cells(
    key_frames: &[KeyFrame],
    clip_from_world: &Pose3,
    params: &RaycastParams,
) -> Vec<Point2> {
    // Below half the height the floor's noise would count, above one and a half a low table would.
    let height_m = params.vacuum_height_m - params.floor_m;
    let (low, high) = (params.floor_m + 0.5 * height_m, params.floor_m + 1.5 * height_m);
    let cell_m = FREE_CELL_M;
    let mut counts: FxHashMap<[i32; 2], u32> = FxHashMap::default();
    for key in key_frames {
        let clip_from_camera = clip_from_world * key.world_from_camera;
        let from = clip_from_camera.translation.vector;
        for point in key.readings.points_in_camera() {
            let to = (clip_from_camera * point).coords;
            // Fraction of the way at which the ray enters and leaves the layer; it must fall through it.
            if from.z <= high || to.z >= high {
                continue;
            }
            let at = |z: f64| (from.z - z) / (from.z - to.z);
            // Stop short of the hit: it is a surface, not free space.
            let short = 1.0 - 0.05 / (to - from).norm();
            let (enter, leave) = (at(high), at(low).min(short));
            if leave <= enter {
                continue;
            }
            let (a, b) = (from + (to - from) * enter, from + (to - from) * leave);
            let steps = ((b - a).xy().norm() / cell_m).ceil().max(1.0);
            let mut last = None;
            for step in 0..=steps as usize {
                let p = a + (b - a) * (step as f64 / steps);
                let cell = cell_of(&Point2::from(p.xy()), cell_m);
                if last != Some(cell) {
                    *counts.entry(cell).or_default() += 1;
                    last = Some(cell);
                }
            }
        }
    }
    // One ray may be a flying pixel at an edge.
    let mut cells: Vec<[i32; 2]> =
        counts.into_iter().filter(|(_, n)| *n >= 2).map(|(cell, _)| cell).collect();
    cells.sort_unstable();
    cells
        .into_iter()
        .map(|[x, y]| Point2::new((f64::from(x) + 0.5) * cell_m, (f64::from(y) + 0.5) * cell_m))
        .collect()
}
