//! Writes small clips in each layout, as a folder or as a zip.

use image::{ImageFormat, Luma, Rgb};
use std::io::{Cursor, Write};
use std::path::Path;
use tempfile::{NamedTempFile, TempDir};
use viola_formats::clip::{Clip, ClipError};
use viola_formats::container::Zip;

pub const WIDTH: u32 = 32;
pub const HEIGHT: u32 = 24;
pub const FX: f64 = 28.25;
pub const FY: f64 = 28.5;
pub const CX: f64 = 15.75;
pub const CY: f64 = 11.25;

/// Names and contents.
pub type Files = Vec<(String, Vec<u8>)>;

pub fn color_jpeg(width: u32, height: u32) -> Vec<u8> {
    let image = image::ImageBuffer::from_fn(width, height, |x, y| Rgb([x as u8, y as u8, 90]));
    encode(&image.into(), ImageFormat::Jpeg)
}

pub fn depth_png(width: u32, height: u32, value: impl Fn(u32, u32) -> u16) -> Vec<u8> {
    let image = image::ImageBuffer::from_fn(width, height, |x, y| Luma([value(x, y)]));
    encode(&image.into(), ImageFormat::Png)
}

pub fn encode(image: &image::DynamicImage, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

/// Returns a pixel of a frame's depth picture, in the file's units: every frame's is different.
pub fn units(number: u32, x: u32, y: u32) -> u16 {
    match (x, y) {
        (0, 0) => 0,
        (1, 0) => 65_535,
        _ => (1000 + 7 * (number % 1000) + 3 * x + 11 * y) as u16,
    }
}

/// Returns the pose of a frame, row after row, without round numbers.
pub fn pose(number: u32) -> [[f64; 4]; 4] {
    let n = f64::from(number % 10_000);
    let rotation = nalgebra::Rotation3::from_euler_angles(0.1 + 0.01 * n, -1.9 + 0.003 * n, 0.7 - 0.02 * n);
    let r = rotation.matrix();
    let t = [0.123_456_789_012 * n, -1.0 / (n + 3.0), 1.4 + 1e-7 * n];
    let row = |i: usize| [r[(i, 0)], r[(i, 1)], r[(i, 2)], t[i]];
    [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
}

pub fn matrix_text<const N: usize>(rows: &[[f64; N]]) -> Vec<u8> {
    let line = |row: &[f64; N]| row.map(|v| format!("{v:.17e}")).join(" ") + "\n";
    rows.iter().map(line).collect::<String>().into_bytes()
}

fn intrinsics3() -> Vec<u8> {
    matrix_text(&[[FX, 0.0, CX], [0.0, FY, CY], [0.0, 0.0, 1.0]])
}

fn intrinsics4() -> Vec<u8> {
    matrix_text(&[[FX, 0.0, CX, 0.0], [0.0, FY, CY, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
}

fn depth_of(number: u32) -> Vec<u8> {
    depth_png(WIDTH, HEIGHT, |x, y| units(number, x, y))
}

pub fn scannet(root: &str, numbers: &[u32]) -> Files {
    let mut files = vec![
        (format!("{root}intrinsic/intrinsic_color.txt"), intrinsics4()),
        (format!("{root}intrinsic/intrinsic_depth.txt"), intrinsics4()),
    ];
    for number in numbers {
        files.push((format!("{root}color/{number}.jpg"), color_jpeg(WIDTH, HEIGHT)));
        files.push((format!("{root}depth/{number}.png"), depth_of(*number)));
        files.push((format!("{root}pose/{number}.txt"), matrix_text(&pose(*number))));
    }
    files
}

pub fn seven_scenes(root: &str, numbers: &[u32]) -> Files {
    let mut files = vec![(format!("{root}camera-intrinsics.txt"), intrinsics3())];
    for number in numbers {
        files.push((format!("{root}frame-{number:06}.color.jpg"), color_jpeg(WIDTH, HEIGHT)));
        files.push((format!("{root}frame-{number:06}.depth.png"), depth_of(*number)));
        files.push((format!("{root}frame-{number:06}.pose.txt"), matrix_text(&pose(*number))));
    }
    files
}

/// Returns frames 0.1 s apart, colour 4 ms after depth, with a pose at each depth picture's time.
pub fn tum(root: &str, numbers: &[u32]) -> Files {
    let mut files = vec![(format!("{root}camera-intrinsics.txt"), intrinsics3())];
    let [mut rgb, mut depth, mut poses] = [(); 3].map(|()| String::from("# a comment\n"));
    for number in numbers {
        let time_s = 1_305_031_229.5 + 0.1 * f64::from(*number);
        let color_time_s = time_s + 0.004;
        rgb += &format!("{color_time_s:.6} rgb/{number}.jpg\n");
        depth += &format!("{time_s:.6} depth/{time_s:.6}.png\n");
        let m = pose(*number);
        let rotation = nalgebra::Matrix3::from_fn(|i, j| m[i][j]);
        let q = nalgebra::UnitQuaternion::from_rotation_matrix(&nalgebra::Rotation3::from_matrix_unchecked(
            rotation,
        ));
        let row = [m[0][3], m[1][3], m[2][3], q.i, q.j, q.k, q.w].map(|v| format!("{v:.17e}")).join(" ");
        poses += &format!("{time_s:.6} {row}\n");
        files.push((format!("{root}rgb/{number}.jpg"), color_jpeg(WIDTH, HEIGHT)));
        files.push((format!("{root}depth/{time_s:.6}.png"), depth_of(*number)));
    }
    for (name, text) in [("rgb.txt", rgb), ("depth.txt", depth), ("groundtruth.txt", poses)] {
        files.push((format!("{root}{name}"), text.into_bytes()));
    }
    files
}

pub fn zip_bytes(files: &[(String, Vec<u8>)]) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in files {
        zip.start_file(name.as_str(), zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

/// Opens the files as a clip, from a zip in memory.
pub fn open(files: &[(String, Vec<u8>)]) -> Result<Clip, ClipError> {
    Clip::from_container(Box::new(Zip::from_bytes(zip_bytes(files)).unwrap()))
}

pub fn as_file(bytes: &[u8]) -> NamedTempFile {
    let mut file = NamedTempFile::new().unwrap();
    file.write_all(bytes).unwrap();
    file.flush().unwrap();
    file
}

pub fn as_zip(files: &[(String, Vec<u8>)]) -> NamedTempFile {
    as_file(&zip_bytes(files))
}

pub fn as_folder(files: &[(String, Vec<u8>)]) -> TempDir {
    let folder = TempDir::new().unwrap();
    for (name, bytes) in files {
        write(&folder.path().join(name), bytes);
    }
    folder
}

pub fn write(path: &Path, bytes: &[u8]) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(path, bytes).unwrap();
}

/// Returns the CRC-32 of PNG and zip.
pub fn crc32(bytes: &[u8]) -> u32 {
    let mut crc = flate2::Crc::new();
    crc.update(bytes);
    crc.sum()
}
