//! Corrections of people beside what the clips say.

use super::home_maps::{align, due, revision};
use super::*;
use crate::corrections::Correction;
use serde::{Deserialize, Serialize};
use std::sync::{Arc, Mutex, mpsc};
use tokio::sync::mpsc::UnboundedSender;
use viola_geometry::Pose2;
use viola_geometry::taxonomy::Class;
use viola_home::{Coverage, ObjectCorrection, PlacedBy, Room, RoomCorrection, RoomField, RoomSource};

on_every_back_end!(
    a_correction_is_kept_until_it_is_withdrawn,
    a_correction_makes_the_map_due,
    corrections_that_cannot_be,
    a_room_is_corrected,
    a_room_grows_by_one_merge_after_another,
    rooms_are_corrected_by_the_cells_of_the_lidar_map,
    a_list_has_the_places_of_the_present_map,
    a_room_is_divided_by_one_line,
    two_people_do_not_overwrite_each_other,
    a_home_has_so_many_corrections,
    a_slow_check_keeps_no_other_write_waiting,
);

pub(super) fn chair(id: &str, x: f64) -> MapObject {
    MapObject {
        id: id.to_owned(),
        level: LevelName::MAIN,
        class: Class::Chair,
        confidence: 0.5,
        centre_m: [x, 2.0, 0.5],
        size_m: [0.6, 0.5, 1.0],
        yaw_rad: 0.0,
        room: None,
        points: 9,
        clips: Vec::new(),
        last_seen: None,
        name: None,
        corrected: Vec::new(),
    }
}

fn room(id: &str, low_x: f64) -> MapRoom {
    let high_x = low_x + 4.0;
    let room = Room {
        id: id.to_owned(),
        name: None,
        source: RoomSource::Computed,
        area_m2: 12.0,
        polygon_m: vec![[low_x, 0.0], [high_x, 0.0], [high_x, 3.0], [low_x, 3.0]],
        holes_m: Vec::new(),
        label_at_m: [low_x + 2.0, 1.5],
    };
    MapRoom::new(LevelName::MAIN, room, None)
}

/// Ends the merge that is due with a scene that has the claim's corrections.
async fn merge(storage: &Storage, seconds: i64) -> MergeClaim {
    merge_to(storage, seconds, vec![room("1", 0.0), room("2", 4.1), room("3", 20.0)]).await
}

async fn merge_to(storage: &Storage, seconds: i64, rooms: Vec<MapRoom>) -> MergeClaim {
    merge_with(storage, seconds, rooms, MapHistory::default()).await
}

async fn merge_with(storage: &Storage, seconds: i64, rooms: Vec<MapRoom>, history: MapHistory) -> MergeClaim {
    let claim = due(storage, seconds).await.expect("the home is due");
    let mut new = revision(&claim, PlacedBy::Alignment, b"tile");
    new.objects = vec![chair("chair-1", 1.0), chair("chair-2", 3.0)];
    let scene = MapScene {
        rooms,
        objects: new.objects.clone(),
        coverage: Coverage { seen: 0.0, floor_seen: 0.0, by_room: Vec::new() },
        history: Some(MapHistory { corrections: claim.corrections.version, ..history }),
    };
    new.files = vec![(LevelName::MAIN, map_file::SCENE, serde_json::to_vec(&scene).unwrap())];
    new.has_object_changes = true;
    assert!(storage.finish_merge(&claim, Some(&new), at(seconds)).await.unwrap());
    claim
}

/// Creates a home with a map of two chairs and three rooms.
async fn furnished(storage: &Storage) -> HomeId {
    let (home, _) = one_job(storage).await;
    align(storage, AlignmentState::Aligned).await;
    merge(storage, 200).await;
    home
}

fn renamed(name: Option<&str>) -> ObjectChange {
    ObjectChange { name: Some(name.map(str::to_owned)), ..ObjectChange::default() }
}

