//! The answer to a file that is no clip or no map, in three lines.

use anyhow::{Error, anyhow};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use viola_formats::clip::{Clip, ClipError};
use viola_formats::container::ContainerError;
use viola_formats::lidar::{LidarError, LidarMap};

const CLIPS: &str = "A clip is a recording with depth: a folder, zip or tar of a scanner app or a data set, or a single .r3d, \
                     .sens, .db (RTAB-Map), .mcap or .db3 (ROS 2) file.";
const MAPS: &str = "A LiDAR map is the file of a robot (Valetudo, Roborock, Dreame, Viomi), a ROS map (YAML and image, or a zip of \
                    both), a CARMEN log, or points as CSV, PLY or PCD.";
const MORE: &str = "docs/formats.md lists what is read.";

/// Layouts of folders: the name, the file without which it is not found, and other parts.
const LAYOUTS: &[(&str, &str, &[&str])] = &[
    ("Stray Scanner", "odometry.csv", &["camera_matrix.csv", "confidence", "imu.csv", "rgb.mp4"]),
    ("TUM RGB-D", "depth.txt", &["rgb.txt", "groundtruth.txt", "accelerometer.txt"]),
    ("TUM RGB-D", "rgb.txt", &["depth.txt"]),
    ("ARKitScenes", "lowres_wide.traj", &["lowres_depth", "lowres_wide", "lowres_wide_intrinsics"]),
    ("Record3D", "metadata", &["rgbd"]),
    ("Spectacular AI", "data.jsonl", &["frames2", "calibration.json"]),
];

/// Advice for a file on the place of the other kind, by what a command takes.
#[derive(Clone, Copy)]
pub enum Advice {
    /// The command has the flags `--clip` and `--lidar`.
    Flags,
    /// `viola map`: clips have no flag.
    Arguments,
    /// `viola convert`: the target names the kind.
    Target,
}

impl Advice {
    fn of_lidar_map(self) -> &'static str {
        match self {
            Advice::Flags | Advice::Arguments => "a LiDAR map (give it as --lidar)",
            Advice::Target => "a LiDAR map (choose --to valetudo, ros or ply)",
        }
    }

    fn of_clip(self) -> &'static str {
        match self {
            Advice::Flags => "a clip (give it as --clip)",
            Advice::Arguments => "a clip (give it without --lidar)",
            Advice::Target => {
                "a clip (choose --to stray, tum or scannet; `viola align` and `viola map` write its points as PLY)"
            }
        }
    }
}

/// Returns the error of a clip that cannot be opened; the error of a file of another kind has three lines.
pub fn of_clip(path: &Path, error: ClipError, advice: Advice) -> Error {
    let name = path.display();
    match (error, kind(path, advice)) {
        (ClipError::UnknownLayout { .. }, Some(kind)) => {
            anyhow!("{name} is {kind}, not a clip\n{CLIPS}\n{MORE}")
        }
        (ClipError::UnknownLayout { files }, None) if path.is_dir() => {
            let nearest = nearest_layout(path).unwrap_or_default();
            anyhow!("{name} has {files} files, and no clip that is known{nearest}\n{CLIPS}\n{MORE}")
        }
        (ClipError::Container(error @ ContainerError::CannotUnpack { .. }), _) => {
            anyhow!("clip {name}: {error}; {}", unpacked_in())
        }
        (error, _) => Error::new(error).context(format!("clip {name}")),
    }
}

/// Names the folder in which archives are unpacked, and how to choose another one.
pub fn unpacked_in() -> String {
    format!("it is unpacked in {}: name another folder by TMPDIR", std::env::temp_dir().display())
}

/// Names the layout of which a folder has most parts without the file that tells it.
fn nearest_layout(folder: &Path) -> Option<String> {
    let has = |name: &str| folder.join(name).exists();
    let parts_of = |layout: &&(&str, &str, &[&str])| {
        let (_, key, parts) = **layout;
        if has(key) { 0 } else { parts.iter().filter(|part| has(part)).count() }
    };
    let (layout, key, _) = LAYOUTS.iter().filter(|layout| parts_of(layout) > 0).max_by_key(parts_of)?;
    Some(format!("; it looks like {layout}, but {key} is missing"))
}

/// Returns the error of a LiDAR map that cannot be opened; the error of a file of another kind has three lines.
pub fn of_map(path: &Path, error: LidarError, advice: Advice) -> Error {
    let name = path.display();
    let is_folder = path.is_dir();
    if let (LidarError::ImageWithoutYaml, Some(yaml)) = (&error, yaml_beside(path)) {
        return anyhow!("{name} is the image of a ROS map; give its yaml file: {}", yaml.display());
    }
    if !is_folder && !matches!(error, LidarError::UnknownFormat) {
        return Error::new(error).context(format!("LiDAR map {name}"));
    }
    let is_clip = Clip::open(path).is_ok();
    let kind = if is_clip { Some(advice.of_clip()) } else { kind(path, advice) };
    let other = if is_folder {
        "a folder (name the file of the map in it)"
    } else if path.is_file() {
        "an archive of other files"
    } else {
        "a pipe with other content"
    };
    anyhow!("{name} is {}, not a LiDAR map\n{MAPS}\n{MORE}", kind.unwrap_or(other))
}

/// Returns the yaml file of a ROS map's image, if it is beside it under the same name.
fn yaml_beside(path: &Path) -> Option<PathBuf> {
    ["yaml", "yml"].map(|ending| path.with_extension(ending)).into_iter().find(|yaml| yaml.is_file())
}

