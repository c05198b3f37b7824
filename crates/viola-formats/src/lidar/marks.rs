//! Marks of a robot's software on a map: the robot's pose, zones, lines and obstacles.

use super::LidarInfo;
use serde::{Deserialize, Serialize};
use viola_geometry::Pose2;

/// Maximum number of marks of one kind; they are part of every answer about the map.
pub(super) const MAX_MARKS: usize = 500;
/// Maximum number of corners of a zone.
pub(super) const MAX_CORNERS: usize = 64;

/// Marks on a map, in the map's frame.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct MapMarks {
    /// Pose of the robot when the map was written; yaw is its heading.
    pub robot: Option<Pose2>,
    pub zones: Vec<Zone>,
    pub lines: Vec<Line>,
    pub obstacles: Vec<Obstacle>,
    /// Area of the cells in which the robot detected carpet, in square metres.
    pub carpet_m2: f64,
}

/// An area that a user drew or the robot detected.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Zone {
    pub kind: ZoneKind,
    /// Its corners in order, in metres.
    pub outline_m: Vec<[f64; 2]>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ZoneKind {
    /// The robot must not enter.
    NoGo,
    /// It may vacuum there, but not mop.
    NoMop,
    /// It may mop there, but not vacuum.
    NoVacuum,
    Carpet,
    Ramp,
}

/// A line on the floor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Line {
    pub kind: LineKind,
    /// Its two ends, in metres.
    pub ends_m: [[f64; 2]; 2],
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LineKind {
    /// The robot must not cross it.
    VirtualWall,
    Threshold,
    Curtain,
}

/// An object on the floor that the robot's camera detected.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Obstacle {
    /// Class and confidence, in the words of the robot's software.
    pub label: String,
    /// Position, in metres.
    pub at_m: [f64; 2],
}

impl MapMarks {
    /// Sorts zones and lines by kind, and keeps at most `MAX_MARKS` zones, lines and obstacles.
    pub(super) fn settle(&mut self, notes: &mut Vec<String>) {
        self.zones.sort_by_key(|zone| zone.kind);
        self.lines.sort_by_key(|line| line.kind);
        for (name, found) in
            [("zones", self.zones.len()), ("lines", self.lines.len()), ("obstacles", self.obstacles.len())]
        {
            if found > MAX_MARKS {
                notes.push(format!("of {found} {name} the first {MAX_MARKS} were kept"));
            }
        }
        self.zones.truncate(MAX_MARKS);
        self.lines.truncate(MAX_MARKS);
        self.obstacles.truncate(MAX_MARKS);
    }
}

impl LidarInfo {
    /// Returns the number of marks in words; empty without any.
    pub fn marks_in_words(&self) -> String {
        let count = |number: usize, one: &str| match number {
            0 => None,
            1 => Some(format!("1 {one}")),
            _ => Some(format!("{number} {one}s")),
        };
        let zones = |kind: ZoneKind| self.marks.zones.iter().filter(|zone| zone.kind == kind).count();
        let lines = |kind: LineKind| self.marks.lines.iter().filter(|line| line.kind == kind).count();
        let parts = [
            self.marks.robot.map(|_| "the robot".to_string()),
            count(zones(ZoneKind::NoGo), "no-go zone"),
            count(zones(ZoneKind::NoMop), "no-mop zone"),
            count(zones(ZoneKind::NoVacuum), "no-vacuum zone"),
            count(zones(ZoneKind::Carpet), "carpet"),
            count(zones(ZoneKind::Ramp), "ramp"),
            count(lines(LineKind::VirtualWall), "virtual wall"),
            count(lines(LineKind::Threshold), "threshold"),
            count(lines(LineKind::Curtain), "curtain"),
            count(self.marks.obstacles.len(), "obstacle"),
            (self.marks.carpet_m2 > 0.0).then(|| format!("{:.1} m2 of carpet", self.marks.carpet_m2)),
        ];
        parts.into_iter().flatten().collect::<Vec<_>>().join(", ")
    }
}
