//! Configuration of the Xiaomi vacuum map card for Home Assistant (PiotrMachowski, lovelace-xiaomi-vacuum-map-card):
//! calibration points of `plan.png`, rooms, zones and positions in the robot's own coordinates.

use super::area::Cover;
use super::drive::GoalArea;
use super::places::{Place, Places};
use super::segments::{Segment, segments};
use super::titles::Titles;
use super::{RobotLevel, Xy, round};
use crate::plan::PlanImage;
use crate::rooms::{Room, rooms};
use serde::Serialize;
use serde_json::Value;
use viola_formats::lidar::RobotFrame;
use viola_geometry::taxonomy::Class;

/// The configuration. The card takes `calibration_points` as its `calibration_source` and `map_modes` as they are.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CalibrationFile {
    pub vacuum: Vacuum,
    /// Size of `plan.png`, in pixels.
    pub image_px: [u32; 2],
    pub calibration_points: [CalibrationPoint; 3],
    /// The free space that has all positions.
    pub goal_area: GoalArea,
    pub map_modes: Vec<MapMode>,
}

/// The robot's coordinates.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Vacuum {
    /// Format of the LiDAR map whose coordinates they are.
    pub format: String,
    /// `mm`, `cm` or `m`.
    pub unit: &'static str,
    pub is_y_down: bool,
}

/// A point in the robot's coordinates, and its pixel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CalibrationPoint {
    pub vacuum: Xy,
    /// Pixels from the upper-left corner of the picture, y down.
    pub map: Xy,
}

/// A mode of the card: one of its templates with selections.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MapMode {
    pub template: &'static str,
    /// Kind of the selections: in older releases of the card some templates have another one.
    pub selection_type: &'static str,
    /// Maximum number of selections that the card sends at once; absent without a maximum.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_selections: Option<u8>,
    pub predefined_selections: Vec<Selection>,
}

