//! ScanNet's `.sens`, version 4 (and 3, which has no inertial data): one file of a header and frames,
//! little-endian (ScanNet/ScanNet, SensReader/c++/src/sensorData.h). Only its index is read here.

use super::text::pose_from_rows;
use super::{Cameras, ClipError, ColorAt, DepthAt, Intrinsics, Layout, Numbers, Of, Source};
use crate::clip::MAX_FRAMES;
use crate::clip::files::{Coding, Part, has_ending};
use crate::container::{Container, ContainerError, Region};
use std::io::ErrorKind;

/// Maximum size of a file: whole scenes have some gigabytes.
const MAX_BYTES: u64 = 64 << 30;
const MAX_NAME_BYTES: u64 = 4096;
const MAX_SIDE: u32 = 8192;
/// The limit of single pictures: a whole picture is in memory at a time.
const MAX_PIXELS: u64 = 16 << 20;
/// Maximum size of one packed picture.
const MAX_PART_BYTES: u64 = 64 << 20;

/// Finds the file in a container; returns `None` if there is none.
pub(super) fn find(container: &dyn Container) -> Result<Option<Layout>, ClipError> {
    let names = container.names();
    // A file that was sent alone may have any name.
    let is_candidate = |name: &&String| names.len() == 1 || has_ending(name, ".sens");
    let mut candidates = names.iter().filter(is_candidate);
    let Some(name) = candidates.next() else { return Ok(None) };
    if let Some(second) = candidates.next() {
        return Err(ClipError::SeveralClips { first: name.clone(), second: second.clone() });
    }
    let region = container.region(name, MAX_BYTES)?;
    let mut cursor = Cursor { region: &region, name, at: 0 };
    let is_named = has_ending(name, ".sens");
    match cursor.u32() {
        Ok(3 | 4) => {}
        Ok(version) if is_named => {
            return Err(cursor.bad(format!("version {version} of .sens is not read, only 3 and 4")));
        }
        Err(error) if is_named || error.is_service_fault() => return Err(error),
        _ => return Ok(None),
    }
    let header = match cursor.header() {
        Ok(header) => header,
        Err(error) if is_named || error.is_service_fault() => return Err(error),
        // A version number alone does not make a .sens file.
        Err(_) => return Ok(None),
    };
    let sources = cursor.frames(&header)?;
    let frames = sources.len();
    let mut notes = Vec::new();
    if header.has_extrinsics {
        notes.push("the file has a pose between its two cameras, which was not used".to_string());
    }
    let name = name.clone();
    let intrinsics = |numbers| Intrinsics { name: name.clone(), numbers };
    let (color, depth) = (intrinsics(header.color), intrinsics(header.depth));
    Ok(Some(Layout {
        pose_files: "the file's frames",
        depth_unit: "the header's depthShift (16 bits, zlib or raw)",
        depth_units_per_m: header.units_per_m,
        color_pictures: frames,
        depth_pictures: frames,
        intrinsics: "the header, for colour and for depth".to_string(),
        region: Some(region),
        notes,
        ..Layout::new("sens", Cameras::Each { color, depth }, sources)
    }))
}

struct Header {
    color: Numbers,
    depth: Numbers,
    has_extrinsics: bool,
    color_coding: Coding,
    depth_coding: Coding,
    color_size: (u32, u32),
    depth_size: (u32, u32),
    units_per_m: f32,
    frames: u64,
}

/// A reader with a position in the file.
struct Cursor<'a> {
    region: &'a Region,
    name: &'a str,
    at: u64,
}

