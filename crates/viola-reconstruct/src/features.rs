//! Local features of a clip: upright patches of surface, by which two clips recognise the same place.
//!
//! A feature is a corner with depth. Its patch has a fixed size in metres, stands upright, and faces as the
//! surface does, so its description depends little on the camera's distance, roll and direction.

mod corners;
mod descriptor;
mod distinct;
mod patch;

pub use descriptor::{DESCRIPTOR_BYTES, Descriptor};

use crate::track::picture::{Layer, Pyramid};
use rayon::prelude::*;
use viola_formats::clip::Frame;
use viola_geometry::{Point3, Pose3};

/// Maximum number of features of a clip.
pub const MAX_FEATURES: usize = 400;
/// Key frames of a clip that are searched, evenly spread.
pub const MAX_PICTURES: usize = 24;

/// A described place of a clip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Feature {
    /// In the clip's frame.
    pub position_m: [f32; 3],
    /// Angle about z of the direction that the patch faces, in the clip's frame.
    pub heading_rad: f32,
    pub descriptor: Descriptor,
}

impl Feature {
    pub fn position(&self) -> Point3 {
        Point3::from(self.position_m.map(f64::from))
    }

    /// Returns the feature in a frame whose floor is lower by `rise_m`.
    pub fn raised(mut self, rise_m: f64) -> Feature {
        self.position_m[2] += rise_m as f32;
        self
    }
}

/// Grey and depth of a key frame, from which its features are made once the floor is known.
#[derive(Debug, Clone)]
pub struct Picture {
    world_from_camera: Pose3,
    layer: Layer,
}

impl Picture {
    pub fn new(frame: &Frame, world_from_camera: &Pose3) -> Picture {
        let layer = Pyramid::new(frame).layers.swap_remove(0);
        Picture { world_from_camera: *world_from_camera, layer }
    }
}

/// Returns the features of a clip, the most reliable first. The z axis of the clip's frame points up.
pub fn features(pictures: &[Picture], clip_from_world: &Pose3) -> Vec<Feature> {
    let found: Vec<Vec<Found>> = pictures
        .par_iter()
        .map(|picture| in_picture(&picture.layer, &(clip_from_world * picture.world_from_camera)))
        .collect();
    distinct::distinct(&found, MAX_FEATURES)
}

/// A feature of one picture, with the strength of its corner.
#[derive(Debug, Clone)]
struct Found {
    feature: Feature,
    strength: f32,
}

fn in_picture(layer: &Layer, clip_from_camera: &Pose3) -> Vec<Found> {
    let pyramid = Pyramid::from_layer(layer.clone());
    let smooth: Vec<corners::Smooth> = pyramid.layers.iter().map(corners::Smooth::of).collect();
    let camera_from_clip = clip_from_camera.inverse();
    let describe = |corner: corners::Corner| {
        let patch = patch::Patch::around(layer, &corner, clip_from_camera)?;
        let descriptor = descriptor::describe(&smooth, &camera_from_clip, &patch)?;
        let position_m = patch.centre.map(|c| c as f32).into();
        let feature = Feature { position_m, heading_rad: patch.heading_rad as f32, descriptor };
        Some(Found { feature, strength: corner.strength })
    };
    corners::corners(layer, &smooth).into_iter().filter_map(describe).collect()
}

#[cfg(test)]
mod tests;
