//! The readers of maps and what they stand on, from viola's own sources, and what must hold of any map.

#[path = "../../src"]
#[allow(dead_code)]
mod viola {
    pub mod container;
    pub mod geometry;
    pub mod lidar;
}

pub use viola::{container, geometry, lidar};

use flate2::Compression;
use flate2::write::ZlibEncoder;
use lidar::LidarMap;
use std::io::{Cursor, Write};
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

/// Reads a file, and writes what it is in each format; a map's numbers must be finite, and what is written must be
/// read again.
pub fn check(bytes: &[u8]) {
    let Ok(map) = LidarMap::read(bytes) else { return };
    assert!(!map.occupied_m.is_empty());
    assert!(map.occupied_m.iter().all(|p| p.x.is_finite() && p.y.is_finite()));
    assert!(map.charger.is_none_or(|pose| pose.is_finite()));
    let marks = &map.info.marks;
    assert!(marks.robot.is_none_or(|pose| pose.is_finite()));
    assert!(marks.zones.iter().flat_map(|zone| &zone.outline_m).flatten().all(|v| v.is_finite()));
    assert!(LidarMap::read(&map.to_ply().bytes).is_ok());
    // A map can be too wide for cells or for Valetudo, and is then refused.
    let _ = map.to_ros("map.pgm");
    if let Ok(written) = map.to_valetudo() {
        let read = LidarMap::read(&written.bytes);
        assert!(read.is_ok(), "{:?}", read.err());
    }
}

pub fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
    // Writing into a vector cannot fail.
    let _ = encoder.write_all(bytes);
    encoder.finish().unwrap_or_default()
}

/// A ROS map of a yaml file and an image, in one zip.
pub fn ros_zip(bytes: &[u8]) -> Vec<u8> {
    let at = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
    let (yaml, image) = (&bytes[..at], bytes.get(at + 1..).unwrap_or_default());
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in [("map.yaml", yaml), ("map.pgm", image)] {
        // Writing into a vector cannot fail.
        let _ = zip.start_file(name, SimpleFileOptions::default());
        let _ = zip.write_all(bytes);
    }
    zip.finish().map(Cursor::into_inner).unwrap_or_default()
}
