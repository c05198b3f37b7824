//! The rows of `odometry.csv`.

use crate::clip::layout::text::{all_numbers, pose_from_quaternion, read_table};
use crate::clip::layout::{Numbers, Of};
use crate::clip::{ClipError, MAX_FRAMES};
use crate::container::Container;
use nalgebra::Quaternion;
use std::collections::BTreeMap;
use viola_geometry::{Pose3, Vector3};

const COLUMNS: &str = "expected numbers: timestamp, frame, x, y, z, qx, qy, qz, qw, and maybe fx, fy, cx, cy";
/// Minimum number of poses at the origin that are not tracked: a clip may begin at its origin.
const MIN_UNTRACKED: usize = 2;

/// A row of the odometry.
pub(super) struct Row {
    /// In pixels of the colour picture.
    pub numbers: Option<Numbers>,
    pub time_s: Option<f64>,
    pub world_from_camera: Option<Pose3>,
}

/// Returns the rows by frame number; old recordings have no times and numbers, and are counted. Since April
/// 2026 the frame's intrinsics and the centre of the lens distortion, which may be empty, follow the pose.
pub(super) fn read(
    container: &dyn Container,
    name: &str,
    notes: &mut Vec<String>,
) -> Result<BTreeMap<u32, Row>, ClipError> {
    let mut rows = BTreeMap::new();
    let (mut count, mut more) = (0, 0);
    let mut is_old = None;
    read_table(container, name)?.read_rows(notes, |text| {
        if is_head(text) {
            return Ok(());
        }
        let values = all_numbers(text).ok_or(COLUMNS)?;
        let (head, [x, y, z, qx, qy, qz, qw], behind) = match values.as_slice() {
            pose if pose.len() == 7 => (None, pose.first_chunk().ok_or(COLUMNS)?, &[][..]),
            [time_s, frame, rest @ ..] if matches!(rest.len(), 7 | 11..) => {
                let (pose, behind) = rest.split_first_chunk().ok_or(COLUMNS)?;
                (Some((*time_s, *frame)), pose, behind)
            }
            _ => return Err(COLUMNS),
        };
        // A row of a newer recording that was cut off may have as many columns as an old one.
        if *is_old.get_or_insert(head.is_none()) != head.is_none() {
            return Err(COLUMNS);
        }
        let number = match head {
            Some((_, frame)) if frame.fract() == 0.0 && (0.0..=4e9).contains(&frame) => frame as u32,
            Some(_) => return Err("the frame is no whole number"),
            None => count,
        };
        count += 1;
        // A hostile file has a million rows, of which each would take some hundred bytes.
        if rows.len() == MAX_FRAMES && !rows.contains_key(&number) {
            more += 1;
            return Ok(());
        }
        let numbers = behind.first_chunk().map(|&[fx, fy, cx, cy]| Numbers { fx, fy, cx, cy, of: Of::Color });
        let world_from_camera =
            pose_from_quaternion(Quaternion::new(*qw, *qx, *qy, *qz), Vector3::new(*x, *y, *z));
        let time_s = head.map(|(time_s, _)| time_s).filter(|time_s| time_s.is_finite());
        rows.insert(number, Row { numbers, time_s, world_from_camera });
        Ok(())
    })?;
    if more > 0 {
        return Err(ClipError::TooManyFrames { frames: MAX_FRAMES + more, max: MAX_FRAMES });
    }
    notes.extend(drop_untracked(&mut rows, name));
    Ok(rows)
}

/// Drops the poses of the first rows if all of them are at the origin and a later one is not, and returns a note.
///
/// Until ARKit tracks the camera, its position is exactly 0, and only its rotation is known. Tracked positions differ
/// from row to row: of two real recordings, one begins with 39 rows at the origin, and no other position occurs twice
/// in a row. So one row at the origin is the start of a clip, and more of them are not tracked. If all rows are there,
/// another program wrote a camera that turns on the spot.
fn drop_untracked(rows: &mut BTreeMap<u32, Row>, name: &str) -> Option<String> {
    let is_at_origin =
        |row: &&Row| row.world_from_camera.is_some_and(|pose| pose.translation.vector == Vector3::zeros());
    let untracked = rows.values().take_while(is_at_origin).count();
    if untracked < MIN_UNTRACKED || untracked == rows.len() {
        return None;
    }
    rows.values_mut().take(untracked).for_each(|row| row.world_from_camera = None);
    Some(format!(
        "the first {untracked} rows of {name} have the position 0, 0, 0, as before tracking begins: their poses were \
         not used"
    ))
}

/// Returns whether a line holds the columns' names.
fn is_head(text: &str) -> bool {
    text.split(',').next().is_none_or(|word| word.trim().parse::<f64>().is_err() && text.contains("qw"))
}
