//! Corrections of rooms.

use super::{Correction, CorrectionError, CorrectionState};
use crate::{MapRoom, MapScene};
use viola_geometry::Pose2;
use viola_home::{Room, RoomCorrection, RoomField, RoomMerge, RoomSplit, correct_rooms};

/// A change of a room's correction: `None` keeps a field, and `Some(None)` withdraws it. The values were
/// checked.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RoomChange {
    pub name: Option<Option<String>>,
    /// Ids of the rooms that become one with it.
    pub merge_with: Option<Option<Vec<String>>>,
    /// Two points of the line that divides it.
    pub split_by: Option<Option<[[f64; 2]; 2]>>,
}

impl Correction for RoomCorrection {
    const KIND: &'static str = "room";
    type Target = MapRoom;
    type Change = RoomChange;

    fn target(scene: &MapScene, id: &str) -> Option<MapRoom> {
        scene.rooms.iter().find(|room| room.room.id == id).cloned()
    }

    /// Rooms are held by place, so the id of a corrected room may have been another one.
    fn key(scene: &MapScene, id: &str) -> String {
        let room = RoomCorrection::target(scene, id);
        room.and_then(|room| room.correction).unwrap_or_else(|| id.to_owned())
    }

    /// Rooms can be merged if each meets those before it at a wall.
    fn check(scene: &MapScene, id: &str, change: &RoomChange) -> Result<(), CorrectionError> {
        let own = RoomCorrection::target(scene, id);
        let (Some(own), Some(Some(others))) = (own, &change.merge_with) else { return Ok(()) };
        let mut whole = scene.room_of_cells(&own).clone();
        for id in others {
            // A room that does not exist is refused later.
            let Some(other) = other_room(scene, &own, id) else { break };
            whole = viola_home::merged(&whole, other).ok_or_else(|| {
                let detail = format!("room '{id}' does not meet room '{}' at a wall", own.room.id);
                CorrectionError::Impossible { field: "merge_with", detail }
            })?;
        }
        Ok(())
    }

    fn changed(
        state: &CorrectionState<RoomCorrection>,
        change: &RoomChange,
        scene: &MapScene,
        order: i64,
    ) -> Result<RoomCorrection, CorrectionError> {
        let kept = state.kept.as_ref().map(|kept| kept.correction.clone());
        let fresh = state.shown.as_ref().map(|room| RoomCorrection {
            name: None,
            merge: None,
            split: None,
            at_m: scene.room_of_cells(room).label_at_m,
        });
        let mut correction = kept.or(fresh).ok_or(CorrectionError::NoMap)?;
        if let Some(name) = &change.name {
            correction.name.clone_from(name);
        }
        let is_now =
            |field: RoomField| state.shown.as_ref().is_some_and(|room| room.corrected.contains(&field));
        if let Some(line) = &change.split_by {
            let split = line.map(|[from_m, to_m]| RoomSplit { from_m, to_m, order });
            let is_same = |old: &RoomSplit| {
                split.as_ref().is_some_and(|new| [new.from_m, new.to_m] == [old.from_m, old.to_m])
            };
            if !correction.split.as_ref().is_some_and(is_same) {
                if split.is_some() && is_now(RoomField::SplitBy) {
                    let detail = "the room is divided by another line; divide its other part, or withdraw that line with null first";
                    return Err(CorrectionError::Impossible { field: "split_by", detail: detail.to_owned() });
                }
                correction.split = split;
            }
        }
        if let (Some(Some(_)), Some(split), Some(room)) = (&change.split_by, &correction.split, &state.shown)
            && !is_now(RoomField::SplitBy)
        {
            let alone =
                RoomCorrection { name: None, merge: None, split: Some(split.clone()), at_m: correction.at_m };
            let mut parts = vec![scene.room_of_cells(room).clone()];
            correct_rooms(&mut parts, &[(String::new(), alone)]);
            if parts.len() < 2 {
                let detail = "split_by does not divide the room into two parts of at least 0.5 m2".to_owned();
                return Err(CorrectionError::Impossible { field: "split_by", detail });
            }
        }
        if let Some(others) = &change.merge_with {
            let before = correction.merge.take();
            // The rooms that are a part of it already have no ids to be named by.
            let parts = before.clone().filter(|_| is_now(RoomField::MergeWith));
            correction.merge = match others {
                Some(others) => {
                    let mut with_m = parts.map_or_else(Vec::new, |merge| merge.with_m);
                    // The same request again, before the next revision, changes nothing.
                    for place in places_of(scene, state, others)? {
                        if !with_m.contains(&place) {
                            with_m.push(place);
                        }
                    }
                    let same = before.filter(|before| before.with_m == with_m);
                    Some(same.unwrap_or(RoomMerge { with_m, order }))
                }
                None => None,
            };
        }
        Ok(correction)
    }

    fn is_empty(&self) -> bool {
        RoomCorrection::is_empty(self)
    }

    fn move_by(&mut self, now_from_then: &Pose2) {
        RoomCorrection::move_by(self, now_from_then);
    }
}

/// Returns a point inside each of the rooms to be merged with one.
fn places_of(
    scene: &MapScene,
    state: &CorrectionState<RoomCorrection>,
    others: &[String],
) -> Result<Vec<[f64; 2]>, CorrectionError> {
    let impossible = |detail: String| CorrectionError::Impossible { field: "merge_with", detail };
    let own =
        state.shown.as_ref().ok_or_else(|| impossible("the room is a part of another one now".to_owned()))?;
    let place = |id: &String| {
        let place = other_room(scene, own, id).map(|other| other.label_at_m);
        place.ok_or_else(|| impossible(format!("merge_with has '{id}', which is no other room of the map")))
    };
    others.iter().map(place).collect()
}

/// Returns the room with this id as corrections see it; `None` if it is this one.
fn other_room<'a>(scene: &'a MapScene, own: &MapRoom, id: &str) -> Option<&'a Room> {
    let other = scene.rooms.iter().find(|room| room.room.id == id && id != own.room.id)?;
    Some(scene.room_of_cells(other))
}
