//! Suggested no-go zones: areas in which a robot gets stuck, falls, or must not go.

use super::area::{self, for_cells};
use super::ground::Ground;
use super::labels::REACH_M;
use super::{RobotLevel, RobotObject, round_all};
use crate::objects::UprightBox;
use crate::rooms::outline::Outline;
use serde::Serialize;
use viola_formats::lidar::{Cell, LineKind, ZoneKind};
use viola_geometry::Grid;
use viola_geometry::taxonomy::Class;

/// Maximum number of zones; the first ones are kept, in the order of [`NoGoReason`].
const MAX_ZONES: usize = 500;
/// Width around a television or a lamp in which its cables lie.
const CABLES_M: f64 = 0.15;
/// Thickness of a virtual wall as a polygon.
const VIRTUAL_WALL_M: f64 = 0.1;

/// Why a zone is suggested, the most important first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum NoGoReason {
    /// The robot's own software has it: a no-go zone or a virtual wall that a person drew there.
    RobotMap,
    /// The robot may fall.
    Stairs,
    /// Cables hang from a television, a desk or a lamp to the floor.
    Cables,
    /// The robot may get stuck below a sofa or a bed.
    LowFurniture,
    /// A robot that mops wets it, and fringes get into the brushes.
    Rug,
}

impl NoGoReason {
    /// Returns the value in the keepout mask: 100 is forbidden, less is dearer than free floor.
    pub fn mask(self) -> u8 {
        if self == NoGoReason::Rug { 50 } else { 100 }
    }
}

/// A suggested zone.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NoGoZone {
    pub reason: NoGoReason,
    /// Value in the keepout mask, 1..=100.
    pub mask: u8,
    /// Corners in order, in the map's frame; the first one is not repeated.
    pub polygon_m: Vec<[f64; 2]>,
    /// Holes, in the same way.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub holes_m: Vec<Vec<[f64; 2]>>,
    /// The object that it is made of.
    pub object: Option<String>,
    pub class: Option<Class>,
    /// Fraction of the zone that is free in the robot's map, 0..=1; null for maps without free cells.
    pub driven: Option<f64>,
}

impl NoGoZone {
    fn new(
        level: &RobotLevel,
        reason: NoGoReason,
        polygon_m: &[[f64; 2]],
        holes_m: &[Vec<[f64; 2]>],
    ) -> NoGoZone {
        let mut zone = NoGoZone {
            reason,
            mask: reason.mask(),
            polygon_m: round_all(polygon_m),
            holes_m: holes_m.iter().map(|hole| round_all(hole)).collect(),
            object: None,
            class: None,
            driven: None,
        };
        zone.driven = level.lidar.cells.as_ref().map(|cells| free_fraction(cells, &zone));
        zone
    }

    fn of_object(level: &RobotLevel, object: &RobotObject) -> Option<NoGoZone> {
        // No cable hangs from a ceiling lamp to the floor.
        if object.class == Class::Lamp && object.bounds.bottom_m() >= REACH_M {
            return None;
        }
        let (reason, by_m) = reason(object.class)?;
        let zone = NoGoZone::new(level, reason, &grown(&object.bounds, by_m).corners(), &[]);
        Some(NoGoZone { object: Some(object.id.clone()), class: Some(object.class), ..zone })
    }

    /// Returns the border and the holes.
    pub fn rings(&self) -> Vec<&[[f64; 2]]> {
        area::rings(&self.polygon_m, &self.holes_m)
    }
}

/// Returns the zones of a level that no robot may enter, without the stairs that only points show.
pub fn forbidden(level: &RobotLevel) -> Vec<NoGoZone> {
    let zones =
        of_map(level).into_iter().chain(level.objects.iter().filter_map(|o| NoGoZone::of_object(level, o)));
    zones.filter(|zone| zone.mask == 100).collect()
}

/// Returns the zones of a level. `ground` has its rugs and stairs.
pub fn no_go_zones(level: &RobotLevel, ground: &Ground) -> Vec<NoGoZone> {
    let outlined = |reason: NoGoReason, outline: &Outline| {
        NoGoZone::new(level, reason, &outline.ring_m, &outline.holes_m)
    };
    let mut zones = of_map(level);
    zones.extend(ground.stairs().iter().map(|outline| outlined(NoGoReason::Stairs, outline)));
    zones.extend(ground.rugs().iter().map(|outline| outlined(NoGoReason::Rug, outline)));
    zones.extend(level.objects.iter().filter_map(|object| NoGoZone::of_object(level, object)));
    // A stable sort keeps the order within a reason.
    zones.sort_by_key(|zone| zone.reason);
    zones.truncate(MAX_ZONES);
    zones
}

/// Returns what the robot's own map has: zones, virtual walls, carpets that a person drew.
fn of_map(level: &RobotLevel) -> Vec<NoGoZone> {
    let mut zones = Vec::new();
    let mut add = |reason, polygon_m: &[[f64; 2]]| zones.push(NoGoZone::new(level, reason, polygon_m, &[]));
    let marks = &level.lidar.info.marks;
    for zone in &marks.zones {
        match zone.kind {
            ZoneKind::NoGo => add(NoGoReason::RobotMap, &zone.outline_m),
            ZoneKind::Carpet => add(NoGoReason::Rug, &zone.outline_m),
            ZoneKind::NoMop | ZoneKind::NoVacuum | ZoneKind::Ramp => {}
        }
    }
    for line in marks.lines.iter().filter(|line| line.kind == LineKind::VirtualWall) {
        add(NoGoReason::RobotMap, &strip(line.ends_m));
    }
    zones
}

/// Returns the reason that follows from an object's class, and the width around its footprint.
fn reason(class: Class) -> Option<(NoGoReason, f64)> {
    match class {
        Class::Stairs => Some((NoGoReason::Stairs, 0.0)),
        Class::Television | Class::Lamp => Some((NoGoReason::Cables, CABLES_M)),
        Class::Desk => Some((NoGoReason::Cables, 0.0)),
        Class::Sofa | Class::Bed => Some((NoGoReason::LowFurniture, 0.0)),
        Class::Rug => Some((NoGoReason::Rug, 0.0)),
        _ => None,
    }
}

fn grown(bounds: &UprightBox, by_m: f64) -> UprightBox {
    let [length, width, height] = bounds.size_m;
    UprightBox { size_m: [length + 2.0 * by_m, width + 2.0 * by_m, height], ..*bounds }
}

/// Returns the corners of a strip around a line, counter-clockwise.
fn strip([from, to]: [[f64; 2]; 2]) -> [[f64; 2]; 4] {
    let along = [to[0] - from[0], to[1] - from[1]];
    let length_m = along[0].hypot(along[1]).max(1e-9);
    let [x, y] = along.map(|side| side / length_m * VIRTUAL_WALL_M / 2.0);
    [[from[0] + y, from[1] - x], [to[0] + y, to[1] - x], [to[0] - y, to[1] + x], [from[0] - y, from[1] + x]]
}

/// Returns the fraction of a zone's cells that are free; 0 for a zone without cells.
fn free_fraction(cells: &Grid<Cell>, zone: &NoGoZone) -> f64 {
    let (mut all, mut free) = (0usize, 0usize);
    for_cells(&cells.frame, &zone.rings(), |index| {
        all += 1;
        free += usize::from(cells.cells[index] == Cell::Free);
    });
    if all == 0 { 0.0 } else { super::round(free as f64 / all as f64) }
}
