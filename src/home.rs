//! What a home looks like: one map out of its clips, pictures and files for people and for other programs.

mod assemble;
mod completion;
mod info;
mod lettering;
mod map_point;
mod picture;
mod ply;
mod points;
mod share;

pub use assemble::{
    AssembleParams, Assembly, CLIP_AT, Extent, Manifest, Member, NeighbourParams, Overlap, OverlapParams,
    POINT_BYTES, Pair, PlacedBy, PlacedClip, SettleParams, Tile, TileBytes, TileInfo, TileKey, Verdict, assemble,
    disagreement, point_bytes, read_point,
};
pub use completion::{completion_png, completion_pngs};
pub use info::{ClassCount, HomeMapInfo};
pub use lettering::write as write_words;
pub use map_point::MapPoint;
pub use picture::{lidar_png, overlay_png};
pub use points::{ClipNumbers, Glb, Ply, PointFilter};
pub use ply::{NotOurs, cloud_ply, read_cloud_ply};
pub use share::{ClipScan, ScanCamera, Share, read_views, views_bytes};

/// Side of the map's voxels: that of the clips.
pub const MAP_VOXEL_M: f64 = 0.03;
