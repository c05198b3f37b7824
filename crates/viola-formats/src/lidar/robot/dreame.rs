//! Dreame's maps (1C, D9, Z10, L10, X10 and others): base64url of a zlib stream with a header, an image and a
//! JSON object, which holds the saved map with the rooms as such a string again (`rism`). The layout is that
//! of Hypfer/Valetudo, `assets/kaitai_structs/dreame_map_file.ksy` and `DreameMapParser.js`.
//!
//! Positions are millimetres with y up, from -32768 on; cells are usually 5 cm, their rows from the bottom.

mod extra;

use self::extra::Extra;
use super::{Bytes, MAX_SIDE, inflate, is_zlib, round_cm};
use crate::lidar::drawing::{Drawing, Layer, LayerKind, Spot};
use crate::lidar::sheet::{Run, Runs, Sheet};
use crate::lidar::{LidarError, LidarMap, RobotFrame};
use base64::Engine;
use base64::alphabet::URL_SAFE;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};

const HEADER_BYTES: usize = 27;
const WHOLE_FRAME: u8 = b'I';
const CHANGES_FRAME: u8 = b'P';
/// Positions are signed 16-bit millimetres; this moves them above zero.
const OFFSET_MM: f64 = 32_768.0;
/// Side of the sheet: the range of those positions, in whole centimetres.
const SIDE_CM: i64 = 6554;
/// An unknown position.
const UNSET: i16 = 32_767;
/// Above this segment number a cell of the image is floor or wall without a room.
const MAX_SEGMENT: u8 = 61;

/// Base64 with or without padding, which may be lost when a file is copied from a page.
const BASE64URL: GeneralPurpose = GeneralPurpose::new(
    &URL_SAFE,
    GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true),
);

/// The whole file, or the saved map inside it.
struct Frame<'a> {
    kind: u8,
    robot: Option<Spot>,
    charger: Option<Spot>,
    pixel_cm: i64,
    width: usize,
    height: usize,
    left_cm: f64,
    top_cm: f64,
    cells: &'a [u8],
    extra: &'a [u8],
}

/// Layout of the bits of a cell.
#[derive(Clone, Copy, PartialEq)]
enum Source {
    /// Six bits of segment, two of type.
    Regular,
    /// A bit for walls, one for carpet, six of segment.
    Saved,
}

/// The cells of a frame, by type.
struct Cells {
    floor: Runs,
    wall: Runs,
    carpet: Runs,
    segments: Vec<Runs>,
}

fn bad(reason: impl Into<String>) -> LidarError {
    LidarError::BadRobotMap { format: "Dreame", reason: reason.into() }
}

/// Returns whether a text can be a map: only base64, of a zlib stream. Programs break it into lines.
pub(in super::super) fn is_text(text: &[u8]) -> bool {
    let is_digit = |b: &u8| b.is_ascii_alphanumeric() || b"-_+/=".contains(b);
    // Two bytes; the next digit can be of either alphabet.
    let first: Vec<u8> = text.iter().copied().filter(|b| !b.is_ascii_whitespace()).take(3).collect();
    text.len() > HEADER_BYTES
        && text.iter().all(|b| is_digit(b) || b.is_ascii_whitespace())
        && BASE64URL.decode(first).is_ok_and(|bytes| is_zlib(&bytes))
}

/// Decodes either alphabet of base64, and inflates the result.
pub(super) fn decode(text: &[u8]) -> Result<Vec<u8>, LidarError> {
    let url_safe: Vec<u8> = text
        .iter()
        .filter(|b| !b.is_ascii_whitespace())
        .map(|b| match b {
            b'+' => b'-',
            b'/' => b'_',
            _ => *b,
        })
        .collect();
    let deflated =
        BASE64URL.decode(url_safe).map_err(|error| bad(format!("its base64 is broken: {error}")))?;
    inflate(&deflated)
}

/// Returns whether inflated bytes can be a map; the format has no magic number.
pub(super) fn is(bytes: &[u8]) -> bool {
    let frame = Bytes(bytes);
    let size = |at: usize| frame.i16(at).map_or(0, i64::from);
    matches!(frame.u8(4), Some(WHOLE_FRAME | CHANGES_FRAME))
        && (10..=1000).contains(&size(17))
        && (1..=MAX_SIDE).contains(&size(19))
        && (1..=MAX_SIDE).contains(&size(21))
}

