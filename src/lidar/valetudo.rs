//! Valetudo's map JSON, metaData.version 1 and 2 (Hypfer/Valetudo, `backend/lib/entities/map`).
//!
//! In the file everything counts from the top-left corner with y down: cells in pixels, sizes and entities
//! in centimetres. Here y is turned up, and the origin is the lower-left corner of `size`.

use super::build::{Parts, build, occupied_centres};
use super::{Cell, LidarError, LidarMap, MAX_CELLS, MAX_POINTS, Room};
use crate::geometry::{Grid, GridFrame, Point2, Pose2};
use serde::Deserialize;

/// A kilometre: no robot maps more.
const MAX_SIZE_CM: i64 = 100_000;
const MAX_PIXEL_CM: i64 = 100;
/// Below this many wall cells for each cell around the floor, the walls are taken from the floor's border.
const MIN_WALL_SHARE: f64 = 0.25;

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct MapFile {
    size: Size,
    pixel_size: i64,
    layers: Vec<Layer>,
    #[serde(default)]
    entities: Vec<Entity>,
}

#[derive(Deserialize)]
struct Size {
    x: i64,
    y: i64,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Layer {
    #[serde(rename = "type")]
    kind: String,
    #[serde(default)]
    meta_data: LayerMetaData,
    /// Version 1: x, y of every pixel.
    #[serde(default)]
    pixels: Vec<i32>,
    /// Version 2: x, y of a run's first pixel and how many there are to its right.
    #[serde(default)]
    compressed_pixels: Vec<i32>,
}

#[derive(Deserialize, Default)]
#[serde(rename_all = "camelCase", default)]
struct LayerMetaData {
    segment_id: Option<Label>,
    name: Option<String>,
}

/// Identifiers are strings; early versions wrote numbers.
#[derive(Deserialize)]
#[serde(untagged)]
enum Label {
    Text(String),
    Number(i64),
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Entity {
    #[serde(rename = "type")]
    kind: String,
    #[serde(default)]
    points: Vec<f64>,
    #[serde(default)]
    meta_data: EntityMetaData,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct EntityMetaData {
    angle: Option<f64>,
}

pub(super) fn read(bytes: &[u8]) -> Result<LidarMap, LidarError> {
    let file: MapFile =
        serde_json::from_slice(bytes).map_err(|error| LidarError::BadJson { reason: error.to_string() })?;
    check_range("size.x", file.size.x, MAX_SIZE_CM)?;
    check_range("size.y", file.size.y, MAX_SIZE_CM)?;
    check_range("pixelSize", file.pixel_size, MAX_PIXEL_CM)?;
    let sheet = Sheet {
        width: file.size.x / file.pixel_size,
        height: file.size.y / file.pixel_size,
        height_m: file.size.y as f64 / 100.0,
        cell_m: file.pixel_size as f64 / 100.0,
    };

    let mut layers = Vec::new();
    let mut total_cells = 0;
    for (index, layer) in file.layers.iter().enumerate() {
        let runs = sheet.runs(layer, index)?;
        total_cells += runs.iter().map(|run| u64::from(run.count)).sum::<u64>();
        if total_cells > MAX_POINTS as u64 {
            return Err(LidarError::TooManyCells { cells: total_cells, max: MAX_POINTS });
        }
        layers.push(runs);
    }
    let mut notes = Vec::new();
    let mut grid = sheet.grid_around(&layers)?;
    let mut rooms = Vec::new();
    // Walls are written over floors, whatever the layers' order.
    for (layer, runs) in file.layers.iter().zip(&layers) {
        match layer.kind.as_str() {
            "floor" => sheet.fill(&mut grid, runs, Cell::Free),
            "segment" => {
                sheet.fill(&mut grid, runs, Cell::Free);
                rooms.push(room(&sheet, layer, runs, rooms.len()));
            }
            "wall" => {}
            other => notes.push(format!("a layer of type {other:.40} was ignored")),
        }
    }
    for (layer, runs) in file.layers.iter().zip(&layers) {
        if layer.kind == "wall" {
            sheet.fill(&mut grid, runs, Cell::Occupied);
        }
    }
    add_floor_border(&mut grid, &mut notes);
    build(Parts {
        format: "valetudo",
        frame: "metres, x right, y up, origin at the lower-left corner of `size`",
        occupied_m: occupied_centres(&grid)?,
        cells: Some(grid),
        rooms,
        charger: charger(&file, &mut notes),
        notes,
    })
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

/// A run of cells to the right of (x, y), counted from the top-left corner.
#[derive(Clone, Copy)]
struct Run {
    x: u32,
    y: u32,
    count: u32,
}

/// The whole sheet that `size` spans, in cells.
struct Sheet {
    width: i64,
    height: i64,
    height_m: f64,
    cell_m: f64,
}

impl Sheet {
    /// A layer's cells as checked runs; both encodings, also mixed.
    fn runs(&self, layer: &Layer, index: usize) -> Result<Vec<Run>, LidarError> {
        let flat = layer.pixels.chunks(2).map(|c| (c, 2, "pixels"));
        let packed = layer.compressed_pixels.chunks(3).map(|c| (c, 3, "compressedPixels"));
        let mut runs = Vec::with_capacity(flat.len() + packed.len());
        for (values, expected, name) in flat.chain(packed) {
            let bad = |what: &str| LidarError::BadField {
                field: format!("layers[{index}].{name}"),
                value: format!("{values:?}"),
                expected: what.to_string(),
            };
            if values.len() != expected {
                return Err(bad("whole groups of numbers"));
            }
            let (x, y, count) = (values[0], values[1], values.get(2).copied().unwrap_or(1));
            let fits = x >= 0
                && y >= 0
                && count >= 1
                && i64::from(y) < self.height
                && i64::from(x) + i64::from(count) <= self.width;
            if !fits {
                return Err(bad(&format!("inside the map's {}x{} pixels", self.width, self.height)));
            }
            runs.push(Run { x: x as u32, y: y as u32, count: count as u32 });
        }
        Ok(runs)
    }

    /// An empty grid around all runs, so that an almost empty sheet costs nothing.
    fn grid_around(&self, layers: &[Vec<Run>]) -> Result<Grid<Cell>, LidarError> {
        let mut runs = layers.iter().flatten();
        let first = runs.next().ok_or(LidarError::NoWalls)?;
        let (mut left, mut right, mut top, mut bottom) =
            (first.x, first.x + first.count, first.y, first.y + 1);
        for run in runs {
            left = left.min(run.x);
            right = right.max(run.x + run.count);
            top = top.min(run.y);
            bottom = bottom.max(run.y + 1);
        }
        // One unknown cell on each side, for the border of a floor that has no walls.
        let (width, height) = ((right - left) as usize + 2, (bottom - top) as usize + 2);
        if width * height > MAX_CELLS {
            return Err(LidarError::TooManyCells { cells: (width * height) as u64, max: MAX_CELLS });
        }
        let origin_m =
            [(f64::from(left) - 1.0) * self.cell_m, self.height_m - (f64::from(bottom) + 1.0) * self.cell_m];
        Ok(Grid::filled(GridFrame { origin_m, cell_m: self.cell_m, width, height }, Cell::Unknown))
    }

    /// The centre of a cell, in the map's frame.
    fn centre(&self, x: u32, y: u32) -> Point2 {
        Point2::new((f64::from(x) + 0.5) * self.cell_m, self.height_m - (f64::from(y) + 0.5) * self.cell_m)
    }

    fn fill(&self, grid: &mut Grid<Cell>, runs: &[Run], value: Cell) {
        for run in runs {
            if let Some((x, y)) = grid.frame.cell(&self.centre(run.x, run.y)) {
                let from = y * grid.frame.width + x;
                grid.cells[from..from + run.count as usize].fill(value);
            }
        }
    }
}

fn room(sheet: &Sheet, layer: &Layer, runs: &[Run], index: usize) -> Room {
    let id = match &layer.meta_data.segment_id {
        Some(Label::Text(text)) => text.clone(),
        Some(Label::Number(number)) => number.to_string(),
        None => format!("{}", index + 1),
    };
    let cells_m =
        runs.iter().flat_map(|run| (run.x..run.x + run.count).map(|x| sheet.centre(x, run.y))).collect();
    Room { id, name: layer.meta_data.name.clone().filter(|name| !name.is_empty()), cells_m }
}

/// Some early robots (Dreame 1C) hardly store walls. Where the floor ends there is one.
fn add_floor_border(grid: &mut Grid<Cell>, notes: &mut Vec<String>) {
    let (width, height) = (grid.frame.width, grid.frame.height);
    let walls = grid.cells.iter().filter(|cell| **cell == Cell::Occupied).count();
    let mut border = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let is_free = |nx: usize, ny: usize| nx < width && ny < height && grid.get(nx, ny) == Cell::Free;
            let touches_floor = is_free(x.wrapping_sub(1), y)
                || is_free(x + 1, y)
                || is_free(x, y.wrapping_sub(1))
                || is_free(x, y + 1);
            if grid.get(x, y) != Cell::Free && touches_floor {
                border.push((x, y));
            }
        }
    }
    if walls == 0 || walls as f64 >= MIN_WALL_SHARE * border.len() as f64 {
        return;
    }
    for &(x, y) in &border {
        grid.set(x, y, Cell::Occupied);
    }
    notes.push(format!(
        "the map has only {walls} wall cells; the {} cells around its floor were taken as walls too",
        border.len()
    ));
}

/// The dock: its angle is 0 towards the top of the picture and grows clockwise.
fn charger(file: &MapFile, notes: &mut Vec<String>) -> Option<Pose2> {
    let entity = file.entities.iter().find(|entity| entity.kind == "charger_location")?;
    let &[x_cm, y_cm] = entity.points.as_slice() else { return None };
    let angle_deg = entity.meta_data.angle.unwrap_or_else(|| {
        notes.push("the charger has no angle; it was taken as facing the top of the map".to_string());
        0.0
    });
    let yaw_rad = (90.0 - angle_deg).to_radians();
    let pose = Pose2::new(x_cm / 100.0, (file.size.y as f64 - y_cm) / 100.0, yaw_rad);
    pose.is_finite().then_some(pose)
}
