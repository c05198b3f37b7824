//! A LiDAR map as a grid of cells.

use super::messages::{Grid, Pose, UINT8, Vector2, fields};
use viola_formats::lidar::{Cell, LidarMap};
use viola_geometry::{GridFrame, Pose3};

/// Maximum number of cells; larger maps get larger cells.
const MAX_CELLS: usize = 4 << 20;
/// Side of a cell for maps that are bare points.
const CELL_OF_POINTS_M: f64 = 0.05;
/// Bytes of a cell: colour and opacity, and the occupancy of ROS (0 free, 100 occupied, 255 unknown).
const CELL_BYTES: usize = 5;
const UNKNOWN: [u8; CELL_BYTES] = [0, 0, 0, 0, 255];
const FREE: [u8; CELL_BYTES] = [225, 229, 235, 255, 0];
const OCCUPIED: [u8; CELL_BYTES] = [40, 44, 52, 255, 100];

/// Returns the cells of a LiDAR map, without frame and time. A cell that covers several of the map's is occupied if
/// one of them is, else free if one of them is.
pub fn grid(lidar: &LidarMap) -> Grid {
    let frame = frame(lidar);
    let mut data = UNKNOWN.repeat(frame.len());
    let mut set = |(x, y): (usize, usize), value: [u8; CELL_BYTES]| {
        let at = (y * frame.width + x) * CELL_BYTES;
        data[at..at + CELL_BYTES].copy_from_slice(&value);
    };
    if let Some(cells) = &lidar.cells {
        for wanted in [Cell::Free, Cell::Occupied] {
            let value = if wanted == Cell::Free { FREE } else { OCCUPIED };
            for (index, _) in cells.cells.iter().enumerate().filter(|(_, cell)| **cell == wanted) {
                let centre = cells.frame.centre(index % cells.frame.width, index / cells.frame.width);
                if let Some(place) = frame.cell(&centre) {
                    set(place, value);
                }
            }
        }
    } else {
        for place in lidar.occupied_m.iter().filter_map(|point| frame.cell(point)) {
            set(place, OCCUPIED);
        }
    }
    let [x, y] = frame.origin_m;
    Grid {
        timestamp: None,
        frame_id: String::new(),
        pose: Some(Pose::from(&Pose3::translation(x, y, 0.0))),
        column_count: frame.width as u32,
        cell_size: Some(Vector2 { x: frame.cell_m, y: frame.cell_m }),
        row_stride: (frame.width * CELL_BYTES) as u32,
        cell_stride: CELL_BYTES as u32,
        fields: fields(&[
            ("red", 0, UINT8),
            ("green", 1, UINT8),
            ("blue", 2, UINT8),
            ("alpha", 3, UINT8),
            ("occupancy", 4, UINT8),
        ]),
        data,
    }
}

/// Returns the map's own cells if they are not too many, else larger ones around everything known.
fn frame(lidar: &LidarMap) -> GridFrame {
    if let Some(cells) = &lidar.cells
        && cells.frame.len() <= MAX_CELLS
    {
        return cells.frame;
    }
    let (min_m, max_m) = (lidar.info.min_m, lidar.info.max_m);
    let mut cell_m = lidar.cells.as_ref().map_or(CELL_OF_POINTS_M, |cells| cells.frame.cell_m);
    loop {
        let frame = GridFrame::covering(min_m, max_m, cell_m, cell_m);
        if frame.len() <= MAX_CELLS {
            return frame;
        }
        cell_m *= 2.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn occupancy(grid: &Grid) -> Vec<u8> {
        grid.data.chunks(CELL_BYTES).map(|cell| cell[4]).collect()
    }

    #[test]
    fn points_are_occupied_cells_at_their_place() {
        let lidar = LidarMap::read(b"x,y\n1.0,2.0\n3.0,2.0\n3.0,5.0\n1.0,5.0\n1.5,2.0\n").unwrap();
        let grid = grid(&lidar);
        assert_eq!(occupancy(&grid).iter().filter(|value| **value == 100).count(), 5);
        let origin = grid.pose.unwrap().position.unwrap();
        let (columns, cell_m) = (grid.column_count as usize, grid.cell_size.unwrap().x);
        for (index, cell) in grid.data.chunks(CELL_BYTES).enumerate().filter(|(_, cell)| cell[4] == 100) {
            assert_eq!(cell, OCCUPIED);
            let x = origin.x + (index % columns) as f64 * cell_m;
            let y = origin.y + (index / columns) as f64 * cell_m;
            let holds = |point: &viola_geometry::Point2| {
                (0.0..cell_m).contains(&(point.x - x)) && (0.0..cell_m).contains(&(point.y - y))
            };
            assert!(lidar.occupied_m.iter().any(holds), "({x}, {y})");
        }
    }

    #[test]
    fn a_large_map_gets_larger_cells() {
        let lidar = LidarMap::read(b"x,y\n0.0,0.0\n240.0,0.0\n240.0,240.0\n0.0,240.0\n1.0,0.0\n").unwrap();
        let grid = grid(&lidar);
        assert!(grid.data.len() <= MAX_CELLS * CELL_BYTES);
        assert_eq!(occupancy(&grid).iter().filter(|value| **value == 100).count(), 5);
        assert_eq!(grid.cell_size.unwrap().x, 0.2);
    }
}
