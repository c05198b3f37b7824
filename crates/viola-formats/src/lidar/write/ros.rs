//! ROS map_server: a yaml file and a PGM with the values that map savers write.

use crate::lidar::{Cell, LidarError, LidarMap};

/// The two files of a map.
#[derive(Debug, Clone)]
pub struct RosFiles {
    pub yaml: Vec<u8>,
    pub pgm: Vec<u8>,
    /// Data that the format cannot hold.
    pub notes: Vec<String>,
}

pub(super) fn write(map: &LidarMap, image: &str) -> Result<RosFiles, LidarError> {
    let grid = map.raster()?;
    let frame = grid.frame;
    let mut pgm = format!("P5\n{} {}\n255\n", frame.width, frame.height).into_bytes();
    pgm.reserve(frame.len());
    for row in grid.cells.chunks_exact(frame.width.max(1)).rev() {
        pgm.extend(row.iter().map(|cell| match cell {
            Cell::Occupied => 0u8,
            Cell::Free => 254,
            Cell::Unknown => 205,
        }));
    }
    let [x_m, y_m] = frame.written_origin_m();
    // YAML reads JSON's quotes too. 0.196 keeps unknown cells from being free.
    let image = serde_json::Value::from(image);
    let yaml = format!(
        "image: {image}\nmode: trinary\nresolution: {}\norigin: [{x_m:?}, {y_m:?}, 0.0]\nnegate: 0\n\
         occupied_thresh: 0.65\nfree_thresh: 0.196\n",
        frame.cell_m
    );
    let mut notes = Vec::new();
    if map.cells.is_none() {
        notes.push(format!("points became cells of {} m", frame.cell_m));
    }
    if !map.rooms.is_empty() || map.charger.is_some() || !map.info.marks_in_words().is_empty() {
        notes.push("rooms, charger and marks are not kept".to_string());
    }
    Ok(RosFiles { yaml: yaml.into_bytes(), pgm, notes })
}
