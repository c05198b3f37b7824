//! The answer to a file that is no clip, in three lines.

use anyhow::{Error, anyhow};
use std::fs::File;
use std::io::Read;
use std::path::Path;
use viola_formats::clip::ClipError;
use viola_formats::lidar::LidarMap;

const CLIPS: &str = "A clip is a recording with depth: a folder, zip or tar of a scanner app or a data set, or a single .r3d, \
                     .sens, .db (RTAB-Map), .mcap or .db3 (ROS 2) file.";
const MORE: &str = "docs/formats.md lists what is read.";

/// Returns the error of a clip that cannot be opened; a file of another kind is told in three lines.
pub fn of_clip(path: &Path, error: ClipError) -> Error {
    let name = path.display();
    match (error, kind(path)) {
        (ClipError::UnknownLayout { .. }, Some(kind)) => {
            anyhow!("{name} is {kind}, not a clip\n{CLIPS}\n{MORE}")
        }
        (ClipError::UnknownLayout { files }, None) if path.is_dir() => {
            anyhow!("{name} has {files} files, and no clip that is known\n{CLIPS}\n{MORE}")
        }
        (error, _) => Error::new(error).context(format!("clip {name}")),
    }
}

/// Names the kind of a file in words; `None` if it is a folder, an archive or unknown.
pub fn kind(path: &Path) -> Option<&'static str> {
    let mut head = [0; 512];
    let read = File::open(path).and_then(|mut file| file.read(&mut head)).ok().filter(|_| path.is_file())?;
    let head = &head[..read];
    if LidarMap::open(path).is_ok() {
        return Some("a LiDAR map (give it as --lidar)");
    }
    Some(match head {
        [] => "an empty file",
        [0xff, 0xd8, ..] | [0x89, b'P', b'N', b'G', ..] => "a picture",
        [_, _, _, _, b'f', b't', b'y', b'p', ..] => "a video without depth",
        [b'%', b'P', b'D', b'F', ..] => "a PDF",
        [0x7f, b'E', b'L', b'F', ..] | [b'M', b'Z', ..] => "a program",
        [b'P', b'K', ..] | [0x1f, 0x8b, ..] => return None,
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
            (b"\x01\x02\x03\x04", "is a file of unknown kind"),
        ] {
            let path = folder.path().join("file");
            std::fs::write(&path, bytes).unwrap();
            let error = of_clip(&path, ClipError::UnknownLayout { files: 1 }).to_string();
            assert!(error.lines().count() == 3 && error.contains(words), "{error}");
        }
        let other = of_clip(folder.path(), ClipError::VideoEnded { frame: 7 });
        assert!(format!("{other:#}").contains("before frame 7"), "{other:#}");
    }
}
