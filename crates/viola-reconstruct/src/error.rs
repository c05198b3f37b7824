//! Errors of a reconstruction.

use viola_formats::clip::ClipError;
use viola_geometry::progress::Cancelled;

/// An error that leaves no surface. A clip that shows too little is no error: its answer has the reasons.
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
