//! ROS map_server maps: a yaml file and a grey image (nav2_map_server `map_io.cpp`).

mod raster;
mod turn;
mod yaml;

use self::yaml::Description;
use super::build::{Parts, build, occupied_centres};
use super::{LidarError, LidarMap, MAX_FILE_BYTES};
use crate::container::{Container, ContainerError, Zip};
use std::f64::consts::TAU;
use viola_geometry::{Grid, GridFrame};

const MAX_YAML_BYTES: u64 = 64 << 10;
/// A free threshold that keeps a map saver's unknown (205) from being free.
const SAVED_FREE_THRESHOLD: f64 = 0.196;
/// Larger cells get a note.
const COARSE_CELL_M: f64 = 0.2;
/// A smaller yaw moves the largest map by less than a cell.
const MIN_YAW_RAD: f64 = 1e-6;

/// Words in the names of the masks of costmap filters, which lie beside a map.
const MASK_WORDS: [&str; 3] = ["mask", "keepout", "speed"];
/// Words in the names of masks, and of maps without one of the words above.
const POSSIBLE_MASK_WORDS: [&str; 2] = ["filter", "semantic"];
/// Maximum number of yaml files that are read to find the map's.
const MAX_YAMLS: usize = 100;
/// Maximum number of names in an error.
const MAX_LISTED: usize = 10;

/// Returns whether a file is a map's description by its name.
pub(super) fn is_yaml(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    name.ends_with(".yaml") || name.ends_with(".yml")
}

/// How likely a file is a mask, by its name.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Mask {
    No,
    Possible,
    Yes,
}

impl Mask {
    /// Judges the name of a file, whatever its folder's.
    fn of(path: &str) -> Mask {
        let name = path.rsplit('/').next().unwrap_or_default().to_ascii_lowercase();
        let has = |words: &[&str]| words.iter().any(|word| name.contains(word));
        if has(&MASK_WORDS) {
            Mask::Yes
        } else if has(&POSSIBLE_MASK_WORDS) {
            Mask::Possible
        } else {
            Mask::No
        }
    }
}

/// Returns the yaml file of the map: the only one, or the only one that is least likely a mask's.
fn yaml_of_map<'a>(yamls: &[&'a str]) -> Result<&'a str, LidarError> {
    let Some(least) = yamls.iter().map(|name| Mask::of(name)).min() else {
        return Err(LidarError::UnknownFormat);
    };
    let maps: Vec<&str> = yamls.iter().copied().filter(|name| Mask::of(name) == least).collect();
    if let &[only] = maps.as_slice() {
        return Ok(only);
    }
    let names: Vec<String> = maps.iter().take(MAX_LISTED).map(|name| format!("{name:.80}")).collect();
    let more = if maps.len() > MAX_LISTED { ", ..." } else { "" };
    let reason = format!(
        "it is one of {} in the archive that may be the map's ({}{more}); send one map",
        maps.len(),
        names.join(", ")
    );
    let name = names.into_iter().next().unwrap_or_default();
    Err(LidarError::BadYaml { name, reason })
}

/// Returns the yaml files of maps and masks, without those of other programs; all of them if there are none.
fn yamls_of_maps(zip: &Zip) -> Result<Vec<&str>, LidarError> {
    let all: Vec<&str> = zip.names().iter().map(String::as_str).filter(|name| is_yaml(name)).collect();
    if all.len() == 1 || all.len() > MAX_YAMLS {
        return Ok(all);
    }
    let mut own = Vec::new();
    for name in &all {
        let yaml = match zip.read(name, MAX_YAML_BYTES) {
            // The description of a map is short.
            Err(ContainerError::FileTooLarge { .. }) => continue,
            yaml => yaml?,
        };
        if Description::is_in(&yaml) {
            own.push(*name);
        }
    }
    Ok(if own.is_empty() { all } else { own })
}

/// Returns whether a file begins as a zip does: with its first entry, or with the end of one without entries.
pub(super) fn is_zip(bytes: &[u8]) -> bool {
    bytes.starts_with(b"PK\x03") || bytes.starts_with(b"PK\x05")
}

