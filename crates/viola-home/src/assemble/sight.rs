//! Observations of a map point by a clip's views: surface seen there, or seen through.

use viola_geometry::{Point3, Pose3};
use viola_reconstruct as reconstruct;

/// Observation of a place by one view.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Sight {
    /// The view measured a surface at the place.
    Surface,
    /// The view measured a surface behind the place.
    Through,
    Unknown,
}

/// A placed view.
pub(crate) struct View<'a> {
    map_from_camera: Pose3,
    camera_from_map: Pose3,
    view: &'a reconstruct::View,
}

/// Views of a placed clip.
pub(super) struct Sights<'a> {
    views: Vec<View<'a>>,
}

impl<'a> Sights<'a> {
    pub fn new(views: &'a [reconstruct::View], map_from_clip: &Pose3) -> Sights<'a> {
        Sights { views: views.iter().map(|view| View::new(view, map_from_clip)).collect() }
    }

    /// Returns the numbers of views that saw a surface at a point, and that saw through it.
    pub fn of(&self, point_in_map: &Point3) -> (usize, usize) {
        let (mut surface, mut through) = (0, 0);
        for view in &self.views {
            match view.sight(point_in_map, 0.0, margin_m) {
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

/// The same within one clip, whose poses hardly err against each other.
fn own_margin_m(depth_m: f64) -> f64 {
    0.5 * margin_m(depth_m)
}

impl<'a> View<'a> {
    pub fn new(view: &'a reconstruct::View, map_from_clip: &Pose3) -> View<'a> {
        let map_from_camera = map_from_clip * view.clip_from_camera;
        View { map_from_camera, camera_from_map: map_from_camera.inverse(), view }
    }

    /// Returns the camera's position in the map.
    pub fn eye_m(&self) -> Point3 {
        self.map_from_camera.translation.vector.into()
    }

    /// Returns the measured points in the map.
    pub fn hits_m(&self) -> impl Iterator<Item = Point3> {
        self.view.readings.points_in_camera().map(|point| self.map_from_camera * point)
    }

    /// Returns the observation of the ball of `radius_m` around a point by a view of the same clip. It was looked
    /// through only if the rays past its edge were, too: a ball on the floor is not.
    pub fn own_sight(&self, point_in_clip: &Point3, radius_m: f64) -> Sight {
        self.sight(point_in_clip, radius_m, own_margin_m)
    }

    fn sight(&self, point_in_map: &Point3, radius_m: f64, margin_m: fn(f64) -> f64) -> Sight {
        const NEAREST_M: f64 = 0.3;
        let point_in_camera = self.camera_from_map * point_in_map;
        let depth_m = point_in_camera.z;
        if depth_m < NEAREST_M {
            return Sight::Unknown;
        }
        let readings = &self.view.readings;
        let Some(pixel) = readings.camera().project(&point_in_camera) else { return Sight::Unknown };
        let Some(read_m) = readings.depth_at(pixel.x, pixel.y) else { return Sight::Unknown };
        let margin_m = margin_m(depth_m);
        if (read_m - depth_m).abs() < margin_m {
            return Sight::Surface;
        }
        if read_m < depth_m {
            return Sight::Unknown;
        }
        // At a depth edge the adjacent reading may be the right one: all four must agree.
        let stride = f64::from(readings.stride());
        let across = (radius_m * readings.camera().fx / depth_m).max(stride);
        let down = (radius_m * readings.camera().fy / depth_m).max(stride);
        let around = [(across, 0.0), (-across, 0.0), (0.0, down), (0.0, -down)];
        let all_through = around.iter().all(|(du, dv)| {
            readings.depth_at(pixel.x + du, pixel.y + dv).is_some_and(|read_m| read_m > depth_m + margin_m)
        });
        if all_through { Sight::Through } else { Sight::Unknown }
    }
}
