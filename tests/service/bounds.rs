//! Memory and time of an alignment are bounded for any map and clip: the real binary under hard limits.

mod clips;
mod maps;

use image::{DynamicImage, ImageBuffer, ImageFormat, Luma};
use serde_json::Value;
use std::io::{Cursor, Read};
use std::process::Command;
use std::sync::LazyLock;
use viola_geometry::Pose2;
use viola_lab::simulate::{ClipParams, Home, HomeParams, Sensor, Set, points_csv, write_scannet_zip};
use viola_testing::process::viola;
use viola_testing::room;
use viola_testing::zips::{self, Files};

/// Address space: 1 GiB of memory, and the unused mappings of a debug build and its threads.
const MAX_KIB: u64 = 1280 << 10;
/// Limit of processor time: 60 s on two cores, of a build without optimisation.
const MAX_SECONDS: u64 = 120;

/// Returns the answer of `viola align`.
fn align(clip: &Files, map: &str) -> Value {
    try_align(clip, map.as_bytes()).unwrap()
}

/// Returns the answer of `viola align`, or its refusal.
fn try_align(clip: &Files, map: &[u8]) -> Result<Value, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("clip.zip"), zips::zip(clip)).unwrap();
    std::fs::write(path("map"), map).unwrap();
    let mut limited = Command::new("sh");
    let limits = format!("ulimit -v {MAX_KIB} && ulimit -t {MAX_SECONDS} && exec \"$0\" \"$@\"");
    limited.args(["-c", &limits]).arg(viola().get_program()).args(["align", "--clip"]).arg(path("clip.zip"));
    limited.arg("--lidar").arg(path("map")).arg("--out").arg(path("out"));
    // Each thread reserves address space of its own.
    limited.env("RAYON_NUM_THREADS", "2").env("MALLOC_ARENA_MAX", "2");
    let output = limited.output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    if output.status.code() == Some(1) {
        return Err(said);
    }
    // 3: there is no pose.
    assert!(matches!(output.status.code(), Some(0 | 3)), "{}: {said}", output.status);
    Ok(serde_json::from_slice(&std::fs::read(path("out/result.json")).unwrap()).unwrap())
}

fn png(picture: impl Into<DynamicImage>) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    picture.into().write_to(&mut bytes, ImageFormat::Png).unwrap();
    bytes.into_inner()
}

fn codes(answer: &Value) -> Vec<&str> {
    answer["reasons"].as_array().unwrap().iter().filter_map(|reason| reason["code"].as_str()).collect()
}

/// A clip of 20 frames of a simulated home, its map, and the true pose.
struct Recorded {
    files: Files,
    map: String,
    truth: Pose2,
}

/// All tests align this one.
static RECORDED: LazyLock<Recorded> = LazyLock::new(|| {
    let home = Home::generate(&HomeParams::new(Set::Normal, 4));
    let survey = home.survey();
    let color_width = Sensor::PhoneLidar.depth_camera().width;
    let clip = home.clip(&survey, 0, &ClipParams { frames: 20, color_width, ..ClipParams::default() });
    let mut bytes = Vec::new();
    write_scannet_zip(&clip, Cursor::new(&mut bytes)).unwrap();
    let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).unwrap();
    let files = (0..archive.len()).map(|index| {
        let mut file = archive.by_index(index).unwrap();
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).unwrap();
        (file.name().unwrap().into_owned(), bytes)
    });
    Recorded { files: files.collect(), map: points_csv(&survey), truth: clip.truth.robot_from_clip }
});

/// Returns the files with the cameras of some frames moved along x and y.
fn moved(files: &Files, by_m: impl Fn(u32) -> f64) -> Files {
    let mut files = files.clone();
    for (name, bytes) in &mut files {
        let number = name.strip_prefix("pose/").and_then(|name| name.strip_suffix(".txt"));
        let Some(number) = number.and_then(|number| number.parse().ok()) else { continue };
        let text = std::str::from_utf8(bytes).unwrap();
        let rows = text.lines().enumerate().map(|(row, line)| {
            let mut numbers: Vec<f64> = line.split_whitespace().map(|word| word.parse().unwrap()).collect();
            numbers[3] += if row < 2 { by_m(number) } else { 0.0 };
            numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(" ") + "\n"
        });
        *bytes = rows.collect::<String>().into_bytes();
    }
    files
}

fn check_aligned(answer: &Value, truth: &Pose2) {
    assert_eq!(answer["state"], "aligned", "{answer:#}");
    let pose: Pose2 = serde_json::from_value(answer["map_from_clip"].clone()).unwrap();
    assert!(pose.distance_m(truth) < 0.3, "{pose:?} is not {truth:?}");
}