/// Reads a zip with the yaml file of one map and the image that it names, or with one file of any other map.
pub(super) fn read_zip(bytes: &[u8]) -> Result<LidarMap, LidarError> {
    let zip = Zip::from_bytes(bytes.to_vec())?;
    if let [name] = zip.names()
        && !is_yaml(name)
    {
        let bytes = zip.read(name, MAX_FILE_BYTES)?;
        // Archives in archives would be read by calls in calls, until the stack is full.
        if is_zip(&bytes) {
            return Err(ContainerError::ArchiveInside { name: name.clone() }.into());
        }
        return LidarMap::read(&bytes);
    }
    let yamls = yamls_of_maps(&zip)?;
    let name = yaml_of_map(&yamls)?;
    let has_masks = yamls.len() > 1;
    let folder = name.rsplit_once('/').map_or(String::new(), |(folder, _)| format!("{folder}/"));
    let files = zip.names().iter().filter_map(|path| path.strip_prefix(folder.as_str()));
    let mut images = files.filter(|file| is_image(file) && !(has_masks && Mask::of(file) > Mask::of(name)));
    let only_image = images.next().filter(|_| images.next().is_none());
    let mut map = read(&zip.read(name, MAX_YAML_BYTES)?, name, Images::Beside(only_image), |image| {
        let path = format!("{folder}{image}");
        let in_any_case = || zip.names().iter().find(|name| name.eq_ignore_ascii_case(&path));
        let place = zip.names().iter().find(|name| **name == path).or_else(in_any_case);
        let absent = || LidarError::MissingImage { yaml: name.to_string(), image: image.to_string() };
        Ok(zip.read(place.ok_or_else(absent)?, MAX_FILE_BYTES)?)
    })?;
    if has_masks {
        map.info.notes.push(format!("{} yaml files of masks were ignored", yamls.len() - 1));
    }
    Ok(map)
}

/// Returns whether a file in the yaml file's folder is an image by its name.
fn is_image(name: &str) -> bool {
    let lower = name.to_ascii_lowercase();
    !name.contains('/') && [".pgm", ".png", ".bmp"].iter().any(|ending| lower.ends_with(ending))
}

/// The images that a yaml file may name.
pub(super) enum Images<'a> {
    /// Those of any folder, as map_server reads them: the file is of this machine's owner.
    Anywhere,
    /// Those beside the file or in a folder beside it. The value is the only one beside it, if there is one.
    Beside(Option<&'a str>),
}

/// Reads a yaml file, and its image with `read_image`.
pub(super) fn read(
    yaml: &[u8],
    name: &str,
    images: Images,
    read_image: impl Fn(&str) -> Result<Vec<u8>, LidarError>,
) -> Result<LidarMap, LidarError> {
    let bad = |reason: String| LidarError::BadYaml { name: name.to_string(), reason };
    if yaml.len() as u64 > MAX_YAML_BYTES {
        return Err(bad(format!("it has more than {MAX_YAML_BYTES} bytes")));
    }
    let mut description = Description::parse(yaml).map_err(bad)?;
    let mut notes = Vec::new();
    let (found, only_image) = match images {
        Images::Anywhere => (read_image(&description.image).ok(), None),
        Images::Beside(only_image) => (None, only_image),
    };
    let image_name = match &found {
        Some(_) => description.image.clone(),
        None => image_beside(&description.image, &mut notes).map_err(bad)?,
    };
    let origin = description.origin().map_err(bad)?;
    let [.., yaw_rad] = description.origin;
    if description.has_no_yaw() {
        notes.push("the yaw of origin is not a number; 0 was taken".to_string());
    } else if yaw_rad.abs() > TAU {
        notes.push(format!(
            "the yaw of origin, {yaw_rad}, is more than a turn in radians, in which it was read; if it is in degrees, write \
             {:.4}",
            yaw_rad.to_radians()
        ));
    }
    if description.resolution > COARSE_CELL_M {
        notes.push(format!(
            "cells of {} m are coarse: poses of clips are up to half a cell off, and most clips are not aligned",
            description.resolution
        ));
    }
    let (bytes, image_name) = match found {
        Some(bytes) => (bytes, image_name.as_str()),
        None => find_image(&image_name, only_image, read_image, &mut notes)?,
    };
    let image = raster::decode(&bytes, image_name)?;
    if raster::is_saved_with_wide_threshold(&image, &description) {
        notes.push(format!(
            "the image's 205, which map savers write for unknown, is below free_thresh {}; it was read as unknown",
            description.free_thresh
        ));
        description.free_thresh = SAVED_FREE_THRESHOLD;
    }
    let frame = GridFrame {
        origin_m: [origin.x_m, origin.y_m],
        cell_m: description.resolution,
        width: image.width() as usize,
        height: image.height() as usize,
    };
    let grid = Grid { frame, cells: raster::classify(&image, &description) };
    let (grid, occupied_m) = if origin.yaw_rad.abs() > MIN_YAW_RAD {
        notes.push("the origin has a yaw: the cells were sampled again on an upright grid".to_string());
        turn::turn(&grid, &origin)?
    } else {
        let occupied_m = occupied_centres(&grid)?;
        (grid, occupied_m)
    };
    build(Parts {
        format: "ros_map_server",
        frame: "metres, the map frame of the yaml file",
        occupied_m,
        cells: Some(grid),
        notes,
        ..Parts::default()
    })
}

