//! The paper's own stages 7-9, as the rows of the evaluation to compare with (paper III-C, IV-A).

mod correlate;
mod fft2;

pub use correlate::{CorrelateParams, correlate};
