//! The interface of a segmentation network.

use super::class_map::ClassMap;
use image::RgbImage;
use viola_network::NetworkError;

/// Classifies the pixels of a picture.
pub trait Segmenter: Send + Sync {
    fn segment(&self, picture: &RgbImage) -> Result<ClassMap, SegmentError>;

    /// Returns the network and its runtime, for the answer.
    fn name(&self) -> String;
}

/// Reason why a network could not be used. A clip without any answer of a network is labelled by geometry alone.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SegmentError {
    #[error("{0}")]
    Run(String),
    #[error("the network gave {got} where {want} was expected")]
    Shape { got: String, want: String },
    #[error("the network gave values that are not finite")]
    NotFinite,
    #[error("the picture has no pixels")]
    NoPicture,
    #[error("no part of the surface lies between the floor and {height_m:.1} m above it")]
    NoSurface { height_m: f64 },
    #[error("the network {network} is not what its entry in models.toml says: {problem}")]
    Misfit { network: String, problem: String },
}

impl From<NetworkError> for SegmentError {
    fn from(error: NetworkError) -> SegmentError {
        SegmentError::Run(error.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cause_is_told_once() {
        let failed = NetworkError::Run { reason: "no memory".to_owned() };
        assert_eq!(SegmentError::from(failed).to_string(), "the network failed: no memory");
    }
}
