//! Stage 6: the virtual scan that the vacuum would see (paper III-B).

mod cast;
mod free;
mod hit;
mod landmarks;
mod obstacles;

pub use cast::{MAX_HITS, VirtualScan, raycast, recast};
pub use hit::{FREE_CELL_M, HIT_SPACING_M, Hit, RaycastParams, VACUUM_HEIGHT_M};
pub use landmarks::Landmark;
pub use obstacles::upright;
