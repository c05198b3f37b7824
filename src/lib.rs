//! `viola` aligns short RGB-D clips of a home to the 2D LiDAR map that the home's robot vacuum made.
//!
//! The modules in reading order, ground floor first. A floor imports only from itself and from below;
//! `tests/house.rs` holds that.
//!
//! | floor | module | what it knows |
//! |---|---|---|
//! | 1 | [`geometry`], [`progress`], [`container`], [`taxonomy`] | transforms, cameras, grids, distance fields; how long work reports itself; folders and archives; the classes of things |
//! | 2 | [`video`] | frames of a recorded video, decoded here or in a process of limited means |
//! | 3 | [`clip`], [`lidar`], [`network`] | a recorded clip and a LiDAR map, one file for each format they come in; running a neural network |
//! | 4 | [`align`] | the method |
//! | 5 | [`home`], [`simulate`] | pictures and files of a home; homes with exact truth |
//! | 6 | [`stopwatch`] | the time of each stage |
//! | 7 | [`evaluate`], [`storage`] | the paper's protocol; records and blobs |
//! | 8 | [`jobs`] | the queue and its workers |
//! | 9 | [`api`] | HTTP |
//! | 10 | [`cli`] | the command line |

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
pub mod network;
pub mod progress;
pub mod simulate;
pub mod stopwatch;
pub mod storage;
pub mod taxonomy;
pub mod video;
pub mod webhooks;
