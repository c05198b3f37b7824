//! A furnished room recorded by a turning camera, in ScanNet's layout, and its LiDAR map: small enough for a
//! test, real enough to be aligned.

use crate::zips::Files;
use image::{ImageFormat, Luma, Rgb};
use std::f64::consts::TAU;
use std::io::Cursor;

/// Lower and upper corners in metres, z up. The first is the room, the others stand in it.
const BOXES: [[[f64; 3]; 2]; 4] = [
    [[0.0, 0.0, 0.0], [5.0, 4.0, 2.5]],
    [[0.0, 3.3, 0.0], [1.4, 4.0, 2.0]],
    [[4.2, 0.0, 0.0], [5.0, 1.0, 1.8]],
    [[3.1, 3.2, 0.0], [3.5, 4.0, 2.5]],
];
const WIDTH: u32 = 160;
const HEIGHT: u32 = 120;
const FOCAL_PX: f64 = 110.0;
pub const CAMERA_HEIGHT_M: f64 = 1.3;
/// Length, width and height of the room.
pub const SIZE_M: [f64; 3] = BOXES[0][1];
/// The circle on which the camera goes round, in the room.
pub const CIRCLE_M: [f64; 2] = [2.5, 2.0];
pub const RADIUS_M: f64 = 0.4;
/// Downwards, so that the floor is seen.
const PITCH_RAD: f64 = 0.45;
/// Position of the room's corner in the map, and its rotation.
pub const MAP_FROM_ROOM: (f64, f64, f64) = (2.0, -1.5, 0.6);

/// Position and direction of the first camera in the room.
pub const FIRST_CAMERA: (f64, f64, f64) = (2.9, 2.0, 0.0);

/// Returns a clip with one turn in `frames` frames.
pub fn clip(frames: u32) -> Files {
    let mut files = vec![
        ("intrinsic/intrinsic_color.txt".to_owned(), intrinsics()),
        ("intrinsic/intrinsic_depth.txt".to_owned(), intrinsics()),
    ];
    for number in 0..frames {
        let yaw = TAU * f64::from(number) / f64::from(frames);
        // On a circle around the middle, looking outwards.
        let [x_m, y_m] = CIRCLE_M;
        let position = [x_m + RADIUS_M * yaw.cos(), y_m + RADIUS_M * yaw.sin(), CAMERA_HEIGHT_M];
        let axes = camera_axes(yaw);
        let (color, depth) = render(position, axes);
        files.push((format!("color/{number}.jpg"), color));
        files.push((format!("depth/{number}.png"), depth));
        files.push((format!("pose/{number}.txt"), pose(position, axes)));
    }
    files
}

/// Returns [`lidar_csv`] in another frame, with each point at `moved` of its place.
pub fn lidar_csv_moved(moved: impl Fn(f64, f64) -> [f64; 2]) -> String {
    let csv = lidar_csv();
    let points = csv.lines().skip(1).filter_map(|line| line.split_once(','));
    let lines = points.filter_map(|(x, y)| {
        let [x, y] = moved(x.parse().ok()?, y.parse().ok()?);
        Some(format!("{x:.4},{y:.4}\n"))
    });
    std::iter::once("x,y\n".to_owned()).chain(lines).collect()
}

/// Returns points along the outlines at the vacuum's height, every 2 cm.
pub fn lidar_csv() -> String {
    let (x0, y0, yaw) = MAP_FROM_ROOM;
    let mut text = String::from("x,y\n");
    for [low, high] in BOXES {
        let corners = [[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]];
        for (a, b) in corners.iter().zip(corners.iter().cycle().skip(1)) {
            let length = (b[0] - a[0]).hypot(b[1] - a[1]);
            let steps = (length / 0.02) as usize;
            for step in 0..steps {
                let t = step as f64 / steps as f64;
                let (x, y) = (a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]));
                let hidden = BOXES[1..]
                    .iter()
                    .any(|[low, high]| inside(x, low[0], high[0]) && inside(y, low[1], high[1]));
                if !hidden {
                    let (u, v) = (x0 + yaw.cos() * x - yaw.sin() * y, y0 + yaw.sin() * x + yaw.cos() * y);
                    text += &format!("{u:.4},{v:.4}\n");
                }
            }
        }
    }
    text
}