impl Cursor<'_> {
    fn bad(&self, reason: String) -> ClipError {
        ClipError::BadMetadata { name: self.name.to_string(), reason }
    }

    fn bytes<const N: usize>(&mut self) -> Result<[u8; N], ClipError> {
        let mut bytes = [0; N];
        let read = self.region.read_exact_at(self.at, &mut bytes);
        read.map_err(|source| match source.kind() {
            ErrorKind::UnexpectedEof => {
                self.bad(format!("it ends too early, at byte {}; send the whole file", self.at))
            }
            _ => ContainerError::Unreadable { name: self.name.to_string(), source }.into(),
        })?;
        self.at += N as u64;
        Ok(bytes)
    }

    fn u32(&mut self) -> Result<u32, ClipError> {
        Ok(u32::from_le_bytes(self.bytes()?))
    }

    fn u64(&mut self) -> Result<u64, ClipError> {
        Ok(u64::from_le_bytes(self.bytes()?))
    }

    /// Reads a 4x4 matrix, row by row.
    fn matrix(&mut self) -> Result<[f64; 16], ClipError> {
        let bytes: [u8; 64] = self.bytes()?;
        let mut matrix = [0.0; 16];
        for (value, bytes) in matrix.iter_mut().zip(bytes.as_chunks().0) {
            *value = f64::from(f32::from_le_bytes(*bytes));
        }
        Ok(matrix)
    }

    fn size(&mut self, of: &str) -> Result<(u32, u32), ClipError> {
        let (width, height) = (self.u32()?, self.u32()?);
        let is_side = |side| (1..=MAX_SIDE).contains(&side);
        let pixels = u64::from(width) * u64::from(height);
        if is_side(width) && is_side(height) && pixels <= MAX_PIXELS {
            return Ok((width, height));
        }
        Err(self.bad(format!("{of} cannot be {width}x{height}")))
    }

    fn header(&mut self) -> Result<Header, ClipError> {
        let name_bytes = self.u64()?;
        if name_bytes > MAX_NAME_BYTES {
            return Err(self.bad(format!("the sensor's name cannot have {name_bytes} bytes")));
        }
        self.at += name_bytes;
        let numbers = |m: [f64; 16], of| Numbers { fx: m[0], fy: m[5], cx: m[2], cy: m[6], of };
        let color = numbers(self.matrix()?, Of::Color);
        let color_extrinsics = self.matrix()?;
        let depth = numbers(self.matrix()?, Of::Depth);
        let depth_extrinsics = self.matrix()?;
        let color_compression = self.u32()? as i32;
        let depth_compression = self.u32()? as i32;
        let color_size = self.size("colour")?;
        let depth_size = self.size("depth")?;
        let color_coding = match color_compression {
            0 => Coding::Raw(color_size),
            1 | 2 => Coding::Picture,
            other => {
                return Err(self.bad(format!("colour compression {other} is not read: raw, PNG, JPEG are")));
            }
        };
        let depth_coding = match depth_compression {
            0 => Coding::Raw(depth_size),
            1 => Coding::Zlib,
            other => return Err(self.bad(format!("depth compression {other} is not read: raw and zlib are"))),
        };
        let units_per_m = f32::from_le_bytes(self.bytes()?);
        if !(1.0..=1e6).contains(&units_per_m) {
            return Err(self.bad(format!("{units_per_m} units a metre (depthShift) cannot be")));
        }
        let frames = self.u64()?;
        if frames > MAX_FRAMES as u64 {
            let frames = usize::try_from(frames).unwrap_or(usize::MAX);
            return Err(ClipError::TooManyFrames { frames, max: MAX_FRAMES });
        }
        let has_extrinsics = pose_from_rows(&color_extrinsics)
            .zip(pose_from_rows(&depth_extrinsics))
            .is_some_and(|(color, depth)| (color.inverse() * depth).translation.vector.norm() > 1e-4);
        Ok(Header {
            color,
            depth,
            has_extrinsics,
            color_coding,
            depth_coding,
            color_size,
            depth_size,
            units_per_m,
            frames,
        })
    }

    /// Reads the index of the frames and skips their pictures.
    fn frames(&mut self, header: &Header) -> Result<Vec<Source>, ClipError> {
        let mut sources: Vec<Source> = Vec::new();
        for number in 0..header.frames as u32 {
            // If tracking was lost, all numbers are -inf.
            let world_from_camera = pose_from_rows(&self.matrix()?);
            let (_color_time, depth_time) = (self.u64()?, self.u64()?);
            let (color_bytes, depth_bytes) = (self.u64()?, self.u64()?);
            let color = self.part(color_bytes, header.color_coding, number)?;
            let depth = self.part(depth_bytes, header.depth_coding, number)?;
            // Microseconds; arbitrary if the recorder had no clock.
            let time_s = Some(depth_time as f64 * 1e-6);
            let color = ColorAt::Part { part: color, size: header.color_size };
            let depth = DepthAt::Part { part: depth, size: header.depth_size };
            sources.push(Source { time_s, world_from_camera, ..Source::new(number, color, depth) });
        }
        if !sources.is_sorted_by(|a, b| a.time_s < b.time_s) {
            for source in &mut sources {
                source.time_s = None;
            }
        }
        Ok(sources)
    }

    fn part(&mut self, bytes: u64, coding: Coding, number: u32) -> Result<Part, ClipError> {
        let at = self.at;
        let end = at.checked_add(bytes).filter(|end| *end <= self.region.bytes);
        let (Some(end), Ok(length)) = (end, u32::try_from(bytes)) else {
            return Err(self.bad(format!("it ends inside of frame {number}; send the whole file")));
        };
        if bytes > MAX_PART_BYTES {
            return Err(self.bad(format!("frame {number} cannot have a picture of {bytes} bytes")));
        }
        self.at = end;
        Ok(Part { at, bytes: length, coding, number, confidence_bytes: 0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::{self, File};

    #[test]
    fn a_file_that_cannot_be_read_has_not_ended() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scan.sens");
        fs::write(&path, [0; 8]).unwrap();
        let only_written = File::options().write(true).open(&path).unwrap();
        for (file, code) in [(only_written, "unreadable"), (File::open(&path).unwrap(), "bad_metadata")] {
            let region = Region::whole(file).unwrap();
            let mut cursor = Cursor { region: &region, name: "scan.sens", at: 0 };
            let error = cursor.matrix().unwrap_err();
            assert_eq!(error.code(), code, "{error}");
        }
    }
}
