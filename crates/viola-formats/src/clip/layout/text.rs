//! The small text files of a clip: poses, intrinsics, lists of names.

use super::{ClipError, Intrinsics, Numbers, Of};
use crate::container::Container;
use nalgebra::{Matrix3, Quaternion, Rotation3, Translation3, UnitQuaternion};
use viola_geometry::{Pose3, Vector3};

const MAX_POSE_BYTES: u64 = 4 << 10;
const MAX_INTRINSICS_BYTES: u64 = 4 << 10;
const MAX_TABLE_BYTES: u64 = 16 << 20;
/// Poses further than this from their origin are invalid.
pub(super) const MAX_DISTANCE_M: f64 = 1e5;
/// Maximum error of the products of a rotation's columns. Exports print six digits; 7-Scenes is off by up to
/// 1e-3.
const ROTATION_TOLERANCE: f64 = 0.02;
/// If fewer than one in so many rows end with as few digits as the last row, this row was cut off.
const ROWS_FOR_A_SHORT_ONE: usize = 100;
/// Maximum difference of a quaternion's length from 1.
const QUATERNION_TOLERANCE: f64 = 0.1;

/// Reads a camera-to-world pose of 4x4 numbers, row by row; `None` if it is not a finite rigid motion.
pub(super) fn read_pose(container: &dyn Container, name: &str) -> Result<Option<Pose3>, ClipError> {
    let bytes = container.read(name, MAX_POSE_BYTES)?;
    Ok(numbers(&bytes, 16).and_then(|rows| pose_from_rows(&rows)))
}

/// Returns the pose of a 3x4 or 4x4 matrix, row by row; `None` if it is not a finite rigid motion.
pub(super) fn pose_from_rows(m: &[f64]) -> Option<Pose3> {
    let last_row_is_affine = match m.len() {
        12 => true,
        16 => m[12..15].iter().all(|v| v.abs() < 1e-6) && (m[15] - 1.0).abs() < 1e-6,
        _ => false,
    };
    if !last_row_is_affine {
        return None;
    }
    let rotation = Matrix3::new(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]);
    rigid(nearest_rotation(&rotation)?, Vector3::new(m[3], m[7], m[11]))
}

/// Returns a pose from its parts, or `None` if it is not finite or too far away.
pub(super) fn rigid(rotation: UnitQuaternion<f64>, translation: Vector3) -> Option<Pose3> {
    let is_finite = rotation.coords.iter().all(|v| v.is_finite()) && translation.norm() < MAX_DISTANCE_M;
    is_finite.then(|| Pose3::from_parts(Translation3::from(translation), rotation))
}

/// Returns a pose, or `None` if the quaternion is not of length one or a value is not finite.
pub(super) fn pose_from_quaternion(rotation: Quaternion<f64>, translation: Vector3) -> Option<Pose3> {
    let is_unit = (rotation.norm() - 1.0).abs() < QUATERNION_TOLERANCE;
    rigid(UnitQuaternion::from_quaternion(rotation), translation).filter(|_| is_unit)
}

/// Returns the rotation nearest to a matrix, or `None` if the matrix differs by more than rounding.
fn nearest_rotation(matrix: &Matrix3<f64>) -> Option<UnitQuaternion<f64>> {
    let deviation = (matrix.transpose() * matrix - Matrix3::identity()).abs().max();
    // NaN fails the comparison; a reflection has a negative determinant.
    let is_rotation = deviation < ROTATION_TOLERANCE && matrix.determinant() > 0.0;
    if !is_rotation {
        return None;
    }
    let svd = matrix.svd(true, true);
    let rotation = Rotation3::from_matrix_unchecked(svd.u? * svd.v_t?);
    Some(UnitQuaternion::from_rotation_matrix(&rotation))
}

/// Reads intrinsics from a 3x3 or a 4x4 matrix, row by row.
pub(super) fn read_intrinsics(
    container: &dyn Container,
    name: &str,
    of: Of,
) -> Result<Intrinsics, ClipError> {
    if !container.contains(name) {
        return Err(ClipError::MissingIntrinsics { name: name.to_string() });
    }
    let bytes = container.read(name, MAX_INTRINSICS_BYTES)?;
    let bad = |reason: &str| ClipError::BadIntrinsics { name: name.to_string(), reason: reason.to_string() };
    let (m, stride) = match (numbers(&bytes, 9), numbers(&bytes, 16)) {
        (Some(m), _) => (m, 3),
        (_, Some(m)) => (m, 4),
        _ => return Err(bad("expected a matrix of 3x3 or 4x4 numbers")),
    };
    let at = |row: usize, column: usize| m[row * stride + column];
    if !m.iter().all(|v| v.is_finite()) {
        return Err(bad("the matrix has numbers that are not finite"));
    }
    if at(1, 0) != 0.0 || at(2, 0) != 0.0 || at(2, 1) != 0.0 || at(2, 2) != 1.0 || at(0, 1).abs() > 1.0 {
        return Err(bad("the matrix is not one of intrinsics (fx 0 cx / 0 fy cy / 0 0 1)"));
    }
    let numbers = Numbers { fx: at(0, 0), fy: at(1, 1), cx: at(0, 2), cy: at(1, 2), of };
    Ok(Intrinsics { name: name.to_string(), numbers })
}

