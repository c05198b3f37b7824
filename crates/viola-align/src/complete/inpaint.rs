//! Fills the holes of a picture.

mod hole;
mod migan;
mod open;
mod stable_diffusion;

pub use open::open_inpainter;
pub use stable_diffusion::{Generated, Noise, StableDiffusion};

use image::{GrayImage, RgbImage};
use viola_network::NetworkError;

/// Fills the holes of a picture.
pub trait Inpainter: Send + Sync {
    /// Returns the picture with its holes filled; `hole` is of its size, 255 in the holes and 0 elsewhere,
    /// where the picture stays as it is. The same seed gives the same picture. Long work polls `keep_going`
    /// between its steps.
    fn inpaint(
        &self,
        picture: &RgbImage,
        hole: &GrayImage,
        seed: u64,
        keep_going: &dyn Fn() -> bool,
    ) -> Result<RgbImage, InpaintError>;

    /// Returns the network and its runtime, for the answer.
    fn name(&self) -> String;
}

/// Reason why a hole was not filled.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum InpaintError {
    #[error("the work was cancelled")]
    Cancelled,
    #[error("the network cannot be opened: {0}")]
    Open(String),
    #[error("{0}")]
    Run(String),
    #[error("the network gave {got} where {want} was expected")]
    Shape { got: String, want: String },
    #[error("the network gave values that are not finite")]
    NotFinite,
    #[error("the picture has no pixels")]
    NoPicture,
    #[error("the mask of the holes is {hole}, but the picture {picture}")]
    HoleSize { hole: String, picture: String },
    #[error("the network {network} is not what its entry in models.toml says: {problem}")]
    Misfit { network: String, problem: String },
}

impl From<NetworkError> for InpaintError {
    fn from(error: NetworkError) -> InpaintError {
        InpaintError::Run(error.to_string())
    }
}
