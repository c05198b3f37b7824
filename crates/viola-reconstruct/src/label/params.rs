//! Parameters of the labelling.

use super::segmenter::Segmenter;
use super::surface::SurfaceNetwork;
use std::sync::Arc;

/// The network segments one key frame of each stretch in which the camera moves this far ...
pub(super) const KEY_DISTANCE_M: f64 = 0.3;
/// ... or turns this far.
pub(super) const KEY_ANGLE_RAD: f64 = 20f64.to_radians();

/// Parameters of the labelling.
#[derive(Clone)]
pub struct LabelParams {
    /// Network for the pictures; `None` uses no picture.
    pub segmenter: Option<Arc<dyn Segmenter>>,
    /// Network for the surface itself; `None` classifies it by its planes.
    pub surface: Option<Arc<SurfaceNetwork>>,
    /// Reason why a requested network is unavailable; every answer reports it.
    pub unavailable: Option<String>,
    /// Colour changes for further segmentations of a picture, up to [`AUGMENTATIONS`](super::AUGMENTATIONS).
    pub augmentations: usize,
    /// True if shapes are used beside the pictures.
    pub by_shape: bool,
}

impl LabelParams {
    /// Returns the networks, as [`LabelReport::by`](super::LabelReport::by) names them if they are used.
    pub fn networks(&self) -> String {
        let pictures = self.segmenter.as_ref().map(|segmenter| segmenter.name());
        let surface = self.surface.as_ref().map(|network| network.name().to_owned());
        let names: Vec<String> = pictures.into_iter().chain(surface).collect();
        if names.is_empty() { "geometry".to_owned() } else { names.join("; ") }
    }
}

impl Default for LabelParams {
    fn default() -> Self {
        LabelParams { segmenter: None, surface: None, unavailable: None, augmentations: 0, by_shape: true }
    }
}

impl std::fmt::Debug for LabelParams {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LabelParams")
            .field("segmenter", &self.segmenter.as_ref().map(|segmenter| segmenter.name()))
            .field("surface", &self.surface.as_ref().map(|network| network.name()))
            .field("unavailable", &self.unavailable)
            .field("augmentations", &self.augmentations)
            .field("by_shape", &self.by_shape)
            .finish()
    }
}

impl PartialEq for LabelParams {
    fn eq(&self, other: &Self) -> bool {
        format!("{self:?}") == format!("{other:?}")
    }
}