#[test]
fn a_stray_point_of_the_map_costs_nothing() {
    let Recorded { files, map, truth } = &*RECORDED;
    for stray in ["150,150", "-200,3"] {
        check_aligned(&align(files, &format!("{map}{stray}\n")), truth);
    }
}

/// Two homes in one map: the second repeats every other point of the first, 150 m away along x and y.
#[test]
fn a_map_of_two_homes_far_apart_is_searched() {
    let Recorded { files, map, truth } = &*RECORDED;
    let second = map.lines().skip(1).step_by(2).filter_map(|line| line.split_once(','));
    let second = second.map(|(x, y)| {
        let [x, y]: [f64; 2] = [x, y].map(|number| number.parse().unwrap());
        format!("{},{}\n", x + 150.0, y + 150.0)
    });
    let answer = align(files, &format!("{map}{}", second.collect::<String>()));
    let there = |pose: &Value| serde_json::from_value::<Pose2>(pose.clone()).unwrap().distance_m(truth) < 0.3;
    let alternatives = answer["alternatives"].as_array().unwrap();
    assert!(alternatives.iter().any(|pose| there(&pose["map_from_clip"])), "{answer:#}");
}

#[test]
fn wild_poses_are_dropped_and_the_rest_is_aligned() {
    let Recorded { files, map, truth } = &*RECORDED;
    for (wild, km) in [
        (vec![7], 0.3),
        (vec![7], 0.5),
        (vec![7], 1.0),
        (vec![7], 10.0),
        (vec![3, 4, 5], 1.0),
        (vec![19], 0.3),
    ] {
        let by_m = |number: u32| if wild.contains(&number) { 1000.0 * km } else { 0.0 };
        let answer = align(&moved(files, by_m), map);
        check_aligned(&answer, truth);
        assert_eq!(codes(&answer), ["poses_dropped"], "{answer:#}");
        let detail = answer["reasons"][0]["detail"].as_str().unwrap();
        assert!(detail.starts_with(&format!("{} of 20 camera poses", wild.len())), "{detail}");
    }
}

/// The first frame's pose is an outlier: the clip begins with the second one.
#[test]
fn a_wild_first_pose_is_dropped() {
    let Recorded { files, map, .. } = &*RECORDED;
    let answer = align(&moved(files, |number| if number == 0 { 1000.0 } else { 0.0 }), map);
    assert_eq!((&answer["state"], codes(&answer)), (&"aligned".into(), vec!["poses_dropped"]), "{answer:#}");
}

/// Returns the pictures of one frame under many poses.
fn repeated(frames: u32) -> Files {
    let one = room::clip(1);
    let mut files: Files = one.iter().filter(|(name, _)| name.starts_with("intrinsic")).cloned().collect();
    for number in 0..frames {
        let own = one.iter().filter(|(name, _)| !name.starts_with("intrinsic"));
        files.extend(own.map(|(name, bytes)| (name.replace("/0.", &format!("/{number}.")), bytes.clone())));
    }
    files
}

#[test]
fn frames_that_are_far_from_each_other_end_in_a_reason() {
    let answer = align(&moved(&repeated(200), |number| 28.3 * f64::from(number)), &room::lidar_csv());
    assert!(codes(&answer).contains(&"poses_dropped"), "{answer:#}");
    assert_eq!(answer["key_frames"], 1, "{answer:#}");
}

#[test]
fn a_way_that_no_home_has_room_for_ends_in_a_reason() {
    let answer = align(&moved(&repeated(200), |number| 2.0 * f64::from(number)), &room::lidar_csv());
    assert_eq!(answer["state"], "failed", "{answer:#}");
    assert_eq!(codes(&answer), ["clip_extent_too_large"], "{answer:#}");
    let detail = answer["reasons"][0]["detail"].as_str().unwrap();
    assert!(detail.contains("398 m") && detail.contains("250 m"), "{detail}");
}

/// Depth without any surface.
#[test]
fn noise_costs_no_more_than_a_home() {
    let mut files = repeated(60);
    let mut state = 1u32;
    let mut noise = ImageBuffer::<Luma<u16>, Vec<u16>>::new(160, 120);
    for pixel in noise.pixels_mut() {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        pixel.0 = [200 + (state >> 16) as u16 % 4800];
    }
    let noise = png(noise);
    for (_, bytes) in files.iter_mut().filter(|(name, _)| name.starts_with("depth/")) {
        bytes.clone_from(&noise);
    }
    let answer = align(&moved(&files, |number| 0.1 * f64::from(number)), &room::lidar_csv());
    assert_ne!(answer["state"], "aligned", "{answer:#}");
}
