//! The maps of Viomi and Cecotec (3irobotix): a zlib stream of flags and, for each flag in turn, a block that
//! begins with the map's number. The layout is that of Hypfer/Valetudo,
//! `assets/kaitai_structs/viomi_map_file.ksy`, `ViomiMapParser.js` and `ThreeIRobotixMapParser.js`.
//!
//! Positions are metres with y up, the image covers -20 to 20 m; cells are 5 cm, their rows from the bottom.

use super::{Bytes, MAX_SIDE, heading_deg};
use crate::lidar::drawing::{Drawing, Layer, LayerKind, Spot};
use crate::lidar::sheet::{Runs, Sheet};
use crate::lidar::{LidarError, LidarMap, LineKind, RobotFrame, ZoneKind};
use std::collections::BTreeMap;

const IMAGE_AT: usize = 48;
const IMAGE_HEADER_BYTES: usize = 40;
const PATH_POINT_BYTES: usize = 9;
const AREA_BYTES: usize = 92;
/// Cells of at least this value are of a room that is being cleaned, whose number is 50 less.
const FIRST_ACTIVE: u8 = 60;
/// Maximum number of rooms, as in Valetudo. A larger number is the beginning of another name.
const MAX_ROOMS: u32 = 255;
/// A coordinate of an unknown position.
const UNKNOWN_M: f64 = 1100.0;

mod flag {
    pub const STATUS_AND_IMAGE: u32 = 0b11;
    pub const PATH: u32 = 1 << 2;
    pub const CHARGER: u32 = 1 << 3;
    pub const RESTRICTIONS: u32 = 1 << 4;
    pub const ACTIVE_ZONES: u32 = 1 << 5;
    pub const TARGET: u32 = 1 << 6;
    pub const ROBOT: u32 = 1 << 7;
    /// Blocks of unknown length.
    pub const UNKNOWN: u32 = 0b111 << 8;
    pub const BEFORE_NAMES: u32 = 1 << 11;
    pub const NAMES: u32 = 1 << 12;
}

struct Image {
    width: usize,
    height: usize,
    min_m: [f64; 2],
    pixel_cm: i64,
}

fn bad(reason: impl Into<String>) -> LidarError {
    LidarError::BadRobotMap { format: "Viomi / 3irobotix", reason: reason.into() }
}

/// Returns whether inflated bytes can be a map; the format has no magic number.
pub(super) fn is(bytes: &[u8]) -> bool {
    let map = Bytes(bytes);
    let has_image = map.u32(0).is_some_and(|flags| flags & flag::STATUS_AND_IMAGE == flag::STATUS_AND_IMAGE);
    has_image && map.u32(4) == map.u32(IMAGE_AT) && image(&map).is_ok()
}

fn image(map: &Bytes) -> Result<Image, LidarError> {
    let whole = |at: usize| map.u32(IMAGE_AT + at).map_or(0, i64::from);
    let metres = |at: usize| map.f32(IMAGE_AT + at).unwrap_or(f64::NAN);
    let (height, width) = (whole(12), whole(16));
    if !(1..=MAX_SIDE).contains(&width) || !(1..=MAX_SIDE).contains(&height) {
        return Err(bad(format!("its image has {width}x{height} cells")));
    }
    let (min_m, pixel_m) = ([metres(20), metres(24)], metres(36));
    if !(0.01..=0.5).contains(&pixel_m) || !min_m.iter().all(|v| v.abs() < 1000.0) {
        return Err(bad(format!("its image has cells of {pixel_m} m from {min_m:?} on")));
    }
    let pixel_cm = (pixel_m * 100.0).round() as i64;
    Ok(Image { width: width as usize, height: height as usize, min_m, pixel_cm })
}

