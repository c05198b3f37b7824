//! Points as lines of text.

use super::records::{Columns, Points};
use crate::lidar::{LidarError, LidarMap};
use std::ops::RangeInclusive;

/// Maximum number of columns that are read.
const MAX_COLUMNS: usize = 1000;
/// Range of the heights of a 3D scan of a room or a building, from the lowest to the highest point in metres.
/// Intensities from 0 to 1 have a smaller one, intensities to 100 or 255 a larger one.
const HEIGHT_RANGE_M: RangeInclusive<f64> = 1.2..=20.0;

/// A value of a line.
struct Field<'a> {
    text: &'a str,
    /// True if a comma in it is a decimal comma, and does not separate values.
    has_decimal_comma: bool,
}

impl Field<'_> {
    fn number(&self) -> Option<f64> {
        match self.text.parse() {
            Ok(number) => Some(number),
            Err(_) if self.has_decimal_comma => self.text.replacen(',', ".", 1).parse().ok(),
            Err(_) => None,
        }
    }
}

/// Reads lines of `x, y` in metres, with or without a header; separators are comma, semicolon, blank and tab.
/// With a header the columns may be in any order, and those that are not x, y or z are ignored. Without a header, x and y
/// are the first two columns, and the third is z if it can be heights.
pub(in super::super) fn read_csv(bytes: &[u8]) -> Result<LidarMap, LidarError> {
    let text = std::str::from_utf8(bytes).map_err(|_| LidarError::UnknownFormat)?;
    let mut lines = text.lines().enumerate().filter(|(_, line)| {
        let line = line.trim();
        !line.is_empty() && !line.starts_with('#')
    });
    let Some((first_index, first)) = lines.next() else { return Err(LidarError::UnknownFormat) };
    // CloudCompare writes two slashes in front of the columns' names.
    let first = first.trim_start().trim_start_matches("//");
    let separator = separator(first);
    let first_fields = fields(first, separator);
    let (mut points, mut notes) = (Points::default(), Vec::new());
    let columns = match columns(&first_fields) {
        Some(columns) => columns,
        None if first_fields.len() >= 2 && first_fields.iter().take(2).all(|f| f.number().is_some()) => {
            let others = lines.clone().map(|(_, line)| line);
            let has_z = are_heights(std::iter::once(first).chain(others), separator);
            let columns = Columns { x: 0, y: 1, z: has_z.then_some(2) };
            add_line(&mut points, &columns, &first_fields, first_index)?;
            if first_fields.len() > 2 {
                notes.push("without a header, the first two columns were taken as x and y".to_string());
            }
            columns
        }
        None if first.starts_with("image:") || text.contains("\nimage:") => {
            return Err(LidarError::YamlWithoutImage);
        }
        None => return Err(LidarError::UnknownFormat),
    };
    for (index, line) in lines {
        add_line(&mut points, &columns, &fields(line, separator), index)?;
    }
    points.into_map("csv_points", notes)
}

/// Returns the separator of a line; `None` stands for blanks and tabs.
fn separator(line: &str) -> Option<char> {
    [';', ','].into_iter().find(|&separator| parts(line, separator).nth(1).is_some())
}

/// Splits a line at a separator outside of quotation marks.
fn parts(line: &str, separator: char) -> impl Iterator<Item = &str> {
    let mut is_quoted = false;
    line.split(move |c: char| {
        is_quoted ^= c == '"';
        c == separator && !is_quoted
    })
}

/// Splits a line at blanks outside of quotation marks.
fn words(line: &str) -> impl Iterator<Item = &str> {
    let mut is_quoted = false;
    let words = line.split(move |c: char| {
        is_quoted ^= c == '"';
        c.is_whitespace() && !is_quoted
    });
    words.filter(|word| !word.is_empty())
}

fn fields(line: &str, separator: Option<char>) -> Vec<Field<'_>> {
    let field = |part| {
        let text: &str = str::trim(part);
        let has_decimal_comma = separator != Some(',') || text.starts_with('"');
        Field { text: text.trim_matches('"').trim(), has_decimal_comma }
    };
    match separator {
        Some(separator) => parts(line, separator).take(MAX_COLUMNS).map(field).collect(),
        None => words(line).take(MAX_COLUMNS).map(field).collect(),
    }
}

/// Returns the columns that a header calls x, y and z.
fn columns(header: &[Field]) -> Option<Columns> {
    let find = |axis: &str| {
        let names = [axis.to_string(), format!("{axis}_m"), format!("{axis}[m]"), format!("{axis} [m]")];
        header.iter().position(|field| names.contains(&field.text.to_lowercase()))
    };
    Some(Columns { x: find("x")?, y: find("y")?, z: find("z") })
}

/// Returns whether the third values of all lines can be heights in metres, and not qualities, labels or intensities.
fn are_heights<'a>(lines: impl Iterator<Item = &'a str>, separator: Option<char>) -> bool {
    let (mut low, mut high, mut are_whole) = (f64::INFINITY, f64::NEG_INFINITY, true);
    for line in lines {
        let Some(third) = fields(line, separator).get(2).and_then(Field::number) else { return false };
        are_whole &= third.fract() == 0.0;
        (low, high) = (low.min(third), high.max(third));
    }
    !are_whole && HEIGHT_RANGE_M.contains(&(high - low))
}

fn add_line(
    points: &mut Points,
    columns: &Columns,
    fields: &[Field],
    index: usize,
) -> Result<(), LidarError> {
    let number = |column: usize| fields.get(column).and_then(Field::number);
    let (Some(x), Some(y)) = (number(columns.x), number(columns.y)) else {
        let reason = "expected a number for x and for y".to_string();
        return Err(LidarError::BadPoints { line: index + 1, reason });
    };
    let z = columns.z.and_then(number).unwrap_or(f64::NAN);
    points.add(columns, |column| match column {
        _ if column == columns.x => x,
        _ if column == columns.y => y,
        _ => z,
    })
}