/// Returns whether a file can be an inflated map: its numbers are possible, and JSON follows the image.
pub(in super::super) fn is_inflated(bytes: &[u8]) -> bool {
    let has_json =
        |frame: Frame| frame.extra.starts_with(b"{") && frame.extra.trim_ascii_end().ends_with(b"}");
    is(bytes) && Frame::parse(bytes).is_ok_and(has_json)
}

pub(in super::super) fn read(bytes: &[u8]) -> Result<LidarMap, LidarError> {
    let frame = Frame::parse(bytes)?;
    if frame.kind == CHANGES_FRAME {
        return Err(LidarError::PartialMap);
    }
    let words = "metres, x right, y up, origin at the lower-left corner of the robot's sheet of 65.54 m, as Valetudo \
                 has it";
    let mut drawing = Drawing::new("dreame", words, Sheet::new(SIDE_CM, SIDE_CM, frame.pixel_cm));
    drawing.own_frame = Some(RobotFrame::millimetres([-OFFSET_MM; 2]));
    let extra = Extra::parse(frame.extra, &mut drawing.notes);
    let cells = frame.cells(Source::Regular, &drawing.sheet)?;
    let (mut has_floor, mut has_wall) = (!cells.floor.0.is_empty(), !cells.wall.0.is_empty());
    (drawing.robot, drawing.charger) = (frame.robot, frame.charger);
    let mut rooms: Vec<(usize, Vec<Run>)> = cells.rooms();
    drawing.carpet = cells.carpet.0;
    let mut layers = vec![(LayerKind::Floor, cells.floor.0), (LayerKind::Wall, cells.wall.0)];
    let mut infos = extra.segments.clone();

    // The saved map is the fallback for parts that this one lacks.
    let saved_bytes = match &extra.saved_map {
        Some(text) if extra.uses_saved_map() => Some(decode(text.as_bytes())?),
        _ => None,
    };
    if let Some(bytes) = &saved_bytes {
        let saved = Frame::parse(bytes)?;
        if saved.pixel_cm != frame.pixel_cm {
            return Err(bad("the saved map in it has cells of another size"));
        }
        let saved_extra = Extra::parse(saved.extra, &mut drawing.notes);
        let cells = saved.cells(Source::Saved, &drawing.sheet)?;
        drawing.robot = drawing.robot.or(saved.robot);
        drawing.charger = drawing.charger.or(saved.charger);
        saved_extra.restrict(&mut drawing);
        for (id, runs) in cells.rooms() {
            if !rooms.iter().any(|(other, _)| *other == id) {
                rooms.push((id, runs));
            }
        }
        for (kind, runs, has) in [
            (LayerKind::Floor, cells.floor.0, &mut has_floor),
            (LayerKind::Wall, cells.wall.0, &mut has_wall),
        ] {
            if !*has {
                *has = !runs.is_empty();
                layers.push((kind, runs));
            }
        }
        if drawing.carpet.is_empty() {
            drawing.carpet = cells.carpet.0;
        }
        for (id, info) in saved_extra.segments {
            infos.entry(id).or_default().take(info);
        }
    }
    drawing.layers.extend(layers.into_iter().map(|(kind, runs)| Layer { kind, runs }));
    for (id, runs) in rooms {
        let info = infos.remove(&id).unwrap_or_default();
        let kind = LayerKind::Segment { id: id.to_string(), name: info.name, material: info.material };
        drawing.layers.push(Layer { kind, runs });
    }
    extra.restrict(&mut drawing);
    extra.add_obstacles(&mut drawing);
    drawing.into_map()
}