/// Returns the room as Valetudo's JSON on a sheet of 10 m x 10 m, moved by (1 m, 2.5 m): its floor is the segment 16,
/// and cells of 5 cm within 4 cm of an outline are walls.
pub fn lidar_valetudo() -> String {
    const SIDE: i64 = 200;
    let (x0, y0, yaw) = MAP_FROM_ROOM;
    let (mut floor, mut walls) = (Vec::new(), Vec::new());
    for row in 0..SIDE {
        for column in 0..SIDE {
            // Rows count from the top.
            let (u, v) =
                (column as f64 * 0.05 + 0.025 - 1.0 - x0, 10.0 - row as f64 * 0.05 - 0.025 - 2.5 - y0);
            let (x, y) = (yaw.cos() * u + yaw.sin() * v, yaw.cos() * v - yaw.sin() * u);
            let is_in = |[low, high]: &[[f64; 3]; 2], by: f64| {
                inside(x, low[0] - by, high[0] + by) && inside(y, low[1] - by, high[1] + by)
            };
            let is_near_wall = is_in(&BOXES[0], 0.04) && !is_in(&BOXES[0], -0.04);
            let is_near_furniture = BOXES[1..].iter().any(|one| is_in(one, 0.04) && !is_in(one, -0.04));
            if is_in(&BOXES[0], 0.04) && (is_near_wall || is_near_furniture) {
                walls.extend([column, row, 1]);
            } else if is_in(&BOXES[0], 0.0) && !BOXES[1..].iter().any(|one| is_in(one, 0.0)) {
                floor.extend([column, row, 1]);
            }
        }
    }
    format!(
        r#"{{"__class":"ValetudoMap","metaData":{{"version":2}},"size":{{"x":1000,"y":1000}},"pixelSize":5,"layers":[
        {{"type":"segment","metaData":{{"segmentId":"16","name":"Room 1"}},"compressedPixels":{floor:?}}},
        {{"type":"wall","metaData":{{}},"compressedPixels":{walls:?}}}],"entities":[]}}"#
    )
}

fn inside(value: f64, low: f64, high: f64) -> bool {
    value > low + 1e-9 && value < high - 1e-9
}

fn intrinsics() -> Vec<u8> {
    let (cx, cy) = (f64::from(WIDTH - 1) / 2.0, f64::from(HEIGHT - 1) / 2.0);
    format!("{FOCAL_PX} 0 {cx} 0\n0 {FOCAL_PX} {cy} 0\n0 0 1 0\n0 0 0 1\n").into_bytes()
}

/// Returns the camera's right, down and forward in the room.
fn camera_axes(yaw: f64) -> [[f64; 3]; 3] {
    let (s, c) = yaw.sin_cos();
    let (down, level) = PITCH_RAD.sin_cos();
    [[s, -c, 0.0], [-down * c, -down * s, -level], [level * c, level * s, -down]]
}

fn pose(position: [f64; 3], axes: [[f64; 3]; 3]) -> Vec<u8> {
    let row = |i: usize| format!("{} {} {} {}\n", axes[0][i], axes[1][i], axes[2][i], position[i]);
    format!("{}{}{}0 0 0 1\n", row(0), row(1), row(2)).into_bytes()
}

fn render(position: [f64; 3], axes: [[f64; 3]; 3]) -> (Vec<u8>, Vec<u8>) {
    let mut color = image::RgbImage::new(WIDTH, HEIGHT);
    let mut depth = image::ImageBuffer::<Luma<u16>, Vec<u16>>::new(WIDTH, HEIGHT);
    for (x, y, pixel) in color.enumerate_pixels_mut() {
        let u = (f64::from(x) - f64::from(WIDTH - 1) / 2.0) / FOCAL_PX;
        let v = (f64::from(y) - f64::from(HEIGHT - 1) / 2.0) / FOCAL_PX;
        // Forward has length 1 along z, so the ray's parameter is the depth.
        let ray: [f64; 3] = std::array::from_fn(|i| u * axes[0][i] + v * axes[1][i] + axes[2][i]);
        let (which, depth_m) = hit(position, ray);
        depth.put_pixel(x, y, Luma([(depth_m * 1000.0).round() as u16]));
        *pixel = Rgb([60 + 45 * which as u8, (depth_m * 40.0) as u8, 140]);
    }
    (encode(&color.into(), ImageFormat::Jpeg), encode(&depth.into(), ImageFormat::Png))
}

/// Returns the nearest surface along a ray: the room from inside, its furniture from outside.
fn hit(from: [f64; 3], ray: [f64; 3]) -> (usize, f64) {
    let mut nearest = (0, f64::INFINITY);
    for (which, [low, high]) in BOXES.iter().enumerate() {
        let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
        for i in 0..3 {
            let (a, b) = ((low[i] - from[i]) / ray[i], (high[i] - from[i]) / ray[i]);
            enter = enter.max(a.min(b));
            leave = leave.min(a.max(b));
        }
        let at = if which == 0 { leave } else { enter };
        if enter <= leave && at > 0.0 && at < nearest.1 {
            nearest = (which, at);
        }
    }
    nearest
}

fn encode(image: &image::DynamicImage, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}
