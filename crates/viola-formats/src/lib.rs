//! Readers of untrusted files: archives, recorded clips, LiDAR maps and videos. Every reader is bounded in
//! memory and time, and refuses with a typed reason.

pub mod clip;
pub mod container;
mod json;
pub mod lidar;
pub mod ply;
mod scalar;
pub mod video;
