//! Bare points: CSV.

use super::build::{Parts, build};
use super::{LidarError, LidarMap, MAX_POINTS};
use crate::geometry::Point2;

/// Points further away than this from the origin are no home's, in metres.
const MAX_DISTANCE_M: f64 = 1e5;

/// Lines of `x, y` in metres, with or without a header; separators are comma, semicolon, blank and tab.
/// With a header the columns may be in any order, and those that are not x or y are ignored.
pub(super) fn read_csv(bytes: &[u8]) -> Result<LidarMap, LidarError> {
    let text = std::str::from_utf8(bytes).map_err(|_| LidarError::UnknownFormat)?;
    let mut lines = text.lines().enumerate().filter(|(_, line)| {
        let line = line.trim();
        !line.is_empty() && !line.starts_with('#')
    });
    let Some((first_index, first)) = lines.next() else { return Err(LidarError::UnknownFormat) };
    let separator = separator(first);
    let first_fields = fields(first, separator);
    let mut cloud = Cloud::default();
    let (x, y) = match columns(&first_fields) {
        Some(columns) => columns,
        None if first_fields.len() >= 2 && first_fields.iter().take(2).all(|f| f.parse::<f64>().is_ok()) => {
            cloud.add_line(&first_fields, (0, 1), first_index)?;
            (0, 1)
        }
        None if first.starts_with("image:") || text.contains("\nimage:") => {
            return Err(LidarError::YamlWithoutImage);
        }
        None => return Err(LidarError::UnknownFormat),
    };
    for (index, line) in lines {
        cloud.add_line(&fields(line, separator), (x, y), index)?;
    }
    cloud.into_map("csv_points", Vec::new())
}

/// The separator of a line; none stands for blanks and tabs.
fn separator(line: &str) -> Option<char> {
    [';', ','].into_iter().find(|&c| line.contains(c))
}

fn fields(line: &str, separator: Option<char>) -> Vec<&str> {
    match separator {
        Some(separator) => line.split(separator).map(|field| field.trim().trim_matches('"')).collect(),
        None => line.split_whitespace().collect(),
    }
}

/// Which columns a header calls x and y.
fn columns(header: &[&str]) -> Option<(usize, usize)> {
    let find = |axis: &str| {
        let names = [axis.to_string(), format!("{axis}_m"), format!("{axis}[m]"), format!("{axis} [m]")];
        header.iter().position(|field| names.contains(&field.to_lowercase()))
    };
    Some((find("x")?, find("y")?))
}

/// Points as they come in.
#[derive(Default)]
struct Cloud {
    points: Vec<Point2>,
    not_finite: usize,
}

impl Cloud {
    fn add_line(&mut self, fields: &[&str], (x, y): (usize, usize), index: usize) -> Result<(), LidarError> {
        let number = |column: usize| fields.get(column).and_then(|field| field.parse::<f64>().ok());
        let (Some(x), Some(y)) = (number(x), number(y)) else {
            let reason = "expected a number for x and for y".to_string();
            return Err(LidarError::BadPoints { line: index + 1, reason });
        };
        self.add(x, y)
    }

    fn add(&mut self, x: f64, y: f64) -> Result<(), LidarError> {
        // NaN fails the comparisons.
        if x.abs() < MAX_DISTANCE_M && y.abs() < MAX_DISTANCE_M {
            if self.points.len() == MAX_POINTS {
                return Err(LidarError::TooManyPoints { max: MAX_POINTS });
            }
            self.points.push(Point2::new(x, y));
        } else {
            self.not_finite += 1;
        }
        Ok(())
    }

    fn into_map(self, format: &'static str, mut notes: Vec<String>) -> Result<LidarMap, LidarError> {
        if self.not_finite > 0 {
            notes.push(format!("{} points that are not finite were dropped", self.not_finite));
        }
        build(Parts {
            format,
            frame: "metres, the file's own frame, x right, y up",
            occupied_m: self.points,
            cells: None,
            rooms: Vec::new(),
            charger: None,
            notes,
        })
    }
}
