//! Splits one fuzzed input into the files of a clip: its parts, in order, are their contents.
//!
//! The writer of the seeds (tests/readers/fuzz_seeds.rs) includes this file, so that both use the same names.

/// Separator of the parts. Pictures are unlikely to contain it, and the fuzzer learns it from the seeds.
pub const SEPARATOR: &[u8] = b"\n~~~~\n";

/// Targets whose layout has several files, with the files of two frames each.
pub const LAYOUTS: [(&str, &[&str]); 13] = [
    (
        "clip_stray",
        &[
            "odometry.csv",
            "camera_matrix.csv",
            "imu.csv",
            "depth/000000.png",
            "rgb/000000.jpg",
            "confidence/000000.png",
            "depth/000001.png",
            "rgb/000001.jpg",
            "depth/000000.npy",
            "depth/000001.npy",
        ],
    ),
    (
        "clip_record3d",
        &[
            "metadata",
            "rgbd/0.depth",
            "rgbd/0.jpg",
            "rgbd/0.conf",
            "rgbd/1.depth",
            "rgbd/1.jpg",
            "rgbd/1.conf",
        ],
    ),
    (
        "clip_polycam",
        &[
            "keyframes/cameras/5000250000.json",
            "keyframes/images/5000250000.jpg",
            "keyframes/depth/5000250000.png",
            "keyframes/confidence/5000250000.png",
            "keyframes/corrected_cameras/5000250000.json",
            "keyframes/corrected_images/5000250000.jpg",
            "keyframes/cameras/5000350000.json",
            "keyframes/images/5000350000.jpg",
            "keyframes/depth/5000350000.png",
            "keyframes/corrected_cameras/5000350000.json",
            "keyframes/corrected_images/5000350000.jpg",
        ],
    ),
    (
        "clip_scanner_3d",
        &[
            "frame_00000.json",
            "frame_00000.jpg",
            "depth_00000.png",
            "conf_00000.png",
            "frame_00001.json",
            "frame_00001.jpg",
            "depth_00001.png",
        ],
    ),
    (
        "clip_arkit_scenes",
        &[
            "lowres_wide.traj",
            "lowres_wide/41069021_5000.250.png",
            "lowres_depth/41069021_5000.250.png",
            "lowres_wide_intrinsics/41069021_5000.250.pincam",
            "confidence/41069021_5000.250.png",
            "lowres_wide/41069021_5000.350.png",
            "lowres_depth/41069021_5000.350.png",
            "lowres_wide_intrinsics/41069021_5000.350.pincam",
        ],
    ),
    (
        "clip_colmap",
        &[
            "sparse/cameras.bin",
            "sparse/images.bin",
            "images/frame_00000.jpg",
            "stereo/depth_maps/frame_00000.jpg.geometric.bin",
            "images/frame_00001.jpg",
            "stereo/depth_maps/frame_00001.jpg.geometric.bin",
        ],
    ),
    ("clip_points", &["scan.ply", "scan.txt"]),
    (
        "clip_redwood",
        &[
            "scene/trajectory.log",
            "camera_intrinsic.json",
            "color/000000.jpg",
            "depth/000000.png",
            "color/000001.jpg",
            "depth/000001.png",
        ],
    ),
    (
        "clip_nerfstudio",
        &[
            "transforms.json",
            "images/frame_00000.jpg",
            "depths/frame_00000.png",
            "images/frame_00001.jpg",
            "depths/frame_00001.png",
            "images/0.png",
            "images/0.depth.png",
            "images/1.png",
            "images/1.depth.png",
        ],
    ),
    (
        "clip_spectacular",
        &[
            "data.jsonl",
            "calibration.json",
            "frames/00000000.jpg",
            "frames2/00000000.png",
            "frames/00000001.jpg",
            "frames2/00000001.png",
        ],
    ),
    (
        "clip_scannet",
        &[
            "intrinsic/intrinsic_color.txt",
            "intrinsic/intrinsic_depth.txt",
            "pose/0.txt",
            "color/0.jpg",
            "depth/0.png",
            "pose/1.txt",
            "color/1.jpg",
            "depth/1.png",
        ],
    ),
    (
        "clip_seven_scenes",
        &[
            "camera-intrinsics.txt",
            "frame-000000.pose.txt",
            "frame-000000.color.jpg",
            "frame-000000.depth.png",
            "frame-000001.pose.txt",
            "frame-000001.color.jpg",
            "frame-000001.depth.png",
        ],
    ),
    (
        "clip_tum",
        &[
            "rgb.txt",
            "depth.txt",
            "groundtruth.txt",
            "camera-intrinsics.txt",
            "rgb/0.jpg",
            "depth/1305031229.500000.png",
            "rgb/1.jpg",
            "depth/1305031229.600000.png",
        ],
    ),
];

/// Returns the file names of a target; empty for other targets.
pub fn names(target: &str) -> &'static [&'static str] {
    LAYOUTS.iter().find(|(name, _)| *name == target).map_or(&[], |(_, names)| names)
}

/// Returns names and contents. An empty part means a missing file.
pub fn split(target: &str, input: &[u8]) -> Vec<(String, Vec<u8>)> {
    let mut parts = Vec::new();
    let mut rest = input;
    while let Some(at) = rest.windows(SEPARATOR.len()).position(|window| window == SEPARATOR) {
        parts.push(&rest[..at]);
        rest = &rest[at + SEPARATOR.len()..];
    }
    parts.push(rest);
    let files = names(target).iter().zip(parts).filter(|(_, part)| !part.is_empty());
    files.map(|(name, part)| (name.to_string(), part.to_vec())).collect()
}

/// Builds the input that [`split`] splits into these files.
pub fn join(target: &str, files: &[(String, Vec<u8>)]) -> Vec<u8> {
    let part = |name: &&str| files.iter().find(|(own, _)| own == name).map_or(&[][..], |(_, bytes)| bytes);
    let parts: Vec<&[u8]> = names(target).iter().map(part).collect();
    parts.join(SEPARATOR)
}
