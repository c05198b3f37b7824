//! Levels of an earlier run in the output folder: their files would look like parts of the new map.

use crate::cli::output;
use anyhow::Result;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use viola_geometry::LevelName;

/// Returns the levels of the map in a folder; none without a `map.json` of `viola map`.
pub fn levels_in(out: &Path) -> Vec<LevelName> {
    let json = fs::read(out.join("map.json")).unwrap_or_default();
    let map: Value = serde_json::from_slice(&json).unwrap_or_default();
    let levels = map["levels"].as_array().map_or(&[][..], Vec::as_slice);
    let level = |level: &Value| level["level"].as_str()?.parse().ok();
    levels.iter().map(level).collect::<Option<_>>().unwrap_or_default()
}

/// Returns the folder of a level's files.
pub fn folder_of(out: &Path, level: LevelName) -> PathBuf {
    if level.is_main() { out.to_owned() } else { out.join(level.as_str()) }
}

/// Removes the files of a level, and its folder if nothing else is in it.
pub fn remove_level(out: &Path, level: LevelName, files: &[&str]) -> Result<()> {
    let folder = folder_of(out, level);
    for name in files {
        output::remove(&folder.join(name))?;
    }
    if !level.is_main() {
        // A folder with other files stays.
        let _ = fs::remove_dir(&folder);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_files_of_a_level_are_removed() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path();
        let json = r#"{"clips": [], "levels": [{"level": "main"}, {"level": "upper"}, {"level": "attic"}]}"#;
        fs::write(out.join("map.json"), json).unwrap();
        for name in ["plan.svg", "upper/plan.svg", "upper/notes.txt", "attic/plan.svg"] {
            fs::create_dir_all(out.join(name).parent().unwrap()).unwrap();
            fs::write(out.join(name), "").unwrap();
        }
        let levels = levels_in(out);
        assert_eq!(levels.iter().map(LevelName::as_str).collect::<Vec<_>>(), ["main", "upper", "attic"]);
        for level in &levels[1..] {
            remove_level(out, *level, &["plan.svg", "plan.png"]).unwrap();
        }
        assert!(out.join("plan.svg").exists() && out.join("upper/notes.txt").exists());
        assert!(!out.join("upper/plan.svg").exists() && !out.join("attic").exists());
    }

    #[test]
    fn the_map_of_another_program_has_no_levels() {
        let folder = tempfile::tempdir().unwrap();
        assert!(levels_in(folder.path()).is_empty());
        for json in ["{}", "[", r#"{"levels": 3}"#, r#"{"levels": [{"level": "../up"}]}"#] {
            fs::write(folder.path().join("map.json"), json).unwrap();
            assert!(levels_in(folder.path()).is_empty(), "{json}");
        }
    }
}
