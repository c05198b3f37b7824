//! Points as lines of text.

use super::{Columns, Points};
use crate::lidar::{LidarError, LidarMap};
use std::borrow::Cow;
use std::ops::RangeInclusive;

/// Maximum number of columns that are read.
const MAX_COLUMNS: usize = 1000;
/// Maximum number of a header's names in an error.
const MAX_LISTED: usize = 20;
/// Range of the heights of a 3D scan of a room or a building, from the lowest to the highest point in metres.
/// Intensities from 0 to 1 have a smaller one, intensities to 100 or 255 a larger one.
const HEIGHT_RANGE_M: RangeInclusive<f64> = 1.2..=20.0;

/// The columns of a table.
#[derive(Clone, Copy)]
struct Table {
    /// `None` stands for blanks and tabs.
    separator: Option<char>,
    columns: Columns,
    /// Units of x, y and z in a metre.
    units_per_m: [f64; 3],
}

/// A line with the names of the columns, of which one is x and one is y.
struct Header {
    names: Vec<String>,
    /// Its separator is that of the names.
    table: Table,
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
    let text: &str = &with_line_feeds(text);
    let is_comment = |line: &str| line.trim_start().starts_with('#');
    let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty() && !is_comment(line));
    let Some((first_index, first)) = lines.next() else { return Err(LidarError::UnknownFormat) };
    // CloudCompare writes two slashes in front of the columns' names.
    let first = first.trim_start().trim_start_matches("//");
    let second = lines.clone().next();
    let (mut points, mut notes) = (Points::default(), Vec::new());
    let table = if let Some(header) = Header::parse(first) {
        header.table_above(first_index, second)?
    } else {
        // NumPy writes the names behind the sign of a comment.
        let comment = text.lines().take(first_index).enumerate().filter(|(_, line)| is_comment(line)).last();
        let table = if let Some((index, table)) = comment.and_then(|line| Table::of_comment(line, first)) {
            notes.push(format!("line {}, a comment, was read as the names of the columns", index + 1));
            table
        } else {
            let others = lines.clone().map(|(_, line)| line);
            let Some(table) = Table::without_header(std::iter::once(first).chain(others)) else {
                if first.starts_with("image:") || text.contains("\nimage:") {
                    return Err(LidarError::YamlWithoutImage);
                }
                return Err(without_x_and_y(first, second.map(|(_, line)| line), first_index));
            };
            if table.fields(first).len() > 2 {
                notes.push("without a header, the first two columns were taken as x and y".to_string());
            }
            table
        };
        table.add_line(&mut points, first, first_index)?;
        table
    };
    for (index, line) in lines {
        table.add_line(&mut points, line, index)?;
    }
    points.into_map("csv_points", notes)
}

/// Returns the text with line feeds, also if its lines end in carriage returns alone, as in Excel's "CSV (Macintosh)".
fn with_line_feeds(text: &str) -> Cow<'_, str> {
    if text.contains('\n') || !text.contains('\r') {
        Cow::Borrowed(text)
    } else {
        Cow::Owned(text.replace('\r', "\n"))
    }
}

/// Returns the error for a first line that names no x and y. It is a header if only the line after it has numbers.
fn without_x_and_y(first: &str, second: Option<&str>, index: usize) -> LidarError {
    let separator = separator(first);
    let (first, second) = (fields(first, separator), fields(second.unwrap_or_default(), separator));
    let numbers = |fields: &[Field]| fields.iter().filter(|field| field.is_number()).count();
    if numbers(&first) > 0 || numbers(&second) < 2 {
        return LidarError::UnknownFormat;
    }
    let names = listed(first.iter().map(|field| field.text));
    let reason = format!("the columns are {names}; name two of them x and y (metres), or x_mm, x_cm, x [mm]");
    LidarError::BadPoints { line: index + 1, reason }
}

/// Returns the first names of a header in words.
fn listed<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let names: Vec<String> = names.take(MAX_LISTED).map(|name| format!("{name:.40}")).collect();
    names.join(", ")
}

