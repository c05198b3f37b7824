//! Roborock's RRMap (Xiaomi Mi Robot, S5, S6 and later): blocks of a type, a header and data. The layout is
//! that of Hypfer/Valetudo, `assets/kaitai_structs/roborock_map_file.ksy` and `RoborockMapParser.js`, and of
//! marcelrv/XiaomiRobotVacuumProtocol, `RRMapFile/RRFileFormat.md`.
//!
//! Positions are millimetres on a sheet of 51.2 m with y up; cells are 5 cm, their rows from the bottom.

use super::{Bytes, heading_deg, round_cm};
use crate::lidar::drawing::{Drawing, Layer, LayerKind, Spot};
use crate::lidar::sheet::{Runs, Sheet};
use crate::lidar::{LidarError, LidarMap, LineKind, Obstacle, RobotFrame, ZoneKind};

const FILE_HEADER_BYTES: usize = 20;
const BLOCK_HEADER_BYTES: usize = 8;
/// The last 16 bytes of the image's header are its position and size.
const PLACE_BYTES: usize = 16;
/// Minimum length of a header with a number of segments.
const HEADER_BYTES_WITH_SEGMENTS: usize = 28;
const SIDE_CELLS: i64 = 1024;
const SIDE_CM: i64 = 5120;
const SIDE_MM: f64 = 51_200.0;
const SEGMENTS: usize = 32;

mod block {
    pub const CHARGER: u16 = 1;
    pub const IMAGE: u16 = 2;
    pub const PATH: u16 = 3;
    pub const ROBOT: u16 = 8;
    pub const NO_GO: u16 = 9;
    pub const WALLS: u16 = 10;
    pub const NO_MOP: u16 = 12;
    pub const OBSTACLES: u16 = 15;
    pub const CARPET: u16 = 17;
    pub const NO_VACUUM: u16 = 23;
    pub const MATERIALS: u16 = 24;
}

/// Returns the name of an obstacle's type, from the camera of the later models.
fn obstacle_name(kind: u16) -> &'static str {
    match kind {
        0 | 48 => "cable",
        1 => "pet waste",
        2 => "shoe",
        3 | 4 => "pedestal",
        5 => "power strip",
        9 => "scale",
        10 | 34 | 51 => "fabric",
        25 => "dustpan",
        26 | 27 => "furniture",
        49 => "cat",
        50 => "dog",
        _ => "obstacle",
    }
}

struct Block<'a> {
    kind: u16,
    header: Bytes<'a>,
    data: Bytes<'a>,
}

pub(in super::super) fn is(bytes: &[u8]) -> bool {
    matches!(bytes, [b'r', b'r', header_bytes, 0, ..] if usize::from(*header_bytes) >= FILE_HEADER_BYTES)
}

fn bad(reason: impl Into<String>) -> LidarError {
    LidarError::BadRobotMap { format: "Roborock", reason: reason.into() }
}

pub(in super::super) fn read(bytes: &[u8]) -> Result<LidarMap, LidarError> {
    let blocks = blocks(bytes)?;
    // If a type occurs twice, the last block counts.
    let find = |kind: u16| blocks.iter().rev().find(|block| block.kind == kind);
    let frame = "metres, x right, y up, origin at the lower-left corner of the robot's sheet of 51.2 m, as Valetudo \
                 has it";
    let mut drawing = Drawing::new("roborock", frame, Sheet::new(SIDE_CM, SIDE_CM, 5));
    drawing.own_frame = Some(RobotFrame::millimetres([0.0; 2]));
    let image = find(block::IMAGE).ok_or_else(|| bad("it has no image block"))?;
    let materials = find(block::MATERIALS).map_or(&[][..], |block| block.data.0);
    read_image(&mut drawing, image, materials)?;
    drawing.charger = find(block::CHARGER).and_then(|block| spot(&block.data));
    drawing.robot = find(block::ROBOT).and_then(|block| spot(&block.data));
    if let Some(robot) = &mut drawing.robot
        && robot.angle_deg.is_none()
        && let Some(path) = find(block::PATH)
    {
        robot.angle_deg = last_heading(&path.data);
        drawing.notes.push("the robot's heading was taken from the end of its path".to_string());
    }
    for (kind, zone) in [
        (block::NO_GO, ZoneKind::NoGo),
        (block::NO_MOP, ZoneKind::NoMop),
        (block::NO_VACUUM, ZoneKind::NoVacuum),
    ] {
        for corners in find(kind).map(structures::<4>).unwrap_or_default() {
            drawing.add_zone(zone, &corners);
        }
    }
    for ends in find(block::WALLS).map(structures::<2>).unwrap_or_default() {
        drawing.add_line(LineKind::VirtualWall, &ends);
    }
    if let Some(block) = find(block::OBSTACLES) {
        add_obstacles(&mut drawing, block);
    }
    if find(block::CARPET).is_some() {
        drawing.notes.push("the block of carpets is of an unknown layout and was ignored".to_string());
    }
    drawing.into_map()
}

