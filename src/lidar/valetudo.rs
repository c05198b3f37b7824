//! Valetudo's map JSON, metaData.version 1 and 2 (Hypfer/Valetudo, `backend/lib/entities/map`).
//!
//! In the file everything counts from the top-left corner with y down: cells in pixels, sizes and entities
//! in centimetres. Here y is turned up, and the origin is the lower-left corner of `size`.

mod file;
mod sheet;

use self::file::{Label, Layer, MapFile};
use self::sheet::{Run, Sheet};
use super::build::{Parts, build, occupied_centres};
use super::{Cell, LidarError, LidarMap, MAX_POINTS, Room};
use crate::geometry::{Grid, Pose2};

/// A kilometre: no robot maps more.
const MAX_SIZE_CM: i64 = 100_000;
const MAX_PIXEL_CM: i64 = 100;
const MAX_NAME_CHARS: usize = 100;
/// Below this many wall cells for each cell around the floor, the walls are taken from the floor's border.
const MIN_WALL_SHARE: f64 = 0.25;

pub(super) fn read(bytes: &[u8]) -> Result<LidarMap, LidarError> {
    let file: MapFile =
        serde_json::from_slice(bytes).map_err(|error| LidarError::BadJson { reason: error.to_string() })?;
    let file_layers = &file.layers.0;
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
    for (index, layer) in file_layers.iter().enumerate() {
        let runs = sheet.runs(layer, index)?;
        total_cells += runs.iter().map(|run| u64::from(run.count)).sum::<u64>();
        if total_cells > MAX_POINTS as u64 {
            return Err(LidarError::TooManyCells { cells: total_cells, max: MAX_POINTS });
        }
        layers.push(runs);
    }
    let (mut notes, mut ignored_layers) = (Vec::new(), 0);
    let mut grid = sheet.grid_around(&layers)?;
    let mut rooms = Vec::new();
    // Walls are written over floors, whatever the layers' order.
    for (layer, runs) in file_layers.iter().zip(&layers) {
        match layer.kind.as_str() {
            "floor" => sheet.fill(&mut grid, runs, Cell::Free),
            "segment" => {
                sheet.fill(&mut grid, runs, Cell::Free);
                rooms.push(room(&sheet, layer, runs, rooms.len()));
            }
            "wall" => {}
            _ => ignored_layers += 1,
        }
    }
    if ignored_layers > 0 {
        notes.push(format!("{ignored_layers} layers are neither floor, segment nor wall and were ignored"));
    }
    for (layer, runs) in file_layers.iter().zip(&layers) {
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

fn room(sheet: &Sheet, layer: &Layer, runs: &[Run], index: usize) -> Room {
    let id = match &layer.meta_data.segment_id {
        Some(Label::Text(text)) => text.clone(),
        Some(Label::Number(number)) => number.to_string(),
        None => format!("{}", index + 1),
    };
    let cells_m =
        runs.iter().flat_map(|run| (run.x..run.x + run.count).map(|x| sheet.centre(x, run.y))).collect();
    let name = layer.meta_data.name.as_deref().map(shorten).filter(|name| !name.is_empty());
    Room { id: shorten(&id), name, cells_m }
}

/// Names go into every answer about the map.
fn shorten(name: &str) -> String {
    name.chars().filter(|c| !c.is_control()).take(MAX_NAME_CHARS).collect()
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
    let entity = file.entities.0.iter().find(|entity| entity.kind == "charger_location")?;
    let [x_cm, y_cm] = entity.points.0?;
    let angle_deg = entity.meta_data.angle.unwrap_or_else(|| {
        notes.push("the charger has no angle; it was taken as facing the top of the map".to_string());
        0.0
    });
    let yaw_rad = (90.0 - angle_deg).to_radians();
    let pose = Pose2::new(x_cm / 100.0, (file.size.y as f64 - y_cm) / 100.0, yaw_rad);
    pose.is_finite().then_some(pose)
}