pub(super) fn read(bytes: &[u8]) -> Result<LidarMap, LidarError> {
    let map = Bytes(bytes);
    let image = image(&map)?;
    let (flags, number) = (map.u32(0).unwrap_or_default(), map.u32(4).unwrap_or_default());
    let first = IMAGE_AT + IMAGE_HEADER_BYTES;
    let end = first + image.width * image.height;
    let cells = bytes.get(first..end).ok_or_else(|| bad("it ends in its image"))?;

    let frame =
        "metres, x right, y up, origin at the lower-left corner of the robot's image, as Valetudo has it";
    let (width_cm, height_cm) = (image.width as i64 * image.pixel_cm, image.height as i64 * image.pixel_cm);
    let mut drawing = Drawing::new("viomi", frame, Sheet::new(width_cm, height_cm, image.pixel_cm));
    drawing.own_frame = Some(RobotFrame { origin: image.min_m, ..RobotFrame::MAP });
    let place = Place { min_m: image.min_m, height_cm: height_cm as f64 };
    let mut blocks = Blocks { map, number, at: end };
    let names = blocks.read(flags, &place, &mut drawing).unwrap_or_else(|| {
        drawing
            .notes
            .push("the blocks behind the image were not all understood; the rest was ignored".to_string());
        BTreeMap::new()
    });
    // A map without a number is temporary; its rooms are not valid yet.
    read_image(&mut drawing, &image, cells, &names, number != 0);
    drawing.into_map()
}

/// Reads one byte per cell: 0 is unknown, 1 floor, 255 a wall, and anything else a room.
fn read_image(
    drawing: &mut Drawing,
    image: &Image,
    cells: &[u8],
    names: &BTreeMap<u8, String>,
    has_rooms: bool,
) {
    let (mut floor, mut wall) = (Runs::default(), Runs::default());
    let mut rooms: BTreeMap<u8, Runs> = BTreeMap::new();
    for (row, cells) in cells.chunks_exact(image.width).enumerate().rev() {
        let y = (image.height - 1 - row) as u32;
        for (x, &value) in cells.iter().enumerate() {
            let x = x as u32;
            match value {
                0 => {}
                255 => wall.add(x, y),
                1 => floor.add(x, y),
                _ if !has_rooms => floor.add(x, y),
                FIRST_ACTIVE.. => rooms.entry(value - 50).or_default().add(x, y),
                _ => rooms.entry(value).or_default().add(x, y),
            }
        }
    }
    drawing.layers.push(Layer { kind: LayerKind::Floor, runs: floor.0 });
    drawing.layers.push(Layer { kind: LayerKind::Wall, runs: wall.0 });
    for (id, runs) in rooms {
        let kind = LayerKind::Segment { id: id.to_string(), name: names.get(&id).cloned(), material: None };
        drawing.layers.push(Layer { kind, runs: runs.0 });
    }
}

/// Position of the image in the robot's frame.
struct Place {
    min_m: [f64; 2],
    height_cm: f64,
}

impl Place {
    /// Converts metres with y up to centimetres with y down; rounds upwards, like Valetudo.
    fn on_sheet(&self, x_m: f64, y_m: f64) -> [f64; 2] {
        let cm = |value: f64, min: f64| ((value - min) * 100.0).ceil();
        [cm(x_m, self.min_m[0]), self.height_cm - cm(y_m, self.min_m[1])]
    }

    /// Reads a position; `None` if it is unknown.
    fn position(&self, map: &Bytes, at: usize) -> Option<[f64; 2]> {
        let [x_m, y_m] = [map.f32(at)?, map.f32(at + 4)?];
        (x_m != UNKNOWN_M && y_m != UNKNOWN_M).then(|| self.on_sheet(x_m, y_m))
    }

    /// Reads a pose of x, y and an angle in radians counter-clockwise from the right. Valetudo adds 180 to
    /// that number as if it were degrees; read as radians, docks face away from their walls.
    fn spot(&self, map: &Bytes, at: usize) -> Option<Spot> {
        let ([x_cm, y_cm], yaw_rad) = (self.position(map, at)?, map.f32(at + 8)?);
        Some(Spot { x_cm, y_cm, angle_deg: Some(90.0 - yaw_rad.to_degrees()) })
    }
}

/// The blocks after the image.
struct Blocks<'a> {
    map: Bytes<'a>,
    number: u32,
    at: usize,
}

