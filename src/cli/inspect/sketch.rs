//! A map in characters, for a terminal.

use viola_formats::lidar::{Cell, LidarMap};
use viola_geometry::{GridFrame, Point2};

const COLUMNS: f64 = 78.0;
/// A character is about twice as high as it is wide.
const ASPECT: f64 = 2.0;
const MAX_ROWS: f64 = 60.0;

/// Returns the map in characters, top row first: `#` walls, `.` free floor, letters for rooms, `@` the dock.
pub(super) fn sketch(map: &LidarMap) -> String {
    let size = [0, 1].map(|axis| (map.info.max_m[axis] - map.info.min_m[axis]).max(0.01));
    // A step below the map's cell size would leave gaps.
    let finest_m = map.info.cell_m.unwrap_or(0.0);
    let step_m = (size[0] / COLUMNS).max(size[1] / MAX_ROWS / ASPECT).max(finest_m);
    let [columns, rows] = [size[0] / step_m, size[1] / step_m / ASPECT].map(|v| v.ceil().max(1.0) as usize);
    let mut characters = vec![b' '; columns * rows];
    let mut put = |point: &Point2, character: u8| {
        let column = ((point.x - map.info.min_m[0]) / step_m) as usize;
        let row = ((map.info.max_m[1] - point.y) / step_m / ASPECT) as usize;
        characters[row.min(rows - 1) * columns + column.min(columns - 1)] = character;
    };
    if let Some(cells) = &map.cells {
        let GridFrame { width, .. } = cells.frame;
        for (index, _) in cells.cells.iter().enumerate().filter(|(_, cell)| **cell == Cell::Free) {
            put(&cells.frame.centre(index % width, index / width), b'.');
        }
    }
    for (index, room) in map.rooms.iter().enumerate() {
        room.cells_m.iter().for_each(|point| put(point, b'a' + (index % 26) as u8));
    }
    map.occupied_m.iter().for_each(|point| put(point, b'#'));
    if let Some(dock) = &map.charger {
        put(&Point2::new(dock.x_m, dock.y_m), b'@');
    }
    let mut text = String::new();
    for row in characters.chunks_exact(columns) {
        text.push_str(String::from_utf8_lossy(row).trim_end());
        text.push('\n');
    }
    text
}