/// Divides a room along a line across it.
fn line(x: f64) -> RoomChange {
    RoomChange { split_by: Some(Some([[x, 0.0], [x, 1.0]])), ..RoomChange::default() }
}

fn with(id: &str) -> RoomChange {
    RoomChange { merge_with: Some(Some(vec![id.to_owned()])), ..RoomChange::default() }
}

async fn correct(
    storage: &Storage,
    home: &HomeId,
    id: &str,
    change: &ObjectChange,
) -> CorrectionState<ObjectCorrection> {
    storage.correct::<ObjectCorrection>(home, id, change, |_| true, at(300)).await.unwrap()
}

async fn a_correction_is_kept_until_it_is_withdrawn(storage: Storage) {
    let home = furnished(&storage).await;
    let before = storage.corrected::<ObjectCorrection>(&home, "chair-1").await.unwrap();
    assert_eq!((before.shown.clone().unwrap(), &before.kept), (chair("chair-1", 1.0), &None));
    let state = correct(&storage, &home, "chair-1", &renamed(Some("Throne"))).await;
    let kept = state.kept.clone().unwrap();
    assert_eq!((kept.correction.name.as_deref(), kept.corrected_at), (Some("Throne"), at(300)));
    assert_eq!((kept.lidar_map_revision, state.shown.is_some()), (1, true));
    // Another member is added to it.
    let class = ObjectChange { class: Some(Some(Class::Sofa)), ..ObjectChange::default() };
    let state = correct(&storage, &home, "chair-1", &class).await;
    let kept = state.kept.clone().unwrap().correction;
    assert_eq!((kept.name.as_deref(), kept.class), (Some("Throne"), Some(Class::Sofa)));
    assert_eq!(storage.corrected::<ObjectCorrection>(&home, "chair-1").await.unwrap(), state);
    let all = storage.corrections(&home).await.unwrap();
    assert_eq!((all.version, all.objects.len(), all.rooms.len()), (2, 1, 0));
    let none = ObjectChange { class: Some(None), ..renamed(None) };
    assert_eq!(correct(&storage, &home, "chair-1", &none).await.kept, None);
    let all = storage.corrections(&home).await.unwrap();
    assert_eq!((all.version, all.objects.len()), (3, 0));
    // They go with the home.
    correct(&storage, &home, "chair-2", &renamed(Some("Stool"))).await;
    storage.delete_home(&home, |_| true, at(500)).await.unwrap();
    storage.put_home(&home, None, |_| true, at(501)).await.unwrap();
    assert_eq!(storage.corrections(&home).await.unwrap(), Corrections::default());
}

async fn a_correction_makes_the_map_due(storage: Storage) {
    let home = furnished(&storage).await;
    assert!(due(&storage, 301).await.is_none());
    correct(&storage, &home, "chair-1", &renamed(Some("Throne"))).await;
    let claim = merge(&storage, 302).await;
    assert_eq!((claim.corrections.version, claim.corrections.objects.len()), (1, 1));
    let files = storage.home_map_files(&home, 2, LevelName::MAIN, map_file::SCENE).await.unwrap();
    let scene = storage.map_scene(&files[0]).await.unwrap().unwrap();
    assert_eq!(scene.history().corrections, 1);
    // The same again changes nothing.
    correct(&storage, &home, "chair-1", &renamed(Some("Throne"))).await;
    assert!(due(&storage, 303).await.is_none());
    let changes = storage.changes(&Tenant::default(), None, 100, at(304)).await.unwrap();
    let objects = changes.items.iter().find(|change| change.kind == ChangeKind::Objects).unwrap();
    assert_eq!(objects.revision, Some(2));
}