impl Blocks<'_> {
    /// Reads the blocks into the drawing and returns the rooms' names; `None` if one does not match its flag.
    fn read(&mut self, flags: u32, place: &Place, drawing: &mut Drawing) -> Option<BTreeMap<u8, String>> {
        let mut heading = None;
        if flags & flag::PATH != 0 {
            let count = self.count()?;
            let first = self.next(12 + count.checked_mul(PATH_POINT_BYTES)?)? + 12;
            let point_before_end = |index: usize| {
                let at = first + count.checked_sub(index)? * PATH_POINT_BYTES;
                place.position(&self.map, at + 1)
            };
            let end = point_before_end(1);
            heading = point_before_end(2).zip(end).and_then(|(from, to)| heading_deg(from, to));
            if self.number == 0 {
                drawing.robot = end.map(|[x_cm, y_cm]| Spot { x_cm, y_cm, angle_deg: heading });
            }
        }
        if self.number == 0 {
            drawing.notes.push("the map has no number yet: rooms and restrictions were not read".to_string());
            return Some(BTreeMap::new());
        }
        if flags & flag::CHARGER != 0 {
            let at = self.next(16)?;
            drawing.charger = place.spot(&self.map, at + 4);
        }
        if flags & flag::RESTRICTIONS != 0 {
            let count = self.count()?;
            let first = self.next(12 + count.checked_mul(AREA_BYTES)?)? + 12;
            for index in 0..count {
                self.restrict(first + index * AREA_BYTES + 12, place, drawing)?;
            }
        }
        if flags & flag::ACTIVE_ZONES != 0 {
            let count = self.count()?;
            self.next(12 + count.checked_mul(AREA_BYTES)?)?;
        }
        if flags & flag::TARGET != 0 {
            self.next(20)?;
        }
        if flags & flag::ROBOT != 0 {
            let at = self.next(21)?;
            drawing.robot = place.spot(&self.map, at + 9);
            // The heading of the path is more exact than the robot's own.
            if let (Some(robot), Some(heading)) = (&mut drawing.robot, heading) {
                robot.angle_deg = Some(heading);
            }
        }
        if flags & flag::UNKNOWN != 0 && flags & flag::NAMES != 0 {
            return None;
        }
        if flags & flag::BEFORE_NAMES != 0 {
            self.next(8)?;
        }
        if flags & flag::NAMES != 0 { self.names() } else { Some(BTreeMap::new()) }
    }

    /// Returns the number of items of the current block.
    fn count(&self) -> Option<usize> {
        self.map.u32(self.at + 8).map(|count| count as usize)
    }

    /// Skips a block of this length, which must begin with the map's number, and returns its start.
    fn next(&mut self, bytes: usize) -> Option<usize> {
        let at = self.at;
        if self.map.u32(at)? != self.number || bytes > self.map.0.len() - at {
            return None;
        }
        self.at += bytes;
        Some(at)
    }

    /// Reads four corners: two points twice are a wall, otherwise they are a zone.
    fn restrict(&self, at: usize, place: &Place, drawing: &mut Drawing) -> Option<()> {
        let mut corners = [[0.0; 2]; 4];
        for (index, corner) in corners.iter_mut().enumerate() {
            *corner = [self.map.f32(at + 8 * index)?, self.map.f32(at + 8 * index + 4)?];
        }
        let on_sheet = corners.map(|[x_m, y_m]| place.on_sheet(x_m, y_m));
        if corners[0] == corners[1] && corners[2] == corners[3] {
            drawing.add_line(LineKind::VirtualWall, &[on_sheet[0], on_sheet[2]]);
        } else {
            drawing.add_zone(ZoneKind::NoGo, &on_sheet);
        }
        Some(())
    }

    /// Reads the rooms' names, after the names of one or more maps, each with a number. The last number of a list
    /// is at most 1, but that of a single map can be larger. A byte and a place follow each room's name.
    fn names(&self) -> Option<BTreeMap<u8, String>> {
        if self.map.u32(self.at)? != self.number {
            return None;
        }
        let mut at = self.at + 4;
        let count = loop {
            at += 1 + usize::from(self.map.u8(at)?) + 4;
            let count = self.map.u32(at)?;
            if count <= MAX_ROOMS {
                break count;
            }
        };
        at += 4;
        let mut names = BTreeMap::new();
        for _ in 0..count {
            let (id, length) = (self.map.u8(at)?, usize::from(self.map.u8(at + 1)?));
            let name = self.map.0.get(at + 2..at + 2 + length)?;
            names.insert(id, String::from_utf8_lossy(name).into_owned());
            at += 2 + length + 1 + 8;
        }
        Some(names)
    }
}