fn blocks(bytes: &[u8]) -> Result<Vec<Block<'_>>, LidarError> {
    let header_bytes = Bytes(bytes).u16(2).map_or(0, usize::from);
    let mut rest = bytes.get(header_bytes..).ok_or_else(|| bad("it ends in its header"))?;
    let mut blocks = Vec::new();
    while !rest.is_empty() {
        let at = bytes.len() - rest.len();
        let head = Bytes(rest);
        let (Some(kind), Some(header_bytes), Some(data_bytes)) = (head.u16(0), head.u16(2), head.u32(4))
        else {
            return Err(bad(format!("it ends in the head of the block at byte {at}")));
        };
        let header_bytes = usize::from(header_bytes);
        if header_bytes < BLOCK_HEADER_BYTES {
            return Err(bad(format!("the block at byte {at} has a header of {header_bytes} bytes")));
        }
        let end = header_bytes.checked_add(data_bytes as usize).filter(|end| *end <= rest.len());
        let end = end.ok_or_else(|| bad(format!("it ends in the block of type {kind} at byte {at}")))?;
        let (header, data) = (Bytes(&rest[..header_bytes]), Bytes(&rest[header_bytes..end]));
        blocks.push(Block { kind, header, data });
        rest = &rest[end..];
    }
    Ok(blocks)
}

/// Reads one byte per cell: the lower three bits are 0 for nothing, 1 for a wall and more for floor, the
/// upper five the segment. Robots without segments use those five for something else.
fn read_image(drawing: &mut Drawing, image: &Block, materials: &[u8]) -> Result<(), LidarError> {
    let header_bytes = image.header.0.len();
    let place = header_bytes.checked_sub(PLACE_BYTES).filter(|at| *at >= BLOCK_HEADER_BYTES);
    let place = place.ok_or_else(|| bad(format!("its image has a header of {header_bytes} bytes")))?;
    let number = |index: usize| image.header.i32(place + 4 * index).map_or(0, i64::from);
    let [top, left, height, width] = [0, 1, 2, 3].map(number);
    let is_inside = |first: i64, count: i64| first >= 0 && count >= 0 && first + count <= SIDE_CELLS;
    if !is_inside(top, height) || !is_inside(left, width) {
        return Err(LidarError::BadField {
            field: "image".into(),
            value: format!("{width}x{height} cells at {left}, {top}"),
            expected: format!("inside {SIDE_CELLS}x{SIDE_CELLS} cells"),
        });
    }
    if ![24, HEADER_BYTES_WITH_SEGMENTS].contains(&header_bytes) {
        drawing.notes.push(format!("the image's header of {header_bytes} bytes was read as one of 28 bytes"));
    }
    let cells = image.data.0;
    if (cells.len() as i64) < width * height {
        return Err(bad(format!("its image has {} of {width}x{height} cells", cells.len())));
    }
    let has_segments = header_bytes >= HEADER_BYTES_WITH_SEGMENTS;
    let (mut floor, mut wall) = (Runs::default(), Runs::default());
    let mut segments = vec![Runs::default(); SEGMENTS];
    let rows = cells.chunks_exact(width.max(1) as usize).take(height as usize).enumerate();
    for (row, cells) in rows.rev() {
        let y = (SIDE_CELLS - 1 - top - row as i64) as u32;
        for (column, &value) in cells.iter().enumerate() {
            let x = left as u32 + column as u32;
            match (value & 0b111, usize::from(value >> 3)) {
                (0, _) => {}
                (1, _) => wall.add(x, y),
                (_, segment) if has_segments && segment > 0 => segments[segment].add(x, y),
                _ => floor.add(x, y),
            }
        }
    }
    drawing.layers.push(Layer { kind: LayerKind::Floor, runs: floor.0 });
    drawing.layers.push(Layer { kind: LayerKind::Wall, runs: wall.0 });
    for (id, runs) in segments.into_iter().enumerate().filter(|(_, runs)| !runs.0.is_empty()) {
        let material = match materials.get(id) {
            Some(3) => Some("wood".to_string()),
            Some(4) => Some("tile".to_string()),
            _ => None,
        };
        let kind = LayerKind::Segment { id: id.to_string(), name: None, material };
        drawing.layers.push(Layer { kind, runs: runs.0 });
    }
    Ok(())
}

