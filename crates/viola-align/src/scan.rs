//! Stage 6: what the vacuum would see (paper III-B).

mod cast;
mod free;
mod hit;
mod landmarks;
mod obstacles;

pub use cast::{VirtualScan, raycast, recast};
pub use hit::{Hit, RaycastParams};
pub use landmarks::Landmark;
