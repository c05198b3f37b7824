//! A network that tells the classes of a picture.

use super::class_map::ClassMap;
use image::RgbImage;

/// Tells the classes of a picture's pixels.
pub trait Segmenter: Send + Sync {
    fn segment(&self, picture: &RgbImage) -> Result<ClassMap, SegmentError>;

    /// Which network, and what runs it, for the answer.
    fn name(&self) -> String;
}

/// Why a network could not be used. The clip goes on with geometry alone.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SegmentError {
    #[error("the network failed: {0}")]
    Run(String),
    #[error("the network gave {got} where {want} was expected")]
    Shape { got: String, want: String },
    #[error("the network gave values that are not finite")]
    NotFinite,
    #[error("the picture has no pixels")]
    NoPicture,
    #[error("the network {network} is not what its entry in models.toml says: {problem}")]
    Misfit { network: String, problem: String },
}