async fn corrections_that_cannot_be(storage: Storage) {
    let (home, _) = one_job(&storage).await;
    let change = renamed(Some("Throne"));
    let none = storage.correct::<ObjectCorrection>(&home, "chair-1", &change, |_| true, at(1)).await;
    assert!(matches!(none, Err(CorrectionError::NoMap)), "{none:?}");
    align(&storage, AlignmentState::Aligned).await;
    merge(&storage, 200).await;
    for id in ["chair-3", "", "Chair-1", "sofa-1"] {
        let none = storage.correct::<ObjectCorrection>(&home, id, &change, |_| true, at(1)).await;
        assert!(matches!(none, Err(CorrectionError::NotFound { kind: "object", .. })), "{id}: {none:?}");
    }
    let elsewhere = super::home("elsewhere");
    let none = storage.correct::<ObjectCorrection>(&elsewhere, "chair-1", &change, |_| true, at(1)).await;
    assert!(matches!(none, Err(CorrectionError::Storage(StorageError::NoSuchHome))), "{none:?}");
    for (change, field) in [
        (line(9.0), "split_by"),
        (line(0.01), "split_by"),
        (with("1"), "merge_with"),
        (with("3"), "merge_with"),
        (with("nowhere"), "merge_with"),
    ] {
        let refused = storage.correct::<RoomCorrection>(&home, "1", &change, |_| true, at(1)).await;
        let Err(CorrectionError::Impossible { field: found, .. }) = refused else {
            panic!("{change:?}: {refused:?}")
        };
        assert_eq!(found, field);
    }
    assert_eq!(storage.corrections(&home).await.unwrap().version, 0);
}

async fn a_room_is_corrected(storage: Storage) {
    let home = furnished(&storage).await;
    let change = RoomChange {
        name: Some(Some("Lounge".to_owned())),
        merge_with: Some(Some(vec!["2".to_owned()])),
        ..RoomChange::default()
    };
    let state = storage.correct::<RoomCorrection>(&home, "1", &change, |_| true, at(300)).await.unwrap();
    // The same request again, after a lost answer, changes nothing, whatever its condition says.
    let again = storage.correct::<RoomCorrection>(&home, "1", &change, |_| false, at(300)).await.unwrap();
    assert_eq!(again.kept, state.kept);
    let kept = state.kept.unwrap().correction;
    assert_eq!((kept.name.as_deref(), kept.at_m), (Some("Lounge"), [2.0, 1.5]));
    let merge_made = kept.merge.unwrap();
    assert_eq!((merge_made.with_m, merge_made.order), (vec![[6.1, 1.5]], 1));
    let state = storage.correct::<RoomCorrection>(&home, "1", &line(3.0), |_| true, at(301)).await.unwrap();
    assert_eq!(state.kept.unwrap().correction.split.unwrap().order, 2);
    let undo = RoomChange { merge_with: Some(None), split_by: Some(None), ..RoomChange::default() };
    let state = storage.correct::<RoomCorrection>(&home, "1", &undo, |_| true, at(302)).await.unwrap();
    let kept = state.kept.unwrap().correction;
    assert_eq!((kept.name.as_deref(), kept.merge, kept.split), (Some("Lounge"), None, None));
    assert_eq!(merge(&storage, 303).await.corrections.rooms.len(), 1);
}

async fn a_room_grows_by_one_merge_after_another(storage: Storage) {
    let home = furnished(&storage).await;
    storage.correct::<RoomCorrection>(&home, "1", &with("2"), |_| true, at(300)).await.unwrap();
    let mut both = room("1", 0.0);
    both.room.polygon_m = vec![[0.0, 0.0], [8.1, 0.0], [8.1, 3.0], [0.0, 3.0]];
    both.corrected = vec![RoomField::MergeWith];
    merge_to(&storage, 400, vec![both, room("4", 8.2)]).await;
    let state = storage.correct::<RoomCorrection>(&home, "1", &with("4"), |_| true, at(401)).await.unwrap();
    let again = storage.correct::<RoomCorrection>(&home, "1", &with("4"), |_| false, at(402)).await.unwrap();
    assert_eq!(again.kept, state.kept, "the same request again");
    let merge = state.kept.unwrap().correction.merge.unwrap();
    assert_eq!((merge.with_m, merge.order), (vec![[6.1, 1.5], [10.2, 1.5]], 2));
}