/// Reads the image from the place that the yaml file names, else from beside the yaml file, else the only image there.
/// Returns its bytes and its name.
fn find_image<'a>(
    wanted: &'a str,
    only_image: Option<&'a str>,
    read_image: impl Fn(&str) -> Result<Vec<u8>, LidarError>,
    notes: &mut Vec<String>,
) -> Result<(Vec<u8>, &'a str), LidarError> {
    let absent = match read_image(wanted) {
        Err(error) if is_absent(&error) => error,
        bytes => return Ok((bytes?, wanted)),
    };
    // Some map savers write the folder of their own working directory.
    if let Some((_, last)) = wanted.rsplit_once('/') {
        match read_image(last) {
            Err(error) if is_absent(&error) => {}
            bytes => {
                notes.push(format!(
                    "image is in a folder that is absent; {last:.80} beside the yaml file was taken"
                ));
                return Ok((bytes?, last));
            }
        }
    }
    // The image was renamed after it was saved.
    let Some(only) = only_image else { return Err(absent) };
    notes.push(format!("image is {wanted:.80}, which is absent; {only:.80} beside the yaml file was taken"));
    Ok((read_image(only)?, only))
}

/// Returns whether the error of reading an image is its absence.
pub(super) fn is_absent(error: &LidarError) -> bool {
    match error {
        LidarError::MissingImage { .. } => true,
        LidarError::Unreadable { source, .. } => source.kind() == std::io::ErrorKind::NotFound,
        _ => false,
    }
}

/// Returns the image's name from the yaml file's own folder. Map savers write absolute names of the robot's
/// disk; only the last part of those is used.
fn image_beside(image: &str, notes: &mut Vec<String>) -> Result<String, String> {
    let is_absolute = image.starts_with('/') || image.contains('\\') || image.contains(':');
    let name = if is_absolute {
        let name = image.rsplit(['/', '\\']).next().unwrap_or_default();
        notes.push(format!("image is an absolute path; {name:.80} beside the yaml file was taken"));
        name
    } else {
        image.strip_prefix("./").unwrap_or(image)
    };
    if name.is_empty() || name.len() > 255 || name.split('/').any(|part| part.is_empty() || part == "..") {
        return Err(format!("image is {image:.80}, and must name a file beside the yaml file"));
    }
    Ok(name.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Cursor, Write};

    /// An archive may begin with the mark of its end. One that holds another one thousands of times would fill the stack.
    #[test]
    fn archives_in_archives_are_refused() {
        let behind_an_end = |inner: &[u8]| {
            let mut start = Cursor::new(b"PK\x05\x06".to_vec());
            start.set_position(4);
            let mut zip = ::zip::ZipWriter::new(start);
            zip.start_file("map.csv", ::zip::write::SimpleFileOptions::default()).unwrap();
            zip.write_all(inner).unwrap();
            zip.finish().unwrap().into_inner()
        };
        let one = behind_an_end(b"x,y\n0,0\n0,1\n");
        assert!(LidarMap::read(&one).is_ok());
        assert_eq!(LidarMap::read(&behind_an_end(&one)).unwrap_err().code(), "not_an_archive");
    }

    #[test]
    fn coarse_cells_are_noted() {
        for (resolution, is_noted) in [(0.05, false), (0.2, false), (0.25, true), (1.0, true)] {
            let yaml = format!(
                "image: a.pgm\nresolution: {resolution}\norigin: [0, 0, 0]\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
            );
            let image = |_: &str| Ok(b"P2 2 1 255\n0 254\n".to_vec());
            let map = read(yaml.as_bytes(), "a.yaml", Images::Beside(None), image).unwrap();
            let coarse = format!("cells of {resolution} m are coarse");
            let notes = &map.info.notes;
            assert_eq!(notes.iter().any(|note| note.starts_with(&coarse)), is_noted, "{notes:?}");
        }
    }

    #[test]
    fn a_map_far_from_its_origin_is_refused() {
        for (y_m, is_read) in [(99_990.0, true), (100_000.0, false), (-666_662.0, false)] {
            let yaml = format!(
                "image: a.pgm\nresolution: 0.05\norigin: [0, {y_m:?}, 0]\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
            );
            let map =
                read(yaml.as_bytes(), "a.yaml", Images::Anywhere, |_| Ok(b"P2 2 1 255\n0 254\n".to_vec()));
            match map {
                Ok(map) => assert!(is_read && LidarMap::read(&map.to_ply().bytes).is_ok(), "{y_m}"),
                Err(error) => {
                    assert!(!is_read && matches!(error, LidarError::FarFromOrigin { .. }), "{error}")
                }
            }
        }
    }
}
