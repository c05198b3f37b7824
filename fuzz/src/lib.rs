//! Invariants of all readers of archives, clips, maps and videos.

pub mod clip_files;
mod clips;
mod rasters;
pub mod targets;

pub use clips::{check_file, check_layout};
pub use viola_formats::{clip, container, lidar, video};

use container::Region;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use lidar::LidarMap;
use std::fs::File;
use std::io::{Cursor, Seek, Write};
use std::sync::OnceLock;
use video::{Codec, VideoInfo};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// Reads a map and writes it in each format; all numbers must be finite, and written maps must be readable. A map is written
/// as cells only if they are few: else each execution may fill 250 m by 250 m with them.
pub fn check(bytes: &[u8]) {
    let Ok(map) = LidarMap::read(bytes) else { return };
    assert!(!map.occupied_m.is_empty());
    assert!(map.occupied_m.iter().all(|p| p.x.is_finite() && p.y.is_finite()));
    assert!(map.charger.is_none_or(|pose| pose.is_finite()));
    let marks = &map.info.marks;
    assert!(marks.robot.is_none_or(|pose| pose.is_finite()));
    assert!(marks.zones.iter().flat_map(|zone| &zone.outline_m).flatten().all(|v| v.is_finite()));
    assert!(LidarMap::read(&map.to_ply().bytes).is_ok());
    if !rasters::is_small(&map) {
        return;
    }
    // Maps that Valetudo cannot hold are refused.
    let _ = map.to_ros("map.pgm");
    if let Ok(written) = map.to_valetudo() {
        let read = LidarMap::read(&written.bytes);
        assert!(read.is_ok(), "{:?}", read.err());
    }
}

/// Reads every file of an archive, whole and by region: both must be equal.
pub fn check_archive(bytes: &[u8]) {
    const MAX_BYTES: u64 = 1 << 20;
    let mut file = tempfile::NamedTempFile::new().expect("a temporary file");
    file.write_all(bytes).expect("room for a temporary file");
    let Ok(archive) = container::open(file.path()) else { return };
    for name in archive.names() {
        let (whole, region) = (archive.read(name, MAX_BYTES), archive.region(name, MAX_BYTES));
        // A stored zip entry's checksum is verified only when it is read whole.
        let Ok(whole) = whole else { continue };
        let region = region.expect("what can be read whole can be read in part");
        let mut part = vec![0; whole.len()];
        assert!(
            region.read_exact_at(0, &mut part).is_ok() && part == whole && region.bytes == whole.len() as u64
        );
    }
}

pub fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
    // Writing into a vector cannot fail.
    let _ = encoder.write_all(bytes);
    encoder.finish().unwrap_or_default()
}

/// Builds a zip with a ROS map: a yaml file and an image.
pub fn ros_zip(bytes: &[u8]) -> Vec<u8> {
    let at = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
    let (yaml, image) = (&bytes[..at], bytes.get(at + 1..).unwrap_or_default());
    zip_of([("map.yaml".to_string(), yaml.to_vec()), ("map.pgm".to_string(), image.to_vec())])
}

/// Builds a zip of uncompressed files.
fn zip_of(files: impl IntoIterator<Item = (String, Vec<u8>)>) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    for (name, bytes) in files {
        // Writing into a vector cannot fail.
        let _ = zip.start_file(name, options);
        let _ = zip.write_all(&bytes);
    }
    zip.finish().map(Cursor::into_inner).unwrap_or_default()
}

/// Maximum pixels of a decoded picture; larger ones only take time.
const MAX_PIXELS: u32 = 1 << 18;

/// Checks a video: frame times must ascend, and decoding must return all frames or an error.
pub fn check_video(bytes: &[u8], decoded: Option<Codec>) {
    // The fuzzer runs thousands of inputs a second, so one file is overwritten; reads are positional.
    static FILE: OnceLock<File> = OnceLock::new();
    let Ok(mut file) = FILE.get_or_init(|| tempfile::tempfile().expect("a file")).try_clone() else { return };
    let written = file.rewind().and_then(|()| file.set_len(0)).and_then(|()| file.write_all(bytes));
    assert!(written.is_ok());
    let Ok(region) = Region::whole(file) else { return };
    let Ok(VideoInfo { codec, width, height, time_s, .. }) = video::inspect(&region) else { return };
    assert!(!time_s.is_empty() && time_s.is_sorted() && time_s[0] == 0.0);
    if decoded != Some(codec) || width * height > MAX_PIXELS {
        return;
    }
    let wanted: Vec<usize> = (0..time_s.len()).take(40).collect();
    let Ok(frames) = video::decode_planes(&region, &wanted) else { return };
    let mut came = 0;
    for (frame, number) in frames.zip(&wanted) {
        let Ok((ours, planes)) = frame else { return };
        assert_eq!((ours, planes.width, planes.height), (*number, width, height));
        came += 1;
    }
    assert_eq!(came, wanted.len());
}

/// Logs panics and continues: decoders catch them and return an error.
pub fn allow_panics() {
    std::panic::set_hook(Box::new(|panic| eprintln!("{panic}")));
}
