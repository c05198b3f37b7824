//! Seeds of the fuzz targets: a small file of each format, as the target expects it.

#[path = "../../fuzz/src/clip_files.rs"]
mod clip_files;

use crate::archives::archives;
use crate::drawing::*;
use crate::export_writers as writers;
use crate::exports_tolerated::depth_as_npy;
use crate::recording::Recording;
use crate::robot_files::*;
use crate::unknown_scale::{colmap, points};
use crate::writers::{as_folder, scannet, seven_scenes, tum, zip_bytes};
use std::path::PathBuf;
use viola_formats::clip::Clip;

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
        let (target, prefix): (_, &[u8]) = match name.split(' ').next().unwrap_or_default() {
            "csv" => ("csv", b""),
            "ply" => ("ply", b"ply\n"),
            "pcd" => ("pcd", b"# .PCD v0.7"),
            "carmen" => ("carmen", b""),
            "roborock" if bytes.starts_with(b"rr") => ("roborock", b"rr\x14\0"),
            "valetudo" if bytes.starts_with(b"{") => ("valetudo", b"{"),
            "valetudo" => ("valetudo_png", b"\x89PNG\r\n\x1a\n"),
            _ => ("any", b""),
        };
        let inner =
            bytes.strip_prefix(prefix).unwrap_or_else(|| panic!("{name} does not begin as it should"));
        seeds.push((target, name, inner.to_vec()));
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
    let sens = std::mem::take(&mut writers::sens("", &recording)[0].1);
    let mut seeds = vec![("clip_sens", "sens", sens[4..].to_vec()), ("clip_any", "sens", sens)];
    let alone = [
        ("clip_sqlite", "rtabmap", crate::databases::rtabmap("", &recording)),
        ("clip_sqlite", "db3", crate::bags::db3("", &recording)),
        ("clip_mcap", "mcap", crate::bags::mcap("", &recording)),
        ("clip_mcap", "mcap lz4", crate::bags::mcap_split("", &recording)),
    ];
    for (target, name, mut files) in alone {
        let magic_bytes = if target == "clip_mcap" { 8 } else { 16 };
        let bytes = std::mem::take(&mut files[0].1);
        seeds.push((target, name, bytes[magic_bytes..].to_vec()));
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

/// Writes the seeds into the folder that `VIOLA_FUZZ_CORPUS` names, for `fuzz/run`.
#[test]
fn fuzz_seeds_are_there_for_every_target() {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("fuzz/fuzz_targets");
    let folder = std::env::var_os("VIOLA_FUZZ_CORPUS").map(PathBuf::from);
    let seeds = seeds();
    for entry in std::fs::read_dir(root).unwrap() {
        let target = entry.unwrap().path().file_stem().unwrap().to_string_lossy().into_owned();
        // The seeds of videos are the files in tests/video, which fuzz/run copies.
        if target.starts_with("video_") {
            continue;
        }
        let own: Vec<_> = seeds.iter().filter(|(of, _, _)| *of == target).collect();
        assert!(!own.is_empty(), "{target} has no seed");
        let Some(folder) = &folder else { continue };
        let folder = folder.join(&target);
        std::fs::create_dir_all(&folder).unwrap();
        for (_, name, bytes) in own {
            std::fs::write(folder.join(name.replace(' ', "_")), bytes).unwrap();
        }
    }
}
