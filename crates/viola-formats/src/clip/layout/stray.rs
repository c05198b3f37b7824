//! Stray Scanner: `odometry.csv`, `camera_matrix.csv`, `depth/000000.png`, `confidence/000000.png`, and
//! colour as `rgb.mp4`, `rgb.mov` or pictures in `rgb/` (strayrobots/scanner, docs/format.md and the encoders
//! in Swift; OpenArCloud/openvps and YvigUnderscore/ReMap read the same).
//!
//! Depth, intrinsics and the pixels of the video lie as the sensor does. The app writes a rotation by 90 degrees
//! clockwise into the video's header, however the phone is held (`VideoEncoder.swift`). Players and most
//! programs that unpack or convert the video apply it, so their pictures are upright beside depth that lies.

mod imu;
mod odometry;

use super::numbered::{self, PICTURES, pictures_under};
use super::text::read_intrinsics;
use super::{
    ARKIT_UP, Cameras, ClipError, ColorAt, DepthAt, Layout, MILLIMETRES, Numbers, Of, Source, incomplete,
    only_root, roots_of, video,
};
use crate::clip::npy::Allowed;
use crate::container::Container;
use odometry::Row;
use std::collections::BTreeMap;
use viola_geometry::Vector3;

const ODOMETRY: &str = "odometry.csv";
const INTRINSICS: &str = "camera_matrix.csv";

const TURNED: &str = "colour is upright and depth lies as the sensor does: colour was turned back by a quarter, against \
    the rotation by 90 degrees that the app writes into its video";

/// Maximum relative change of a frame's intrinsics from the last frame's: the lens moves to stabilise.
const MAX_DRIFT: f64 = 0.1;

/// Finds the recording in a container; returns `None` if there is none.
pub(super) fn find(container: &dyn Container) -> Result<Option<Layout>, ClipError> {
    let Some(root) = only_root(roots_of(container, ODOMETRY))? else { return Ok(None) };
    let mut notes = Vec::new();
    let rows = odometry::read(container, &format!("{root}{ODOMETRY}"), &mut notes)?;
    let pictures =
        |folder: &str, endings: &[&str]| pictures_under(container, &format!("{root}{folder}/"), endings);
    let (color, confidence) = (pictures("rgb", &PICTURES)?, pictures("confidence", &["png"])?);
    let mut depth = pictures("depth", &["png"])?;
    // Early versions of the app wrote NumPy files.
    let is_npy = depth.is_empty();
    if is_npy {
        depth = pictures("depth", &["npy"])?;
    }

    let video = if color.is_empty() { video::find(container, root, &["rgb.mp4", "rgb.mov"])? } else { None };
    let shown = video.as_ref().map_or(0, |(_, _, info)| info.time_s.len());
    let first_shown = first_shown(&rows, shown);
    let color_at = |number: u32| match &video {
        Some((_, _, info)) => {
            let (frame, size) = (number.checked_sub(first_shown)?, (info.width, info.height));
            ((frame as usize) < shown).then_some(ColorAt::Video { frame, size })
        }
        None => numbered::color_at(&color, number),
    };
    let intrinsics = read_intrinsics(container, &format!("{root}{INTRINSICS}"), Of::Color)?;
    let use_own = use_own(&rows, &intrinsics.numbers, &mut notes);

    let mut sources = Vec::new();
    for (&number, &depth) in &depth {
        let Some(color) = color_at(number) else { continue };
        let row = rows.get(&number);
        sources.push(Source {
            number,
            time_s: row.and_then(|row| row.time_s),
            world_from_camera: row.and_then(|row| row.world_from_camera),
            color,
            depth: depth_at(depth.to_string(), is_npy),
            confidence: confidence.get(&number).map(|name| name.to_string()),
            numbers: row.and_then(|row| row.numbers).filter(|_| use_own),
        });
    }
    let imu = format!("{root}imu.csv");
    if container.contains(&imu) {
        let poses = rows.values().filter_map(|row| Some((row.time_s?, row.world_from_camera?)));
        // It is compared only: a damaged file costs a note and not the clip.
        match imu::compare(container, &imu, poses) {
            Err(error) if !error.is_service_fault() => notes.push(format!("not used: {error}")),
            note => notes.push(note?),
        }
    }
    notes.extend(video.as_ref().map(|(name, _, info)| video::words(name, info)));
    let color_is_turned = is_turned(container, sources.first(), &intrinsics.numbers)?;
    notes.extend(color_is_turned.then(|| TURNED.to_string()));
    let color_pictures = color.len() + shown;
    let incomplete = incomplete(color_pictures, depth.len(), sources.len());
    let words = if use_own {
        format!("{ODOMETRY}, for each frame; depth is scaled to them")
    } else {
        format!("{INTRINSICS}, of the last frame, for all; depth is scaled to it")
    };
    Ok(Some(Layout {
        pose_files: ODOMETRY,
        depth_unit: if is_npy { "millimetres (16-bit .npy)" } else { MILLIMETRES },
        gravity: ARKIT_UP.to_string(),
        up_in_world: Some(Vector3::y()),
        color_pictures,
        depth_pictures: depth.len(),
        incomplete,
        intrinsics: words,
        video: video.map(|(name, region, _)| (name, region)),
        color_is_turned,
        notes,
        ..Layout::new("stray_scanner", Cameras::One(intrinsics), sources)
    }))
}

fn depth_at(name: String, is_npy: bool) -> DepthAt {
    if is_npy { DepthAt::Npy(name, Allowed::Integers) } else { DepthAt::Png(name) }
}

/// Returns the number of the video's first frame among the odometry's rows. If their numbers begin above 0, the start of
/// the recording was cut off: from the video, too, or from the odometry alone.
fn first_shown(rows: &BTreeMap<u32, Row>, shown: usize) -> u32 {
    let (Some((first, _)), Some((last, _))) = (rows.first_key_value(), rows.last_key_value()) else {
        return 0;
    };
    // A whole video has a frame for each number up to the last one, a cut one for each row; a few may be missing.
    let is_whole = shown as u64 + u64::from(*first) / 2 > u64::from(*last);
    if is_whole { 0 } else { *first }
}

/// Returns whether the rows' own intrinsics are used, and notes if they are not.
fn use_own(rows: &BTreeMap<u32, Row>, numbers: &Numbers, notes: &mut Vec<String>) -> bool {
    let mut own = rows.values().filter_map(|row| row.numbers).peekable();
    let has_own = own.peek().is_some();
    let use_own = has_own && own.all(|own| own.is_near(numbers, MAX_DRIFT));
    if has_own && !use_own {
        notes.push(format!(
            "fx, fy, cx, cy of {ODOMETRY} are not near those of {INTRINSICS}, which were used"
        ));
    }
    use_own
}

/// Returns whether colour is upright, and depth and intrinsics lie as the sensor does.
fn is_turned(
    container: &dyn Container,
    first: Option<&Source>,
    numbers: &Numbers,
) -> Result<bool, ClipError> {
    let Some(first) = first else { return Ok(false) };
    let Some((color_width, color_height)) = first.color.size(container)? else { return Ok(false) };
    let (depth_width, depth_height) = first.depth.size(container)?;
    Ok(color_width < color_height && depth_width > depth_height && numbers.cx > numbers.cy)
}
