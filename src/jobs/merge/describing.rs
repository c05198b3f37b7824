//! Describes the next revision: its ids come from the last one, and corrections of people are applied.

use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use viola_align::LevelMap;
use viola_geometry::progress::{Cancelled, Progress};
use viola_geometry::{LevelName, Pose2};
use viola_home as home;
use viola_home::{
    ClipNumbers, Description, History, LookedThrough, Object, ObjectCorrection, PlacedClip, RevisionObjects,
    Room, RoomCorrection, Tile,
};
use viola_storage::{Corrections, MapHistory, MapObject, MapRoom, MapScene, map_file};

/// Frames of earlier LiDAR maps that are kept beside those that corrections need: the kept revisions of a
/// home's map have no more.
const FRAMES: usize = 5;

/// One level of the revision that a new one follows, and what people corrected on the level; empty before the
/// first.
#[derive(Debug, Default, Serialize, Deserialize)]
pub struct Earlier {
    pub clips: Vec<PlacedClip>,
    pub scene: Option<MapScene>,
    pub corrections: Corrections,
    /// The home's name now.
    pub home_name: Option<String>,
    /// The level's earlier LiDAR map, if the new revision of the home has another.
    pub left: Option<LeftMap>,
    /// The histories of levels that the home had and has no more.
    pub removed_levels: BTreeMap<LevelName, History>,
}

/// A LiDAR map that a level had at its last revision.
#[derive(Debug, Serialize, Deserialize)]
pub struct LeftMap {
    pub revision: i64,
    /// From its frame into that of the present map, by registering the maps; `None` if they do not tell it.
    pub now_from_left: Option<Pose2>,
}

impl Earlier {
    /// Returns whether the level is described with its current LiDAR map, its corrections, and the home's name and
    /// removed levels.
    pub fn is_described(&self) -> bool {
        let history = self.scene.as_ref().and_then(|scene| scene.history.as_ref());
        let is_same = |history: &MapHistory| {
            history.corrections == self.corrections.version
                && history.home_name == self.home_name
                && history.removed_levels == self.removed_levels
        };
        history.is_some_and(is_same) && self.left.is_none()
    }

    /// Returns the history from which the level continues.
    fn history(&self, level: LevelName) -> MapHistory {
        let ids = || self.removed_levels.get(&level).cloned().unwrap_or_else(|| History::of_level(level));
        let first = || MapHistory { ids: ids(), ..MapHistory::default() };
        let history = self.scene.as_ref().map_or_else(first, MapScene::history);
        MapHistory { removed_levels: self.removed_levels.clone(), ..history }
    }
}

