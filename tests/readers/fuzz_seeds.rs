//! Seeds of the fuzz targets: a small file of each format, as the target expects it.

#[path = "../../fuzz/src/clip_files.rs"]
mod clip_files;
#[path = "../../fuzz/src/rasters.rs"]
mod rasters;
#[path = "../../fuzz/src/targets.rs"]
mod targets;

use crate::archives::archives;
use crate::drawing::*;
use crate::export_writers as writers;
use crate::exports_tolerated::depth_as_npy;
use crate::recording::Recording;
use crate::robot_files::*;
use crate::unknown_scale::{colmap, points};
use crate::writers::{as_folder, scannet, seven_scenes, tum, zip_bytes};
use std::path::PathBuf;
use targets::{Input, TARGETS};
use viola_formats::clip::Clip;
use viola_formats::lidar::LidarMap;

/// Returns the seeds by target, without the bytes that a target prepends itself.
fn seeds() -> Vec<(&'static str, &'static str, Vec<u8>)> {
    let mut seeds = vec![
        ("dreame", "inflated", dreame_inflated(b'I')),
        ("viomi", "inflated", viomi_inflated(77)),
        ("viomi", "temporary", viomi_inflated(0)),
        ("ros", "pgm", [yaml(""), vec![0], pgm(grey(0, 254, 205))].concat()),
        ("ros", "raw", [yaml("mode: raw"), vec![0], pgm(grey(100, 0, 255))].concat()),
    ];
    for (name, bytes) in one_of_each_format() {
        let target = match name.split(' ').next().unwrap_or_default() {
            "csv" => "csv",
            "ply" => "ply",
            "pcd" => "pcd",
            "carmen" => "carmen",
            "roborock" if bytes.starts_with(b"rr") => "roborock",
            "valetudo" if bytes.starts_with(b"{") => "valetudo",
            "valetudo" => "valetudo_png",
            _ => "any",
        };
        // A log may begin with the line that the target prepends.
        let seed = if target == "carmen" { bytes.clone() } else { after_prefix(target, name, &bytes) };
        seeds.push((target, name, seed));
        seeds.push(("any", name, bytes));
    }
    let files = [("a/b.txt".to_owned(), b"some text".repeat(9)), ("c.bin".to_owned(), vec![7; 600])];
    seeds.extend(archives(&files).into_iter().map(|(what, bytes)| ("container", what, bytes)));
    seeds.extend(clips());
    seeds
}

/// Returns two frames of each layout, as files for the layout's own target and as a zip for `clip_any`.
fn clips() -> Vec<(&'static str, &'static str, Vec<u8>)> {
    let recording = Recording::small(2);
    let numbers = [0, 1];
    let mut old_stray = writers::stray("", &recording);
    depth_as_npy(&mut old_stray, "<u2", "False", "(24, 32)");
    let layouts = [
        ("clip_stray", "stray", writers::stray("", &recording)),
        ("clip_stray", "stray npy", old_stray),
        ("clip_record3d", "record3d", writers::record3d("", &recording)),
        ("clip_polycam", "polycam", writers::polycam("", &recording)),
        ("clip_scanner_3d", "scanner 3d", writers::scanner_3d("", &recording)),
        ("clip_arkit_scenes", "arkit scenes", writers::arkit_scenes("", &recording)),
        ("clip_colmap", "colmap", colmap("", &recording)),
        ("clip_points", "points", points("scan.ply", "scan.txt", 5)),
        ("clip_redwood", "redwood", writers::redwood("", &recording)),
        ("clip_nerfstudio", "nerfstudio", writers::nerfstudio("", &recording)),
        ("clip_nerfstudio", "nerf capture", writers::nerf_capture("", &recording)),
        ("clip_spectacular", "spectacular", writers::spectacular("", &recording)),
        ("clip_scannet", "scannet", scannet("", &numbers)),
        ("clip_seven_scenes", "seven scenes", seven_scenes("", &numbers)),
        ("clip_tum", "tum", tum("", &numbers)),
    ];
    let mut seeds = Vec::new();
    let alone = [
        ("clip_sens", "sens", writers::sens("", &recording)),
        ("clip_sqlite", "rtabmap", crate::databases::rtabmap("", &recording)),
        ("clip_sqlite", "db3", crate::bags::db3("", &recording)),
        ("clip_mcap", "mcap", crate::bags::mcap("", &recording)),
        ("clip_mcap", "mcap lz4", crate::bags::mcap_split("", &recording)),
    ];
    for (target, name, mut files) in alone {
        let bytes = std::mem::take(&mut files[0].1);
        seeds.push((target, name, after_prefix(target, name, &bytes)));
        seeds.push(("clip_any", name, bytes));
    }
    for (target, name, files) in layouts {
        let seed = clip_files::join(target, &files);
        // The target must see a clip, and not only some of its files.
        let folder = as_folder(&clip_files::split(target, &seed));
        let clip = Clip::open(folder.path()).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(clip.frames().len(), 2, "{name}");
        assert!((0..2).all(|index| clip.load(index).is_ok()), "{name}");
        seeds.push((target, name, seed));
        seeds.push(("clip_any", name, zip_bytes(&files)));
    }
    seeds
}

/// Returns a file without the bytes that the target prepends.
fn after_prefix(target: &str, name: &str, file: &[u8]) -> Vec<u8> {
    let prefix = TARGETS.iter().find_map(|(own, input)| match input {
        Input::Map(prefix) | Input::ClipFile(prefix) if *own == target => Some(*prefix),
        _ => None,
    });
    let seed = prefix.and_then(|prefix| file.strip_prefix(prefix));
    seed.unwrap_or_else(|| panic!("{name} does not begin as {target} expects it")).to_vec()
}

/// Writes the seeds into the folder that `VIOLA_FUZZ_CORPUS` names, for `fuzz/run`.
#[test]
fn fuzz_seeds_are_there_for_every_target() {
    let folder = std::env::var_os("VIOLA_FUZZ_CORPUS").map(PathBuf::from);
    let seeds = seeds();
    for (target, input) in TARGETS {
        // The seeds of videos are the files in tests/video, which fuzz/run copies.
        if matches!(input, Input::VideoTables | Input::H264 | Input::Hevc) {
            continue;
        }
        let own: Vec<_> = seeds.iter().filter(|(of, _, _)| *of == target).collect();
        assert!(!own.is_empty(), "{target} has no seed");
        let Some(folder) = &folder else { continue };
        let folder = folder.join(target);
        std::fs::create_dir_all(&folder).unwrap();
        for (_, name, bytes) in own {
            std::fs::write(folder.join(name.replace(' ', "_")), bytes).unwrap();
        }
    }
}

/// The fuzzer writes small maps in each format, and wide ones only as points.
#[test]
fn the_maps_of_the_seeds_are_small_enough_to_be_written() {
    let is_small = |bytes: &[u8]| rasters::is_small(&LidarMap::read(bytes).unwrap());
    for (name, bytes) in one_of_each_format() {
        assert!(is_small(&bytes), "{name}");
    }
    let corners = |side_m: f64| format!("x,y\n0,0\n{side_m},0\n0,{side_m}\n{side_m},{side_m}\n");
    for (side_m, expected) in [(15.0, true), (16.0, false), (250.0, false)] {
        assert_eq!(is_small(corners(side_m).as_bytes()), expected, "{side_m} m");
    }
}
