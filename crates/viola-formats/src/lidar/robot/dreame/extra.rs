//! The JSON object after the image of a Dreame map. Unknown forms are ignored: firmwares write the same
//! member as a number, a list or a string of Python.

use super::on_sheet;
use crate::lidar::drawing::Drawing;
use crate::lidar::{LineKind, Obstacle, ZoneKind};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::Value;
use std::collections::BTreeMap;

/// Maximum size of the object; the longest known has 0.1 MB.
const MAX_JSON_BYTES: usize = 2 << 20;
const SAVED_MAP_APPLIES: i64 = 2;

/// The used members of the object.
#[derive(Default)]
pub(super) struct Extra {
    /// The saved map, as a text in the form of the whole file.
    pub saved_map: Option<String>,
    saved_map_applies: bool,
    /// Rooms by their number.
    pub segments: BTreeMap<usize, SegmentInfo>,
    restrictions: Value,
    obstacles: Value,
}

#[derive(Clone, Default)]
pub(super) struct SegmentInfo {
    pub name: Option<String>,
    pub material: Option<String>,
}

impl SegmentInfo {
    /// Merges the saved map's data: its name, edited there, takes precedence; its material is a fallback.
    pub fn take(&mut self, saved: SegmentInfo) {
        self.name = saved.name.or(self.name.take());
        self.material = self.material.take().or(saved.material);
    }
}

impl Extra {
    /// Parses the object. If it is broken, the rooms' names and the restrictions are lost, not the map.
    pub fn parse(bytes: &[u8], notes: &mut Vec<String>) -> Extra {
        let bytes = bytes.trim_ascii();
        if bytes.is_empty() {
            return Extra::default();
        }
        if bytes.len() > MAX_JSON_BYTES {
            notes.push("the data behind the image is too long and was ignored".to_string());
            return Extra::default();
        }
        let mut object: Value = match serde_json::from_slice(bytes) {
            Ok(object) => object,
            Err(error) => {
                notes.push(format!("the data behind the image is no JSON and was ignored: {error}"));
                return Extra::default();
            }
        };
        let saved_map = match object.get_mut("rism").map(Value::take) {
            Some(Value::String(text)) => Some(text),
            _ => None,
        };
        let is_clean_log = object.get("iscleanlog").and_then(Value::as_bool).unwrap_or(false);
        Extra {
            saved_map,
            saved_map_applies: object.get("ris").and_then(Value::as_i64) == Some(SAVED_MAP_APPLIES)
                || is_clean_log,
            segments: segments(object.get("seg_inf")),
            restrictions: object.get_mut("vw").map(Value::take).unwrap_or_default(),
            obstacles: object.get_mut("ai_obstacle").map(Value::take).unwrap_or_default(),
        }
    }

    pub fn uses_saved_map(&self) -> bool {
        self.saved_map_applies
    }

    /// Adds no-go zones, no-mop zones and virtual walls: lists of two corners in millimetres.
    pub fn restrict(&self, drawing: &mut Drawing) {
        for (member, kind) in [("rect", ZoneKind::NoGo), ("mop", ZoneKind::NoMop)] {
            for [a, b] in self.corners(member) {
                let (x, y) = ([a[0].min(b[0]), a[0].max(b[0])], [a[1].min(b[1]), a[1].max(b[1])]);
                drawing.add_zone(kind, &[[x[0], y[0]], [x[1], y[0]], [x[1], y[1]], [x[0], y[1]]]);
            }
        }
        for ends in self.corners("line") {
            drawing.add_line(LineKind::VirtualWall, &ends);
        }
    }

    fn corners(&self, member: &str) -> Vec<[[f64; 2]; 2]> {
        let list = self.restrictions.get(member).and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
        let numbers = |item: &Value| -> Option<[[f64; 2]; 2]> {
            let number = |index: usize| item.get(index)?.as_f64();
            Some([on_sheet(number(0)?, number(1)?), on_sheet(number(2)?, number(3)?)])
        };
        list.iter().filter_map(numbers).collect()
    }

    /// Adds the camera's obstacles: texts of x, y in millimetres, a type number, and the confidence.
    pub fn add_obstacles(&self, drawing: &mut Drawing) {
        let list = self.obstacles.as_array().map_or(&[][..], Vec::as_slice);
        for item in list {
            let text = |index: usize| item.get(index).and_then(Value::as_str).unwrap_or_default();
            let (Ok(x), Ok(y)) = (text(0).parse::<f64>(), text(1).parse::<f64>()) else { continue };
            let [x_cm, y_cm] = on_sheet(x, y);
            let at = drawing.sheet.point(x_cm, y_cm);
            if !(at.x.is_finite() && at.y.is_finite()) {
                continue;
            }
            let percent = text(3).parse::<f64>().unwrap_or_default() * 100.0;
            let label = format!("{} ({percent:.0}%)", obstacle_name(text(2)));
            drawing.marks.obstacles.push(Obstacle { label, at_m: [at.x, at.y] });
        }
    }
}

/// Reads `{"3": {"name": base64, "type": number, "material": number, "direction": degrees}}`.
fn segments(object: Option<&Value>) -> BTreeMap<usize, SegmentInfo> {
    let Some(members) = object.and_then(Value::as_object) else { return BTreeMap::new() };
    let info = |(id, segment): (&String, &Value)| {
        let name = segment.get("name").and_then(Value::as_str).filter(|name| !name.is_empty());
        let name = name.and_then(|name| STANDARD.decode(name).ok());
        let direction = segment.get("direction").and_then(Value::as_i64);
        let material = match (segment.get("material").and_then(Value::as_i64), direction) {
            (Some(1), Some(0)) => Some("wood_horizontal"),
            (Some(1), Some(90)) => Some("wood_vertical"),
            (Some(1), _) => Some("wood"),
            (Some(2), _) => Some("tile"),
            _ => None,
        };
        let name = name.map(|name| String::from_utf8_lossy(&name).into_owned());
        let info = SegmentInfo {
            name: name.or_else(|| kind_of_room(segment.get("type")?.as_i64()?).map(str::to_string)),
            material: material.map(str::to_string),
        };
        Some((id.parse().ok()?, info))
    };
    members.iter().filter_map(info).collect()
}

/// Returns the default name of a room's type in the robot's app (as in Tasshack's `dreame-vacuum`).
fn kind_of_room(number: i64) -> Option<&'static str> {
    const KINDS: [&str; 15] = [
        "Living room",
        "Primary bedroom",
        "Study",
        "Kitchen",
        "Dining hall",
        "Bathroom",
        "Balcony",
        "Corridor",
        "Utility room",
        "Closet",
        "Meeting room",
        "Office",
        "Fitness area",
        "Recreation area",
        "Secondary bedroom",
    ];
    // Type 0 has no name.
    KINDS.get(usize::try_from(number).ok()?.checked_sub(1)?).copied()
}

fn obstacle_name(kind: &str) -> &'static str {
    match kind {
        "128" => "pedestal",
        "129" => "scale",
        "130" => "power strip",
        "132" => "toy",
        "133" => "shoe",
        "134" => "sock",
        "135" => "pet waste",
        "136" => "bin",
        "137" => "fabric",
        "138" => "cable",
        "139" | "206" => "stain",
        "158" => "pet",
        "159" | "160" => "furniture leg",
        "163" => "cleaner",
        "165" => "bottle",
        "167" => "pet bowl",
        "168" => "mirror",
        "170" => "remote control",
        "171" => "flower pot",
        "201" => "bar stool",
        "208" => "yoga mat",
        _ => "obstacle",
    }
}
