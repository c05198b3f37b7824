//! How points are labelled.

use super::segmenter::Segmenter;
use super::structure::StructureParams;
use std::sync::Arc;

/// How points are labelled.
#[derive(Clone)]
pub struct LabelParams {
    /// None: by shape alone.
    pub segmenter: Option<Arc<dyn Segmenter>>,
    /// Why there is none although one is wanted; every answer tells it.
    pub unavailable: Option<String>,
    /// The network looks at one key frame of each stretch in which the camera moves this far ...
    pub key_distance_m: f64,
    /// ... or turns this far.
    pub key_angle_rad: f64,
    /// Changes of colour under which each picture is looked at again, up to [`AUGMENTATIONS`].
    pub augmentations: usize,
    /// None: by the pictures alone.
    pub structure: Option<StructureParams>,
}

impl Default for LabelParams {
    fn default() -> Self {
        LabelParams {
            segmenter: None,
            unavailable: None,
            key_distance_m: 0.3,
            key_angle_rad: 20f64.to_radians(),
            augmentations: 0,
            structure: Some(StructureParams::default()),
        }
    }
}

impl std::fmt::Debug for LabelParams {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LabelParams")
            .field("segmenter", &self.segmenter.as_ref().map(|segmenter| segmenter.name()))
            .field("key_distance_m", &self.key_distance_m)
            .field("key_angle_rad", &self.key_angle_rad)
            .field("augmentations", &self.augmentations)
            .field("structure", &self.structure)
            .finish()
    }
}

impl PartialEq for LabelParams {
    fn eq(&self, other: &Self) -> bool {
        format!("{self:?}") == format!("{other:?}")
    }
}
