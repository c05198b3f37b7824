//! Why a clip could not be reconstructed.

use viola_formats::clip::ClipError;
use viola_geometry::progress::Cancelled;

/// Why there is no surface. A clip that shows too little is no error: the reasons of its answer tell it.
#[derive(Debug, thiserror::Error)]
pub enum ReconstructError {
    #[error("the work was cancelled")]
    Cancelled,
    #[error(transparent)]
    Clip(#[from] ClipError),
}

impl From<Cancelled> for ReconstructError {
    fn from(_: Cancelled) -> Self {
        ReconstructError::Cancelled
    }
}