/// Parses exactly `count` numbers separated by blanks or commas.
pub(super) fn numbers(bytes: &[u8], count: usize) -> Option<Vec<f64>> {
    let text = without_mark(std::str::from_utf8(bytes).ok()?);
    let mut values = Vec::with_capacity(count);
    for word in words(text) {
        if values.len() == count {
            return None;
        }
        values.push(word.parse().ok()?);
    }
    (values.len() == count).then_some(values)
}

/// Parses a line of numbers separated by blanks or commas; `None` if it holds anything else.
pub(super) fn all_numbers(line: &str) -> Option<Vec<f64>> {
    words(line).map(|word| word.parse().ok()).collect()
}

/// Splits a text at blanks and commas.
fn words(text: &str) -> impl DoubleEndedIterator<Item = &str> {
    text.split(|c: char| c.is_whitespace() || c == ',').filter(|word| !word.is_empty())
}

/// Returns whether a row of numbers has fewer of them than the row above, or ends with fewer digits than nearly all rows
/// above, which are given from the first one.
fn is_shorter<'a>(row: &str, above: &str, rows: impl Iterator<Item = &'a str>) -> bool {
    let (Some(own), Some(_)) = (last_precision(row), last_precision(above)) else { return false };
    if words(row).count() < words(above).count() {
        return true;
    }
    let (mut all, mut as_short) = (0, 0);
    for precision in rows.filter_map(last_precision) {
        all += 1;
        as_short += usize::from(precision <= own);
    }
    as_short * ROWS_FOR_A_SHORT_ONE < all
}

/// Whether a number has an exponent and a point, and its digits behind the point, or all of them without one.
type Precision = (bool, bool, usize);

/// Returns the precision of a row's last number; `None` if the row ends with another word.
fn last_precision(row: &str) -> Option<Precision> {
    words(row).next_back().filter(|word| word.parse::<f64>().is_ok()).map(precision)
}

fn precision(number: &str) -> Precision {
    let (digits, exponent) = number.split_once(['e', 'E']).map_or((number, None), |(a, b)| (a, Some(b)));
    let (digits, has_point) = digits.split_once('.').map_or((digits, false), |(_, behind)| (behind, true));
    (exponent.is_some(), has_point, digits.trim_start_matches(['-', '+']).len())
}

/// Returns a text without the byte order mark that Windows' editors write in front.
fn without_mark(text: &str) -> &str {
    text.strip_prefix('\u{feff}').unwrap_or(text)
}

/// Returns a path of a list or of JSON in the form of a container's names, which have `/` between their parts.
pub(super) fn listed_path(path: &str) -> String {
    path.replace('\\', "/").trim_start_matches("./").to_string()
}

/// A text file with one entry per line; `#` begins a comment.
pub(super) struct Table {
    name: String,
    text: String,
}

pub(super) fn read_table(container: &dyn Container, name: &str) -> Result<Table, ClipError> {
    let bytes = container.read(name, MAX_TABLE_BYTES)?;
    let name = name.to_string();
    match String::from_utf8(bytes) {
        Ok(text) => Ok(Table { name, text }),
        Err(_) => Err(ClipError::BadIndex { name, line: 1, reason: "the file is not text".to_string() }),
    }
}

/// Reads a file that may be another program's; `None` if it is not text, or too large.
pub(super) fn read_possible_table(container: &dyn Container, name: &str) -> Result<Option<Table>, ClipError> {
    match read_table(container, name) {
        Err(error) if !error.is_service_fault() => Ok(None),
        table => table.map(Some),
    }
}

impl Table {
    /// Returns the lines that are not empty or comments, and their numbers, from 1.
    pub fn rows(&self) -> impl Iterator<Item = (usize, &str)> {
        let lines = without_mark(&self.text).lines().enumerate();
        let lines = lines.map(|(index, line)| (index + 1, line.trim()));
        lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
    }

