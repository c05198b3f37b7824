//! Clips that no phone records: many frames, large pictures.

use super::{png, try_align};
use image::{ImageBuffer, Luma, Rgb};
use viola_testing::room;
use viola_testing::zips::Files;

/// Frames of the long clips: a fifth of the most that are read, so that the archive is written soon.
const MANY: u32 = 20_000;

fn intrinsics(width: u32, height: u32) -> Vec<u8> {
    let (width, height) = (f64::from(width), f64::from(height));
    let focal = 0.8 * width;
    format!("{focal} 0 {} 0\n0 {focal} {} 0\n0 0 1 0\n0 0 0 1\n", width / 2.0, height / 2.0).into_bytes()
}

/// Returns the pose of a level camera that turns by 10 degrees from frame to frame.
fn pose(number: u32) -> Vec<u8> {
    let (sin, cos) = f64::from(10 * number).to_radians().sin_cos();
    format!("{sin} 0 {cos} 0\n{} 0 {sin} 0\n0 -1 0 1.4\n0 0 0 1\n", -cos).into_bytes()
}

/// Returns a flat depth picture at 2 m.
fn depth_png(side: u32) -> Vec<u8> {
    png(ImageBuffer::from_pixel(side, side, Luma([2000u16])))
}

/// Returns a colour picture, if possible with texture at every scale.
fn color_png(side: u32) -> Vec<u8> {
    if side > 4096 {
        // A plain one, since its file has to be small.
        return png(ImageBuffer::from_pixel(side, side, Luma([100u8])));
    }
    let pixel = |x: u32, y: u32| Rgb([(x ^ y) as u8, (x * 7 + y / 8) as u8, (y / 16) as u8]);
    png(ImageBuffer::from_fn(side, side, pixel))
}

/// Returns a clip whose frames have the same pictures; without colour if its side is 0.
fn clip(frames: u32, color_side: u32, depth_side: u32, has_poses: bool) -> Files {
    let mut files = vec![("intrinsic/intrinsic_depth.txt".to_owned(), intrinsics(depth_side, depth_side))];
    let depth = depth_png(depth_side);
    let color = (color_side > 0).then(|| color_png(color_side));
    if color.is_some() {
        files.push(("intrinsic/intrinsic_color.txt".to_owned(), intrinsics(color_side, color_side)));
    }
    for number in 0..frames {
        files.push((format!("depth/{number}.png"), depth.clone()));
        files.extend(color.iter().map(|color| (format!("color/{number}.png"), color.clone())));
        if has_poses {
            files.push((format!("pose/{number}.txt"), pose(number)));
        }
    }
    files
}

#[test]
fn a_clip_of_very_many_frames_is_aligned_within_the_limits() {
    let answer = try_align(&clip(MANY, 0, 32, true), room::lidar_csv().as_bytes()).unwrap();
    assert_ne!(answer["state"], "aligned", "{answer:#}");
    assert!((1000..=2000).contains(&answer["key_frames"].as_u64().unwrap()), "{answer:#}");
}

/// The largest pictures that are read: 16 million pixels of colour, 4 million of depth.
#[test]
fn the_largest_pictures_are_decoded_within_the_limits() {
    let answer = try_align(&clip(24, 4096, 2048, true), room::lidar_csv().as_bytes()).unwrap();
    assert_eq!(answer["key_frames"], 24, "{answer:#}");
}

#[test]
fn pictures_of_16k_by_16k_are_refused() {
    let map = room::lidar_csv();
    let refusal = try_align(&clip(2, 16_384, 64, true), map.as_bytes()).unwrap_err();
    assert!(refusal.contains("16384x16384"), "{refusal}");
    let refusal = try_align(&clip(2, 0, 4096, true), map.as_bytes()).unwrap_err();
    assert!(refusal.contains("4194304"), "{refusal}");
}
