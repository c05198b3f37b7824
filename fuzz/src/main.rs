//! The fuzzer of all readers. `VIOLA_FUZZ_TARGET` names the target of a process; `list` prints the names of all.
#![no_main]

use std::process::exit;
use std::sync::LazyLock;
use viola_fuzz::targets::{Input, TARGETS};
use viola_fuzz::video::Codec;
use viola_fuzz::{allow_panics, check, check_archive, check_file, check_layout, check_video, ros_zip, zlib};

/// The target of this process.
static TARGET: LazyLock<(&str, Input)> = LazyLock::new(target);

libfuzzer_sys::fuzz_target!(init: begin(), |bytes: &[u8]| run(bytes));

/// Returns the target that the environment names.
fn target() -> (&'static str, Input) {
    let wanted = std::env::var("VIOLA_FUZZ_TARGET").unwrap_or_default();
    if wanted == "list" {
        TARGETS.iter().for_each(|(name, _)| println!("{name}"));
        exit(0);
    }
    let found = TARGETS.into_iter().find(|(name, _)| *name == wanted);
    found.unwrap_or_else(|| {
        eprintln!("VIOLA_FUZZ_TARGET is `{wanted}`, which is no target; `list` prints the names of all");
        exit(2)
    })
}

/// Prepares the process before the first input. A wrong name ends it here.
fn begin() {
    if matches!(TARGET.1, Input::H264 | Input::Hevc) {
        allow_panics();
    }
}

fn run(bytes: &[u8]) {
    let (name, input) = *TARGET;
    match input {
        Input::Map(first) => check(&[first, bytes].concat()),
        Input::InflatedMap => check(&zlib(bytes)),
        Input::RosMap => check(&ros_zip(bytes)),
        Input::Archive => check_archive(bytes),
        Input::ClipFile(first) => check_file(&[first, bytes].concat()),
        Input::ClipFiles => check_layout(name, bytes),
        Input::VideoTables => check_video(bytes, None),
        Input::H264 => check_video(bytes, Some(Codec::H264)),
        Input::Hevc => check_video(bytes, Some(Codec::Hevc)),
    }
}