/// The plan draws less of the rooms than the LiDAR map has of them.
async fn rooms_are_corrected_by_the_cells_of_the_lidar_map(storage: Storage) {
    let home = furnished(&storage).await;
    storage.correct::<RoomCorrection>(&home, "1", &with("2"), |_| true, at(300)).await.unwrap();
    let mut drawn = room("1", 0.0);
    drawn.corrected = vec![RoomField::MergeWith];
    let mut both = drawn.room.clone();
    both.polygon_m = vec![[0.0, 0.0], [8.1, 0.0], [8.1, 3.0], [0.0, 3.0]];
    let mut next = room("4", 8.2).room;
    next.label_at_m = [10.0, 1.0];
    let history = MapHistory { rooms_of_cells: vec![both, next], ..MapHistory::default() };
    merge_with(&storage, 400, vec![drawn, room("4", 8.2)], history).await;
    let state = storage.correct::<RoomCorrection>(&home, "1", &line(5.0), |_| true, at(401)).await.unwrap();
    assert_eq!(state.kept.unwrap().correction.split.unwrap().from_m, [5.0, 0.0]);
    let state = storage.correct::<RoomCorrection>(&home, "1", &with("4"), |_| true, at(402)).await.unwrap();
    let merge = state.kept.unwrap().correction.merge.unwrap();
    assert_eq!((merge.with_m, merge.order), (vec![[6.1, 1.5], [10.0, 1.0]], 3));
}

/// A new LiDAR map has another frame.
async fn a_list_has_the_places_of_the_present_map(storage: Storage) {
    let home = furnished(&storage).await;
    let place = ObjectChange { centre_m: Some(Some([2.0, 1.0, 0.5])), ..ObjectChange::default() };
    correct(&storage, &home, "chair-1", &place).await;
    let name = RoomChange { name: Some(Some("Lounge".to_owned())), ..RoomChange::default() };
    storage.correct::<RoomCorrection>(&home, "1", &name, |_| true, at(300)).await.unwrap();
    put_map(&storage, &home, b"another map").await;
    align(&storage, AlignmentState::Aligned).await;
    let frames = [(1, Pose2::new(1.0, 2.0, 0.0))].into();
    let history = MapHistory { frames, ..MapHistory::default() };
    merge_with(&storage, 400, vec![room("1", 1.0)], history).await;
    let all = storage.corrections(&home).await.unwrap();
    let places = (all.objects[0].correction.centre_m, all.rooms[0].correction.at_m);
    assert_eq!(places, (Some([3.0, 3.0, 0.5]), [3.0, 3.5]));
    let object = storage.corrected::<ObjectCorrection>(&home, "chair-1").await.unwrap();
    let room = storage.corrected::<RoomCorrection>(&home, "1").await.unwrap();
    assert_eq!((object.kept, room.kept), (Some(all.objects[0].clone()), Some(all.rooms[0].clone())));
}

async fn a_room_is_divided_by_one_line(storage: Storage) {
    let home = furnished(&storage).await;
    storage.correct::<RoomCorrection>(&home, "1", &line(3.0), |_| true, at(300)).await.unwrap();
    let mut part = room("1", 0.0);
    part.room.polygon_m = vec![[0.0, 0.0], [3.0, 0.0], [3.0, 3.0], [0.0, 3.0]];
    part.corrected = vec![RoomField::SplitBy];
    merge_to(&storage, 400, vec![part]).await;
    let refused = storage.correct::<RoomCorrection>(&home, "1", &line(1.0), |_| true, at(401)).await;
    assert!(matches!(refused, Err(CorrectionError::Impossible { field: "split_by", .. })), "{refused:?}");
    let again = storage.correct::<RoomCorrection>(&home, "1", &line(3.0), |_| true, at(402)).await.unwrap();
    assert_eq!(again.kept.unwrap().correction.split.unwrap().order, 1);
    let none = RoomChange { split_by: Some(None), ..RoomChange::default() };
    let whole = storage.correct::<RoomCorrection>(&home, "1", &none, |_| true, at(403)).await.unwrap();
    assert!(whole.kept.is_none());
}