/// A selection of the card, in the robot's coordinates.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Selection {
    /// Id of the robot's segment: a text for Valetudo, else a number.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub id: Option<Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub outline: Option<Vec<[f64; 2]>>,
    /// Rectangles: x and y of the lower corner, then of the upper one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub zones: Option<Vec<[f64; 4]>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position: Option<[f64; 2]>,
    pub label: Label,
    pub icon: Icon,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Label {
    pub text: String,
    pub x: f64,
    pub y: f64,
    /// Pixels below the point.
    pub offset_y: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Icon {
    pub name: &'static str,
    pub x: f64,
    pub y: f64,
}

/// Returns the configuration for a level and the picture of its plan.
pub fn calibration(level: &RobotLevel, places: &Places, image: &PlanImage) -> CalibrationFile {
    let frame = &level.lidar.frames.own;
    // A robot cleans its own segments, whatever rooms people made of them.
    let own = rooms(level.lidar, &[]);
    let segments = segments(level);
    let titles = Titles::of(level).segments(level, &segments);
    let named =
        segments.iter().zip(&titles).filter_map(|(segment, title)| Some((segment, title.as_deref()?)));
    let rooms = named.filter_map(|(segment, title)| room(level, segment, title, &own)).collect();
    let shown = || places.all.iter().filter(|place| !place.is_hung);
    let zones = shown().filter_map(|place| zone(frame, place)).collect();
    let positions = shown().filter_map(|place| position(frame, place)).collect();
    let mode = |template, selection_type, max_selections, predefined_selections: Vec<Selection>| MapMode {
        template,
        selection_type,
        max_selections,
        predefined_selections,
    };
    let modes = [
        mode("vacuum_clean_segment", "ROOM", None, rooms),
        // The card sends the zones of all selections together, and those of one may be as many as a robot takes.
        mode("vacuum_clean_zone_predefined", "PREDEFINED_RECTANGLE", Some(1), zones),
        mode("vacuum_goto_predefined", "PREDEFINED_POINT", Some(1), positions),
    ];
    // The card refuses a mode that needs selections and has none.
    let modes = modes.into_iter().filter(|mode| !mode.predefined_selections.is_empty());
    CalibrationFile {
        vacuum: Vacuum {
            format: level.lidar.info.format.clone(),
            unit: frame.unit(),
            is_y_down: frame.is_y_down,
        },
        image_px: image.size_px,
        calibration_points: points(level, image),
        goal_area: places.goal_area,
        map_modes: modes.collect(),
    }
}

/// Returns three corners of the LiDAR map's box. Each is rounded in the robot's coordinates first, so that the pixel
/// belongs to the rounded point.
fn points(level: &RobotLevel, image: &PlanImage) -> [CalibrationPoint; 3] {
    let (frame, low, high) = (&level.lidar.frames.own, level.lidar.info.min_m, level.lidar.info.max_m);
    // Three points on a line would calibrate nothing.
    let high = [0, 1].map(|axis| high[axis].max(low[axis] + 1.0));
    [low, [high[0], low[1]], [low[0], high[1]]].map(|corner_m| {
        let vacuum = frame.rounded(corner_m);
        let pixel = image.pixel(frame.to_map(vacuum)).map(round);
        CalibrationPoint { vacuum: vacuum.into(), map: pixel.into() }
    })
}

/// Returns the selection of a segment: the outline of its own cells with its title, which is that of its room. `own` are
/// the segments as rooms.
fn room(level: &RobotLevel, segment: &Segment, title: &str, own: &[Room]) -> Option<Selection> {
    let frame = &level.lidar.frames.own;
    let own = own.iter().find(|room| room.id == segment.id)?;
    let at = frame.rounded(own.label_at_m);
    Some(Selection {
        id: Some(segment_id(&level.lidar.info.format, segment.id)),
        outline: Some(own.polygon_m.iter().map(|corner| frame.rounded(*corner)).collect()),
        ..selection(title, None, at)
    })
}

/// Returns the id of a segment as its robot takes it. The card sends it as it is: Valetudo takes texts, and robots of
/// Roborock refuse them ("data for segment is not a number").
fn segment_id(format: &str, id: &str) -> Value {
    match id.parse::<u32>() {
        Ok(number) if format != "valetudo" => Value::from(number),
        _ => Value::from(id),
    }
}

fn zone(frame: &RobotFrame, place: &Place) -> Option<Selection> {
    let zones = rectangles(frame, &place.zone);
    let first = zones.first()?;
    let middle = [(first[0] + first[2]) / 2.0, (first[1] + first[3]) / 2.0];
    let at = frame.rounded(frame.to_map(middle));
    Some(Selection { zones: Some(zones), ..selection(&place.title, place.class, at) })
}

fn position(frame: &RobotFrame, place: &Place) -> Option<Selection> {
    let goal = place.goal?;
    let at = frame.rounded([goal.x_m, goal.y_m]);
    Some(Selection { position: Some(at), ..selection(&place.title, place.class, at) })
}

/// Returns rectangles as the smaller and the larger coordinates.
fn rectangles(frame: &RobotFrame, cover: &Cover) -> Vec<[f64; 4]> {
    let corners = cover.rectangles.iter().map(|r| (frame.rounded(r.low_m), frame.rounded(r.high_m)));
    corners.map(|(a, b)| [a[0].min(b[0]), a[1].min(b[1]), a[0].max(b[0]), a[1].max(b[1])]).collect()
}

fn selection(name: &str, class: Option<Class>, [x, y]: [f64; 2]) -> Selection {
    /// Pixels; the label is below the icon, as in the card's own examples.
    const OFFSET_Y: f64 = 35.0;
    Selection {
        id: None,
        outline: None,
        zones: None,
        position: None,
        label: Label { text: name.to_owned(), x, y, offset_y: OFFSET_Y },
        icon: Icon { name: icon(class), x, y },
    }
}

/// Returns the name of an icon of Material Design Icons.
fn icon(class: Option<Class>) -> &'static str {
    match class {
        Some(Class::Bed) => "mdi:bed",
        Some(Class::Sofa) => "mdi:sofa",
        Some(Class::Chair) => "mdi:chair-rolling",
        Some(Class::Table) => "mdi:table-furniture",
        Some(Class::Desk) => "mdi:desk",
        Some(Class::Refrigerator) => "mdi:fridge",
        Some(Class::Stove) => "mdi:stove",
        Some(Class::WashingMachine) => "mdi:washing-machine",
        Some(Class::Television) => "mdi:television",
        Some(Class::Toilet) => "mdi:toilet",
        Some(Class::Bathtub) => "mdi:bathtub",
        Some(Class::Shower) => "mdi:shower",
        _ => "mdi:broom",
    }
}