/// Names the kind of a file in words; `None` if it is a folder, a pipe, an archive or unknown.
pub fn kind(path: &Path, advice: Advice) -> Option<&'static str> {
    // Opening a pipe would wait for a writer, and reading it would take its content away.
    if !path.is_file() {
        return None;
    }
    let mut head = [0; 512];
    let read = File::open(path).and_then(|mut file| file.read(&mut head)).ok()?;
    let head = &head[..read];
    if LidarMap::open(path).is_ok() {
        return Some(advice.of_lidar_map());
    }
    Some(match head {
        [] => "an empty file",
        [0xff, 0xd8, ..] | [0x89, b'P', b'N', b'G', ..] => "a picture",
        [_, _, _, _, b'f', b't', b'y', b'p', ..] => "a video without depth",
        [b'%', b'P', b'D', b'F', ..] => "a PDF",
        [0x7f, b'E', b'L', b'F', ..] | [b'M', b'Z', ..] => "a program",
        [b'P', b'K', ..] | [0x1f, 0x8b, ..] => return None,
        [b'7', b'z', 0xbc, 0xaf, ..]
        | [0xfd, b'7', b'z', b'X', b'Z', ..]
        | [b'B', b'Z', b'h', ..]
        | [b'R', b'a', b'r', b'!', ..] => "an archive that is not read (make a zip or tar.gz of its content)",
        text if is_text(text) => "a text file",
        _ => "a file of unknown kind",
    })
}

/// Returns whether the first bytes are UTF-8 without control characters; the last character may be cut.
fn is_text(head: &[u8]) -> bool {
    let text = match std::str::from_utf8(head) {
        Ok(text) => text,
        Err(error) if head.len() - error.valid_up_to() < 4 => {
            std::str::from_utf8(&head[..error.valid_up_to()]).unwrap_or_default()
        }
        Err(_) => return false,
    };
    !text.is_empty() && text.chars().all(|c| !c.is_control() || matches!(c, '\n' | '\r' | '\t'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_file_is_answered_in_three_lines() {
        let folder = tempfile::tempdir().unwrap();
        for (bytes, words) in [
            (&b"Dear diary,\n"[..], "is a text file, not a clip"),
            (b"\xff\xd8\xff\xe0", "is a picture"),
            (b"\0\0\0\x18ftypmp42", "is a video without depth"),
            (b"x,y\n1,2\n3,4\n5,6\n", "is a LiDAR map (give it as --lidar)"),
            (b"\xfd7zXZ\0", "is an archive that is not read (make a zip or tar.gz"),
            (b"BZh91AY", "is an archive that is not read"),
            (b"\x01\x02\x03\x04", "is a file of unknown kind"),
        ] {
            let path = folder.path().join("file");
            std::fs::write(&path, bytes).unwrap();
            let error = of_clip(&path, ClipError::UnknownLayout { files: 1 }, Advice::Flags).to_string();
            assert!(error.lines().count() == 3 && error.contains(words), "{error}");
        }
        let path = folder.path().join("file");
        for (bytes, words) in [
            (&b"Dear diary,\n"[..], "is a text file, not a LiDAR map"),
            (b"PK\x05\x06", "is an archive of other files"),
        ] {
            std::fs::write(&path, bytes).unwrap();
            let error = of_map(&path, LidarError::UnknownFormat, Advice::Flags).to_string();
            assert!(error.lines().count() == 3 && error.contains(words), "{error}");
        }
        std::fs::write(folder.path().join("file.yaml"), "").unwrap();
        let image = of_map(&path, LidarError::ImageWithoutYaml, Advice::Flags).to_string();
        assert!(image.ends_with("file.yaml"), "{image}");
        let of_folder = of_map(folder.path(), LidarError::UnknownFormat, Advice::Target).to_string();
        assert!(of_folder.contains("is a folder (name the file of the map in it), not a"), "{of_folder}");
        for (files, words) in [
            (
                &["camera_matrix.csv", "rgb.mp4"][..],
                "it looks like Stray Scanner, but odometry.csv is missing",
            ),
            (&["rgb.txt", "groundtruth.txt"], "it looks like TUM RGB-D, but depth.txt is missing"),
            (&["depth.txt"], "it looks like TUM RGB-D, but rgb.txt is missing"),
            (&["notes.txt"], "has 2 files, and no clip that is known\n"),
        ] {
            let clip = tempfile::tempdir().unwrap();
            for file in files {
                std::fs::write(clip.path().join(file), "").unwrap();
            }
            let error =
                of_clip(clip.path(), ClipError::UnknownLayout { files: 2 }, Advice::Flags).to_string();
            assert!(error.lines().count() == 3 && error.contains(words), "{error}");
        }
        let other = of_map(&path, LidarError::FileTooLarge { max_bytes: 7 }, Advice::Flags);
        assert!(format!("{other:#}").starts_with("LiDAR map "), "{other:#}");
        let other = of_clip(folder.path(), ClipError::VideoEnded { frame: 7 }, Advice::Flags);
        assert!(format!("{other:#}").contains("before frame 7"), "{other:#}");
    }

    #[cfg(unix)]
    #[test]
    fn nothing_is_taken_out_of_a_pipe() {
        use std::io::Write;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pipe");
        assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
        let mut pipe = File::options().read(true).write(true).open(&path).unwrap();
        pipe.write_all(b"mi").unwrap();
        let clip = of_clip(&path, ClipError::VideoEnded { frame: 7 }, Advice::Flags);
        assert!(format!("{clip:#}").contains("before frame 7"), "{clip:#}");
        let map = of_map(&path, LidarError::UnknownFormat, Advice::Flags).to_string();
        assert!(map.contains("is a pipe with other content, not a LiDAR map"), "{map}");
        pipe.write_all(b"ne").unwrap();
        let mut left = [0; 8];
        assert_eq!(pipe.read(&mut left).unwrap(), 4);
    }
}
