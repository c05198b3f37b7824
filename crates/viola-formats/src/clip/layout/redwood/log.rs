//! Trajectories of five lines per pose: three numbers, of which the third is the frame's, and the four rows of a
//! camera-to-world matrix.

use crate::clip::ClipError;
use crate::clip::layout::text::{numbers, pose_from_rows, read_possible_table};
use crate::container::Container;
use std::collections::{BTreeMap, BTreeSet};
use viola_geometry::Pose3;

/// A number and its pose; a bad pose is `None`.
type Numbered = (u32, Option<Pose3>);
pub(super) type Poses = BTreeMap<u32, Option<Pose3>>;

/// Minimum fraction of the poses that are a picture's, if there are fewer of them than pictures. If every second picture was
/// kept, and the poses are counted, half of them find another one's picture.
const MIN_FOUND: f64 = 0.75;

/// A trajectory.
pub(super) struct Log<'a> {
    name: &'a str,
    /// By the frames' numbers, from 1; at least one.
    poses: Poses,
    /// Tells that its end was cut off.
    note: Option<String>,
}

impl<'a> Log<'a> {
    /// Returns the trajectory of the pictures under `root`, `None` without any; logs of programs are skipped. One beside the
    /// pictures is preferred; several candidates are an error. At most two trajectories are in memory.
    pub fn of(
        container: &dyn Container,
        root: &str,
        names: &[&'a String],
    ) -> Result<Option<Log<'a>>, ClipError> {
        let (beside, elsewhere): (Vec<&String>, Vec<&String>) =
            names.iter().copied().partition(|name| name.starts_with(root));
        for candidates in [beside, elsewhere] {
            let mut found: Option<Log> = None;
            for name in candidates {
                let Some(second) = Log::read(container, name)? else { continue };
                if let Some(first) = found {
                    let (first, second) = (first.name.to_string(), second.name.to_string());
                    return Err(ClipError::SeveralTrajectories { first, second });
                }
                found = Some(second);
            }
            if found.is_some() {
                return Ok(found);
            }
        }
        Ok(None)
    }

