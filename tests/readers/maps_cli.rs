//! `viola inspect` and `viola convert`.

use crate::drawing::*;
use crate::robot_files::*;
use crate::writers::{as_folder, scannet, zip_bytes};
use std::process::{Command, Output};
use viola_formats::lidar::LidarMap;

fn viola(arguments: &[&str], folder: &std::path::Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_viola")).args(arguments).current_dir(folder).output().unwrap()
}

fn text_of(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

#[test]
fn inspect_tells_what_a_file_is() {
    let files = vec![
        ("map.rrmap".to_string(), roborock()),
        ("text.txt".to_string(), b"Nothing of use.".to_vec()),
        ("part.bin".to_string(), dreame(&dreame_inflated(b'P'))),
        ("clip.zip".to_string(), zip_bytes(&scannet("s/", &[0, 1, 2]))),
    ];
    let folder = as_folder(&files);
    let map = viola(&["inspect", "map.rrmap", "--picture", "map.png"], folder.path());
    let told = text_of(&map.stdout);
    for part in [
        "map:    roborock",
        "room:   16",
        "wood",
        "1 no-go zone",
        "dock:   2.30, 5.05 m, facing 90 deg",
        "usable: yes, nothing in it was refused",
    ] {
        assert!(told.contains(part), "{part}: {told}");
    }
    let picture = std::fs::read(folder.path().join("map.png")).unwrap();
    assert!(picture.starts_with(b"\x89PNG"));
    let sketch = text_of(&viola(&["inspect", "map.rrmap"], folder.path()).stdout);
    assert!(sketch.contains("###") && sketch.contains('@'), "{sketch}");
    let json = viola(&["inspect", "map.rrmap", "--json"], folder.path());
    let info: viola_formats::lidar::LidarInfo = serde_json::from_slice(&json.stdout).unwrap();
    assert_eq!(info, LidarMap::read(&roborock()).unwrap().info);
    let clip = text_of(&viola(&["inspect", "clip.zip"], folder.path()).stdout);
    assert!(clip.contains("clip:   scannet") && clip.contains("frames: 3"), "{clip}");
    for (file, parts) in
        [("text.txt", ["unknown_format", "neither"]), ("part.bin", ["partial_map", "whole map"])]
    {
        let refused = viola(&["inspect", file], folder.path());
        assert!(!refused.status.success());
        let told = text_of(&refused.stderr);
        assert!(parts.iter().all(|part| told.contains(part)), "{told}");
    }
}

#[test]
fn inspect_tells_what_to_do_about_a_part_of_a_clip_or_a_map() {
    use crate::archives::{Names, tar_bytes};
    let clip = gzip(&tar_bytes(&scannet("clip/", &[0, 1, 2]), Names::Gnu));
    let files = [
        ("clip.tar.gz".to_string(), clip[..clip.len() / 2].to_vec()),
        ("map.yaml".to_string(), yaml("")),
        ("map.pgm".to_string(), pgm(grey(0, 254, 205))),
    ];
    let folder = as_folder(&files);
    for (file, words) in [
        ("clip.tar.gz", "ends too early; send the whole file again"),
        ("map.pgm", "map.pgm is the image of a ROS map; give its yaml file: map.yaml"),
    ] {
        let refused = viola(&["inspect", file], folder.path());
        let told = text_of(&refused.stderr);
        assert!(!refused.status.success() && told.contains(words), "{file}: {told}");
    }
}

#[test]
fn convert_writes_what_is_read_back() {
    let folder = as_folder(&[("map.rrmap".to_string(), roborock())]);
    for (to, out) in [("valetudo", "map.json"), ("ros", "map.yaml"), ("ros", "map.zip"), ("ply", "map.ply")] {
        let done = viola(&["convert", "map.rrmap", "--to", to, "--out", out], folder.path());
        assert!(done.status.success(), "{to}: {}", text_of(&done.stderr));
        let read = LidarMap::open(&folder.path().join(out)).unwrap();
        assert_eq!(read.info.occupied_points, hits().len(), "{to}");
    }
    // Each has something that the other one lacks.
    std::fs::copy(folder.path().join("map.rrmap"), folder.path().join("robot.zip")).unwrap();
    for (file, to) in [("map.rrmap", "valetudo"), ("map.yaml", "valetudo"), ("robot.zip", "ros")] {
        let before = std::fs::read(folder.path().join(file)).unwrap();
        let refused = viola(&["convert", file, "--to", to, "--out", file], folder.path());
        let told = text_of(&refused.stderr);
        assert!(!refused.status.success() && told.contains("choose another --out"), "{file}: {told}");
        assert_eq!(std::fs::read(folder.path().join(file)).unwrap(), before, "{file}");
    }
    // A clip has points of its own, which other commands write.
    for (name, bytes) in scannet("clip/", &[0, 1, 2]) {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    }
    let clip = viola(&["convert", "clip", "--to", "ply", "--out", "clip.ply"], folder.path());
    let told = text_of(&clip.stderr);
    assert!(!clip.status.success() && told.contains("clip is a clip (choose --to stray, tum or"), "{told}");
    assert!(
        told.contains("`viola align` and `viola map`") && !folder.path().join("clip.ply").exists(),
        "{told}"
    );
    // LidarMap::open knows the yaml file by its name.
    for out in ["map.pgm", "other", "other.txt"] {
        let bad = viola(&["convert", "map.rrmap", "--to", "ros", "--out", out], folder.path());
        let told = text_of(&bad.stderr);
        assert!(!bad.status.success() && told.contains("name its yaml file"), "{out}: {told}");
    }
    assert!(["other", "other.txt", "other.pgm"].iter().all(|name| !folder.path().join(name).exists()));
    // The image of this ROS map is map.pgm.
    let image = || std::fs::read(folder.path().join("map.pgm")).unwrap();
    let before = image();
    std::fs::rename(folder.path().join("map.yaml"), folder.path().join("old.yaml")).unwrap();
    let bad = viola(&["convert", "old.yaml", "--to", "ros", "--out", "map.yaml"], folder.path());
    let told = text_of(&bad.stderr);
    assert!(!bad.status.success() && told.contains("choose another --out"), "{told}");
    assert!(image() == before && !folder.path().join("map.yaml").exists());
    let again = viola(&["convert", "old.yaml", "--to", "ros", "--out", "old.yaml"], folder.path());
    assert!(again.status.success(), "{}", text_of(&again.stderr));
}

#[test]
fn a_ros_map_is_whole_if_nobody_reads_the_list_of_its_files() {
    let folder = as_folder(&[("map.rrmap".to_string(), roborock())]);
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let mut convert = Command::new(env!("CARGO_BIN_EXE_viola"));
    convert.args(["convert", "map.rrmap", "--to", "ros", "--out", "map.yaml"]).current_dir(folder.path());
    let output = convert.stdout(writer).output().unwrap();
    assert!(output.status.success(), "{}", text_of(&output.stderr));
    let read = LidarMap::open(&folder.path().join("map.yaml")).unwrap();
    assert_eq!(read.info.occupied_points, hits().len());
}

#[test]
fn inspect_overwrites_no_input() {
    let clip = scannet("clip/", &[0, 1, 2]);
    let yaml =
        b"image: map.png\nresolution: 0.05\norigin: [0, 0, 0]\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";
    let mut files = vec![
        ("map.rrmap".to_string(), roborock()),
        ("map.yaml".to_string(), yaml.to_vec()),
        ("map.png".to_string(), b"mine".to_vec()),
        ("clip.zip".to_string(), zip_bytes(&clip)),
    ];
    files.extend(clip);
    let folder = as_folder(&files);
    for (input, picture) in [
        ("map.rrmap", "./map.rrmap"),
        ("map.yaml", "map.png"),
        ("clip.zip", "clip.zip"),
        ("clip", "clip/frames.png"),
    ] {
        let refused = viola(&["inspect", input, "--picture", picture], folder.path());
        let told = text_of(&refused.stderr);
        assert!(!refused.status.success() && told.contains("choose another --picture"), "{input}: {told}");
    }
    for (name, bytes) in files {
        assert_eq!(std::fs::read(folder.path().join(&name)).unwrap(), bytes, "{name}");
    }
    assert!(!folder.path().join("clip/frames.png").exists());
}

#[test]
fn a_clip_is_converted_to_a_folder_or_a_zip_archive() {
    let clip = scannet("clip/", &[0, 1, 2]);
    let folder = as_folder(&clip);
    let convert = |out| viola(&["convert", "clip", "--to", "tum", "--out", out], folder.path());
    let done = convert("OUT.ZIP");
    assert!(done.status.success(), "{}", text_of(&done.stderr));
    assert!(std::fs::read(folder.path().join("OUT.ZIP")).unwrap().starts_with(b"PK"));
    // As an interrupted conversion into an empty folder leaves it.
    std::fs::create_dir_all(folder.path().join("again/viola-AbC123.part/clip/depth")).unwrap();
    let again = convert("again");
    assert!(again.status.success(), "{}", text_of(&again.stderr));
    assert!(folder.path().join("again/depth.txt").exists());
    assert!(!folder.path().join("again/viola-AbC123.part").exists());
    std::fs::write(folder.path().join("mine"), "mine").unwrap();
    let told = text_of(&convert("mine").stderr);
    assert!(
        told.contains("--out mine is not a folder; name a new or empty folder, or a .zip file"),
        "{told}"
    );
    assert_eq!(std::fs::read(folder.path().join("mine")).unwrap(), b"mine");
}

#[cfg(unix)]
#[test]
fn a_clip_replaces_no_device_and_no_broken_link() {
    let folder = as_folder(&scannet("clip/", &[0, 1, 2]));
    for (out, target) in [("device", "/dev/null"), ("broken", "nowhere")] {
        let link = folder.path().join(out);
        std::os::unix::fs::symlink(target, &link).unwrap();
        let refused = viola(&["convert", "clip", "--to", "tum", "--out", out], folder.path());
        let told = text_of(&refused.stderr);
        assert!(
            !refused.status.success() && told.contains(&format!("--out {out} is not a folder")),
            "{told}"
        );
        assert!(link.is_symlink(), "{out}");
    }
}

#[test]
fn a_clip_is_not_converted_into_itself() {
    let clip = zip_bytes(&scannet("clip/", &[0, 1, 2]));
    let folder = as_folder(&[("clip.zip".to_string(), clip.clone())]);
    let refused = viola(&["convert", "clip.zip", "--to", "tum", "--out", "./clip.zip"], folder.path());
    let told = text_of(&refused.stderr);
    assert!(!refused.status.success() && told.contains("choose another --out"), "{told}");
    assert_eq!(std::fs::read(folder.path().join("clip.zip")).unwrap(), clip);
}

#[cfg(unix)]
#[test]
fn a_ros_map_has_a_name_that_its_yaml_file_can_hold() {
    use std::os::unix::ffi::OsStrExt;
    let folder = as_folder(&[("map.rrmap".to_string(), roborock())]);
    let mut command = Command::new(env!("CARGO_BIN_EXE_viola"));
    command.args(["convert", "map.rrmap", "--to", "ros", "--out"]).current_dir(folder.path());
    let refused = command.arg(std::ffi::OsStr::from_bytes(b"m\xff.yaml")).output().unwrap();
    let told = text_of(&refused.stderr);
    assert!(!refused.status.success() && told.contains("is not UTF-8"), "{told}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[cfg(unix)]
#[test]
fn a_map_is_converted_into_a_pipe() {
    let folder = as_folder(&[("map.rrmap".to_string(), roborock())]);
    let done = viola(&["convert", "map.rrmap", "--to", "valetudo", "--out", "/dev/stdout"], folder.path());
    // Only the map is on standard output.
    let map = LidarMap::read(&done.stdout).unwrap();
    assert_eq!(map.info.occupied_points, hits().len());
    assert!(text_of(&done.stderr).starts_with("wrote:"), "{}", text_of(&done.stderr));
}
