//! What a home looks like: pictures and files for people and for other programs.

mod completion;
mod coverage;
mod lettering;
mod map_point;
mod merge;
mod objects;
mod picture;
mod plan;
mod ply;
mod rooms;

pub use completion::{completion_png, completion_pngs};
pub use coverage::{Coverage, CoverageParams, RoomCoverage, coverage};
pub use lettering::write as write_words;
pub use map_point::MapPoint;
pub use merge::{ClassCount, HomeMapInfo, MAP_VOXEL_M, MapMerge};
pub use objects::{Found, Object, ObjectsParams, UprightBox, find_objects, fit_box, is_furniture, objects};
pub use picture::{lidar_png, overlay_png};
pub use plan::{Plan, PlanParams, plan, plan_geojson, plan_png, plan_svg};
pub use ply::{NotOurs, cloud_ply, read_cloud_ply};
pub use rooms::{PartitionParams, Room, RoomShapeParams, RoomSource, RoomsParams, SpaceParams, rooms};
