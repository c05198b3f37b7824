//! Points as lines of text.

use super::Cloud;
use crate::lidar::{LidarError, LidarMap};

/// Reads lines of `x, y` in metres, with or without a header; separators are comma, semicolon, blank and tab.
/// With a header the columns may be in any order, and those that are not x or y are ignored.
pub(in super::super) fn read_csv(bytes: &[u8]) -> Result<LidarMap, LidarError> {
    let text = std::str::from_utf8(bytes).map_err(|_| LidarError::UnknownFormat)?;
    let mut lines = text.lines().enumerate().filter(|(_, line)| {
        let line = line.trim();
        !line.is_empty() && !line.starts_with('#')
    });
    let Some((first_index, first)) = lines.next() else { return Err(LidarError::UnknownFormat) };
    let separator = separator(first);
    let first_fields = fields(first, separator);
    let (mut cloud, mut notes) = (Cloud::default(), Vec::new());
    let (x, y) = match columns(&first_fields) {
        Some(columns) => columns,
        None if first_fields.len() >= 2 && first_fields.iter().take(2).all(|f| f.parse::<f64>().is_ok()) => {
            add_line(&mut cloud, &first_fields, (0, 1), first_index)?;
            if first_fields.len() > 2 {
                notes.push("without a header, the first two columns were taken as x and y".to_string());
            }
            (0, 1)
        }
        None if first.starts_with("image:") || text.contains("\nimage:") => {
            return Err(LidarError::YamlWithoutImage);
        }
        None => return Err(LidarError::UnknownFormat),
    };
    for (index, line) in lines {
        add_line(&mut cloud, &fields(line, separator), (x, y), index)?;
    }
    cloud.into_map("csv_points", notes)
}

/// Returns the separator of a line; `None` stands for blanks and tabs.
fn separator(line: &str) -> Option<char> {
    [';', ','].into_iter().find(|&c| line.contains(c))
}

fn fields(line: &str, separator: Option<char>) -> Vec<&str> {
    match separator {
        Some(separator) => line.split(separator).map(|field| field.trim().trim_matches('"')).collect(),
        None => line.split_whitespace().collect(),
    }
}

/// Returns the columns that a header calls x and y.
fn columns(header: &[&str]) -> Option<(usize, usize)> {
    let find = |axis: &str| {
        let names = [axis.to_string(), format!("{axis}_m"), format!("{axis}[m]"), format!("{axis} [m]")];
        header.iter().position(|field| names.contains(&field.to_lowercase()))
    };
    Some((find("x")?, find("y")?))
}

fn add_line(
    cloud: &mut Cloud,
    fields: &[&str],
    (x, y): (usize, usize),
    index: usize,
) -> Result<(), LidarError> {
    let number = |column: usize| fields.get(column).and_then(|field| field.parse::<f64>().ok());
    let (Some(x), Some(y)) = (number(x), number(y)) else {
        let reason = "expected a number for x and for y".to_string();
        return Err(LidarError::BadPoints { line: index + 1, reason });
    };
    cloud.add(x, y)
}