impl<'a> Frame<'a> {
    fn parse(bytes: &'a [u8]) -> Result<Frame<'a>, LidarError> {
        let head = Bytes(bytes);
        if bytes.len() < HEADER_BYTES {
            return Err(bad(format!("it ends in its header, after {} bytes", bytes.len())));
        }
        let number = |at: usize| head.i16(at).unwrap_or_default();
        let spot = |at: usize| {
            let [x, y, angle] = [at, at + 2, at + 4].map(number);
            let [x_cm, y_cm] = on_sheet(f64::from(x), f64::from(y));
            let angle_deg = Some((90.0 - f64::from(angle)).rem_euclid(360.0));
            (x != UNSET || y != UNSET).then_some(Spot { x_cm, y_cm, angle_deg })
        };
        let pixel_cm = round_cm(f64::from(number(17)) / 10.0) as i64;
        let (width, height) = (i64::from(number(19)), i64::from(number(21)));
        let kind = head.u8(4).unwrap_or_default();
        if ![WHOLE_FRAME, CHANGES_FRAME].contains(&kind) {
            return Err(bad(format!("its frame is of the unknown type {kind}")));
        }
        if !(1..=100).contains(&pixel_cm) {
            return Err(bad(format!("its cells have {} mm", number(17))));
        }
        if !(0..=MAX_SIDE).contains(&width) || !(0..=MAX_SIDE).contains(&height) {
            return Err(bad(format!("its image has {width}x{height} cells")));
        }
        let (width, height) = (width as usize, height as usize);
        let image = bytes[HEADER_BYTES..].split_at_checked(width * height);
        let (cells, extra) =
            image.ok_or_else(|| bad(format!("it ends in its image of {width}x{height} cells")))?;
        let from_edge = |at: usize| round_cm((f64::from(number(at)) + OFFSET_MM) / 10.0);
        Ok(Frame {
            kind,
            robot: spot(5),
            charger: spot(11),
            pixel_cm,
            width,
            height,
            left_cm: from_edge(23),
            top_cm: from_edge(25),
            cells,
            extra,
        })
    }

    fn cells(&self, source: Source, sheet: &Sheet) -> Result<Cells, LidarError> {
        let pixel_cm = self.pixel_cm as f64;
        let mut cells = Cells {
            floor: Runs::default(),
            wall: Runs::default(),
            carpet: Runs::default(),
            segments: vec![Runs::default(); usize::from(MAX_SEGMENT) + 3],
        };
        // Valetudo rounds each cell's position on the sheet, whose side is no multiple of a cell's.
        let x_of = |column: usize| round_cm(column as f64 + self.left_cm / pixel_cm) as i64;
        let y_of =
            |row: usize| round_cm(SIDE_CM as f64 / pixel_cm - (row as f64 + self.top_cm / pixel_cm)) as i64;
        for row in (0..self.height).rev() {
            let y = y_of(row);
            for (column, &value) in self.cells[row * self.width..][..self.width].iter().enumerate() {
                if value == 0 {
                    continue;
                }
                let x = x_of(column);
                if !sheet.holds(x, y, 1) {
                    return Err(LidarError::BadField {
                        field: "image".into(),
                        value: format!("a cell at {x}, {y}"),
                        expected: format!("inside the sheet's {}x{} cells", sheet.width, sheet.height),
                    });
                }
                cells.add(source, value, x as u32, y as u32);
            }
        }
        Ok(cells)
    }
}

impl Cells {
    fn add(&mut self, source: Source, value: u8, x: u32, y: u32) {
        let (segment, kind) = match source {
            Source::Regular => (value >> 2, value & 0b11),
            Source::Saved => (value & 0b0011_1111, value >> 6),
        };
        // A type of 3 is carpet in the image; in the saved map the two bits are wall and carpet.
        let (is_wall, is_carpet) = match source {
            Source::Regular => (false, kind == 3),
            Source::Saved => (kind & 0b10 != 0, kind & 0b01 != 0),
        };
        if is_carpet && !is_wall {
            self.carpet.add(x, y);
        }
        match source {
            Source::Saved if is_wall => self.wall.add(x, y),
            Source::Saved if segment > 0 => self.segments[usize::from(segment)].add(x, y),
            Source::Regular if (1..=MAX_SEGMENT).contains(&segment) => {
                self.segments[usize::from(segment)].add(x, y);
            }
            Source::Regular if kind == 2 => self.wall.add(x, y),
            Source::Regular if kind != 0 => self.floor.add(x, y),
            _ => {}
        }
    }

    fn rooms(&self) -> Vec<(usize, Vec<Run>)> {
        let rooms = self.segments.iter().enumerate().filter(|(_, runs)| !runs.0.is_empty());
        rooms.map(|(id, runs)| (id, runs.0.clone())).collect()
    }
}

/// Converts millimetres with y up to centimetres with y down.
fn on_sheet(x_mm: f64, y_mm: f64) -> [f64; 2] {
    let cm = |mm: f64| round_cm((mm + OFFSET_MM) / 10.0);
    [cm(x_mm), SIDE_CM as f64 - cm(y_mm)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_in_lines_is_a_text() {
        let text = b"eJzLSM3JyVcozy/KSVEwNDI2MTUzt7A0AABTBQYr";
        for (what, text, expected) in [
            ("one line", text.to_vec(), true),
            ("lines", text.chunks(7).collect::<Vec<_>>().join(&b"\r\n"[..]), true),
            ("a line in the first digits", [&b"e\nJ"[..], &text[2..]].concat(), true),
            ("points in millimetres", b"120 340\n560 780\n".repeat(4), false),
        ] {
            assert_eq!(is_text(&text), expected, "{what}");
        }
    }
}
