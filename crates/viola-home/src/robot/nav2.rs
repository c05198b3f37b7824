//! Maps for Nav2: occupancy, keepout mask and labels as PGM and YAML (nav2_map_server, `map_io.cpp`), with the
//! suggested no-go zones and the goal poses as JSON.

use super::area::for_cells;
use super::ground::Ground;
use super::labels::{Labels, Legend};
use super::no_go::{NoGoZone, no_go_zones};
use super::places::{Place, Places};
use super::{RobotLevel, round};
use serde_json::{Value, json};
use std::io::{Cursor, Write as _};
use viola_formats::lidar::LidarError;
use viola_geometry::{Grid, GridFrame};
use zip::write::SimpleFileOptions;

/// Mode of a map whose values are the darkness in hundredths, so that a costmap filter reads 0 to 100.
const SCALE: &str = "scale";
/// Mode of a map whose values are the grey values themselves; above 100 they are unknown.
const RAW: &str = "raw";

/// Returns the files of a level by name. `ground` has its rugs and stairs.
pub fn nav2_files(
    level: &RobotLevel,
    places: &Places,
    ground: &Ground,
) -> Result<Vec<(&'static str, Vec<u8>)>, LidarError> {
    let map = level.lidar.to_ros("map.pgm")?;
    let labels = Labels::new(level)?;
    let frame = labels.classes.frame;
    let zones = no_go_zones(level, ground);
    let keepout = keepout(frame, &zones);
    Ok(vec![
        ("map.yaml", map.yaml),
        ("map.pgm", map.pgm),
        ("keepout_mask.yaml", yaml("keepout_mask.pgm", &frame, SCALE)),
        ("keepout_mask.pgm", pgm(&keepout, darkness)),
        ("semantic_mask.yaml", yaml("semantic_mask.pgm", &frame, RAW)),
        ("semantic_mask.pgm", pgm(&labels.classes, |value| value)),
        ("room_mask.yaml", yaml("room_mask.pgm", &frame, RAW)),
        ("room_mask.pgm", pgm(&labels.rooms, |value| value)),
        ("labels.json", text(&json!(Legend::of(level)))),
        ("no_go_zones.json", text(&json!({ "frame": level.lidar.info.frame, "zones": zones }))),
        ("goals.json", text(&goals(level, places))),
    ])
}

/// Returns files in a zip. The same files give the same bytes.
pub fn nav2_zip(files: &[(&'static str, Vec<u8>)]) -> Vec<u8> {
    let options = SimpleFileOptions::default().last_modified_time(zip::DateTime::default());
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let written = files.iter().try_for_each(|(name, bytes)| {
        archive.start_file(*name, options)?;
        Ok(archive.write_all(bytes)?)
    });
    // Writing to memory fails only for sizes beyond the format's 4 GB, which MAX_CELLS excludes.
    written.and_then(|()| archive.finish()).map(Cursor::into_inner).unwrap_or_default()
}

fn yaml(image: &str, frame: &GridFrame, mode: &str) -> Vec<u8> {
    let [x_m, y_m] = frame.written_origin_m();
    // Black is above one threshold and white below the other for every reader; between them grey is linear.
    format!(
        "image: {image}\nmode: {mode}\nresolution: {}\norigin: [{x_m:?}, {y_m:?}, 0.0]\nnegate: 0\n\
         occupied_thresh: 0.999\nfree_thresh: 0.001\n",
        frame.cell_m
    )
    .into_bytes()
}

/// Returns the grey of a value from 0 to 100: white to black.
fn darkness(value: u8) -> u8 {
    255 - (f64::from(value.min(100)) * 2.55).round() as u8
}

/// Returns a binary PGM, whose first row is the uppermost.
fn pgm(grid: &Grid<u8>, grey: impl Fn(u8) -> u8) -> Vec<u8> {
    let GridFrame { width, height, .. } = grid.frame;
    let mut pgm = format!("P5\n{width} {height}\n255\n").into_bytes();
    for row in grid.cells.chunks_exact(width.max(1)).rev() {
        pgm.extend(row.iter().map(|value| grey(*value)));
    }
    pgm
}

/// Returns the largest value of the zones at each cell.
fn keepout(frame: GridFrame, zones: &[NoGoZone]) -> Grid<u8> {
    let mut mask = Grid::filled(frame, 0u8);
    for zone in zones {
        for_cells(&frame, &zone.rings(), |index| mask.cells[index] = mask.cells[index].max(zone.mask));
    }
    mask
}

/// Returns the goal poses; a room's has no direction, so its yaw is 0.
fn goals(level: &RobotLevel, places: &Places) -> Value {
    let goal = |place: &Place| {
        let goal = place.goal?;
        Some(json!({
            "id": place.id,
            "name": place.name,
            "class": place.class,
            "room": place.room,
            "x_m": goal.x_m,
            "y_m": goal.y_m,
            "yaw_rad": goal.yaw_rad.map_or(0.0, round),
        }))
    };
    let goals: Vec<Value> = places.all.iter().filter_map(goal).collect();
    json!({ "frame": level.lidar.info.frame, "goal_area": places.goal_area, "goals": goals })
}

fn text(value: &Value) -> Vec<u8> {
    let mut text = format!("{value:#}").into_bytes();
    text.push(b'\n');
    text
}
