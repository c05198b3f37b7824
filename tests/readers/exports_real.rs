//! The real apartment in the apps' export formats, read back and aligned.

use crate::export_writers::stray_with_video;
use crate::exports::{EXPORTS, check_poses};
use crate::recording::Recording;
use crate::writers::{as_folder, as_zip};
use std::path::Path;
use std::sync::OnceLock;
use viola_align::{AlignParams, Alignment, align};
use viola_formats::clip::Clip;
use viola_formats::lidar::LidarMap;
use viola_geometry::progress::Silent;
use viola_testing::data;

/// Frames that the method aligns without ambiguity.
const FRAMES: std::ops::Range<u32> = 120..160;

fn alignment(clip: &Clip, lidar: &LidarMap) -> Alignment {
    let range = (clip.frames().len() > FRAMES.len()).then_some(FRAMES);
    align(clip, range, lidar, &AlignParams::default(), &Silent).unwrap().alignment
}

/// Returns the apartment's LiDAR map and the answer for its original recording, which is aligned once for all tests.
fn aligned_directly(scene: &Path) -> &'static (LidarMap, Alignment) {
    static DIRECT: OnceLock<(LidarMap, Alignment)> = OnceLock::new();
    DIRECT.get_or_init(|| {
        let lidar = LidarMap::open(&scene.join("lidar/points.csv")).unwrap();
        let direct = alignment(&Clip::open(scene).unwrap(), &lidar);
        (lidar, direct)
    })
}

/// Checks that an export of [`FRAMES`] gets the pose of the original recording.
pub fn check_aligned(path: &Path, layout: &str, recording: &Recording, direct: &Alignment, lidar: &LidarMap) {
    let clip = Clip::open(path).unwrap_or_else(|error| panic!("{layout}: {error}"));
    assert_eq!(clip.info().layout, layout);
    check_poses(&clip, recording, layout);
    let got = alignment(&clip, lidar);
    let (got, want) = (got.map_from_clip.unwrap(), direct.map_from_clip.unwrap());
    let off_m = (got.x_m - want.x_m).hypot(got.y_m - want.y_m);
    let off_deg = got.inverse().compose(&want).yaw_rad.abs().to_degrees();
    println!("{layout}: {:.1} mm and {off_deg:.2} degrees from the direct path", off_m * 1000.0);
    // The scale of a clip without metres is found within 2 %: 6 cm at 3 m.
    let most = if clip.info().metric { (0.01, 0.25) } else { (0.06, 0.5) };
    assert!(off_m < most.0 && off_deg < most.1, "{layout}: {off_m} m, {off_deg} degrees off");
}

#[test]
fn the_apartment_in_every_layout_is_aligned_as_it_is_directly() {
    let Some(data) = data::root() else { return };
    let scene = data.join("scannet/scene0000_00");
    let (lidar, direct) = aligned_directly(&scene);
    let recording = Recording::scannet(&scene, FRAMES);
    for (layout, write, _) in EXPORTS {
        let files = write("apartment/", &recording);
        // A folder is faster for layouts that need no unpacking; both are containers.
        if layout == "record3d" {
            check_aligned(as_zip(&files).path(), layout, &recording, direct, lidar);
        } else {
            check_aligned(as_folder(&files).path(), layout, &recording, direct, lidar);
        }
    }
}

/// Encodes the recording's colour as a video with ffmpeg.
fn video(recording: &Recording, coding: &[&str]) -> Vec<u8> {
    let folder = tempfile::TempDir::new().unwrap();
    for frame in &recording.frames {
        std::fs::write(folder.path().join(format!("{:06}.jpg", frame.number)), &frame.jpeg).unwrap();
    }
    let out = folder.path().join("rgb.mp4");
    let status = std::process::Command::new("ffmpeg")
        .args(["-v", "error", "-framerate", "10", "-i"])
        .arg(folder.path().join("%06d.jpg"))
        .args(["-pix_fmt", "yuv420p"])
        .args(coding)
        .arg(&out)
        .status()
        .expect("the real recordings are tested with ffmpeg: install it");
    assert!(status.success());
    std::fs::read(out).unwrap()
}

#[test]
fn the_apartment_with_its_colour_as_video_is_aligned_as_it_is_directly() {
    let Some(data) = data::root() else { return };
    let scene = data.join("scannet/scene0000_00");
    let (lidar, direct) = aligned_directly(&scene);
    let mut recording = Recording::scannet(&scene, FRAMES);
    // The app's matrix is in the video's pixels.
    recording.color_size = (640, 480);
    let hevc = ["-c:v", "libx265", "-crf", "20", "-tag:v", "hvc1", "-x265-params", "log-level=none"];
    let scaled = ["-vf", "scale=640:480"];
    for coding in [
        [&scaled[..], &["-c:v", "libx264", "-bf", "3", "-crf", "18"]].concat(),
        // The app's own: the turn is in the header. ffmpeg counts it the other way round.
        [&scaled[..], &hevc, &["-metadata:s:v", "rotate=270"]].concat(),
        // Converted by a program that applied the turn.
        [&["-vf", "scale=640:480,transpose=clock"][..], &hevc].concat(),
    ] {
        let files = stray_with_video("", &recording, video(&recording, &coding));
        let zip = as_zip(&files);
        check_aligned(zip.path(), "stray_scanner", &recording, direct, lidar);
        // Each frame's colour is that of its own picture, and not of its neighbour.
        let clip = Clip::open(zip.path()).unwrap();
        for index in [0, 17, 30, 39] {
            let read = clip.load(index).unwrap().color.unwrap();
            let own = difference(&read, &recording.frames[index].jpeg);
            let next = difference(&read, &recording.frames[(index + 1) % 40].jpeg);
            assert!(
                own < 6.0 && own < next,
                "{coding:?}, frame {index}: {own} levels off, its neighbour {next}"
            );
        }
    }
}

/// Returns the mean difference of a picture from a JPEG of another size, in levels.
fn difference(picture: &image::RgbImage, jpeg: &[u8]) -> f64 {
    let other = image::load_from_memory(jpeg).unwrap().into_rgb8();
    let (width, height) = picture.dimensions();
    let other = image::imageops::resize(&other, width, height, image::imageops::FilterType::Triangle);
    let sum: u64 = picture.as_raw().iter().zip(other.as_raw()).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    sum as f64 / picture.as_raw().len() as f64
}
