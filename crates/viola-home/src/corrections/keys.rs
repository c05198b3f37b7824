//! Keys of the corrections of rooms.

use super::{Corrected, Room, RoomCorrection, RoomField, at};
use std::collections::BTreeMap;

/// Returns keys for the uncorrected rooms that have the id of another room's correction: a robot may number its rooms anew,
/// and the correction stays at its place.
pub(super) fn own_keys(
    rooms: &[Room],
    corrections: &[(String, RoomCorrection)],
    corrected: &BTreeMap<String, Corrected<RoomField>>,
) -> BTreeMap<String, Corrected<RoomField>> {
    let is_free = |key: &String| {
        corrections.iter().all(|(other, _)| other != key) && rooms.iter().all(|room| room.id != *key)
    };
    let mut keys = BTreeMap::new();
    for (index, room) in rooms.iter().enumerate().filter(|(_, room)| !corrected.contains_key(&room.id)) {
        let same = corrections.iter().find(|(key, _)| *key == room.id);
        if same.is_some_and(|(key, one)| at(rooms, &one.at_m, Some(key.as_str())) != Some(index)) {
            let mut numbered = (2_u32..).map(|number| format!("{}-{number}", room.id));
            keys.extend(numbered.find(is_free).map(|key| (room.id.clone(), Corrected::nothing(key))));
        }
    }
    keys
}
