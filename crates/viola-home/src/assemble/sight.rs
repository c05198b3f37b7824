//! Observations of a map point by a clip's views: surface seen there, or seen through.

use viola_geometry::{Point3, Pose3};
use viola_reconstruct::View;

/// Observation of a place by one view.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sight {
    /// The view measured a surface at the place.
    Surface,
    /// The view measured a surface behind the place.
    Through,
    Unknown,
}

/// Views of a placed clip.
pub(super) struct Sights<'a> {
    views: Vec<(Pose3, &'a View)>,
}

impl<'a> Sights<'a> {
    pub fn new(views: &'a [View], map_from_clip: &Pose3) -> Sights<'a> {
        let placed = |view: &'a View| ((map_from_clip * view.clip_from_camera).inverse(), view);
        Sights { views: views.iter().map(placed).collect() }
    }

    /// Returns the numbers of views that saw a surface at a point, and that saw through it.
    pub fn of(&self, point_in_map: &Point3) -> (usize, usize) {
        let (mut surface, mut through) = (0, 0);
        for (camera_from_map, view) in &self.views {
            match sight(view, &(camera_from_map * point_in_map)) {
                Sight::Surface => surface += 1,
                Sight::Through => through += 1,
                Sight::Unknown => {}
            }
        }
        (surface, through)
    }
}

/// Tolerance of a depth comparison: thinned readings lie several centimetres apart, poses err by a few, and
/// depth errors grow with distance.
fn margin_m(depth_m: f64) -> f64 {
    0.12 + 0.03 * depth_m
}

fn sight(view: &View, point_in_camera: &Point3) -> Sight {
    const NEAREST_M: f64 = 0.3;
    let depth_m = point_in_camera.z;
    if depth_m < NEAREST_M {
        return Sight::Unknown;
    }
    let readings = &view.readings;
    let Some(pixel) = readings.camera().project(point_in_camera) else { return Sight::Unknown };
    let Some(read_m) = readings.depth_at(pixel.x, pixel.y) else { return Sight::Unknown };
    let margin_m = margin_m(depth_m);
    if (read_m - depth_m).abs() < margin_m {
        return Sight::Surface;
    }
    // At a depth edge the adjacent reading may be the right one: all four must agree.
    let step = f64::from(readings.stride());
    let around = [(step, 0.0), (-step, 0.0), (0.0, step), (0.0, -step)];
    let all_through = around.iter().all(|(du, dv)| {
        readings.depth_at(pixel.x + du, pixel.y + dv).is_some_and(|read_m| read_m > depth_m + margin_m)
    });
    if read_m > depth_m && all_through { Sight::Through } else { Sight::Unknown }
}

/// Returns whether a later clip's views saw through a point of an earlier clip.
pub(super) fn is_gone(sights: &Sights, point_in_map: &Point3) -> bool {
    const VIEWS: usize = 2;
    let (surface, through) = sights.of(point_in_map);
    through >= VIEWS && through > 3 * surface
}
