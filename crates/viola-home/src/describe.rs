//! Description of a home's map: rooms, objects, coverage and plan.

use super::assemble::Tile;
use super::coverage::{Coverage, coverage};
use super::map_point::MapPoint;
use super::objects::{Object, ObjectsParams, objects};
use super::plan::{Ground, Plan, plan_of_corrected};
use super::points::ClipNumbers;
use super::rooms::{Room, rooms};
use viola_formats::lidar::LidarMap;

/// Rooms, objects, their plan, and the coverage of the LiDAR map.
#[derive(Debug, Clone, PartialEq)]
pub struct Description {
    pub rooms: Vec<Room>,
    pub objects: Vec<Object>,
    pub coverage: Coverage,
    pub plan: Plan,
}

/// Describes the map of `tiles`, which are in the order of their keys.
pub fn describe(lidar: &LidarMap, tiles: &[Tile], clips: &ClipNumbers) -> Description {
    describe_revised(lidar, tiles, clips, |_, _| ())
}

/// Describes a map whose rooms and objects are revised before the plan is drawn: they get the ids that they
/// had, and the corrections of people.
pub fn describe_revised(
    lidar: &LidarMap,
    tiles: &[Tile],
    clips: &ClipNumbers,
    revise: impl FnOnce(&mut Vec<Room>, &mut Vec<Object>),
) -> Description {
    let points: Vec<MapPoint> = tiles.iter().flat_map(|tile| clips.in_map(tile)).collect();
    let rooms_and_objects = || {
        let rooms = rooms(lidar, &points);
        let objects = objects(&points, &rooms, &ObjectsParams::default());
        (rooms, objects)
    };
    let ((found, mut objects), ground) = rayon::join(rooms_and_objects, || Ground::new(lidar, &points));
    let mut rooms = found.clone();
    revise(&mut rooms, &mut objects);
    let (coverage, plan) = rayon::join(
        || coverage(lidar, &points, &rooms),
        || plan_of_corrected(&ground, &points, &found, &rooms, &objects),
    );
    Description { rooms, objects, coverage, plan }
}
