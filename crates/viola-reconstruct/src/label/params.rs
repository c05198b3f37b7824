//! How points are labelled.

use super::segmenter::Segmenter;
use std::sync::Arc;

/// The network looks at one key frame of each stretch in which the camera moves this far ...
pub(super) const KEY_DISTANCE_M: f64 = 0.3;
/// ... or turns this far.
pub(super) const KEY_ANGLE_RAD: f64 = 20f64.to_radians();

/// How points are labelled.
#[derive(Clone)]
pub struct LabelParams {
    /// None: by shape alone.
    pub segmenter: Option<Arc<dyn Segmenter>>,
    /// Why there is none although one is wanted; every answer tells it.
    pub unavailable: Option<String>,
    /// Changes of colour under which each picture is looked at again, up to [`AUGMENTATIONS`].
    pub augmentations: usize,
    /// Uses shapes beside the pictures.
    pub by_shape: bool,
}

impl Default for LabelParams {
    fn default() -> Self {
        LabelParams { segmenter: None, unavailable: None, augmentations: 0, by_shape: true }
    }
}

impl std::fmt::Debug for LabelParams {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LabelParams")
            .field("segmenter", &self.segmenter.as_ref().map(|segmenter| segmenter.name()))
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
