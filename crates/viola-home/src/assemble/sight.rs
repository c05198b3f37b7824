//! What a clip's views say of a place in the map: whether it saw something there, or saw through it.

use viola_geometry::{Point3, Pose3};
use viola_reconstruct::View;

/// What one view says of a place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sight {
    /// Something is there, or the place is hidden, out of the picture or too near to tell.
    Surface,
    /// It looked through the place at something further away.
    Through,
    Unknown,
}

/// The views of a clip at its place in the map.
pub(super) struct Sights<'a> {
    views: Vec<(Pose3, &'a View)>,
}

impl<'a> Sights<'a> {
    pub fn new(views: &'a [View], map_from_clip: &Pose3) -> Sights<'a> {
        let placed = |view: &'a View| ((map_from_clip * view.clip_from_camera).inverse(), view);
        Sights { views: views.iter().map(placed).collect() }
    }

    /// How many views saw something at a place, and how many saw through it.
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

/// Readings of a thinned picture lie several centimetres apart, poses are off by a few, and depth gets worse with
/// distance: what lies within this of a reading may be what was read.
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
    // Beside an edge the reading next to it may be the one that counts: all around have to agree.
    let step = f64::from(readings.stride());
    let around = [(step, 0.0), (-step, 0.0), (0.0, step), (0.0, -step)];
    let all_through = around.iter().all(|(du, dv)| {
        readings.depth_at(pixel.x + du, pixel.y + dv).is_some_and(|read_m| read_m > depth_m + margin_m)
    });
    if read_m > depth_m && all_through { Sight::Through } else { Sight::Unknown }
}

/// Whether a later clip's views say that what an earlier one saw at a place is gone.
pub(super) fn is_gone(sights: &Sights, point_in_map: &Point3) -> bool {
    const VIEWS: usize = 2;
    let (surface, through) = sights.of(point_in_map);
    through >= VIEWS && through > 3 * surface
}
