//! ScanNet's `.sens`, damaged in each of its fields (ScanNet/ScanNet, SensReader/c++/src/sensorData.h).

use crate::edits::content;
use crate::export_writers as writers;
use crate::memory::peak_bytes;
use crate::recording::Recording;
use crate::refusals::check_error;
use crate::robot_files::zlib;
use crate::writers::{as_file, as_zip};
use std::time::{Duration, Instant};
use viola_formats::clip::Clip;

/// Offsets of the fields after the version and a sensor's name of 15 bytes.
const NAME_BYTES: usize = 4;
const COLOR_INTRINSICS: usize = 27;
const DEPTH_INTRINSICS: usize = COLOR_INTRINSICS + 128;
const COLOR_CODING: usize = COLOR_INTRINSICS + 256;
const DEPTH_CODING: usize = COLOR_CODING + 4;
const SIZES: usize = DEPTH_CODING + 4;
const DEPTH_SHIFT: usize = SIZES + 16;
const FRAMES: usize = DEPTH_SHIFT + 4;
const FIRST_FRAME: usize = FRAMES + 8;

fn u64_at(bytes: &[u8], at: usize) -> usize {
    u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) as usize
}

/// Returns the offset of a frame: its pose, two times, two lengths, two pictures.
pub fn frame_at(bytes: &[u8], number: usize) -> usize {
    let next = |at: usize, _: usize| at + 96 + u64_at(bytes, at + 80) + u64_at(bytes, at + 88);
    (0..number).fold(FIRST_FRAME, next)
}

fn sens() -> Vec<u8> {
    std::mem::take(content(&mut writers::sens("", &Recording::small(3)), "scene.sens"))
}

fn with(at: usize, field: &[u8]) -> Vec<u8> {
    let mut bytes = sens();
    bytes[at..at + field.len()].copy_from_slice(field);
    bytes
}

/// Returns the file with other bytes for the depth of the last frame.
fn with_depth(depth: &[u8]) -> Vec<u8> {
    let mut bytes = sens();
    let at = frame_at(&bytes, 2);
    let depth_at = at + 96 + u64_at(&bytes, at + 80);
    let end = depth_at + u64_at(&bytes, at + 88);
    bytes[at + 88..at + 96].copy_from_slice(&(depth.len() as u64).to_le_bytes());
    bytes.splice(depth_at..end, depth.iter().copied());
    bytes
}

/// Checks that a file is refused in little time and memory, as an entry of a zip.
fn check(bytes: Vec<u8>, code: &str, naming: &str) {
    let file = as_zip(&[("scene.sens".to_string(), bytes)]);
    let start = Instant::now();
    let (opened, peak) = peak_bytes(|| Clip::open(file.path()));
    check_error(opened.err().unwrap_or_else(|| panic!("{code}, {naming}: not refused")), code, naming);
    assert!(peak < 4 << 20 && start.elapsed() < Duration::from_secs(5), "{code}: {peak} bytes");
}

/// Checks that only the last frame is refused.
fn check_frame(bytes: Vec<u8>, code: &str, naming: &str) {
    let file = as_file(&bytes);
    let clip = Clip::open(file.path()).unwrap_or_else(|error| panic!("{code}, {naming}: {error}"));
    assert!(clip.load(0).is_ok() && clip.load(1).is_ok(), "{code}");
    let start = Instant::now();
    check_error(clip.load(2).err().unwrap_or_else(|| panic!("{code}, {naming}: not refused")), code, naming);
    assert!(start.elapsed() < Duration::from_secs(5));
}

#[test]
fn headers_are_refused_by_name() {
    check(with(0, &2u32.to_le_bytes()), "bad_metadata", "version 2");
    check(with(0, &5u32.to_le_bytes()), "bad_metadata", "version 5");
    check(with(NAME_BYTES, &u64::MAX.to_le_bytes()), "bad_metadata", "sensor's name");
    check(with(NAME_BYTES, &5000u64.to_le_bytes()), "bad_metadata", "sensor's name");
    check(with(COLOR_CODING, &(-1i32).to_le_bytes()), "bad_metadata", "colour compression -1");
    check(with(COLOR_CODING, &3i32.to_le_bytes()), "bad_metadata", "colour compression 3");
    // Occipital's own.
    check(with(DEPTH_CODING, &2i32.to_le_bytes()), "bad_metadata", "depth compression 2");
    check(with(DEPTH_CODING, &(-1i32).to_le_bytes()), "bad_metadata", "depth compression -1");
    check(with(SIZES, &0u32.to_le_bytes()), "bad_metadata", "colour cannot be 0x48");
    check(with(SIZES + 8, &1_000_000_000u32.to_le_bytes()), "bad_metadata", "depth cannot be 1000000000x24");
    let huge = [8192u32.to_le_bytes(), 8192u32.to_le_bytes()].concat();
    check(with(SIZES, &huge), "bad_metadata", "colour cannot be 8192x8192");
    check(with(SIZES + 8, &huge), "bad_metadata", "depth cannot be 8192x8192");
    for shift in [0.0f32, -1000.0, f32::NAN, f32::INFINITY, 1e-3] {
        check(with(DEPTH_SHIFT, &shift.to_le_bytes()), "bad_metadata", "depthShift");
    }
    check(with(FRAMES, &u64::MAX.to_le_bytes()), "too_many_frames", "100000");
    check(with(FRAMES, &100_000u64.to_le_bytes()), "bad_metadata", "scene.sens");
    check(with(FRAMES, &0u64.to_le_bytes()), "no_frames", "0 colour");
    check(with(COLOR_INTRINSICS, &f32::NAN.to_le_bytes()), "bad_intrinsics", "focal");
    check(with(DEPTH_INTRINSICS, &0f32.to_le_bytes()), "bad_intrinsics", "focal");
    check(with(COLOR_INTRINSICS + 8, &960f32.to_le_bytes()), "bad_intrinsics", "another size");
}