    /// Returns whether any of the files is a trajectory.
    pub fn is_any(container: &dyn Container, names: &[&'a String]) -> Result<bool, ClipError> {
        for name in names {
            if Log::read(container, name)?.is_some() {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Reads a trajectory; `None` for another kind of file.
    fn read(container: &dyn Container, name: &'a str) -> Result<Option<Log<'a>>, ClipError> {
        let Some(table) = read_possible_table(container, name)? else { return Ok(None) };
        let mut rows = table.rows();
        let (mut poses, mut note) = (Poses::new(), None);
        while let Some((line, head)) = rows.next() {
            // A bad first line means another kind of file; a bad later line means damage.
            if poses.is_empty() && numbers(head.as_bytes(), 3).is_none() {
                return Ok(None);
            }
            match read_pose(line, head, &mut rows) {
                Ok(Some((frame, pose))) => {
                    poses.insert(frame, pose);
                }
                Ok(None) => note = Some(table.left_out(line)),
                Err((line, reason)) => note = Some(table.cut_off(line, reason)?),
            }
        }
        Ok((!poses.is_empty()).then_some(Log { name, poses, note }))
    }

    /// Returns the poses by the numbers of their pictures, and notes.
    pub fn by_picture(self, pictures: &BTreeSet<u32>) -> Result<(Poses, Vec<String>), ClipError> {
        let Log { name, poses, note } = self;
        let frames: Vec<u32> = poses.keys().copied().collect();
        let pictures: Vec<u32> = pictures.iter().copied().collect();
        let Some(numbers) = pictures_of(&frames, &pictures, note.is_some()) else {
            let cut_off = note.map_or(String::new(), |note| format!("; {note}"));
            let reason = format!(
                "it has {} poses, of the frames {}, for {} pictures, with the numbers {}, and it is unknown which pose \
                 is whose; add the missing pictures or poses, or keep one pose for each picture and number the poses \
                 from 1{cut_off}",
                frames.len(),
                ends(&frames),
                pictures.len(),
                ends(&pictures),
            );
            return Err(ClipError::BadMetadata { name: name.to_string(), reason });
        };
        let pair = frames.first().zip(numbers.first()).map(|(frame, number)| {
            format!(
                "poses are those of {name}; frame {frame} was taken for the picture with the number {number}"
            )
        });
        let few = (frames.len() < pictures.len())
            .then(|| format!("{name} has {} poses for {} pictures", frames.len(), pictures.len()));
        let poses = numbers.into_iter().zip(poses.into_values()).collect();
        Ok((poses, note.into_iter().chain(pair).chain(few).collect()))
    }
}

/// Reads a frame's number and pose. `None` if the file ends within them; the error has a line and its fault.
fn read_pose<'a>(
    line: usize,
    head: &str,
    rows: &mut impl Iterator<Item = (usize, &'a str)>,
) -> Result<Option<Numbered>, (usize, &'static str)> {
    let head = numbers(head.as_bytes(), 3).ok_or((line, "expected 3 whole numbers"))?;
    let mut matrix = Vec::with_capacity(16);
    for _ in 0..4 {
        let Some((line, row)) = rows.next() else { return Ok(None) };
        matrix.extend(numbers(row.as_bytes(), 4).ok_or((line, "expected 4 numbers"))?);
    }
    let is_number = head[2].fract() == 0.0 && (1.0..=4e9).contains(&head[2]);
    if !is_number {
        return Err((line, "the third number is the frame's, counted from 1"));
    }
    Ok(Some((head[2] as u32, pose_from_rows(&matrix))))
}

/// Returns the number of each frame's picture, or `None` if it is unknown. Both lists ascend, and frames count from 1;
/// `is_cut` is true if another pose was cut off behind the last one.
///
/// Open3D writes a pose for each picture in the order of their names, and counts the poses. Redwood's frames have their
/// own numbers, which poses keep if others are missing. Their pictures count from 0 (indoor scenes, Open3D) or from 1
/// (scans). If the pictures begin later, the first ones were removed, and the last one is the last frame's.
fn pictures_of(frames: &[u32], pictures: &[u32], is_cut: bool) -> Option<Vec<u32>> {
    let (last_frame, first, last) = (*frames.last()?, *pictures.first()?, *pictures.last()?);
    let are_counted = last_frame as usize == frames.len();
    let is_whole = frames.len() == pictures.len() || is_cut && frames.len() + 1 == pictures.len();
    let is_few = frames.len() < pictures.len();
    // Frames before the first picture are no pictures' numbers.
    if are_counted && (is_whole || is_few && last_frame < first) {
        return Some(pictures[..frames.len()].to_vec());
    }
    let ends_from_0 = last.checked_add(1) == Some(last_frame);
    let first_number = match first {
        0 => 0,
        // If it ends so, the first picture of a count from 0 is missing, or the last one of a count from 1.
        1 if !ends_from_0 => 1,
        2.. if ends_from_0 => 0,
        2.. if last == last_frame => 1,
        _ => return None,
    };
    let numbers: Vec<u32> = frames.iter().map(|frame| frame - 1 + first_number).collect();
    // Poses that were counted after pictures were removed are few of the pictures'.
    let found = numbers.iter().filter(|number| pictures.binary_search(number).is_ok()).count();
    let is_doubtful = is_few && (found as f64) < MIN_FOUND * frames.len() as f64;
    (!is_doubtful).then_some(numbers)
}

/// Returns the first and the last number of a list in words.
fn ends(numbers: &[u32]) -> String {
    match numbers {
        [first, .., last] => format!("{first} to {last}"),
        [number] => number.to_string(),
        [] => "none".to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::pictures_of;

    #[test]
    fn poses_belong_to_the_pictures_of_their_frames() {
        let range = |from: u32, to: u32| -> Vec<u32> { (from..=to).collect() };
        let third = |from: u32| -> Vec<u32> { (from..=99).step_by(3).collect() };
        // Frames, pictures, and the number of the first frame's picture.
        for (frames, pictures, expected) in [
            // Whole recordings that count from 0 and from 1.
            (range(1, 100), range(0, 99), Some(0)),
            (range(1, 100), range(1, 100), Some(1)),
            // Open3D reconstructed what was left of the pictures.
            (range(1, 70), range(30, 99), Some(30)),
            (range(1, 33), third(3), Some(3)),
            // Pictures are missing at the start ...
            (range(1, 100), range(30, 99), Some(0)),
            (range(1, 100), range(30, 100), Some(1)),
            (range(31, 100), range(30, 99), Some(30)),
            (range(1, 100), third(3), Some(0)),
            // ... at the end, and everywhere.
            (range(1, 100), range(0, 69), Some(0)),
            (range(1, 100), range(1, 70), Some(1)),
            (range(1, 100), third(0), Some(0)),
            (range(1, 50), third(0), Some(0)),
            // Poses are missing at either end.
            (range(1, 70), range(0, 99), Some(0)),
            (range(31, 100), range(0, 99), Some(30)),
            (range(31, 70), range(1, 100), Some(31)),
            (range(1, 20), range(30, 99), Some(30)),
            // Pictures are missing at both ends, or one is missing at the start or at the end.
            (range(1, 100), range(30, 79), None),
            (range(1, 100), range(1, 99), None),
            // Poses are missing, and pictures at the start, or all but some.
            (range(1, 69), range(30, 99), None),
            (range(1, 30), third(0), None),
            (range(1, 30), (0..=98).step_by(2).collect(), None),
        ] {
            let numbers = pictures_of(&frames, &pictures, false);
            let first = numbers.as_ref().and_then(|numbers| numbers.first().copied());
            assert_eq!(first, expected, "{frames:?} and {pictures:?}");
            assert_eq!(numbers.map(|numbers| numbers.len()), expected.map(|_| frames.len()));
        }
    }

    #[test]
    fn a_pose_that_was_cut_off_counts() {
        let range = |from: u32, to: u32| -> Vec<u32> { (from..=to).collect() };
        let fifth: Vec<u32> = (0..=95).step_by(5).collect();
        for (pictures, expected) in [
            (range(5, 24), range(5, 23)),
            (fifth.clone(), fifth[..19].to_vec()),
            (range(0, 19), range(0, 18)),
        ] {
            assert_eq!(pictures_of(&range(1, 19), &pictures, true), Some(expected), "{pictures:?}");
        }
        assert_eq!(pictures_of(&range(1, 18), &range(5, 24), true), None);
    }
}
