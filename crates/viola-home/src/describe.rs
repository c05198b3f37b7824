//! Description of a home's map: rooms, objects, coverage and plan.

use super::assemble::Tile;
use super::coverage::{Coverage, coverage};
use super::map_point::MapPoint;
use super::objects::{Object, ObjectsParams, objects};
use super::plan::{Plan, plan_of_corrected};
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
    let found = rooms(lidar, &points);
    let mut rooms = found.clone();
    let mut objects = objects(&points, &rooms, &ObjectsParams::default());
    revise(&mut rooms, &mut objects);
    Description {
        coverage: coverage(lidar, &points, &rooms),
        plan: plan_of_corrected(lidar, &points, &found, &rooms, &objects),
        rooms,
        objects,
    }
}