#[test]
fn files_cut_anywhere_are_refused() {
    let whole = sens();
    let second = frame_at(&whole, 1);
    let end = frame_at(&whole, 3);
    let mut cuts: Vec<usize> =
        vec![4, 8, 12, 20, 27, 100, COLOR_CODING, SIZES + 2, DEPTH_SHIFT, FRAMES, FRAMES + 7];
    cuts.extend([FIRST_FRAME, FIRST_FRAME + 10, second, second + 70, second + 90, second + 95, second + 96]);
    cuts.extend([second + 100, end - 1]);
    for cut in cuts {
        check(whole[..cut].to_vec(), "bad_metadata", "send the whole file");
    }
    check(whole[..3].to_vec(), "bad_metadata", "ends too early");
    // The inertial samples behind the frames are not read.
    assert!(Clip::open(as_file(&whole[..end]).path()).is_ok());
}

#[test]
fn lengths_beyond_the_file_are_refused() {
    let whole = sens();
    let second = frame_at(&whole, 1);
    for at in [second + 80, second + 88] {
        for length in [u64::MAX, u64::MAX - 400, 1 << 33, whole.len() as u64] {
            check(with(at, &length.to_le_bytes()), "bad_metadata", "inside of frame 1");
        }
    }
    let frames = with(second + 80, &0u64.to_le_bytes());
    let clip = Clip::open(as_file(&frames).path());
    assert!(clip.is_err() || clip.is_ok_and(|clip| clip.load(1).is_err()));
}

#[test]
fn frames_with_bad_pictures_are_refused_by_name() {
    let readings = vec![7u8; 32 * 24 * 2];
    check_frame(with_depth(b""), "bad_depth", "frame 2");
    check_frame(with_depth(b"no zlib at all"), "bad_depth", "zlib");
    let packed = zlib(&readings);
    check_frame(with_depth(&packed[..packed.len() / 2]), "bad_depth", "zlib");
    check_frame(with_depth(&zlib(&readings[2..])), "bad_depth", "1534 bytes");
    // Unpacking of a bomb stops one byte after the picture's size.
    check_frame(with_depth(&zlib(&vec![0; 256 << 20])), "bad_depth", "1537 bytes");
    // The colour's JPEG in place of the depth.
    let jpeg = Recording::small(1).frames[0].jpeg.clone();
    check_frame(with_depth(&jpeg), "bad_depth", "zlib");
    let mut bytes = sens();
    let colour = frame_at(&bytes, 2) + 96;
    bytes[colour..colour + 2].fill(0);
    check_frame(bytes, "bad_picture", "the colour of frame 2");
}

/// Returns the file with another coding of all pictures.
fn recoded(color: (i32, &[u8]), depth: (i32, &[u8])) -> Vec<u8> {
    let whole = sens();
    let mut bytes = whole[..FIRST_FRAME].to_vec();
    bytes[COLOR_CODING..COLOR_CODING + 4].copy_from_slice(&color.0.to_le_bytes());
    bytes[DEPTH_CODING..DEPTH_CODING + 4].copy_from_slice(&depth.0.to_le_bytes());
    for number in 0..3 {
        let at = frame_at(&whole, number);
        bytes.extend(&whole[at..at + 80]);
        bytes.extend((color.1.len() as u64).to_le_bytes());
        bytes.extend((depth.1.len() as u64).to_le_bytes());
        bytes.extend(color.1);
        bytes.extend(depth.1);
    }
    bytes
}

#[test]
fn raw_pictures_have_the_size_of_the_header() {
    let color: Vec<u8> = (0..64 * 48 * 3).map(|i| i as u8).collect();
    let depth: Vec<u8> = (0..32 * 24u16).flat_map(|i| (1000 + i).to_le_bytes()).collect();
    let open = |bytes: Vec<u8>| Clip::open(as_file(&bytes).path()).unwrap();
    let frame = open(recoded((0, &color), (0, &depth))).load(2).unwrap();
    assert_eq!(frame.color.unwrap().as_raw(), &color);
    assert_eq!(frame.depth.at(5, 3), (1000.0 + 5.0 + 3.0 * 32.0) / 1000.0);
    for (color, depth, code, naming) in [
        (&color[1..], &depth[..], "bad_picture", "9215 bytes"),
        (&[color.as_slice(), b"x"].concat(), &depth, "bad_picture", "9217 bytes"),
        (&color, &depth[2..], "bad_depth", "1534 bytes"),
        (&[], &depth, "bad_picture", "0 bytes"),
    ] {
        check_error(open(recoded((0, color), (0, depth))).load(2).err().unwrap(), code, naming);
    }
    let png = crate::writers::encode(&image::DynamicImage::new_rgb8(64, 48), image::ImageFormat::Png);
    assert!(open(recoded((1, &png), (0, &depth))).load(2).is_ok());
}
