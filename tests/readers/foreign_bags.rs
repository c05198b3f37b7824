//! ROS 2 bags that other programs wrote: `tests/foreign/bags.py`, with the Python of `VIOLA_FOREIGN_READERS`.

use crate::exports::check;
use crate::recording::{Recording, rows};
use serde_json::json;
use std::path::Path;
use std::process::Command;
use viola_formats::clip::Clip;

/// Writes the recording for the script: a list, and bare pixels.
fn write(recording: &Recording, folder: &Path) {
    let frames: Vec<_> = recording
        .frames
        .iter()
        .map(|frame| {
            let names = ["color", "depth"].map(|kind| format!("{kind}_{}", frame.number));
            let color = image::load_from_memory(&frame.jpeg).unwrap().into_rgb8().into_raw();
            std::fs::write(folder.join(&names[0]), color).unwrap();
            let depth: Vec<u8> = frame.depth_mm.iter().flat_map(|mm| mm.to_le_bytes()).collect();
            std::fs::write(folder.join(&names[1]), depth).unwrap();
            json!({"time_s": frame.time_s, "world_from_camera": rows(&frame.world_from_camera),
                "color": names[0], "depth": names[1]})
        })
        .collect();
    let recording = json!({"frames": frames, "color_size": recording.color_size, "depth_size": recording.depth_size,
        "color_k": recording.color_k(), "depth_k": recording.depth_k});
    std::fs::write(folder.join("recording.json"), recording.to_string()).unwrap();
}

#[test]
fn bags_of_other_programs_are_read_to_the_same_poses_and_pixels() {
    let Some(python) = std::env::var_os("VIOLA_FOREIGN_READERS") else {
        let why = "set VIOLA_FOREIGN_READERS to a Python with the packages of tests/foreign/requirements.txt";
        return viola_testing::skipped("bags of other programs", why);
    };
    let recording = Recording::small(12);
    let folder = tempfile::tempdir().unwrap();
    write(&recording, folder.path());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/foreign/bags.py");
    let done = Command::new(python).arg(script).arg(folder.path()).output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    for name in ["rosbags_sqlite3", "rosbags_mcap", "zstd.mcap", "lz4.mcap"] {
        let path = folder.path().join(name);
        check(&path, "ros2_bag", true, &recording);
        let clip = Clip::open(&path).unwrap();
        for (index, frame) in recording.frames.iter().enumerate() {
            let color = image::load_from_memory(&frame.jpeg).unwrap().into_rgb8();
            assert_eq!(clip.load(index).unwrap().color.as_ref(), Some(&color), "{name}: frame {index}");
        }
        println!("{name}: {} frames", recording.frames.len());
    }
}
