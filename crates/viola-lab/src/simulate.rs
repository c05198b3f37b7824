//! Furnished homes with exact truth from a seed, the map that a robot vacuum would make of them, and clips
//! that a phone would record in them.
//!
//! [`Home::generate`] makes a floor plan and furnishes it; [`Home::survey`] drives the vacuum through it and
//! returns its map; [`Home::clip`] walks through it with a phone and returns RGB-D frames, rendered one at a
//! time. Everything is a function of the parameters: the same bytes on any number of threads. Nothing here
//! reads a clock, and only [`Catalogue::open`] reads files. The writers write to the given output.
//!
//! The frame `home` is in metres, z up, with the floor at z = 0 and the walls mostly along x and y. The seed
//! rotates and moves the map's frames and each clip's world against it.

mod catalogue;
mod change;
mod clearance;
mod clip;
mod echo;
mod export;
mod finish;
mod furnish;
mod home;
mod in_memory;
mod lidar_files;
mod model;
mod movement;
mod optics;
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
mod warp;

pub use catalogue::{Catalogue, CatalogueError};
pub use clip::{ClipParams, ClipTruth, LabelImage, SimulatedClip};
pub use export::write_scannet_zip;
pub use home::{Home, HomeObject, HomeParams, HomeTruth, Set};
pub use in_memory::{clip_in_memory, clip_in_memory_heard};
pub(crate) use lidar_files::csv;
pub use lidar_files::{points_csv, ros_pgm, ros_yaml, valetudo_json};
pub use picture::plan_png;
pub use plan::{FacePoint, Plan, Room, RoomKind, RoomShape, TrueOpening};
pub use render::View;
pub(crate) use rng::gaussian;
pub use scene::{Hit, Scene};
pub use sensor::Sensor;
pub use survey::Survey;
pub use warp::Warp;
