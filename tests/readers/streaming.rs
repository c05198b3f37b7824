//! A frame bounds the memory of reading, not the clip: ten times the frames cost at most a fifth more.

use crate::memory::peak_bytes;
use crate::robot_files::zlib;
use crate::writers::{as_folder, color_jpeg, depth_png, matrix_text, pose, scannet};
use flate2::Compression;
use flate2::write::GzEncoder;
use std::fs::File;
use std::io::{BufWriter, Write};
use tempfile::NamedTempFile;
use viola_align::{AlignError, AlignParams, align};
use viola_formats::clip::Clip;
use viola_formats::lidar::LidarMap;
use viola_geometry::progress::Silent;

/// Sizes and intrinsics of ScanNet's cameras. The colour has half the width and height, so that the test takes less time;
/// its size still differs from that of the depth.
const COLOR: (u32, u32) = (648, 484);
const SIZE: (u32, u32) = (640, 480);
const INTRINSICS: [[f64; 4]; 4] =
    [[577.0, 0.0, 319.5, 0.0], [0.0, 578.0, 239.5, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];

const COLOR_INTRINSICS: [[f64; 4]; 4] =
    [[584.5, 0.0, 323.5, 0.0], [0.0, 583.5, 241.5, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];

fn units(x: u32, y: u32) -> u16 {
    (1000 + x + 2 * y) as u16
}

/// Calls `put` with the files of a ScanNet export one by one; the pictures of all frames are the same.
fn put_export(frames: u32, mut put: impl FnMut(&str, &[u8])) {
    let (color, depth) = (color_jpeg(COLOR.0, COLOR.1), depth_png(SIZE.0, SIZE.1, units));
    put("intrinsic/intrinsic_color.txt", &matrix_text(&COLOR_INTRINSICS));
    put("intrinsic/intrinsic_depth.txt", &matrix_text(&INTRINSICS));
    for number in 0..frames {
        put(&format!("color/{number}.jpg"), &color);
        put(&format!("depth/{number}.png"), &depth);
        put(&format!("pose/{number}.txt"), &matrix_text(&pose(number)));
    }
}

fn zip(frames: u32, file: impl Write + std::io::Seek) {
    let mut zip = zip::ZipWriter::new(file);
    put_export(frames, |name, bytes| {
        zip.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(bytes).unwrap();
    });
    zip.finish().unwrap();
}

/// Writes a tar.gz without compression: the equal pictures would otherwise make it look like a bomb.
fn tar_gz(frames: u32, file: impl Write) {
    let mut tar = tar::Builder::new(GzEncoder::new(file, Compression::none()));
    put_export(frames, |name, bytes| {
        let mut header = tar::Header::new_gnu();
        header.set_size(bytes.len() as u64);
        header.set_mode(0o644);
        tar.append_data(&mut header, name, bytes).unwrap();
    });
    tar.into_inner().unwrap().finish().unwrap();
}

fn sens(frames: u32, mut file: impl Write) {
    let mut put = |bytes: &[u8]| file.write_all(bytes).unwrap();
    let floats = |matrix: &[[f64; 4]; 4]| -> Vec<u8> {
        matrix.as_flattened().iter().flat_map(|v| (*v as f32).to_le_bytes()).collect()
    };
    let color = color_jpeg(COLOR.0, COLOR.1);
    let raw = (0..SIZE.0 * SIZE.1).map(|i| units(i % SIZE.0, i / SIZE.0));
    let depth = zlib(&raw.flat_map(u16::to_le_bytes).collect::<Vec<u8>>());
    put(&4u32.to_le_bytes());
    put(&0u64.to_le_bytes());
    let identity: [[f64; 4]; 4] = nalgebra::Matrix4::identity().into();
    for matrix in [&COLOR_INTRINSICS, &identity, &INTRINSICS, &identity] {
        put(&floats(matrix));
    }
    for value in [2, 1, COLOR.0, COLOR.1, SIZE.0, SIZE.1] {
        put(&value.to_le_bytes());
    }
    put(&1000f32.to_le_bytes());
    put(&u64::from(frames).to_le_bytes());
    for number in 0..frames {
        put(&floats(&pose(number)));
        for value in [u64::from(number), u64::from(number) * 33_333, color.len() as u64, depth.len() as u64] {
            put(&value.to_le_bytes());
        }
        put(&color);
        put(&depth);
    }
}

/// Returns the most bytes at once while one thread reads all frames of a clip one after the other.
fn peak_of(frames: u32, write: impl Fn(u32, BufWriter<File>)) -> usize {
    let file = NamedTempFile::new().unwrap();
    write(frames, BufWriter::new(file.reopen().unwrap()));
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let (read, peak) = alone.install(|| {
        peak_bytes(|| {
            let clip = Clip::open(file.path()).unwrap();
            let mut stream = clip.stream((0..clip.frames().len()).collect());
            let mut read = 0;
            while let Some(frame) = stream.next_batch(1).pop() {
                let frame = frame.unwrap();
                assert_eq!(frame.depth.at(3, 5), f32::from(units(3, 5)) / 1000.0);
                read += 1;
            }
            read
        })
    });
    assert_eq!(read, frames);
    peak
}

fn check(write: impl Fn(u32, BufWriter<File>)) {
    let (short, long) = (peak_of(100, &write), peak_of(1000, &write));
    println!("100 frames: {short} bytes, 1000 frames: {long} bytes");
    assert!(long <= short + short / 5, "{short} bytes for 100 frames, {long} bytes for 1000");
}

#[test]
fn a_long_zip_takes_no_more_memory_than_a_short_one() {
    check(zip);
}

#[test]
fn a_long_tar_gz_takes_no_more_memory_than_a_short_one() {
    check(tar_gz);
}

#[test]
fn a_long_sens_takes_no_more_memory_than_a_short_one() {
    check(sens);
}

/// As when a disk is unavailable: the clip is not reported as damaged, and no answer omits its frames.
#[test]
fn a_clip_that_cannot_be_read_for_now_is_a_fault_of_the_machine() {
    let folder = as_folder(&scannet("", &[0, 1, 2, 3]));
    let clip = Clip::open(folder.path()).unwrap();
    drop(folder);
    for frame in clip.stream(vec![0, 1]).next_batch(2) {
        let error = frame.expect_err("its file is away");
        assert!(error.is_service_fault(), "{error}");
    }
    let lidar = LidarMap::read(b"x,y\n0,0\n0,1\n1,1\n").unwrap();
    match align(&clip, None, &lidar, &AlignParams::default(), &Silent) {
        Err(AlignError::Clip(error)) => assert!(error.is_service_fault(), "{error}"),
        other => panic!("{:?}", other.map(|aligned| aligned.alignment)),
    }
}
