//! Valetudo's map JSON, metaData.version 1 and 2 (Hypfer/Valetudo, `backend/lib/entities/map`), and the PNG
//! in which it goes to Home Assistant.
//!
//! The origin in the file is the top-left corner with y down: cells are in pixels, sizes and entities in
//! centimetres.

mod file;
mod png;

use self::file::{Entity, Head, Label, Layer, MapFile, State};
use super::drawing::{self, Drawing, LayerKind, Spot, shorten};
use super::robot::{gunzip, inflate, is_gzip, is_json, is_zlib, json_in_text};
use super::sheet::{Run, Sheet};
use super::{LidarError, LidarMap, LineKind, MAX_FILE_BYTES, MAX_POINTS, Obstacle, ZoneKind, utf16};
use crate::container::{Container, Zip};
use crate::json;
use std::collections::BTreeSet;

/// A kilometre: no robot maps more.
pub(super) const MAX_SIZE_CM: i64 = 100_000;
const MAX_PIXEL_CM: i64 = 100;

/// Returns the JSON of a Valetudo map in UTF-8, which is the file itself, deflated in it, in a picture, or any of these as
/// the only file of a zip; `None` for files of other formats.
pub fn json_of(bytes: &[u8]) -> Option<Vec<u8>> {
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
    match bytes {
        _ if text.starts_with(b"{") => Some(text.to_vec()),
        _ if utf16::is(bytes) => utf16::to_utf8(bytes).ok().and_then(|text| json_of(text.as_bytes())),
        [0x89, b'P', b'N', b'G', ..] => png::json_in(bytes).ok(),
        _ if is_zlib(bytes) => inflate(bytes).ok().filter(|inflated| is_json(inflated)),
        _ if is_gzip(bytes) => gunzip(bytes).ok().filter(|inflated| inflated.starts_with(b"{")),
        [b'P', b'K', 3, ..] => {
            only_file(bytes).filter(|file| !file.starts_with(b"PK")).and_then(|file| json_of(&file))
        }
        _ => json_in_text(text),
    }
}

/// Returns the only file of a zip; `None` if it has several or none.
fn only_file(zip: &[u8]) -> Option<Vec<u8>> {
    let zip = Zip::from_bytes(zip.to_vec()).ok()?;
    let [name] = zip.names() else { return None };
    zip.read(name, MAX_FILE_BYTES).ok()
}

/// Reads the map in a picture.
pub(super) fn read_png(bytes: &[u8]) -> Result<LidarMap, LidarError> {
    read(&png::json_in(bytes)?)
}

pub(super) fn read(bytes: &[u8]) -> Result<LidarMap, LidarError> {
    let file = parse(bytes)?;
    check_range("size.x", file.size.x, MAX_SIZE_CM)?;
    check_range("size.y", file.size.y, MAX_SIZE_CM)?;
    check_range("pixelSize", file.pixel_size, MAX_PIXEL_CM)?;
    let sheet = Sheet::new(file.size.x, file.size.y, file.pixel_size);
    let frame = "metres, x right, y up, origin at the lower-left corner of `size`";
    let mut drawing = Drawing::new("valetudo", frame, sheet);
    let (mut cells, mut segments) = (0, 0_usize);
    let ids = file.layers.0.iter().filter_map(|layer| layer.meta_data.segment_id.as_ref());
    let ids: BTreeSet<String> = ids.map(id_of).collect();
    for (index, layer) in file.layers.0.iter().enumerate() {
        let runs = runs(&sheet, layer, index)?;
        cells += runs.iter().map(|run| u64::from(run.count)).sum::<u64>();
        if cells > MAX_POINTS as u64 {
            return Err(LidarError::TooManyCells { cells, max: MAX_POINTS });
        }
        if layer.kind == "segment" {
            segments += 1;
            while layer.meta_data.segment_id.is_none() && ids.contains(&segments.to_string()) {
                segments += 1;
            }
        }
        drawing.layers.push(drawing::Layer { kind: kind(layer, segments), runs });
    }
    add_entities(&mut drawing, &file.entities.0);
    drawing.into_map()
}

