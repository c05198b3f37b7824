//! `viola` aligns short RGB-D clips of a home to the 2D LiDAR map that the home's robot vacuum made.
//!
//! The modules in reading order, ground floor first. A floor imports only from itself and from below;
//! `tests/house.rs` holds that.
//!
//! | floor | module | what it knows |
//! |---|---|---|
//! | 1 | [`geometry`], [`progress`], [`container`] | transforms, cameras, grids, distance fields; how long work reports itself; folders and zips |
//! | 2 | [`clip`], [`lidar`] | a recorded clip and a LiDAR map, one file for each format they come in |
//! | 3 | [`align`], [`home`], [`simulate`] | the method; pictures and files of a home; homes with exact truth |
//! | 4 | [`evaluate`], [`stopwatch`], [`storage`] | the paper's protocol; time; records and blobs |
//! | 5 | [`jobs`] | the queue and its workers |
//! | 6 | [`api`], [`cli`] | HTTP and the command line |

pub mod align;
pub mod api;
pub mod cli;
pub mod clip;
pub mod container;
pub mod evaluate;
pub mod geometry;
pub mod home;
pub mod jobs;
pub mod lidar;
pub mod progress;
pub mod simulate;
pub mod stopwatch;
pub mod storage;
