//! Valetudo's map JSON, metaData.version 2.

use super::{Written, mark, raster_of};
use crate::lidar::valetudo::MAX_SIZE_CM;
use crate::lidar::{Cell, LidarError, LidarMap, LineKind, MAX_POINTS, Room, ZoneKind};
use serde_json::{Map, Value, json};
use viola_geometry::{Grid, GridFrame, Point2, Pose2};

/// Margin around the map on a new sheet, in cells; left and below only if the map is moved.
const MARGIN: usize = 20;
const WHOLE: f64 = 1e-6;

/// Position of the cells on the sheet.
struct Place {
    /// Columns of the sheet to the left of the map.
    left: usize,
    file_from_map_m: [f64; 2],
    size_cm: [i64; 2],
    pixel_cm: i64,
    /// Rows of the sheet above the map.
    above: usize,
}

pub(super) fn write(map: &LidarMap) -> Result<Written, LidarError> {
    let mut notes = Vec::new();
    let grid = whole_centimetres(map, &mut notes)?;
    let place = Place::of(&grid.frame, map.sheet_cm)?;
    if place.file_from_map_m != [0.0; 2] {
        let [x, y] = place.file_from_map_m;
        notes.push(format!("the map was moved by {x:.3}, {y:.3} m so that it lies on a sheet"));
    }
    let mut in_room = vec![false; grid.cells.len()];
    let mut segments = Vec::new();
    for room in &map.rooms {
        let cells = cells_of(room, &grid.frame);
        cells.iter().for_each(|&index| in_room[index] = true);
        let mut meta = Map::new();
        meta.insert("segmentId".into(), room.id.clone().into());
        meta.insert("active".into(), false.into());
        for (key, text) in [("name", &room.name), ("material", &room.material)] {
            if let Some(text) = text {
                meta.insert(key.into(), text.clone().into());
            }
        }
        segments.push(layer("segment", meta, &cells, &grid.frame, &place));
    }
    let having = |wanted: Cell| -> Vec<usize> {
        let cells = grid.cells.iter().enumerate();
        let of_kind =
            cells.filter(|(index, cell)| **cell == wanted && (wanted != Cell::Free || !in_room[*index]));
        of_kind.map(|(index, _)| index).collect()
    };
    let mut layers = Vec::new();
    for (kind, cells) in [("floor", having(Cell::Free)), ("wall", having(Cell::Occupied))] {
        if !cells.is_empty() {
            layers.push(layer(kind, Map::new(), &cells, &grid.frame, &place));
        }
    }
    layers.extend(segments);
    let cells: u64 = layers.iter().filter_map(|layer| layer["dimensions"]["pixelCount"].as_u64()).sum();
    if cells > MAX_POINTS as u64 {
        return Err(LidarError::TooManyCells { cells, max: MAX_POINTS });
    }
    let area = |layer: &Value| layer["metaData"]["area"].as_i64().unwrap_or(0);
    let total: i64 = layers.iter().map(area).sum();
    let file = json!({
        "__class": "ValetudoMap",
        "metaData": {"version": 2, "totalLayerArea": total},
        "size": {"x": place.size_cm[0], "y": place.size_cm[1]},
        "pixelSize": place.pixel_cm,
        "layers": layers,
        "entities": entities(map, &place, &mut notes),
    });
    Ok(Written { bytes: file.to_string().into_bytes(), file_from_map_m: place.file_from_map_m, notes })
}

/// Returns the map's cells, resampled to 5 cm if their side is no whole number of centimetres.
fn whole_centimetres(map: &LidarMap, notes: &mut Vec<String>) -> Result<Grid<Cell>, LidarError> {
    let grid = map.raster()?;
    let side_cm = grid.frame.cell_m * 100.0;
    if (side_cm - side_cm.round()).abs() < WHOLE && side_cm >= 1.0 - WHOLE {
        return Ok(grid);
    }
    notes.push(format!("cells of {} m became cells of {} m", grid.frame.cell_m, super::CELL_M));
    let half_m = grid.frame.cell_m / 2.0;
    let inner = map.info.max_m.map(|v| v - half_m);
    raster_of(map.info.min_m, inner, super::CELL_M, |coarse| {
        for y in 0..coarse.frame.height {
            for x in 0..coarse.frame.width {
                let cell = grid.at(&coarse.frame.centre(x, y)).unwrap_or(Cell::Unknown);
                coarse.set(x, y, cell);
            }
        }
        mark(coarse, &map.occupied_m);
    })
}

