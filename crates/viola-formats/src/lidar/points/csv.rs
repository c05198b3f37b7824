//! Points as lines of text.

use super::records::{Columns, Points};
use crate::lidar::{LidarError, LidarMap};
use std::ops::RangeInclusive;

/// Maximum number of columns that are read.
const MAX_COLUMNS: usize = 1000;
/// Maximum number of a header's names in an error.
const MAX_LISTED: usize = 20;
/// Range of the heights of a 3D scan of a room or a building, from the lowest to the highest point in metres.
/// Intensities from 0 to 1 have a smaller one, intensities to 100 or 255 a larger one.
const HEIGHT_RANGE_M: RangeInclusive<f64> = 1.2..=20.0;

/// The columns of a table.
struct Table {
    columns: Columns,
    /// Units of x, y and z in a metre.
    units_per_m: [f64; 3],
}

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

    fn is_number(&self) -> bool {
        self.number().is_some()
    }
}

/// Reads lines of `x, y`, with or without a header; separators are comma, semicolon, blank and tab. With a header
/// the columns may be in any order, those that are not x, y or z are ignored, and a name may have its unit. Without a
/// header, x and y are the first two columns, in metres, and the third is z if it can be heights.
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
    let table = match Table::of_header(&first_fields, separator) {
        Some(table) => table,
        None if first_fields.len() >= 2 && first_fields.iter().take(2).all(Field::is_number) => {
            let others = lines.clone().map(|(_, line)| line);
            let has_z = are_heights(std::iter::once(first).chain(others), separator);
            let columns = Columns { x: 0, y: 1, z: has_z.then_some(2) };
            let table = Table { columns, units_per_m: [1.0; 3] };
            table.add_line(&mut points, &first_fields, first_index)?;
            if first_fields.len() > 2 {
                notes.push("without a header, the first two columns were taken as x and y".to_string());
            }
            table
        }
        None if first.starts_with("image:") || text.contains("\nimage:") => {
            return Err(LidarError::YamlWithoutImage);
        }
        None => {
            let second = lines.next().map(|(_, line)| fields(line, separator)).unwrap_or_default();
            return Err(without_x_and_y(&first_fields, &second, first_index));
        }
    };
    for (index, line) in lines {
        table.add_line(&mut points, &fields(line, separator), index)?;
    }
    points.into_map("csv_points", notes)
}

/// Returns the error for a first line that names no x and y. It is a header if only the line after it has numbers.
fn without_x_and_y(first: &[Field], second: &[Field], index: usize) -> LidarError {
    let numbers = |fields: &[Field]| fields.iter().filter(|field| field.is_number()).count();
    if numbers(first) > 0 || numbers(second) < 2 {
        return LidarError::UnknownFormat;
    }
    let names: Vec<String> =
        first.iter().take(MAX_LISTED).map(|field| format!("{:.40}", field.text)).collect();
    let names = names.join(", ");
    let reason = format!("the columns are {names}; name two of them x and y (metres), or x_mm, x_cm, x [mm]");
    LidarError::BadPoints { line: index + 1, reason }
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

/// Returns a header's names in small letters. Between blanks, a unit in brackets belongs to the name before it.
fn names(header: &[Field], separator: Option<char>) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for field in header {
        let name = field.text.to_lowercase();
        match names.last_mut() {
            Some(last) if separator.is_none() && name.starts_with(['[', '(']) => last.push_str(&name),
            _ => names.push(name),
        }
    }
    names
}

/// Returns the units in a metre of the column of an axis, as in `x`, `pos_x`, `x_mm`, `x (m)`; `None` for another name.
fn units_per_m(name: &str, axis: &str) -> Option<f64> {
    let words: Vec<&str> =
        name.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).collect();
    let after_prefix = match words.as_slice() {
        ["pos" | "position", rest @ ..] => rest,
        all => all,
    };
    match after_prefix {
        [first] | [first, "m"] if *first == axis => Some(1.0),
        [first, "cm"] if *first == axis => Some(100.0),
        [first, "mm"] if *first == axis => Some(1000.0),
        _ => None,
    }
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

impl Table {
    /// Returns the columns that a header calls x, y and z.
    fn of_header(header: &[Field], separator: Option<char>) -> Option<Table> {
        let names = names(header, separator);
        let find = |axis: &str| {
            names.iter().enumerate().find_map(|(index, name)| Some((index, units_per_m(name, axis)?)))
        };
        let ((x, x_per_m), (y, y_per_m)) = (find("x")?, find("y")?);
        let (z, z_per_m) = find("z").unzip();
        let units_per_m = [x_per_m, y_per_m, z_per_m.unwrap_or(1.0)];
        Some(Table { columns: Columns { x, y, z }, units_per_m })
    }

    fn add_line(&self, points: &mut Points, fields: &[Field], index: usize) -> Result<(), LidarError> {
        let Columns { x, y, z } = self.columns;
        let [x_per_m, y_per_m, z_per_m] = self.units_per_m;
        let number = |column: usize| fields.get(column).and_then(Field::number);
        let (Some(x_value), Some(y_value)) = (number(x), number(y)) else {
            let reason = "expected a number for x and for y".to_string();
            return Err(LidarError::BadPoints { line: index + 1, reason });
        };
        let z_value = z.and_then(number).unwrap_or(f64::NAN);
        points.add(&self.columns, |column| match column {
            _ if column == x => x_value / x_per_m,
            _ if column == y => y_value / y_per_m,
            _ => z_value / z_per_m,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_axes_have_units_and_prefixes() {
        for (name, per_m) in [
            ("x", Some(1.0)),
            ("x_m", Some(1.0)),
            ("x [m]", Some(1.0)),
            ("x(m)", Some(1.0)),
            ("pos_x", Some(1.0)),
            ("position.x", Some(1.0)),
            ("x_mm", Some(1000.0)),
            ("x [mm]", Some(1000.0)),
            ("pos_x (mm)", Some(1000.0)),
            ("x_cm", Some(100.0)),
            ("y", None),
            ("x [ft]", None),
            ("max", None),
            ("vel_x", None),
            ("x_y", None),
            ("", None),
        ] {
            assert_eq!(units_per_m(name, "x"), per_m, "{name}");
        }
    }
}
