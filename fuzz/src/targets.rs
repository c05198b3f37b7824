//! The fuzz targets: the name of each and how it reads its input.
//!
//! The writer of the seeds (tests/readers/fuzz_seeds.rs) includes this file, so that every target has seeds.

/// How a target reads its input. A target that prepends bytes reaches its reader with any input.
#[derive(Clone, Copy)]
pub enum Input {
    /// A map that begins with these bytes.
    Map(&'static [u8]),
    /// A map after inflation.
    InflatedMap,
    /// A zip of a yaml file and an image; the first zero byte separates the two.
    RosMap,
    /// An archive of any files.
    Archive,
    /// A clip of one file that begins with these bytes.
    ClipFile(&'static [u8]),
    /// The files of a clip, which `clip_files` splits.
    ClipFiles,
    /// A video whose frames are not decoded.
    VideoTables,
    /// A video whose frames are decoded if they are H.264.
    H264,
    /// A video whose frames are decoded if they are HEVC.
    Hevc,
}

pub const TARGETS: [(&str, Input); 32] = [
    ("any", Input::Map(b"")),
    ("carmen", Input::Map(b"SYNC\n")),
    ("csv", Input::Map(b"")),
    ("dreame", Input::InflatedMap),
    ("pcd", Input::Map(b"# .PCD v0.7")),
    ("ply", Input::Map(b"ply\n")),
    // Without the gzip layer, whose checksum no fuzzer guesses.
    ("roborock", Input::Map(b"rr\x14\0")),
    ("ros", Input::RosMap),
    ("valetudo", Input::Map(b"{")),
    ("valetudo_png", Input::Map(b"\x89PNG\r\n\x1a\n")),
    ("viomi", Input::InflatedMap),
    ("container", Input::Archive),
    ("clip_any", Input::ClipFile(b"")),
    ("clip_mcap", Input::ClipFile(b"\x89MCAP0\r\n")),
    // The version of the format.
    ("clip_sens", Input::ClipFile(&[4, 0, 0, 0])),
    // RTAB-Map's database or a ROS 2 bag.
    ("clip_sqlite", Input::ClipFile(b"SQLite format 3\0")),
    ("clip_arkit_scenes", Input::ClipFiles),
    ("clip_colmap", Input::ClipFiles),
    ("clip_nerfstudio", Input::ClipFiles),
    ("clip_points", Input::ClipFiles),
    ("clip_polycam", Input::ClipFiles),
    ("clip_record3d", Input::ClipFiles),
    ("clip_redwood", Input::ClipFiles),
    ("clip_scanner_3d", Input::ClipFiles),
    ("clip_scannet", Input::ClipFiles),
    ("clip_seven_scenes", Input::ClipFiles),
    ("clip_spectacular", Input::ClipFiles),
    ("clip_stray", Input::ClipFiles),
    ("clip_tum", Input::ClipFiles),
    ("video_tables", Input::VideoTables),
    ("video_h264", Input::H264),
    ("video_hevc", Input::Hevc),
];
