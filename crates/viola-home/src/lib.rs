//! A home's fused map: built from its clips, described, and exported as pictures and files.

mod assemble;
mod carved;
mod completion;
mod contact_sheet;
mod contribution;
mod corrections;
mod coverage;
mod describe;
mod features;
mod frame_pictures;
mod gltf;
mod identity;
mod info;
mod lettering;
mod level_ids;
mod light;
mod map_point;
mod mesh;
mod objects;
mod picture;
mod plan;
mod ply;
mod png;
mod points;
mod recording;
mod robot;
mod rooms;
mod shades;
mod svg;

pub use assemble::{
    Agreement, Assembly, ClipMatch, Comparison, Extent, FloorCorrection, Footprint, KnownClip, LabelledMap,
    LoadClips, LookedThrough, Manifest, Marginal, Member, Mode, Motion, Overlap, POINT_BYTES, Pair, PlacedBy,
    PlacedClip, Surfaces, Tile, TileBytes, TileInfo, TileKey, Verdict, assemble, compare, disagreement,
    likeliest, point_bytes, read_point,
};
pub use completion::{completion_png, completion_pngs};
pub use contact_sheet::contact_sheet_png;
pub use contribution::{ClipContribution, ClipScan, ScanCamera, camera_poses, views_bytes};
pub use corrections::{
    Corrected, CorrectedRooms, ObjectCorrection, ObjectField, RoomCorrection, RoomDivision, RoomField,
    RoomMerge, RoomSplit, Seen, correct_objects, correct_rooms, stated,
};
pub use coverage::{Coverage, RoomCoverage, coverage};
pub use describe::{Description, describe, describe_revised};
pub use features::{features_bytes, read_features};
pub use frame_pictures::{FramePictures, frame_pictures};
pub use identity::{
    History, KnownObject, KnownPoint, MIN_MOVE_M, MovedObject, ObjectChanges, RevisionObjects, Stated,
    Statement, map_from_earlier, object_changes,
};
pub use info::{ClassCount, HomeMapInfo};
pub use lettering::write as write_words;
pub use level_ids::level_of_id;
pub use map_point::MapPoint;
pub use mesh::{MESH_TRIANGLES, Mesh, MeshObject};
pub use objects::{Found, Object, Sample, UprightBox, find_objects, fit_box, is_furniture, objects};
pub use picture::{PictureFrame, lidar_png, overlay_png};
pub use plan::{
    Furniture, Opening, OpeningKind, Plan, PlanImage, PlanRoom, Swing, Wall, plan, plan_dxf, plan_geojson,
    plan_json, plan_pdf, plan_png, plan_svg,
};
pub use ply::{UnknownFileFormat, cloud_ply, read_cloud_ply};
pub use points::{ClipNumbers, Glb, Ply, PointFilter, write_e57, write_laz};
pub use recording::{ClipPath, RecordedObject, Recording};
pub use robot::{
    CalibrationFile, Ground, MatterFile, RobotLevel, RobotObject, ValetudoFile, calibration, matter,
    nav2_files, nav2_zip, robot_places, valetudo,
};
pub use rooms::outline::Outline;
pub use rooms::{Room, RoomSource, merged, rooms};

/// Side of the map's voxels; the same as of the clips' clouds.
pub const MAP_VOXEL_M: f64 = 0.03;
