//! Describes the next revision: its ids come from the last one, and corrections of people are applied.

use crate::storage::{MapHistory, MapObject, MapRoom, MapScene, MergeClaim};
use std::collections::{BTreeMap, BTreeSet};
use viola_formats::lidar::LidarMap;
use viola_geometry::Pose2;
use viola_home as home;
use viola_home::{
    ClipNumbers, Description, Manifest, MovedObject, Object, ObjectCorrection, Plan, Room, RoomCorrection,
    Tile,
};

/// Frames of earlier LiDAR maps that are kept beside those that corrections need: the kept revisions of a
/// home's map have no more.
const FRAMES: usize = 5;

/// The last revision; empty before the first.
pub struct Last {
    pub manifest: Manifest,
    pub scene: Option<MapScene>,
}

/// The description of a new revision.
pub struct Described {
    pub scene: MapScene,
    pub plan: Plan,
    /// True if objects were added, moved or are gone.
    pub has_object_changes: bool,
}

/// Describes the map of `tiles`, whose clips are those of `manifest`.
pub fn describe(
    lidar: &LidarMap,
    tiles: &[Tile],
    manifest: &Manifest,
    last: &Last,
    claim: &MergeClaim,
) -> Described {
    let mut history = last.scene.as_ref().map(MapScene::history).unwrap_or_default();
    let now_from_last = now_from_last(manifest, last, claim);
    history.ids.move_by(&now_from_last);
    history.frames = frames(history.frames, now_from_last, claim);
    history.corrections = claim.corrections.version;
    let (of_objects, of_rooms) = corrections(claim, &history);
    let numbers = ClipNumbers::new(manifest.clips.iter().map(|clip| &clip.clip));
    let (mut corrected_rooms, mut corrected_objects) = (BTreeMap::new(), BTreeMap::new());
    let revise = |rooms: &mut Vec<Room>, objects: &mut Vec<Object>| {
        let renamed = history.ids.identify_rooms(rooms);
        corrected_rooms = home::correct_rooms(rooms, &of_rooms);
        history.ids.identify_objects(objects, &home::stated(&of_objects));
        for object in objects.iter_mut() {
            object.room = object.room.as_ref().and_then(|room| renamed.get(room).cloned());
        }
        home::assign_rooms(objects, rooms, &of_rooms);
        let (corrected, hidden) = home::correct_objects(objects, rooms, &of_objects);
        corrected_objects = corrected;
        history.hidden = hidden.into_iter().collect();
    };
    let Description { rooms, objects, coverage, plan } =
        home::describe_revised(lidar, tiles, &numbers, revise);
    let before = last.scene.as_ref().map(|scene| scene.objects.as_slice()).unwrap_or_default();
    let map_object = |object: Object| {
        let mut object = MapObject::new(object, &manifest.clips);
        if let Some(corrected) = corrected_objects.get(&object.id) {
            object.mark(corrected);
        }
        if object.clips.is_empty() {
            let known = before.iter().find(|known| known.id == object.id);
            object.last_seen = known.and_then(|known| known.last_seen);
        }
        object
    };
    let objects: Vec<MapObject> = objects.into_iter().map(map_object).collect();
    let map_room = |room: Room| {
        let corrected = corrected_rooms.get(&room.id);
        MapRoom::new(room, corrected)
    };
    let rooms = rooms.into_iter().map(map_room).collect();
    let has_object_changes = has_object_changes(before, &objects, &now_from_last);
    Described {
        scene: MapScene { rooms, objects, coverage, history: Some(history) },
        plan,
        has_object_changes,
    }
}

/// Returns the transform into the frame of the new revision from that of the last one.
fn now_from_last(manifest: &Manifest, last: &Last, claim: &MergeClaim) -> Pose2 {
    if claim.last_lidar_map_revision == 0 || !claim.has_new_lidar_map() {
        return Pose2::IDENTITY;
    }
    // Without a clip in both maps nothing tells the frames apart.
    home::map_from_earlier(&last.manifest.clips, &manifest.clips).unwrap_or(Pose2::IDENTITY)
}

/// Returns the transforms from the frames of earlier LiDAR maps that may still be needed.
fn frames(last: BTreeMap<i64, Pose2>, now_from_last: Pose2, claim: &MergeClaim) -> BTreeMap<i64, Pose2> {
    if claim.last_lidar_map_revision == 0 || !claim.has_new_lidar_map() {
        return last;
    }
    let moved = last.into_iter().map(|(revision, from_then)| (revision, now_from_last.compose(&from_then)));
    let mut frames: BTreeMap<i64, Pose2> = moved.collect();
    frames.insert(claim.last_lidar_map_revision, now_from_last);
    let of_objects = claim.corrections.objects.iter().map(|kept| kept.lidar_map_revision);
    let of_rooms = claim.corrections.rooms.iter().map(|kept| kept.lidar_map_revision);
    let newest = frames.keys().rev().take(FRAMES).copied();
    let needed: BTreeSet<i64> = of_objects.chain(of_rooms).chain(newest).collect();
    frames.retain(|revision, _| needed.contains(revision));
    frames
}

type Corrections = (Vec<(String, ObjectCorrection)>, Vec<(String, RoomCorrection)>);

/// Returns the corrections in the frame of the new revision.
fn corrections(claim: &MergeClaim, history: &MapHistory) -> Corrections {
    let objects = claim.corrections.objects.iter().map(|kept| {
        let mut correction = kept.correction.clone();
        if let Some(now_from_then) = history.frames.get(&kept.lidar_map_revision) {
            correction.move_by(now_from_then);
        }
        (kept.target.clone(), correction)
    });
    let rooms = claim.corrections.rooms.iter().map(|kept| {
        let mut correction = kept.correction.clone();
        if let Some(now_from_then) = history.frames.get(&kept.lidar_map_revision) {
            correction.move_by(now_from_then);
        }
        (kept.target.clone(), correction)
    });
    (objects.collect(), rooms.collect())
}

fn has_object_changes(before: &[MapObject], after: &[MapObject], now_from_last: &Pose2) -> bool {
    let before: Vec<MovedObject> = before.iter().map(|object| object.in_frame(now_from_last)).collect();
    let after: Vec<MovedObject> = after.iter().map(|object| object.in_frame(&Pose2::IDENTITY)).collect();
    !home::object_changes(&before, &after).is_empty()
}
