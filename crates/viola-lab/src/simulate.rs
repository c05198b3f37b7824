//! Furnished homes with exact truth, from a seed: what a robot vacuum would map of them and what a phone
//! would record in them.
//!
//! [`Home::generate`] makes a floor plan and furnishes it; [`Home::survey`] drives the vacuum through it
//! and gives its map; [`Home::clip`] walks through it with a phone and gives RGB-D frames, rendered one at
//! a time. Everything is a function of the parameters: the same bytes on any number of threads. Nothing
//! here reads a clock or touches a file; the writers write to whatever they are given.
//!
//! The frame `home` is metres with z up, the floor at z = 0 and the walls mostly along x and y. The map's
//! frames are turned and moved against it by the seed, and so is each clip's world.

mod change;
mod clearance;
mod clip;
mod export;
mod finish;
mod furnish;
mod home;
mod in_memory;
mod lidar_files;
mod picture;
mod piece;
mod plan;
mod render;
mod rng;
mod scene;
mod sensor;
mod shade;
mod solid;
mod structure;
mod survey;
mod symmetry;
mod walk;

pub use clip::{ClipParams, ClipTruth, LabelImage, SimulatedClip};
pub use export::write_scannet_zip;
pub use home::{Home, HomeObject, HomeParams, HomeTruth, Set};
pub use in_memory::{clip_in_memory, clip_in_memory_heard};
pub use lidar_files::{points_csv, ros_pgm, ros_yaml, valetudo_json};
pub use picture::plan_png;
pub use plan::{Plan, Room, RoomKind};
pub use render::View;
pub use scene::{Hit, Scene};
pub use sensor::Sensor;
pub use survey::Survey;
