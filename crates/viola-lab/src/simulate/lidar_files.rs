//! The survey as a [`LidarMap`] and in the file formats of robots and their tools.

use super::survey::{CELL_M, Survey};
use serde_json::{Value, json};
use std::fmt::Write;
use viola_formats::lidar::{Cell, LidarError, LidarMap};
use viola_geometry::{Grid, GridFrame, Point2, Pose2};

/// Empty cells around the Valetudo map: left and below; right and above.
const MARGIN: [usize; 2] = [12, 7];

impl Survey {
    /// Returns the transform to Valetudo's frame, whose origin is the lower-left corner of the map's `size`.
    pub fn valetudo_from_home(&self) -> Pose2 {
        let origin = self.cells.frame.origin_m;
        let margin = MARGIN[0] as f64 * CELL_M;
        Pose2::new(margin - origin[0], margin - origin[1], 0.0).compose(&self.robot_from_home)
    }

    fn valetudo_cells(&self) -> Grid<Cell> {
        let frame = self.cells.frame;
        let around = MARGIN[0] + MARGIN[1];
        let mut grid = Grid::filled(
            GridFrame {
                origin_m: [0.0, 0.0],
                cell_m: CELL_M,
                width: frame.width + around,
                height: frame.height + around,
            },
            Cell::Unknown,
        );
        for y in 0..frame.height {
            for x in 0..frame.width {
                grid.set(x + MARGIN[0], y + MARGIN[0], self.cells.get(x, y));
            }
        }
        grid
    }

    /// Returns the charger in whole centimetres, y up, and its angle in Valetudo's degrees.
    fn charger_cm(&self) -> ([i64; 2], i64) {
        let charger =
            self.valetudo_from_home().compose(&self.robot_from_home.inverse()).compose(&self.charger);
        let cm = [charger.x_m, charger.y_m].map(|v| (v * 100.0).round() as i64);
        // Valetudo's degrees are clockwise from north.
        let north = (90.0 - charger.yaw_rad.to_degrees()).round() as i64;
        (cm, north.rem_euclid(360))
    }

    /// Returns the map as its reader returns it from [`valetudo_json`].
    pub fn lidar_map(&self) -> Result<LidarMap, LidarError> {
        LidarMap::read(valetudo_json(self).to_string().as_bytes())
    }

    /// Returns the segment of a cell of the Valetudo map.
    fn segment_at(&self, x: usize, y: usize) -> u16 {
        let frame = &self.cells.frame;
        match (x.checked_sub(MARGIN[0]), y.checked_sub(MARGIN[0])) {
            (Some(x), Some(y)) if x < frame.width && y < frame.height => self.segments[y * frame.width + x],
            _ => 0,
        }
    }
}

/// Returns Valetudo's map JSON, version 2: centimetres, y down, runs of pixels.
pub fn valetudo_json(survey: &Survey) -> Value {
    let cells = survey.valetudo_cells();
    let GridFrame { width, height, .. } = cells.frame;
    let cm = (CELL_M * 100.0) as usize;
    let layer = |kind: &str, mut meta: Value, wanted: &dyn Fn(usize, usize) -> bool| {
        let mut runs: Vec<usize> = vec![];
        let (mut xs, mut ys) = (vec![], vec![]);
        for row in 0..height {
            let y = height - 1 - row;
            let mut x = 0;
            while x < width {
                if !wanted(x, y) {
                    x += 1;
                    continue;
                }
                let from = x;
                while x < width && wanted(x, y) {
                    xs.push(x);
                    ys.push(row);
                    x += 1;
                }
                runs.extend([from, row, x - from]);
            }
        }
        if xs.is_empty() {
            return None;
        }
        let span = |values: &[usize]| {
            let (min, max) = values.iter().fold((usize::MAX, 0), |(low, high), &v| (low.min(v), high.max(v)));
            let avg = values.iter().sum::<usize>() / values.len();
            json!({"min": min, "max": max, "mid": (min + max) / 2, "avg": avg})
        };
        meta["area"] = json!(xs.len() * cm * cm);
        Some(json!({
            "__class": "MapLayer",
            "metaData": meta,
            "type": kind,
            "pixels": [],
            "compressedPixels": runs,
            "dimensions": {"x": span(&xs), "y": span(&ys), "pixelCount": xs.len()},
        }))
    };
    let free = |x, y| cells.get(x, y) == Cell::Free;
    let mut layers = vec![
        layer("floor", json!({}), &|x, y| free(x, y) && survey.segment_at(x, y) == 0),
        layer("wall", json!({}), &|x, y| cells.get(x, y) == Cell::Occupied),
    ];
    for (index, name) in survey.segment_names.iter().enumerate() {
        let meta = json!({"segmentId": (index + 1).to_string(), "active": false, "name": name});
        layers
            .push(layer("segment", meta, &|x, y| free(x, y) && survey.segment_at(x, y) == index as u16 + 1));
    }
    let layers: Vec<Value> = layers.into_iter().flatten().collect();
    let total: u64 = layers.iter().filter_map(|layer| layer["metaData"]["area"].as_u64()).sum();
    let ([x, y], north) = survey.charger_cm();
    let down = (height * cm) as i64 - y;
    let point = |kind: &str| json!({"__class": "PointMapEntity", "type": kind, "points": [x, down], "metaData": {"angle": north}});
    json!({
        "__class": "ValetudoMap",
        "metaData": {"version": 2, "vendorMapId": 1, "totalLayerArea": total},
        "size": {"x": width * cm, "y": height * cm},
        "pixelSize": cm,
        "layers": layers,
        "entities": [point("charger_location"), point("robot_position")],
    })
}

/// Returns the picture of a ROS map_server map (binary PGM), in the frame `robot`.
pub fn ros_pgm(survey: &Survey) -> Vec<u8> {
    let GridFrame { width, height, .. } = survey.cells.frame;
    let mut out = format!("P5\n{width} {height}\n255\n").into_bytes();
    for y in (0..height).rev() {
        out.extend((0..width).map(|x| match survey.cells.get(x, y) {
            Cell::Occupied => 0u8,
            Cell::Free => 254,
            Cell::Unknown => 205,
        }));
    }
    out
}

/// Returns the YAML description of [`ros_pgm`].
pub fn ros_yaml(survey: &Survey, image: &str) -> String {
    let [x, y] = survey.cells.frame.origin_m;
    format!(
        "image: {image}\nmode: trinary\nresolution: {CELL_M}\norigin: [{x:.3}, {y:.3}, 0]\nnegate: 0\n\
         occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
}

/// Returns the wall points as CSV, in the frame `robot`, in metres.
pub fn points_csv(survey: &Survey) -> String {
    csv(&survey.points_m)
}

/// Returns points as CSV that the map readers accept.
pub(crate) fn csv(points_m: &[Point2]) -> String {
    let mut out = String::from("x_m,y_m\n");
    for point in points_m {
        // Writing to a string cannot fail.
        let _ = writeln!(out, "{:.4},{:.4}", point.x, point.y);
    }
    out
}