    /// Reads the rows by `read`, whose error is the fault of a row. Such a row is refused, unless it was cut off.
    ///
    /// The rest of a row that was cut off may be a row as well, with a part of a number at its end. It is left out if it is
    /// shorter than the rows above; the last row of a file that only lacks its last line end is not. Early versions of
    /// Stray Scanner write no line end there, and numbers with as many digits as they need, which differ from row to row.
    pub fn read_rows(
        &self,
        notes: &mut Vec<String>,
        mut read: impl FnMut(&str) -> Result<(), &'static str>,
    ) -> Result<(), ClipError> {
        let unended = self.unended_line();
        let mut above = "";
        for (line, text) in self.rows() {
            let rows_above = self.rows().take_while(|(other, _)| *other < line).map(|(_, row)| row);
            if unended == Some(line) && is_shorter(text, above, rows_above) {
                notes.push(format!(
                    "line {line} of {} has no line end and is shorter than the lines above: it was cut off, and was \
                     left out",
                    self.name
                ));
            } else if let Err(reason) = read(text) {
                notes.push(self.cut_off(line, reason)?);
            }
            above = text;
        }
        Ok(())
    }

    /// Returns the number of the last line if it has no line end.
    fn unended_line(&self) -> Option<usize> {
        (!self.text.ends_with(['\n', '\r'])).then(|| self.text.lines().count())
    }

    /// Returns a note about a bad row that was cut off, and refuses any other bad row.
    ///
    /// A recorder that ends while it writes leaves a last line without a line end.
    pub fn cut_off(&self, line: usize, reason: &str) -> Result<String, ClipError> {
        if self.unended_line() != Some(line) {
            return Err(ClipError::BadIndex { name: self.name.clone(), line, reason: reason.to_string() });
        }
        Ok(self.left_out(line))
    }

    /// Returns the note about a table whose end is missing.
    pub fn left_out(&self, line: usize) -> String {
        format!("the end of {}, from line {line}, was cut off and was left out", self.name)
    }
}

/// Parses exactly `N` numbers; `None` for any other row.
pub(super) fn parse_row<const N: usize>(row: &str) -> Option<[f64; N]> {
    numbers(row.as_bytes(), N)?.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::{is_shorter, read_possible_table};
    use crate::container::{Container, ContainerError, Region};
    use std::io::ErrorKind;
    use std::iter;

    /// A container whose files cannot be read.
    struct Unreadable(ErrorKind);

    impl Container for Unreadable {
        fn names(&self) -> &[String] {
            &[]
        }

        fn read(&self, name: &str, _max_bytes: u64) -> Result<Vec<u8>, ContainerError> {
            Err(ContainerError::Unreadable { name: name.to_string(), source: self.0.into() })
        }

        fn region(&self, name: &str, _max_bytes: u64) -> Result<Region, ContainerError> {
            Err(ContainerError::Missing { name: name.to_string() })
        }
    }

    #[test]
    fn a_fault_of_the_machine_is_not_another_program_s_file() {
        for (kind, is_fault) in [(ErrorKind::OutOfMemory, true), (ErrorKind::InvalidData, false)] {
            let read = read_possible_table(&Unreadable(kind), "trajectory.log");
            assert_eq!(read.is_err(), is_fault, "{kind:?}");
        }
    }

    #[test]
    fn rows_that_end_too_early_are_told_by_the_row_above() {
        for (row, above, expected) in [
            ("3, 0.242785", "2, 0.226478", false),
            ("3, 0.2427", "2, 0.226478", true),
            ("3, -0.22647811", "2, 0.226478", false),
            ("3", "2, 0.226478", true),
            // The principal point, as a fraction or in whole pixels.
            ("1 585.0 24", "1 585.0 245.0", true),
            ("1 585.0 245.", "1 585.0 245.0", true),
            ("1 585 24", "1 585 245", true),
            ("1 585 -24", "1 585 245", true),
            ("1 585 245", "1 585 245", false),
            // Exponents have one digit or more.
            ("1 2.5e0", "1 2.5e-1", false),
            ("1 2.5", "1 2.5e-1", true),
            ("1 2.55e-10", "1 2.5", false),
            // Names, of columns and of files.
            ("1 0.5", "x qw", false),
            ("1.5 rgb/1.p", "1.25 rgb/1.25.png", false),
            ("1 0.5", "", false),
        ] {
            assert_eq!(is_shorter(row, above, iter::once(above)), expected, "{row} below {above}");
        }
        // One row of two ends with four digits, or one of two hundred.
        let above = "2 0.226478";
        for (rows, row, expected) in [
            (1, "3 0.2264", false),
            (1, "3 0.226", true),
            (1, "0.22647811", true),
            (199, "3 0.2264", true),
            (199, "3 0.226478", false),
        ] {
            let rows_above = iter::once("1 0.2471").chain(iter::repeat_n(above, rows));
            assert_eq!(is_shorter(row, above, rows_above), expected, "{row} below {rows} rows");
        }
    }
}
