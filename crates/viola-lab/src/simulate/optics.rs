//! Sight through glass and in mirrors.

use super::finish::Optics;
use super::render::{NOTHING, View, render, render_where};
use super::scene::{Primitive, Scene};
use viola_geometry::{Pinhole, Point3, Pose3, Vector3};

/// Maximum length of a reflected ray, in metres.
const REFLECTED_M: f64 = 20.0;

/// The first surfaces in a picture, and those behind glass.
pub(super) struct Sight {
    /// Glass is a surface here.
    pub first: View,
    /// The picture without glass; none if `first` shows no glass.
    behind: Option<View>,
}

impl Sight {
    pub fn of(scene: &Scene, camera: &Pinhole, home_from_camera: &Pose3) -> Sight {
        let first = render(scene, camera, home_from_camera);
        let glass = |&solid: &u32| solid != NOTHING && !scene.primitives[solid as usize].is_solid();
        let behind = first
            .solid
            .iter()
            .any(glass)
            .then(|| render_where(scene, camera, home_from_camera, Primitive::is_solid));
        Sight { first, behind }
    }

    /// Returns the picture without glass.
    pub fn behind(&self) -> &View {
        self.behind.as_ref().unwrap_or(&self.first)
    }
}

/// A surface seen in a mirror.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Reflected {
    /// Direction of the ray after the mirror; as long as the direction before it.
    pub direction: Vector3,
    /// Distance from the mirror, in units of the direction.
    pub distance: f64,
    pub solid: usize,
}

/// Returns what a mirror shows at a point of its surface. `ray` arrives there; glass is transparent.
pub(super) fn reflect(scene: &Scene, mirror: usize, point: &Point3, ray: &Vector3) -> Option<Reflected> {
    let normal = scene.normal(mirror, point);
    let direction = ray - normal * (2.0 * normal.dot(ray));
    let counts = |primitive: &Primitive| primitive.is_solid() && primitive.finish.optics != Optics::Mirror;
    let hit = scene.cast_where(point, &direction, REFLECTED_M / ray.norm(), counts)?;
    Some(Reflected { direction, distance: hit.distance, solid: hit.solid })
}
