//! What a home looks like: pictures and files for people and for other programs.

mod completion;
mod lettering;
mod merge;
mod picture;
mod ply;

pub use completion::{completion_png, completion_pngs};
pub use lettering::write as write_words;
pub use merge::{ClassCount, HomeMapInfo, MAP_VOXEL_M, MapMerge};
pub use picture::{PictureFrame, lidar_png, overlay_png};
pub use ply::{NotOurs, cloud_ply, read_cloud_ply};