/// Parses a map, which may be a part of the robot's state.
fn parse(bytes: &[u8]) -> Result<MapFile, LidarError> {
    let bad = |reason: String| LidarError::BadJson { reason };
    let head: Head = json::parse(bytes).map_err(bad)?;
    match head {
        Head { size: None, layers: None, map: Some(_) } => {
            json::parse(bytes).map(|State { map }| map).map_err(bad)
        }
        Head { size: None, layers: None, map: None } => {
            Err(bad("it has no `size` and no `layers`, and no `map` that may have them".to_owned()))
        }
        _ => json::parse(bytes).map_err(bad),
    }
}

fn check_range(field: &str, value: i64, max: i64) -> Result<(), LidarError> {
    if (1..=max).contains(&value) {
        return Ok(());
    }
    Err(LidarError::BadField {
        field: field.into(),
        value: value.to_string(),
        expected: format!("from 1 to {max} cm"),
    })
}

/// Returns a layer's cells as checked runs. If a layer has both encodings, they are equal.
fn runs(sheet: &Sheet, layer: &Layer, index: usize) -> Result<Vec<Run>, LidarError> {
    let (values, group, name) = if layer.compressed_pixels.0.is_empty() {
        (&layer.pixels.0, 2, "pixels")
    } else {
        (&layer.compressed_pixels.0, 3, "compressedPixels")
    };
    let mut runs = Vec::with_capacity(values.len() / group);
    for values in values.chunks(group) {
        let bad = |expected: String| LidarError::BadField {
            field: format!("layers[{index}].{name}"),
            value: values.iter().map(|v| v.0.to_string()).collect::<Vec<_>>().join(", "),
            expected,
        };
        if values.len() != group {
            return Err(bad(format!("groups of {group} numbers")));
        }
        let (x, y, count) = (values[0].0, values[1].0, values.get(2).map_or(1, |count| count.0));
        if !sheet.holds(i64::from(x), i64::from(y), i64::from(count)) {
            return Err(bad(format!("inside the map's {}x{} pixels", sheet.width, sheet.height)));
        }
        runs.push(Run { x: x as u32, y: y as u32, count: count as u32 });
    }
    Ok(runs)
}

fn id_of(label: &Label) -> String {
    match label {
        Label::Text(text) => text.clone(),
        Label::Number(id) => id.to_string(),
    }
}

/// Returns a layer's kind; `number` is the id of a segment without one.
fn kind(layer: &Layer, number: usize) -> LayerKind {
    match layer.kind.as_str() {
        "floor" => LayerKind::Floor,
        "wall" => LayerKind::Wall,
        "segment" => LayerKind::Segment {
            id: layer.meta_data.segment_id.as_ref().map_or_else(|| number.to_string(), id_of),
            name: layer.meta_data.name.clone(),
            material: layer.meta_data.material.clone(),
        },
        _ => LayerKind::Other,
    }
}

fn add_entities(drawing: &mut Drawing, entities: &[Entity]) {
    for entity in entities {
        let points = &entity.points.points;
        let spot = points.first().map(|&[x_cm, y_cm]| Spot { x_cm, y_cm, angle_deg: entity.meta_data.angle });
        match entity.kind.as_str() {
            "charger_location" => drawing.charger = drawing.charger.or(spot),
            "robot_position" => drawing.robot = drawing.robot.or(spot),
            "no_go_area" => drawing.add_zone(ZoneKind::NoGo, points),
            "no_mop_area" => drawing.add_zone(ZoneKind::NoMop, points),
            "carpet" => drawing.add_zone(ZoneKind::Carpet, points),
            "ramp" => drawing.add_zone(ZoneKind::Ramp, points),
            "virtual_wall" => drawing.add_line(LineKind::VirtualWall, points),
            "threshold" => drawing.add_line(LineKind::Threshold, points),
            "curtain" => drawing.add_line(LineKind::Curtain, points),
            "obstacle" => {
                let at = spot.map(|spot| drawing.sheet.point(spot.x_cm, spot.y_cm));
                if let Some(at) = at.filter(|at| at.x.is_finite() && at.y.is_finite()) {
                    let label = shorten(entity.meta_data.label.as_deref().unwrap_or_default());
                    drawing.marks.obstacles.push(Obstacle { label, at_m: [at.x, at.y] });
                }
            }
            // Paths, targets and the areas of one cleaning are no part of the home.
            _ => {}
        }
    }
}
