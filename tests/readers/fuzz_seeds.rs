//! What the fuzz targets begin with: a small file of each format, as the target expects it.

use crate::drawing::*;
use crate::robot_files::*;
use std::path::PathBuf;

/// The seeds by target; what a target puts in front of its bytes is left out.
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
