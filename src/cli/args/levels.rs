//! The `--lidar` argument of homes with one level or several.

use super::wrong_arguments;
use crate::cli::wrong_file::{self, Advice};
use anyhow::{Context, Result, bail};
use clap::builder::{OsStringValueParser, TypedValueParser};
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use viola_formats::lidar::{LidarMap, MAX_FILE_BYTES, valetudo_json};
use viola_geometry::{InvalidLevelName, LevelName, MAX_LEVELS};

/// Maximum size of the YAML file of a ROS map, as its reader has it.
const MAX_YAML_BYTES: u64 = 64 << 10;

/// The LiDAR map of a level: `FILE` for the level `main`, else `LEVEL=FILE`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LevelArgument {
    pub level: LevelName,
    pub path: PathBuf,
}

/// Returns the parser of an argument.
pub fn parser() -> impl TypedValueParser<Value = LevelArgument> {
    OsStringValueParser::new().map(|text| parse(text, Path::exists))
}

fn parse(text: OsString, exists: impl Fn(&Path) -> bool) -> LevelArgument {
    // Text before the first `=` that cannot be the name of a level belongs to the file's name, and so does that of a file
    // that is there under the whole name.
    let named = text.to_str().filter(|text| !exists(Path::new(text))).and_then(|text| {
        let (level, path) = text.split_once('=')?;
        Some(LevelArgument { level: level.parse().ok()?, path: path.into() })
    });
    named.unwrap_or_else(|| LevelArgument { level: LevelName::MAIN, path: text.into() })
}

/// Opens the maps; returns them by the levels' names. A file that is no map is answered with the command's advice.
pub fn open(arguments: &[LevelArgument], advice: Advice) -> Result<Vec<(LevelName, LidarMap)>> {
    if arguments.len() > MAX_LEVELS {
        let given = arguments.len();
        let text = format!("{given} LiDAR maps were given; a home has at most {MAX_LEVELS} levels");
        return Err(wrong_arguments(text));
    }
    let mut sorted = arguments.to_vec();
    sorted.sort_by_key(|argument| argument.level);
    if let Some(pair) = sorted.windows(2).find(|pair| pair[0].level == pair[1].level) {
        let level = pair[0].level;
        let text = format!("two LiDAR maps were given for the level {level}; name the levels: LEVEL=FILE");
        return Err(wrong_arguments(text));
    }
    let open = |LevelArgument { level, path }: &LevelArgument| {
        // The text before `=` was meant as the name of a level, if there is no such file.
        let named = path.to_str().and_then(|text| text.split_once('=')).filter(|_| !path.exists());
        if let Some((name, _)) = named.filter(|(name, _)| !name.contains('/')) {
            return Err(wrong_arguments(format!("`{name}` cannot name a level: {InvalidLevelName}")));
        }
        let map = LidarMap::open(path).map_err(|error| wrong_file::of_map(path, error, advice))?;
        Ok((*level, map))
    };
    sorted.iter().map(open).collect()
}

/// Returns the files that the maps are read from.
pub fn files(arguments: &[LevelArgument]) -> Vec<PathBuf> {
    arguments.iter().flat_map(|argument| files_of(&argument.path)).collect()
}

/// Returns the files that a map is read from: its own and, of a ROS map, the image that the YAML file names.
pub fn files_of(path: &Path) -> Vec<PathBuf> {
    let mut files = vec![path.to_owned()];
    let is_yaml = |ending: &&str| path.extension().is_some_and(|own| own.eq_ignore_ascii_case(ending));
    // Opening a pipe would take its content away.
    if !["yaml", "yml"].iter().any(is_yaml) || !path.is_file() {
        return files;
    }
    let mut text = String::new();
    let read = File::open(path).and_then(|file| file.take(MAX_YAML_BYTES).read_to_string(&mut text));
    // Editors of Windows write a byte order mark in front.
    let lines = text.strip_prefix('\u{feff}').unwrap_or(&text).lines();
    let image = lines.map(str::trim_start).find_map(|line| line.strip_prefix("image:"));
    if let (Ok(_), Some(image)) = (read, image) {
        let image = image.split(" #").next().unwrap_or_default().trim().trim_matches(['"', '\'']);
        // The reader takes the image beside the YAML file if there is none at its place.
        let name = image.rsplit(['/', '\\']).next().unwrap_or_default();
        let found = [image, name].map(|image| path.with_file_name(image));
        files.extend(found.into_iter().filter(|image| image.is_file()));
    }
    files
}

/// Returns the JSON of the levels whose maps are Valetudo's.
pub fn valetudo_files(
    arguments: &[LevelArgument],
    maps: &[(LevelName, LidarMap)],
) -> Result<BTreeMap<LevelName, Vec<u8>>> {
    let mut files = BTreeMap::new();
    let is_valetudo = |argument: &&LevelArgument| {
        maps.iter().any(|(level, map)| *level == argument.level && map.info.format == "valetudo")
    };
    for LevelArgument { level, path } in arguments.iter().filter(is_valetudo) {
        if !path.is_file() {
            bail!("LiDAR map {}: a pipe can be read only once; save the map to a file", path.display());
        }
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
            assert_eq!(parse(text.into(), |_| false), expected, "{text}");
        }
        let whole = LevelArgument { level: LevelName::MAIN, path: "run=3.json".into() };
        assert_eq!(parse("run=3.json".into(), |path| path == Path::new("run=3.json")), whole);
        let twice = ["a.json", "main=b.json"].map(|text| parse(text.into(), |_| false));
        let open = |arguments: &[LevelArgument]| open(arguments, Advice::Flags);
        let twice = open(&twice).unwrap_err();
        assert!(twice.is::<clap::Error>() && twice.to_string().contains("level main"), "{twice}");
        let capital = open(&[parse("Upper=a.json".into(), |_| false)]).unwrap_err().to_string();
        assert!(capital.contains("`Upper` cannot name a level"), "{capital}");
        let many: Vec<LevelArgument> =
            (0..9).map(|n| parse(format!("l{n}=a.json").into(), |_| false)).collect();
        assert!(open(&many).unwrap_err().to_string().contains("at most 8"));
    }

    #[test]
    fn a_ros_map_has_two_files() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir(at("maps")).unwrap();
        for image in ["plan.png", "maps/home.pgm"] {
            std::fs::write(at(image), "").unwrap();
        }
        for (file, text, image) in [
            ("map.yaml", "image: plan.png\nresolution: 0.05\n", Some("plan.png")),
            ("map.yaml", "\u{feff}image: plan.png\r\nresolution: 0.05\r\n", Some("plan.png")),
            ("map.YML", "resolution: 0.05\nimage: \"./plan.png\" # the image\n", Some("plan.png")),
            ("map.yaml", "image: /home/me/plan.png\n", Some("plan.png")),
            ("map.yaml", "image: maps/home.pgm\n", Some("maps/home.pgm")),
            ("map.yaml", "image: missing.png\n", None),
            ("map.yaml", "image:\n", None),
            ("map.csv", "image: plan.png\n", None),
        ] {
            std::fs::write(at(file), text).unwrap();
            let files = files_of(&at(file));
            let images: Vec<PathBuf> = files[1..].iter().map(|path| path.canonicalize().unwrap()).collect();
            let expected = image.map(|image| at(image).canonicalize().unwrap());
            assert!(
                files[0] == at(file) && images.iter().all(|image| Some(image) == expected.as_ref()),
                "{text}"
            );
            assert_eq!(images.is_empty(), expected.is_none(), "{text}");
        }
    }
}