impl Place {
    /// Returns the place on the sheet that the cells come from, so that all positions stay those of the robot, else on a
    /// new one.
    fn of(frame: &GridFrame, sheet_cm: Option<[i64; 2]>) -> Result<Place, LidarError> {
        let place = sheet_cm.and_then(|sheet_cm| Place::on_sheet_of(frame, sheet_cm));
        let place = place.unwrap_or_else(|| Place::on_new_sheet(frame));
        if place.size_cm.iter().any(|side_cm| *side_cm > MAX_SIZE_CM) {
            return Err(LidarError::BadField {
                field: "size".into(),
                value: format!("{} x {} cm", place.size_cm[0], place.size_cm[1]),
                expected: format!("at most {MAX_SIZE_CM} cm for Valetudo"),
            });
        }
        Ok(place)
    }

    /// Returns the place on the robot's sheet. Walls that the reader added around the floor may lie a cell beyond its
    /// border: the sheet grows to the right and downwards, and `None` is for those at the left and above.
    fn on_sheet_of(frame: &GridFrame, sheet_cm: [i64; 2]) -> Option<Place> {
        let pixel_cm = (frame.cell_m * 100.0).round();
        let whole = |cells: f64| {
            let is_whole = (cells - cells.round()).abs() < WHOLE && cells.round() >= 0.0;
            is_whole.then(|| cells.round() as usize)
        };
        let left = whole(frame.origin_m[0] * 100.0 / pixel_cm)?;
        let top_m = frame.origin_m[1] + frame.height as f64 * frame.cell_m;
        let above = whole((sheet_cm[1] as f64 - top_m * 100.0) / pixel_cm)?;
        let end_cm = |cells: usize| (cells as f64 * pixel_cm) as i64;
        let size_cm =
            [sheet_cm[0].max(end_cm(left + frame.width)), sheet_cm[1].max(end_cm(above + frame.height))];
        let file_from_map_m = [0.0, (size_cm[1] - sheet_cm[1]) as f64 / 100.0];
        Some(Place { left, file_from_map_m, size_cm, pixel_cm: pixel_cm as i64, above })
    }

    fn on_new_sheet(frame: &GridFrame) -> Place {
        let pixel_cm = (frame.cell_m * 100.0).round();
        let [x_cm, y_cm] = frame.origin_m.map(|v| v * 100.0);
        // The sheet begins with a whole cell at the left and top, so only x must be a multiple of a cell.
        let columns = (x_cm / pixel_cm).round();
        let fits = (x_cm - columns * pixel_cm).abs() < WHOLE * pixel_cm
            && (y_cm - y_cm.round()).abs() < WHOLE * pixel_cm
            && x_cm >= -WHOLE
            && y_cm >= -WHOLE
            && x_cm.max(y_cm) < MAX_SIZE_CM as f64 / 2.0;
        let (left, below_cm) =
            if fits { (columns as usize, y_cm.round()) } else { (MARGIN, MARGIN as f64 * pixel_cm) };
        let place_m = [left as f64 * frame.cell_m, below_cm / 100.0];
        let file_from_map_m =
            if fits { [0.0; 2] } else { [0, 1].map(|axis| place_m[axis] - frame.origin_m[axis]) };
        let size = |cells: usize| (cells as f64 * pixel_cm) as i64;
        let size_cm = [size(left + frame.width + MARGIN), size(MARGIN + frame.height) + below_cm as i64];
        Place { left, file_from_map_m, size_cm, pixel_cm: pixel_cm as i64, above: MARGIN }
    }

    /// Converts a point to whole centimetres from the top-left corner.
    fn on_sheet(&self, point_m: &[f64; 2]) -> [i64; 2] {
        let x_cm = (point_m[0] + self.file_from_map_m[0]) * 100.0;
        let y_cm = self.size_cm[1] as f64 - (point_m[1] + self.file_from_map_m[1]) * 100.0;
        [x_cm.round() as i64, y_cm.round() as i64]
    }
}

/// Returns the indices of a room's cells in the grid, each once.
fn cells_of(room: &Room, frame: &GridFrame) -> Vec<usize> {
    let index = |point: &Point2| frame.cell(point).map(|(x, y)| y * frame.width + x);
    let mut cells: Vec<usize> = room.cells_m.iter().filter_map(index).collect();
    cells.sort_unstable();
    cells.dedup();
    cells
}

