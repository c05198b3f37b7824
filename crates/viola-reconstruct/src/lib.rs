//! Reconstructs a labelled surface with a floor from a clip: stages 2 to 5 of the method.

pub mod cloud;
pub mod error;
mod estimate;
mod extract;
pub mod features;
pub mod floor;
pub mod fuse;
pub mod key_frame;
pub mod label;
mod quarter_turn;
mod reason;
pub mod track;
pub mod trajectory;
mod tsdf;

pub use cloud::{ClassFraction, CloudPoint, Label, NO_COLOR, OTHER_CLASSES, PointCloud};
pub use error::ReconstructError;
pub use estimate::{Estimate, estimate};
pub use features::{DESCRIPTOR_BYTES, Descriptor, Feature, MAX_FEATURES};
pub use floor::{Floor, FloorReport, NoFloor, heading};
pub use fuse::Fused;
pub use key_frame::{KeyFrame, Readings, View};
pub use label::{LabelParams, LabelReport};
pub use quarter_turn::QuarterTurn;
pub use reason::Reason;
pub use track::TrackParams;
