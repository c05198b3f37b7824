//! ROS map_server maps: a yaml file and a grey image (nav2_map_server `map_io.cpp`).

mod raster;
mod turn;

use super::build::{Parts, build, occupied_centres};
use super::{LidarError, LidarMap, MAX_FILE_BYTES, MapMarks};
use crate::container::{Container, ContainerError, Zip};
use serde::Deserialize;
use viola_geometry::{Grid, GridFrame, Pose2};

const MAX_YAML_BYTES: u64 = 64 << 10;
/// A free threshold that keeps a map saver's unknown (205) from being free.
const SAVED_FREE_THRESHOLD: f64 = 0.196;
/// Larger cells get a note.
const COARSE_CELL_M: f64 = 0.2;
/// A smaller yaw moves the largest map by less than a cell.
const MIN_YAW_RAD: f64 = 1e-6;

#[derive(Deserialize)]
struct Description {
    image: String,
    resolution: f64,
    origin: Vec<f64>,
    #[serde(default)]
    negate: Option<Switch>,
    occupied_thresh: f64,
    free_thresh: f64,
    #[serde(default)]
    mode: Mode,
}

#[derive(Deserialize, Default, Clone, Copy, PartialEq)]
#[serde(try_from = "String")]
enum Mode {
    #[default]
    Trinary,
    Scale,
    Raw,
}

impl TryFrom<String> for Mode {
    type Error = String;

    /// Parses a mode in letters of either case, as map_server does.
    fn try_from(name: String) -> Result<Mode, String> {
        match name.to_ascii_lowercase().as_str() {
            "trinary" => Ok(Mode::Trinary),
            "scale" => Ok(Mode::Scale),
            "raw" => Ok(Mode::Raw),
            _ => Err(format!("mode is trinary, scale or raw, and not {name}")),
        }
    }
}

#[derive(Deserialize, Clone, Copy)]
#[serde(untagged)]
enum Switch {
    Bool(bool),
    Number(i64),
}

/// Returns whether a file is a map's description by its name.
pub(super) fn is_yaml(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    name.ends_with(".yaml") || name.ends_with(".yml")
}

/// Reads a zip with one yaml file and the image that it names, or with one file of any other map.
pub(super) fn read_zip(bytes: &[u8]) -> Result<LidarMap, LidarError> {
    let zip = Zip::from_bytes(bytes.to_vec())?;
    if let [name] = zip.names()
        && !is_yaml(name)
    {
        let bytes = zip.read(name, MAX_FILE_BYTES)?;
        if bytes.starts_with(b"PK\x03\x04") {
            return Err(ContainerError::ArchiveInside { name: name.clone() }.into());
        }
        return LidarMap::read(&bytes);
    }
    let mut yamls = zip.names().iter().filter(|name| is_yaml(name));
    let name = yamls.next().ok_or(LidarError::UnknownFormat)?;
    if let Some(second) = yamls.next() {
        let reason = format!("the archive has another one, {second}; send one map");
        return Err(LidarError::BadYaml { name: name.clone(), reason });
    }
    let folder = name.rsplit_once('/').map_or(String::new(), |(folder, _)| format!("{folder}/"));
    let files = zip.names().iter().filter_map(|path| path.strip_prefix(folder.as_str()));
    let mut images = files.filter(|file| is_image(file));
    let only_image = images.next().filter(|_| images.next().is_none());
    read(&zip.read(name, MAX_YAML_BYTES)?, name, only_image, |image| {
        let path = format!("{folder}{image}");
        if !zip.contains(&path) {
            return Err(LidarError::MissingImage { yaml: name.clone(), image: image.to_string() });
        }
        Ok(zip.read(&path, MAX_FILE_BYTES)?)
    })
}

/// Returns whether a file in the yaml file's folder is an image by its name.
fn is_image(name: &str) -> bool {
    let lower = name.to_ascii_lowercase();
    !name.contains('/') && (lower.ends_with(".pgm") || lower.ends_with(".png"))
}

/// Reads a yaml file, and its image with `read_image`. `only_image` is the only image beside it, if there is one.
pub(super) fn read(
    yaml: &[u8],
    name: &str,
    only_image: Option<&str>,
    read_image: impl Fn(&str) -> Result<Vec<u8>, LidarError>,
) -> Result<LidarMap, LidarError> {
    let bad = |reason: String| LidarError::BadYaml { name: name.to_string(), reason };
    if yaml.len() as u64 > MAX_YAML_BYTES {
        return Err(bad(format!("it has more than {MAX_YAML_BYTES} bytes")));
    }
    let mut description: Description =
        serde_yaml_ng::from_slice(yaml).map_err(|error| bad(error.to_string()))?;
    let mut notes = Vec::new();
    let image_name = image_beside(&description.image, &mut notes).map_err(bad)?;
    let origin = check(&description).map_err(bad)?;
    if description.resolution > COARSE_CELL_M {
        notes.push(format!(
            "cells of {} m are coarse: poses of clips are up to half a cell off, and most clips are not aligned",
            description.resolution
        ));
    }
    let (bytes, image_name) = find_image(&image_name, only_image, read_image, &mut notes)?;
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
        rooms: Vec::new(),
        charger: None,
        marks: MapMarks::default(),
        carpet_m: Vec::new(),
        notes,
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

fn is_absent(error: &LidarError) -> bool {
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

/// Checks the numbers and returns the pose of the image's lower-left corner in the map.
fn check(description: &Description) -> Result<Pose2, String> {
    let Description { resolution, occupied_thresh, free_thresh, .. } = *description;
    if !(0.001..=1.0).contains(&resolution) {
        return Err(format!("resolution is {resolution}, and must be from 0.001 to 1 metre for each pixel"));
    }
    let &[x_m, y_m, yaw_rad] = description.origin.as_slice() else {
        return Err("origin must be [x, y, yaw]".to_string());
    };
    let is_bounded = |v: f64| v.abs() < 1e6;
    if !(is_bounded(x_m) && is_bounded(y_m) && is_bounded(yaw_rad)) {
        return Err("origin must be finite".to_string());
    }
    if !(0.0 <= free_thresh && free_thresh < occupied_thresh && occupied_thresh <= 1.0) {
        return Err(format!(
            "free_thresh is {free_thresh} and occupied_thresh is {occupied_thresh}; 0 <= free < occupied <= 1 must hold"
        ));
    }
    Ok(Pose2::new(x_m, y_m, yaw_rad))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coarse_cells_are_noted() {
        for (resolution, is_noted) in [(0.05, false), (0.2, false), (0.25, true), (1.0, true)] {
            let yaml = format!(
                "image: a.pgm\nresolution: {resolution}\norigin: [0, 0, 0]\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
            );
            let map = read(yaml.as_bytes(), "a.yaml", None, |_| Ok(b"P2 2 1 255\n0 254\n".to_vec())).unwrap();
            let coarse = format!("cells of {resolution} m are coarse");
            let notes = &map.info.notes;
            assert_eq!(notes.iter().any(|note| note.starts_with(&coarse)), is_noted, "{notes:?}");
        }
    }
}
