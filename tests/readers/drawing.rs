//! A drawing of a small home, written in each map format.

use crate::writers::{encode, zip_bytes};
use image::{GrayImage, ImageFormat, Luma};
use serde_json::{Value, json};
use viola_formats::lidar::Cell;
use viola_geometry::Point2;

/// A home from above, the top row first: `#` wall, `.` floor, `a` and `b` floor of two rooms. No symmetry.
pub const HOME: [&str; 6] = [
    "  ##### ", //
    "  #aa.# ", //
    "###aa.##", //
    "#....bb#", //
    "#.##.bb#", //
    "#### ###", //
];
pub const CELL_M: f64 = 0.05;

pub fn cell(symbol: char) -> Cell {
    match symbol {
        '#' => Cell::Occupied,
        ' ' => Cell::Unknown,
        _ => Cell::Free,
    }
}

/// Returns every cell of the drawing with its column from the left and its row from the top.
pub fn cells() -> impl Iterator<Item = (usize, usize, char)> {
    HOME.iter().enumerate().flat_map(|(y, row)| row.chars().enumerate().map(move |(x, c)| (x, y, c)))
}

/// Returns the drawing on a sheet of 100 x 80 pixels, its top-left corner at pixel (40, 30).
pub fn valetudo(runs_of_walls: bool, runs_of_floors: bool) -> Value {
    let layer = |kind: &str, symbols: &str, runs: bool, meta: Value| {
        let (mut pixels, mut compressed): (Vec<usize>, Vec<usize>) = Default::default();
        for (x, y, _) in cells().filter(|(_, _, symbol)| symbols.contains(*symbol)) {
            let (x, y) = (x + 40, y + 30);
            match compressed.as_mut_slice() {
                _ if !runs => pixels.extend([x, y]),
                [.., last_x, last_y, count] if *last_y == y && *last_x + *count == x => *count += 1,
                _ => compressed.extend([x, y, 1]),
            }
        }
        json!({"__class": "MapLayer", "type": kind, "metaData": meta, "pixels": pixels, "compressedPixels": compressed,
               "dimensions": {"pixelCount": 3}})
    };
    json!({
        "__class": "ValetudoMap",
        "metaData": {"version": if runs_of_walls { 2 } else { 1 }},
        "size": {"x": 500, "y": 400},
        "pixelSize": 5,
        "layers": [
            layer("wall", "#", runs_of_walls, json!({})),
            layer("floor", ".ab", runs_of_floors, json!({"area": 1})),
            layer("segment", "a", true, json!({"segmentId": "16", "name": "Kitchen"})),
            layer("segment", "b", runs_of_walls, json!({"segmentId": 17})),
        ],
        "entities": [
            {"__class": "PathMapEntity", "type": "path", "points": [1, 2, 3, 4], "metaData": {}},
            {"__class": "PointMapEntity", "type": "charger_location", "points": [230, 170], "metaData": {"angle": 90}},
        ],
    })
}

pub fn text(value: &Value) -> Vec<u8> {
    serde_json::to_vec(value).unwrap()
}

pub fn yaml(extra: &str) -> Vec<u8> {
    format!("image: map.pgm\nresolution: 0.05\norigin: [-1.0, 2.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n{extra}")
        .into_bytes()
}

/// Returns the drawing as an image with these values for wall, floor and unknown.
pub fn grey(wall: u8, floor: u8, unknown: u8) -> GrayImage {
    let mut image = GrayImage::new(8, 6);
    for (x, y, symbol) in cells() {
        let value = match cell(symbol) {
            Cell::Occupied => wall,
            Cell::Free => floor,
            Cell::Unknown => unknown,
        };
        image.put_pixel(x as u32, y as u32, Luma([value]));
    }
    image
}

pub fn pgm(image: GrayImage) -> Vec<u8> {
    let header = format!("P5\n# drawn\n{} {}\n255\n", image.width(), image.height());
    [header.as_bytes(), image.as_raw()].concat()
}

pub fn ros_zip(yaml: &[u8], image: &[u8]) -> Vec<u8> {
    zip_bytes(&[("home/map.yaml".into(), yaml.to_vec()), ("home/map.pgm".into(), image.to_vec())])
}

/// Returns the centres of the drawing's walls.
pub fn hits() -> Vec<Point2> {
    let walls = cells().filter(|(_, _, symbol)| *symbol == '#');
    walls.map(|(x, y, _)| Point2::new(x as f64 * 0.25 - 1.0, 7.5 - y as f64 * 0.25)).collect()
}

/// Returns the walls as PLY with a colour between the coordinates, a height, and a face at the end.
pub fn ply(format: &str) -> Vec<u8> {
    let hits = hits();
    let mut bytes = format!(
        "ply\nformat {format} 1.0\ncomment drawn\nelement vertex {}\nproperty float x\nproperty uchar red\n\
         property double y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n",
        hits.len()
    )
    .into_bytes();
    for (index, p) in hits.iter().enumerate() {
        let (x, red, y, z) = (p.x as f32, 200u8, p.y, index as f32 / 100.0);
        match format {
            "ascii" => bytes.extend(format!("{x} {red} {y} {z}\n").bytes()),
            "binary_little_endian" => {
                bytes.extend(x.to_le_bytes());
                bytes.push(red);
                bytes.extend(y.to_le_bytes());
                bytes.extend(z.to_le_bytes());
            }
            _ => {
                bytes.extend(x.to_be_bytes());
                bytes.push(red);
                bytes.extend(y.to_be_bytes());
                bytes.extend(z.to_be_bytes());
            }
        }
    }
    bytes.extend(b"3 0 1 2\n");
    bytes
}

/// Returns a small valid file of each format.
pub fn one_of_each_format() -> Vec<(&'static str, Vec<u8>)> {
    let csv: Vec<String> = hits().iter().map(|p| format!("{},{}", p.x, p.y)).collect();
    let mut files = vec![
        ("valetudo 2", text(&valetudo(true, true))),
        ("valetudo 1", text(&valetudo(false, false))),
        ("ros pgm", ros_zip(&yaml(""), &pgm(grey(0, 254, 205)))),
        ("ros png", ros_zip(&yaml("mode: scale"), &encode(&grey(0, 254, 205).into(), ImageFormat::Png))),
        ("csv", format!("x,y\n{}", csv.join("\n")).into_bytes()),
        ("ply ascii", ply("ascii")),
        ("ply binary", ply("binary_little_endian")),
    ];
    files.extend(crate::robot_files::robot_files());
    files
}
