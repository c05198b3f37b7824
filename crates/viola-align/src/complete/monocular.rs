//! Estimates the depth of a single picture by a network.

mod network;

pub use network::open_estimator;

use image::RgbImage;
use viola_network::NetworkError;

/// Estimates the depth of a picture's pixels.
pub trait DepthEstimator: Send + Sync {
    /// Returns one value for each pixel, row by row, that grows with the depth along the camera's axis and is
    /// positive and finite. Values in metres, too, are reliable only up to a scale and a shift.
    fn depth(&self, picture: &RgbImage) -> Result<Vec<f32>, DepthError>;

    /// Returns the network and its runtime, for the answer.
    fn name(&self) -> String;
}

/// Reason why there is no depth.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum DepthError {
    #[error("{0}")]
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

impl From<NetworkError> for DepthError {
    fn from(error: NetworkError) -> DepthError {
        DepthError::Run(error.to_string())
    }
}