/// The description of a new revision.
pub struct Described {
    pub scene: MapScene,
    /// The files of the plan, by the names of [`map_file`].
    pub plan: [(&'static str, Vec<u8>); 6],
    /// True if an object moved, or if the revision has other objects than the one before.
    pub has_object_changes: bool,
}

/// Describes one level: the map of `tiles`. `clips` are those of all levels, `looked` is of the level's tiles that
/// changed.
pub fn describe(
    map: LevelMap,
    tiles: &[Tile],
    clips: &[PlacedClip],
    looked: &LookedThrough,
    last: &Earlier,
    progress: &dyn Progress,
) -> Result<Described, Cancelled> {
    let LevelMap { level, lidar } = map;
    let mut history = last.history(level);
    let now_from_last = now_from_last(level, clips, last);
    let ids_before = history.ids.clone();
    let earlier = last.scene.as_ref().map(|scene| scene.earlier_objects(&now_from_last)).unwrap_or_default();
    history.ids.move_by(&now_from_last);
    history.frames = frames(history.frames, now_from_last, last);
    history.corrections = last.corrections.version;
    history.home_name.clone_from(&last.home_name);
    let (of_objects, of_rooms) = corrections(&last.corrections, &history);
    let numbers = ClipNumbers::new(clips.iter().map(|clip| &clip.clip));
    let (mut corrected_rooms, mut corrected_objects) = (BTreeMap::new(), BTreeMap::new());
    let revise = |rooms: &mut Vec<Room>, objects: &mut Vec<Object>| {
        history.ids.identify_rooms(rooms);
        let corrected = home::correct_rooms(rooms, &of_rooms);
        corrected_rooms = corrected.by_id;
        history.rooms_of_cells.clone_from(rooms);
        let times_ms = last.corrections.objects.iter().map(|kept| kept.corrected_at.as_millisecond());
        history.ids.identify_objects(objects, &home::stated(&of_objects, times_ms), looked);
        let (of_ids, hidden) = home::correct_objects(objects, &of_objects);
        corrected_objects = of_ids;
        history.hidden = hidden.into_iter().collect();
        corrected.divisions
    };
    let Description { rooms, objects, coverage, mut plan } =
        home::describe_revised(lidar, tiles, &numbers, revise, progress)?;
    (plan.level, plan.home_name) = (level, last.home_name.clone());
    let before = last.scene.as_ref().map(|scene| scene.objects.as_slice()).unwrap_or_default();
    let map_object = |object: Object| {
        let mut object = MapObject::new(level, object, clips);
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
        MapRoom::new(level, room, corrected)
    };
    let rooms = rooms.into_iter().map(map_room).collect();
    let missing = missing_objects(before, &history, &objects, &now_from_last);
    history.missing = missing;
    let later = objects.iter().map(|object| object.in_frame(&Pose2::IDENTITY)).collect();
    let changes = home::object_changes(
        &RevisionObjects { objects: earlier, ids: &ids_before },
        &RevisionObjects { objects: later, ids: &history.ids },
    );
    Ok(Described {
        scene: MapScene { rooms, objects, coverage, history: Some(history) },
        plan: [
            (map_file::PLAN_PNG, home::plan_png(&plan)),
            (map_file::PLAN_SVG, home::plan_svg(&plan).into_bytes()),
            (map_file::PLAN_PDF, home::plan_pdf(&plan)),
            (map_file::PLAN_GEOJSON, home::plan_geojson(&plan).to_string().into_bytes()),
            (map_file::PLAN_DXF, home::plan_dxf(&plan).into_bytes()),
            (map_file::PLAN_JSON, home::plan_json(&plan).to_string().into_bytes()),
        ],
        has_object_changes: !changes.is_empty(),
    })
}

/// Returns the histories of levels that the scenes of the last revision know, and that were removed. Each scene has those of
/// all levels, since any other level may be removed next.
pub fn removed_levels(
    scenes: &BTreeMap<LevelName, MapScene>,
    is_level: impl Fn(LevelName) -> bool,
) -> BTreeMap<LevelName, History> {
    let histories: Vec<_> = scenes.iter().map(|(level, scene)| (*level, scene.history())).collect();
    let mut removed = BTreeMap::new();
    for (_, history) in &histories {
        removed.extend(history.removed_levels.clone());
    }
    let now = histories.into_iter().filter(|(level, _)| !is_level(*level));
    removed.extend(now.map(|(level, history)| (level, history.ids.without_places())));
    removed
}

/// Returns whether objects of the last revision are on a level that was removed: no description of another level tells that they
/// are lost.
pub fn loses_objects(scenes: &BTreeMap<LevelName, MapScene>, is_level: impl Fn(LevelName) -> bool) -> bool {
    scenes.iter().any(|(level, scene)| !is_level(*level) && !scene.objects.is_empty())
}

/// Returns the transform into the frame of the new revision from that of the last one.
fn now_from_last(level: LevelName, clips: &[PlacedClip], last: &Earlier) -> Pose2 {
    let Some(left) = &last.left else { return Pose2::IDENTITY };
    // Without a clip in both maps, and if the maps do not tell it, the frame is taken as unchanged.
    home::map_from_earlier(level, &last.clips, clips).or(left.now_from_left).unwrap_or(Pose2::IDENTITY)
}

/// Returns the transforms from the frames of earlier LiDAR maps that may still be needed.
fn frames(known: BTreeMap<i64, Pose2>, now_from_last: Pose2, last: &Earlier) -> BTreeMap<i64, Pose2> {
    let Some(left) = &last.left else { return known };
    let moved = known.into_iter().map(|(revision, from_then)| (revision, now_from_last.compose(&from_then)));
    let mut frames: BTreeMap<i64, Pose2> = moved.collect();
    frames.insert(left.revision, now_from_last);
    let of_objects = last.corrections.objects.iter().map(|kept| kept.lidar_map_revision);
    let of_rooms = last.corrections.rooms.iter().map(|kept| kept.lidar_map_revision);
    let newest = frames.keys().rev().take(FRAMES).copied();
    let needed: BTreeSet<i64> = of_objects.chain(of_rooms).chain(newest).collect();
    frames.retain(|revision, _| needed.contains(revision));
    frames
}

type Placed = (Vec<(String, ObjectCorrection)>, Vec<(String, RoomCorrection)>);

/// Returns the corrections in the frame of the new revision.
fn corrections(kept: &Corrections, history: &MapHistory) -> Placed {
    let objects = kept.objects.iter().map(|kept| (kept.target.clone(), kept.in_frame_of(history)));
    let rooms = kept.rooms.iter().map(|kept| (kept.target.clone(), kept.in_frame_of(history)));
    (objects.collect(), rooms.collect())
}

/// Returns the objects of earlier revisions that are not among `objects`, and that no clip showed to be gone.
fn missing_objects(
    before: &[MapObject],
    history: &MapHistory,
    objects: &[MapObject],
    now_from_last: &Pose2,
) -> Vec<MapObject> {
    let is_missing = |object: &&MapObject| {
        let known = history.ids.objects.iter().find(|known| known.id == object.id);
        let is_remembered = known.is_some_and(|known| known.missing > 0 && !known.is_gone);
        is_remembered && !objects.iter().any(|found| found.id == object.id)
    };
    let moved = |object: &MapObject| {
        let bounds = object.bounds().moved(now_from_last);
        MapObject { centre_m: bounds.centre_m, yaw_rad: bounds.yaw_rad, ..object.clone() }
    };
    before.iter().chain(&history.missing).filter(is_missing).map(moved).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use viola_geometry::taxonomy::Class;
    use viola_home::{Coverage, RoomSource};

    /// Returns the scenes of a revision with these levels.
    fn scenes(levels: Vec<(LevelName, MapHistory)>) -> BTreeMap<LevelName, MapScene> {
        let scene = |history| MapScene {
            rooms: Vec::new(),
            objects: Vec::new(),
            coverage: Coverage { seen: 0.0, floor_seen: 0.0, by_room: Vec::new() },
            history: Some(history),
        };
        levels.into_iter().map(|(level, history)| (level, scene(history))).collect()
    }

    /// Returns the id of a room that the history does not know.
    fn id_of_new_room(ids: &mut History) -> String {
        let mut rooms = [Room {
            id: "computed".to_owned(),
            name: None,
            source: RoomSource::Computed,
            area_m2: 12.0,
            polygon_m: vec![[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]],
            holes_m: Vec::new(),
            label_at_m: [2.0, 1.5],
        }];
        ids.identify_rooms(&mut rooms);
        rooms[0].id.clone()
    }

    #[test]
    fn a_level_that_returns_gives_out_no_id_again() {
        let upper: LevelName = "upper".parse().unwrap();
        let mut history = Earlier::default().history(upper);
        assert_eq!(id_of_new_room(&mut history.ids), "upper~1");
        // The next revision has only the main level, and so have those after it.
        let mut last = scenes(vec![(LevelName::MAIN, MapHistory::default()), (upper, history)]);
        for _ in 0..3 {
            let removed_levels = removed_levels(&last, |level| level.is_main());
            let scene = last.remove(&LevelName::MAIN);
            let earlier = Earlier { scene, removed_levels, ..Earlier::default() };
            last = scenes(vec![(LevelName::MAIN, earlier.history(LevelName::MAIN))]);
        }
        let again = Earlier { removed_levels: removed_levels(&last, |_| true), ..Earlier::default() };
        assert_eq!(id_of_new_room(&mut again.history(upper).ids), "upper~2");
    }

    #[test]
    fn the_objects_of_a_removed_level_are_lost() {
        let upper: LevelName = "upper".parse().unwrap();
        let mut last = scenes([LevelName::MAIN, upper].map(|level| (level, MapHistory::default())).into());
        let object = |level| MapObject {
            id: "sofa-1".to_owned(),
            level,
            class: Class::Sofa,
            confidence: 0.9,
            centre_m: [1.0, 1.0, 0.4],
            size_m: [2.0, 0.9, 0.8],
            yaw_rad: 0.0,
            room: None,
            points: 500,
            clips: Vec::new(),
            last_seen: None,
            name: None,
            corrected: Vec::new(),
        };
        assert!(!loses_objects(&last, |level| level.is_main()), "the level had none");
        for (level, scene) in &mut last {
            scene.objects.push(object(*level));
        }
        assert!(loses_objects(&last, |level| level.is_main()));
        assert!(!loses_objects(&last, |_| true));
    }
}
