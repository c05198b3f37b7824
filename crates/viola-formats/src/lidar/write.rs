//! Maps as files that other tools read: Valetudo JSON, ROS map_server, PLY.

mod points;
mod ros;
mod valetudo;

pub use ros::RosFiles;

use super::build::check_sides;
use super::{Cell, LidarError, LidarMap, MAX_CELLS};
use viola_geometry::{Grid, GridFrame, Point2};

/// Side of a cell for maps that are bare points.
const CELL_M: f64 = 0.05;

/// A written file.
#[derive(Debug, Clone)]
pub struct Written {
    pub bytes: Vec<u8>,
    /// Translation from the map's frame to the file's, in metres; zero if the frames are the same.
    pub file_from_map_m: [f64; 2],
    /// Data that the format cannot hold.
    pub notes: Vec<String>,
}

impl LidarMap {
    /// Returns the map as Valetudo's JSON, metaData.version 2. The map of a robot keeps its sheet, and so all positions.
    /// Of other maps, cells of a fraction of a centimetre are resampled, and a map left of or below its origin is moved,
    /// to fit the format.
    pub fn to_valetudo(&self) -> Result<Written, LidarError> {
        valetudo::write(self)
    }

    /// Returns the map as a yaml file and a PGM for ROS map_server; `image` is the name of the PGM.
    pub fn to_ros(&self, image: &str) -> Result<RosFiles, LidarError> {
        ros::write(self, image)
    }

    /// Returns the occupied points as binary PLY.
    pub fn to_ply(&self) -> Written {
        points::write(self)
    }

    /// Returns the map's cells, or a grid with the cells of its points.
    pub fn raster(&self) -> Result<Grid<Cell>, LidarError> {
        match &self.cells {
            Some(cells) => Ok(cells.clone()),
            None => raster_of(self.info.min_m, self.info.max_m, CELL_M, |grid| mark(grid, &self.occupied_m)),
        }
    }
}

/// Returns a grid that covers a box, with cells at multiples of their side.
fn raster_of(
    min_m: [f64; 2],
    max_m: [f64; 2],
    cell_m: f64,
    fill: impl FnOnce(&mut Grid<Cell>),
) -> Result<Grid<Cell>, LidarError> {
    // Rounding may put the product above `v`, which would then lie in no cell.
    let edge = |v: f64| (v / cell_m).floor() * cell_m;
    let least = min_m.map(|v| if edge(v) > v { edge(v) - cell_m } else { edge(v) });
    let frame = GridFrame::covering(least, max_m, 0.0, cell_m);
    // Cells reach up to a cell beyond the points, and a written map must be readable.
    check_sides([frame.width, frame.height].map(|cells| cells as f64 * cell_m))?;
    let cells = frame.width.saturating_mul(frame.height);
    if cells > MAX_CELLS {
        return Err(LidarError::TooManyCells { cells: cells as u64, max: MAX_CELLS });
    }
    let mut grid = Grid::filled(frame, Cell::Unknown);
    fill(&mut grid);
    Ok(grid)
}

fn mark(grid: &mut Grid<Cell>, points: &[Point2]) {
    for point in points {
        if let Some((x, y)) = grid.frame.cell(point) {
            grid.set(x, y, Cell::Occupied);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_on_the_edges_of_cells_are_kept() {
        for n in -400..400 {
            let at = f64::from(n) / 20.0;
            let map = LidarMap::read(format!("{at},{at}\n{},{at}", at + 0.1).as_bytes()).unwrap();
            let written = map.to_valetudo().unwrap();
            let read = LidarMap::read(&written.bytes).map(|read| read.occupied_m.len());
            assert_eq!(read.ok(), Some(2), "{at}");
        }
    }

    #[test]
    fn widest_maps_are_refused_or_readable() {
        for (from_m, to_m, fits) in [(-75.0, 174.94, true), (-75.0, 175.0, false), (-0.01, 249.98, false)] {
            let map = LidarMap::read(format!("x,y\n{from_m},0\n{to_m},0\n{from_m},1\n{to_m},1\n").as_bytes());
            let written = map.unwrap().to_valetudo();
            let read = written.as_ref().is_ok_and(|file| LidarMap::read(&file.bytes).is_ok());
            let refused = matches!(written, Err(LidarError::TooLarge { .. }));
            assert_eq!((read, refused), (fits, !fits), "{from_m} to {to_m} m");
        }
    }
}