/// Returns the separator of a line; `None` stands for blanks. Names may have blanks between tabs, and blanks and tabs may be
/// beside another separator.
fn separator(line: &str) -> Option<char> {
    let line = line.trim_end();
    let splits = |separator: &char| parts(line, *separator).nth(1).is_some();
    let is_beside_another = |part: &str| {
        let part = part.trim();
        part.starts_with([';', ',']) || part.ends_with([';', ','])
    };
    if splits(&'\t') && !parts(line, '\t').any(is_beside_another) {
        return Some('\t');
    }
    [';', ','].into_iter().find(splits)
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
    let is_open = |name: &String| name.rfind(['[', '(']) > name.rfind([']', ')']);
    let mut names: Vec<String> = Vec::new();
    for field in header {
        let name = field.text.to_lowercase();
        let is_unit = name.starts_with(['[', '(']) || names.last().is_some_and(is_open);
        match names.last_mut() {
            Some(last) if separator.is_none() && is_unit => last.push_str(&name),
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

impl Header {
    /// Parses the names of a header, of which one is x and one is y.
    fn parse(line: &str) -> Option<Header> {
        // Tabs stand for blanks if the names are none with them.
        let separators = [separator(line), separator(line).filter(|separator| *separator != '\t')];
        separators.into_iter().find_map(|separator| {
            let names = names(&fields(line, separator), separator);
            let find = |axis: &str| {
                names.iter().enumerate().find_map(|(index, name)| Some((index, units_per_m(name, axis)?)))
            };
            let ((x, x_per_m), (y, y_per_m)) = (find("x")?, find("y")?);
            let (z, z_per_m) = find("z").unzip();
            let units_per_m = [x_per_m, y_per_m, z_per_m.unwrap_or(1.0)];
            Some(Header { table: Table { separator, columns: Columns { x, y, z }, units_per_m }, names })
        })
    }

    /// Returns the table of lines like this one, which has one value for each name; `None` if it has not.
    fn table_of(&self, line: &str) -> Option<Table> {
        let fits = |fields: Vec<Field>| {
            // A separator may be at the end of the lines.
            let last_name = self.names.iter().rposition(|name| !name.is_empty());
            let last_value = fields.iter().rposition(|field| !field.text.is_empty());
            self.names.len() == fields.len() || last_name == last_value
        };
        let separators = [self.table.separator, separator(line), None];
        let separator = separators.into_iter().find(|&separator| fits(fields(line, separator)))?;
        Some(Table { separator, ..self.table })
    }

    /// Returns the table of the line after the header, if there is one; `index` is the header's.
    fn table_above(&self, index: usize, line: Option<(usize, &str)>) -> Result<Table, LidarError> {
        let Some((index_below, line)) = line else { return Ok(self.table) };
        self.table_of(line).ok_or_else(|| {
            let names = listed(self.names.iter().map(String::as_str));
            let reason = format!(
                "it has {} names of columns ({names}), and line {} has {} values; name each column once, or separate names \
                 and values by commas",
                self.names.len(),
                index_below + 1,
                fields(line, separator(line)).len(),
            );
            LidarError::BadPoints { line: index + 1, reason }
        })
    }
}

impl Table {
    /// Returns the table whose columns a comment names, and the comment's index, if the first line has one value for each
    /// name, and numbers for x and y.
    fn of_comment((index, comment): (usize, &str), first: &str) -> Option<(usize, Table)> {
        let names = comment.trim_start().trim_start_matches('#');
        let table = Header::parse(names.trim_start())?.table_of(first)?;
        table.point_m(first).map(|_| (index, table))
    }

    /// Returns the table of lines without names; `None` if the first line does not begin with two numbers.
    fn without_header<'a>(lines: impl Iterator<Item = &'a str> + Clone) -> Option<Table> {
        let first = lines.clone().next()?;
        let separator = separator(first).filter(|separator| *separator != '\t');
        let columns = Columns { x: 0, y: 1, z: None };
        let table = Table { separator, columns, units_per_m: [1.0; 3] };
        table.point_m(first)?;
        let has_z = are_heights(lines, separator);
        Some(Table { columns: Columns { z: has_z.then_some(2), ..columns }, ..table })
    }

    fn fields<'a>(&self, line: &'a str) -> Vec<Field<'a>> {
        fields(line, self.separator)
    }

    /// Returns x, y and z of a line in metres, NaN for an absent z; `None` without numbers for x and y.
    fn point_m(&self, line: &str) -> Option<[f64; 3]> {
        let Columns { x, y, z } = self.columns;
        let [x_per_m, y_per_m, z_per_m] = self.units_per_m;
        let fields = self.fields(line);
        let number = |column: usize| fields.get(column).and_then(Field::number);
        let z_value = z.and_then(number).unwrap_or(f64::NAN);
        Some([number(x)? / x_per_m, number(y)? / y_per_m, z_value / z_per_m])
    }

    fn add_line(&self, points: &mut Points, line: &str, index: usize) -> Result<(), LidarError> {
        let Some([x_m, y_m, z_m]) = self.point_m(line) else {
            let reason = "expected a number for x and for y".to_string();
            return Err(LidarError::BadPoints { line: index + 1, reason });
        };
        points.add(&self.columns, |column| match column {
            _ if column == self.columns.x => x_m,
            _ if column == self.columns.y => y_m,
            _ => z_m,
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
