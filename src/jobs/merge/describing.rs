//! Describes the map of a home: its scene and its plan, in the files of a revision.

use crate::storage::{MapObject, MapScene, map_file};
use viola_formats::lidar::LidarMap;
use viola_home as home;
use viola_home::{ClipNumbers, Description, PlacedClip, Tile};

/// The scene of a home's map and the files of its plan.
pub struct Described {
    pub scene: MapScene,
    /// By the names of [`map_file`].
    pub plan: [(&'static str, Vec<u8>); 3],
}

/// Describes the map of `tiles`, which are in the order of their keys; `clips` are those of the map, in its order.
pub fn describe(lidar: &LidarMap, tiles: &[Tile], clips: &[PlacedClip]) -> Described {
    let numbers = ClipNumbers::new(clips.iter().map(|clip| &clip.clip));
    let Description { rooms, objects, coverage, plan } = home::describe(lidar, tiles, &numbers);
    let objects = objects.into_iter().map(|object| MapObject::new(object, clips)).collect();
    Described {
        scene: MapScene { rooms, objects, coverage },
        plan: [
            (map_file::PLAN_PNG, home::plan_png(&plan)),
            (map_file::PLAN_SVG, home::plan_svg(&plan).into_bytes()),
            (map_file::PLAN_GEOJSON, home::plan_geojson(&plan).to_string().into_bytes()),
        ],
    }
}
