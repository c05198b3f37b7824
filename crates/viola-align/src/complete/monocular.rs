//! Depth of a single picture by a network.

mod network;

pub use network::open_estimator;

use image::RgbImage;

/// Tells how far away the pixels of a picture are.
pub trait DepthEstimator: Send + Sync {
    /// One value a pixel of the picture, row after row, that grows with the depth along the camera's axis and is
    /// positive and finite; metres where the network claims metres, to be trusted up to a scale and a shift.
    fn depth(&self, picture: &RgbImage) -> Result<Vec<f32>, DepthError>;

    /// Which network, and what runs it, for the answer.
    fn name(&self) -> String;
}

/// Why there is no depth.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum DepthError {
    #[error("the network failed: {0}")]
    Run(String),
    #[error("the network gave {got} where {want} was expected")]
    Shape { got: String, want: String },
    #[error("the network gave values that are not finite")]
    NotFinite,
    #[error("the network gave no positive value")]
    NotPositive,
    #[error("the picture has no pixels")]
    NoPicture,
    #[error("the network {network} is not what its entry in models.toml says: {problem}")]
    Misfit { network: String, problem: String },
}
