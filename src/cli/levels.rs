//! The `--lidar` argument of homes with one level or several.

use super::wrong_file::{self, Advice};
use anyhow::{Context, Result, bail};
use clap::builder::{OsStringValueParser, TypedValueParser};
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs::File;
use std::io::Read;
use std::path::PathBuf;
use viola_formats::lidar::{LidarMap, MAX_FILE_BYTES, valetudo_json};
use viola_geometry::{InvalidLevelName, LevelName, MAX_LEVELS};

/// The LiDAR map of a level: `FILE` for the level `main`, else `LEVEL=FILE`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LevelArgument {
    pub level: LevelName,
    pub path: PathBuf,
}

/// Returns the parser of an argument.
pub fn parser() -> impl TypedValueParser<Value = LevelArgument> {
    OsStringValueParser::new().map(parse)
}

fn parse(text: OsString) -> LevelArgument {
    // Text before the first `=` that cannot be the name of a level belongs to the file's name.
    let named = text.to_str().and_then(|text| {
        let (level, path) = text.split_once('=')?;
        Some(LevelArgument { level: level.parse().ok()?, path: path.into() })
    });
    named.unwrap_or_else(|| LevelArgument { level: LevelName::MAIN, path: text.into() })
}

/// Opens the maps; returns them by the levels' names. A file that is no map is answered with the command's advice.
pub fn open(arguments: &[LevelArgument], advice: Advice) -> Result<Vec<(LevelName, LidarMap)>> {
    if arguments.len() > MAX_LEVELS {
        bail!("{} LiDAR maps were given; a home has at most {MAX_LEVELS} levels", arguments.len());
    }
    let mut sorted = arguments.to_vec();
    sorted.sort_by_key(|argument| argument.level);
    if let Some(pair) = sorted.windows(2).find(|pair| pair[0].level == pair[1].level) {
        bail!("two LiDAR maps were given for the level {}; name the levels: LEVEL=FILE", pair[0].level);
    }
    let open = |LevelArgument { level, path }: &LevelArgument| {
        // The text before `=` was meant as the name of a level, if there is no such file.
        let is_level = path.to_str().and_then(|text| text.split_once('=')).filter(|_| !path.exists());
        if let Some((name, _)) = is_level {
            bail!("`{name}` cannot name a level: {InvalidLevelName}");
        }
        let map = LidarMap::open(path).map_err(|error| wrong_file::of_map(path, error, advice))?;
        Ok((*level, map))
    };
    sorted.iter().map(open).collect()
}

/// Returns the JSON of the levels whose maps are Valetudo's.
pub fn valetudo_files(arguments: &[LevelArgument]) -> Result<BTreeMap<LevelName, Vec<u8>>> {
    let mut files = BTreeMap::new();
    for LevelArgument { level, path } in arguments {
        let mut bytes = Vec::new();
        File::open(path)
            .and_then(|file| file.take(MAX_FILE_BYTES).read_to_end(&mut bytes))
            .with_context(|| format!("LiDAR map {}", path.display()))?;
        files.extend(valetudo_json(&bytes).map(|json| (*level, json)));
    }
    Ok(files)
}

/// Returns the map of a level, else the first one.
pub fn of_level(maps: &[(LevelName, LidarMap)], level: LevelName) -> Result<&LidarMap> {
    let map = maps.iter().find(|(name, _)| *name == level).or(maps.first());
    map.map(|(_, lidar)| lidar).context("no LiDAR map was given")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_level_stands_before_its_file() {
        for (text, level, path) in [
            ("map.json", "main", "map.json"),
            ("upper=maps/up.json", "upper", "maps/up.json"),
            ("main=a=b.json", "main", "a=b.json"),
            ("maps/a=b.json", "main", "maps/a=b.json"),
        ] {
            let expected = LevelArgument { level: level.parse().unwrap(), path: path.into() };
            assert_eq!(parse(text.into()), expected, "{text}");
        }
        let twice = ["a.json", "main=b.json"].map(|text| parse(text.into()));
        let open = |arguments: &[LevelArgument]| open(arguments, Advice::Flags);
        assert!(open(&twice).unwrap_err().to_string().contains("level main"));
        let capital = open(&[parse("Upper=a.json".into())]).unwrap_err().to_string();
        assert!(capital.starts_with("`Upper` cannot name a level"), "{capital}");
        let many: Vec<LevelArgument> = (0..9).map(|n| parse(format!("l{n}=a.json").into())).collect();
        assert!(open(&many).unwrap_err().to_string().contains("at most 8"));
    }
}