/// Converts millimetres with y up to centimetres with y down.
fn on_sheet(x_mm: f64, y_mm: f64) -> [f64; 2] {
    [round_cm(x_mm / 10.0), round_cm((SIDE_MM - y_mm) / 10.0)]
}

/// Reads a position, and since the third generation an angle: degrees counter-clockwise from the right.
fn spot(data: &Bytes) -> Option<Spot> {
    let [x_cm, y_cm] = on_sheet(f64::from(data.u32(0)?), f64::from(data.u32(4)?));
    let angle_deg = data.i32(8).map(|angle| (90.0 - f64::from(angle)).rem_euclid(360.0));
    Some(Spot { x_cm, y_cm, angle_deg })
}

fn last_heading(path: &Bytes) -> Option<f64> {
    let count = path.0.len() / 4;
    let point = |index: usize| {
        let (x, y) = (path.u16(4 * index)?, path.u16(4 * index + 2)?);
        Some(on_sheet(f64::from(x), f64::from(y)))
    };
    heading_deg(point(count.checked_sub(2)?)?, point(count - 1)?)
}

/// Reads structures of `N` points. Their number is in the header; data after them is ignored.
fn structures<const N: usize>(block: &Block) -> Vec<[[f64; 2]; N]> {
    let told = block.header.u32(BLOCK_HEADER_BYTES).map_or(usize::MAX, |count| count as usize);
    let records = block.data.0.chunks_exact(4 * N).take(told);
    let point = |record: &[u8], index: usize| {
        let number = |at: usize| f64::from(Bytes(record).u16(at).unwrap_or_default());
        on_sheet(number(4 * index), number(4 * index + 2))
    };
    records.map(|record| std::array::from_fn(|index| point(record, index))).collect()
}

/// Adds obstacles with x, y, type and confidence; some files also name a picture.
fn add_obstacles(drawing: &mut Drawing, block: &Block) {
    let count = block.header.u32(BLOCK_HEADER_BYTES).map_or(0, |count| count as usize);
    let Some(size) = block.data.0.len().checked_div(count).filter(|size| *size >= 8) else { return };
    for record in block.data.0.chunks_exact(size).map(Bytes) {
        let [x, y, kind, confidence] = [0, 2, 4, 6].map(|at| record.u16(at).unwrap_or_default());
        let [x_cm, y_cm] = on_sheet(f64::from(x), f64::from(y));
        let at = drawing.sheet.point(x_cm, y_cm);
        let label = format!("{} ({:.0}%)", obstacle_name(kind), f64::from(confidence) / 100.0);
        drawing.marks.obstacles.push(Obstacle { label, at_m: [at.x, at.y] });
    }
}