/// Returns a layer of cells, whose indices must ascend.
fn layer(
    kind: &str,
    mut meta: Map<String, Value>,
    cells: &[usize],
    frame: &GridFrame,
    place: &Place,
) -> Value {
    let at = |index: usize| {
        let (x, y) = (index % frame.width, index / frame.width);
        [place.left + x, place.above + frame.height - 1 - y]
    };
    let mut runs: Vec<[usize; 3]> = Vec::new();
    let (mut low, mut high, mut sum) = ([usize::MAX; 2], [0; 2], [0; 2]);
    for [x, y] in cells.iter().map(|&index| at(index)) {
        for (axis, value) in [x, y].into_iter().enumerate() {
            low[axis] = low[axis].min(value);
            high[axis] = high[axis].max(value);
            sum[axis] += value;
        }
        match runs.last_mut() {
            Some([last_x, last_y, count]) if *last_y == y && *last_x + *count == x => *count += 1,
            _ => runs.push([x, y, 1]),
        }
    }
    // From the top, as Valetudo sorts them.
    runs.sort_unstable_by_key(|[x, y, _]| [*y, *x]);
    let count = cells.len();
    let extent = |axis: usize| match count {
        0 => json!({"min": 0, "max": 0, "mid": 0, "avg": 0}),
        _ => {
            json!({"min": low[axis], "max": high[axis], "mid": (low[axis] + high[axis]) / 2, "avg": sum[axis] / count})
        }
    };
    meta.insert("area".into(), (count as i64 * place.pixel_cm * place.pixel_cm).into());
    json!({
        "__class": "MapLayer",
        "type": kind,
        "metaData": meta,
        "pixels": [],
        "compressedPixels": runs.iter().flatten().collect::<Vec<_>>(),
        "dimensions": {"x": extent(0), "y": extent(1), "pixelCount": count},
    })
}

/// Returns an angle as Valetudo has it: degrees clockwise from the top, to a hundredth, a whole number if it can be.
fn angle(yaw_rad: f64) -> Value {
    let hundredths = ((90.0 - yaw_rad.to_degrees()) * 100.0).round().rem_euclid(36_000.0) as i64;
    if hundredths % 100 == 0 { (hundredths / 100).into() } else { (hundredths as f64 / 100.0).into() }
}

fn entities(map: &LidarMap, place: &Place, notes: &mut Vec<String>) -> Vec<Value> {
    let entity = |class: &str, kind: &str, points: &[[f64; 2]], meta: Value| {
        let points: Vec<i64> = points.iter().flat_map(|point| place.on_sheet(point)).collect();
        json!({"__class": class, "type": kind, "points": points, "metaData": meta})
    };
    let pose = |kind: &str, pose: &Pose2, has_unknown_yaw: bool| {
        let meta = if has_unknown_yaw { json!({}) } else { json!({"angle": angle(pose.yaw_rad)}) };
        entity("PointMapEntity", kind, &[[pose.x_m, pose.y_m]], meta)
    };
    let marks = &map.info.marks;
    let mut entities = Vec::new();
    let unknown = map.unknown_yaw;
    entities.extend(map.charger.map(|charger| pose("charger_location", &charger, unknown.charger)));
    entities.extend(marks.robot.map(|robot| pose("robot_position", &robot, unknown.robot)));
    for zone in &marks.zones {
        let kind = match zone.kind {
            ZoneKind::NoGo => "no_go_area",
            ZoneKind::NoMop => "no_mop_area",
            ZoneKind::Carpet => "carpet",
            ZoneKind::Ramp => "ramp",
            ZoneKind::NoVacuum => {
                notes.push("a no-vacuum zone is not kept".to_string());
                continue;
            }
        };
        entities.push(entity("PolygonMapEntity", kind, &zone.outline_m, json!({})));
    }
    for line in &marks.lines {
        let kind = match line.kind {
            LineKind::VirtualWall => "virtual_wall",
            LineKind::Threshold => "threshold",
            LineKind::Curtain => "curtain",
        };
        entities.push(entity("LineMapEntity", kind, &line.ends_m, json!({})));
    }
    for obstacle in &marks.obstacles {
        entities.push(entity(
            "PointMapEntity",
            "obstacle",
            &[obstacle.at_m],
            json!({"label": obstacle.label}),
        ));
    }
    if !map.carpet_m.is_empty() {
        notes.push("cells with carpet are not kept".to_string());
    }
    entities
}
