//! The viewer in a real browser over a real server, and the tests of its parts.
//!
//! They need Node.js, the packages of `web/` (a build fetches them) and Chromium (`$CHROMIUM`, or Debian's).
//! Without them they are skipped with a message, or fail if `VIOLA_BROWSER=1`.

mod origin;
mod session;

use image::RgbImage;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use viola_testing::has_node;
use viola_testing::process::{Process, succeed, viola};

/// Kinds of simulated homes and frames of their clips: a clip of the first is aligned, one of the second is
/// ambiguous. The first is so long that its job can be watched.
const SETS: [(&str, &str); 2] = [("normal", "100"), ("repeated", "40")];

fn web() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("web")
}

fn chromium() -> PathBuf {
    std::env::var_os("CHROMIUM").map_or_else(|| "/usr/bin/chromium".into(), PathBuf::from)
}

/// Returns whether all requirements are met; prints the missing ones.
fn can_run(needs_browser: bool) -> bool {
    let browser = (!needs_browser || chromium().is_file(), "Chromium");
    has_node("the viewer in a browser", &web(), "playwright-core", &[browser])
}

/// Returns a command that runs a script of `web/tests` in a browser.
fn script(name: &str, server: &Process) -> Command {
    let mut command = Command::new("node");
    command.arg(format!("tests/{name}")).current_dir(web());
    command.env("VIOLA_BASE", &server.client.base).env("CHROMIUM", chromium());
    command
}

fn run(command: &mut Command) {
    println!("{}", succeed(command));
}

/// Their types are checked in `tests/service/typescript.rs`, with those of the document.
#[test]
fn the_sources_are_sound() {
    if !can_run(false) {
        return;
    }
    run(Command::new("node").arg("tests/run.mjs").current_dir(web()));
}

#[test]
fn a_person_uses_the_page() {
    if !can_run(true) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let recordings = folder.path().join("recordings");
    for (set, frames) in SETS {
        let arguments =
            ["simulate", "--set", set, "--seed", "1", "--clips", "1", "--frames", frames, "--out"];
        run(viola().args(arguments).arg(recordings.join(set)));
    }
    let pictures = std::env::var_os("VIOLA_ARTIFACTS")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("target"), PathBuf::from)
        .join("browser");
    if pictures.exists() {
        std::fs::remove_dir_all(&pictures).unwrap();
    }
    std::fs::create_dir_all(&pictures).unwrap();
    let server = Process::serve(&folder.path().join("data"), &[]);
    run(script("browser.mjs", &server).env("VIOLA_RECORDINGS", &recordings).env("VIOLA_PICTURES", &pictures));
    look_at(&pictures);
}

/// Checks that no picture is blank, and that colourings differ.
fn look_at(pictures: &Path) {
    let mut by_name = HashMap::new();
    for entry in std::fs::read_dir(pictures).unwrap() {
        let path = entry.unwrap().path();
        let picture = image::open(&path).unwrap().to_rgb8();
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        let counts = counts(&picture);
        let most = counts.values().max().copied().unwrap_or(0);
        let share = most as f64 / f64::from(picture.width() * picture.height());
        // Pages are mostly background; a stage with points on it has many colours.
        assert!(counts.len() > 40 && share < 0.985, "{name} is blank: {} colours, {share:.3}", counts.len());
        by_name.insert(name, picture);
    }
    assert!(by_name.len() >= 18, "only {} pictures", by_name.len());
    let stages = ["03-3d-colour", "03-3d-class", "03-3d-clip", "03-3d-probability", "04-3d-without-walls"];
    for (i, a) in stages.iter().enumerate() {
        assert!(counts(&by_name[*a]).len() > 300, "{a} shows no points");
        for b in &stages[..i] {
            let differing = by_name[*a].pixels().zip(by_name[*b].pixels()).filter(|(a, b)| a != b).count();
            assert!(differing > 5000, "{a} and {b} differ in {differing} pixels only");
        }
    }
}

fn counts(picture: &RgbImage) -> HashMap<[u8; 3], usize> {
    let mut counts = HashMap::new();
    for pixel in picture.pixels() {
        *counts.entry(pixel.0).or_insert(0) += 1;
    }
    counts
}
