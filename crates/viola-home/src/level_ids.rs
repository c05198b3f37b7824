//! Levels in the ids of objects and rooms. Ids on other levels than `main` begin with the level's name.

use viola_geometry::LevelName;

/// Stands between the name of a level and the rest of an id. Names of levels do not have it.
const AFTER_LEVEL: char = '~';

/// Returns the level of an object's or a room's id.
pub fn level_of_id(id: &str) -> LevelName {
    id.split_once(AFTER_LEVEL).and_then(|(level, _)| level.parse().ok()).unwrap_or_default()
}

/// Returns an id without its level.
pub fn own_part(id: &str) -> &str {
    id.split_once(AFTER_LEVEL).map_or(id, |(_, own)| own)
}

/// Returns the id of something on a level.
pub fn on_level(level: LevelName, own: String) -> String {
    if level.is_main() { own } else { format!("{level}{AFTER_LEVEL}{own}") }
}