async fn two_people_do_not_overwrite_each_other(storage: Storage) {
    let home = furnished(&storage).await;
    let read = storage.corrected::<ObjectCorrection>(&home, "chair-1").await.unwrap();
    let is_read = |state: &CorrectionState<ObjectCorrection>| *state == read;
    let first =
        storage.correct::<ObjectCorrection>(&home, "chair-1", &renamed(Some("A")), is_read, at(300)).await;
    assert!(first.is_ok());
    let second =
        storage.correct::<ObjectCorrection>(&home, "chair-1", &renamed(Some("B")), is_read, at(301)).await;
    assert!(matches!(second, Err(CorrectionError::Changed { .. })), "{second:?}");
    let kept = storage.corrected::<ObjectCorrection>(&home, "chair-1").await.unwrap().kept.unwrap();
    assert_eq!(kept.correction.name.as_deref(), Some("A"));
}

async fn a_home_has_so_many_corrections(storage: Storage) {
    let home = furnished(&storage).await;
    let mut transaction = storage.database.begin().await.unwrap();
    for n in 1..MAX_CORRECTIONS {
        crate::database::query(
            "INSERT INTO map_corrections (home_id, kind, target, lidar_map_revision, document, corrected_at)
            SELECT $1, 'object', $2, 1, $3, 0",
        )
        .bind(home.key())
        .bind(format!("old-{n}"))
        .bind("{}")
        .execute(&mut transaction)
        .await
        .unwrap();
    }
    transaction.commit().await.unwrap();
    correct(&storage, &home, "chair-1", &renamed(Some("the last one"))).await;
    let refused = storage
        .correct::<ObjectCorrection>(&home, "chair-2", &renamed(Some("one more")), |_| true, at(1))
        .await;
    assert!(matches!(refused, Err(CorrectionError::TooMany)), "{refused:?}");
    // One that is there may still be changed.
    correct(&storage, &home, "chair-1", &renamed(Some("another name"))).await;
}

/// A correction whose check takes until the test lets it go on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Slow;

/// Tells the test that the check has begun, and hears that it may end.
type Checking = Arc<(UnboundedSender<()>, Mutex<mpsc::Receiver<()>>)>;

impl Correction for Slow {
    const KIND: &'static str = "object";
    type Target = MapObject;
    type Change = Checking;

    fn target(scene: &MapScene, id: &str) -> Option<MapObject> {
        ObjectCorrection::target(scene, id)
    }

    fn key(_: &MapScene, id: &str) -> String {
        id.to_owned()
    }

    fn check(_: &MapScene, _: &str, checking: &Checking) -> Result<(), CorrectionError> {
        checking.0.send(()).unwrap();
        checking.1.lock().unwrap().recv_timeout(LEASE).expect("the other write is done");
        Ok(())
    }

    fn changed(
        _: &CorrectionState<Slow>,
        _: &Checking,
        _: &MapScene,
        _: i64,
    ) -> Result<Slow, CorrectionError> {
        Ok(Slow)
    }

    fn is_empty(&self) -> bool {
        false
    }

    fn move_by(&mut self, _: &Pose2) {}
}

async fn a_slow_check_keeps_no_other_write_waiting(storage: Storage) {
    let home = furnished(&storage).await;
    let (begun, mut begins) = tokio::sync::mpsc::unbounded_channel();
    let (done, ends) = mpsc::channel();
    let checking = Arc::new((begun, Mutex::new(ends)));
    let other_write = async {
        begins.recv().await.unwrap();
        correct(&storage, &home, "chair-2", &renamed(Some("Stool"))).await;
        done.send(()).unwrap();
    };
    let slow = storage.correct::<Slow>(&home, "chair-1", &checking, |_| true, at(300));
    let (state, ()) = tokio::join!(slow, other_write);
    assert_eq!(state.unwrap().kept.map(|kept| kept.correction), Some(Slow));
}
