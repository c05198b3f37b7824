//! Clips in each layout: written clips are read, and unusable ones are refused by name.

use crate::archives::{everywhere, gzip, zstd};
use crate::edits::set;
use crate::export_writers;
use crate::exports::Writer as ExportWriter;
use crate::recording::Recording;
use crate::refusals;
use crate::writers::*;
use proptest::prelude::*;
use std::collections::BTreeSet;
use std::path::Path;
use viola_formats::clip::Clip;
use viola_geometry::Vector3;

/// Checks that a clip holds the frames `numbers` as the writers wrote them, with depth in `units_per_m`.
fn check_clip(path: &Path, layout: &str, numbers: &[u32], units_per_m: f32) {
    let clip = Clip::open(path).unwrap_or_else(|error| panic!("{layout}: {error}"));
    assert_eq!(clip.info().layout, layout);
    assert_eq!(clip.info().frames, numbers.len());
    assert_eq!(clip.info().frames_with_pose, numbers.len());
    assert_eq!((clip.info().color_width, clip.info().color_height), (WIDTH, HEIGHT));
    assert_eq!((clip.info().depth_width, clip.info().depth_height), (WIDTH, HEIGHT));
    for (index, &number) in numbers.iter().enumerate() {
        let frame = clip.load(index).unwrap();
        // TUM has no numbers: its frames are counted.
        assert_eq!(frame.header.number, if layout == "tum_rgbd" { index as u32 } else { number });
        assert_eq!(&frame.header, &clip.frames()[index]);
        let read = frame.header.world_from_camera.unwrap().to_homogeneous();
        let written = pose(number);
        for row in 0..4 {
            for column in 0..4 {
                let error = (read[(row, column)] - written[row][column]).abs();
                assert!(error < 1e-9, "{layout} frame {number} ({row}, {column}): {error:e}");
            }
        }
        for camera in [frame.color_camera, frame.depth_camera] {
            assert_eq!((camera.fx, camera.fy, camera.cx, camera.cy), (FX, FY, CX, CY));
        }
        assert_eq!(frame.color.unwrap().dimensions(), (WIDTH, HEIGHT));
        for (x, y) in [(0, 0), (1, 0), (2, 0), (0, 1), (WIDTH - 1, HEIGHT - 1)] {
            let expected = match units(number, x, y) {
                u16::MAX => 0.0,
                units => f32::from(units) / units_per_m,
            };
            assert_eq!(frame.depth.at(x, y), expected);
        }
    }
}

/// The scenes of ScanNet's subset have their intrinsics beside the folders, and every hundredth frame.
#[test]
fn scenes_of_scannet_s_subset_are_read() {
    let numbers = [0, 100, 200];
    let mut files = scannet("scene0000_00/", &numbers);
    for camera in ["color", "depth"] {
        let name = format!("scene0000_00/intrinsics_{camera}.txt");
        crate::edits::rename(&mut files, &format!("scene0000_00/intrinsic/intrinsic_{camera}.txt"), &name);
    }
    files.push(("scene0000_00/label/000000.png".to_string(), b"png".to_vec()));
    let folder = as_folder(&files);
    check_clip(folder.path(), "scannet", &numbers, 1000.0);
    let told = Clip::open(folder.path()).unwrap().info().intrinsics.clone();
    assert_eq!(told, "intrinsics_color.txt and intrinsics_depth.txt");
    crate::edits::remove(&mut files, |name| name.ends_with("intrinsics_color.txt"));
    let error = Clip::open(as_folder(&files).path()).err().unwrap();
    assert_eq!(error.code(), "missing_intrinsics");
    assert!(error.to_string().contains("scene0000_00/intrinsics_color.txt"), "{error}");
}

type Writer = fn(&str, &[u32]) -> Files;
const LAYOUTS: [(&str, Writer, f32); 3] =
    [("scannet", scannet, 1000.0), ("seven_scenes", seven_scenes, 1000.0), ("tum_rgbd", tum, 5000.0)];

#[test]
fn each_layout_is_read_from_every_container_wherever_it_lies() {
    let numbers = [0, 9, 10, 11, 100];
    for (layout, write_files, units_per_m) in LAYOUTS {
        for root in ["", "scene0000_00/", "a/b/c/"] {
            let mut files = write_files(root, &numbers);
            // Other files, as in archives of real scenes.
            for name in ["mesh/scene.ply", "lidar/map.yaml", "lidar/points.csv", "notes.txt"] {
                files.push((format!("{root}{name}"), b"ply".to_vec()));
            }
            for name in ["__MACOSX/scene/color/._0.jpg", ".DS_Store", "__MACOSX/._frame-000000.depth.png"] {
                files.push((name.to_string(), b"mac".to_vec()));
            }
            files.push((format!("{root}color/._9.jpg"), b"mac".to_vec()));
            let (_root, places) = everywhere(&files);
            for (_, path) in &places {
                check_clip(path, layout, &numbers, units_per_m);
            }
        }
    }
}

#[test]
fn a_clip_is_read_by_several_threads_at_once() {
    let zip = as_zip(&scannet("", &[0, 1, 2, 3, 4, 5, 6, 7]));
    let clip = Clip::open(zip.path()).unwrap();
    let alone: Vec<_> = (0..8).map(|index| clip.load(index).unwrap().depth).collect();
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                for (index, depth) in alone.iter().enumerate().rev() {
                    assert_eq!(&clip.load(index).unwrap().depth, depth);
                }
            });
        }
    });
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn any_gaps_in_the_numbers_keep_the_order(numbers in prop::collection::btree_set(0u32..2_000_000, 1..12)) {
        let sorted: Vec<u32> = numbers.iter().copied().collect();
        check_clip(as_folder(&scannet("", &sorted)).path(), "scannet", &sorted, 1000.0);
        let short: BTreeSet<u32> = numbers.iter().map(|n| n % 1_000_000).collect();
        let short: Vec<u32> = short.into_iter().collect();
        check_clip(as_folder(&seven_scenes("", &short)).path(), "seven_scenes", &short, 1000.0);
    }
}

/// Checks that a clip is read without its colour pictures, with the same depth, poses and depth camera.
fn check_depth_alone(layout: &str, files: &Files, is_color: impl Fn(&str) -> bool) {
    let (mut depth_alone, all) = (files.clone(), as_folder(files));
    depth_alone.retain(|(name, _)| !is_color(name));
    let depth_alone = as_folder(&depth_alone);
    let both = Clip::open(all.path()).unwrap();
    let clip = Clip::open(depth_alone.path()).unwrap_or_else(|error| panic!("{layout}: {error}"));
    assert!(both.has_color() && !clip.has_color(), "{layout}");
    let info = clip.info();
    assert_eq!((info.frames, info.color_width, info.color_height), (both.info().frames, 0, 0), "{layout}");
    assert_eq!(info.skipped_incomplete, 0, "{layout}");
    assert!(info.notes.iter().any(|note| note.contains("no colour")), "{layout}: {:?}", info.notes);
    assert_eq!(clip.frames(), both.frames(), "{layout}");
    for index in 0..info.frames {
        let (frame, want) = (clip.load(index).unwrap(), both.load(index).unwrap());
        assert!(frame.color.is_none() && want.color.is_some());
        assert_eq!(frame.depth, want.depth, "{layout}");
        assert_eq!(frame.color_camera, frame.depth_camera);
        // Without the colour picture, its size is guessed by the principal point.
        let (camera, want) = (frame.depth_camera, want.depth_camera);
        let pairs = [(camera.fx, want.fx), (camera.fy, want.fy), (camera.cx, want.cx), (camera.cy, want.cy)];
        assert!(pairs.iter().all(|(a, b)| (a / b - 1.0).abs() < 0.02), "{layout}: {camera:?} {want:?}");
    }
}

#[test]
fn clips_of_depth_alone_are_read() {
    let picture = |name: &str| name.ends_with(".jpg");
    for (layout, write_files, _) in LAYOUTS {
        check_depth_alone(layout, &write_files("", &[0, 1, 2]), |name| picture(name) || name == "rgb.txt");
    }
    let recording = Recording::small(5);
    let exports: [(&str, ExportWriter); 2] =
        [("stray", export_writers::stray), ("redwood", export_writers::redwood)];
    for (layout, write_files) in exports {
        check_depth_alone(layout, &write_files("", &recording), picture);
    }
}

#[test]
fn up_is_known_for_scannet_only() {
    for (layout, write_files, _) in LAYOUTS {
        let folder = as_folder(&write_files("", &[0, 1]));
        let up = Clip::open(folder.path()).unwrap().up_in_world().map(|up| up.direction);
        assert_eq!(up, (layout == "scannet").then(Vector3::z), "{layout}");
    }
}

#[test]
fn poses_that_are_no_rigid_motion_are_counted_and_none() {
    let identity = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
    let with = |row: usize, column: usize, value: f64| {
        let mut matrix = identity;
        matrix[row][column] = value;
        matrix_text(&matrix)
    };
    let no_pose: [(&str, Vec<u8>); 11] = [
        ("all -inf, as ScanNet writes where tracking was lost", matrix_text(&[[f64::NEG_INFINITY; 4]; 4])),
        ("NaN", matrix_text(&[[f64::NAN; 4]; 4])),
        ("one NaN in the translation", with(1, 3, f64::NAN)),
        ("zeros", matrix_text(&[[0.0; 4]; 4])),
        ("a mirror", with(2, 2, -1.0)),
        ("a scale", with(0, 0, 1.1)),
        ("a shear", with(0, 1, 0.1)),
        ("a projective row", with(3, 0, 0.5)),
        ("fifteen numbers", b"1 ".repeat(15)),
        ("words", b"no pose here".to_vec()),
        ("nothing", Vec::new()),
    ];
    for (what, text) in no_pose {
        let mut files = scannet("", &[0, 1]);
        files.iter_mut().find(|(name, _)| name == "pose/1.txt").unwrap().1 = text;
        let folder = as_folder(&files);
        let clip = Clip::open(folder.path()).unwrap();
        assert!(clip.frames()[0].world_from_camera.is_some(), "{what}");
        assert_eq!(clip.frames()[1].world_from_camera, None, "{what}");
        assert_eq!((clip.info().frames_with_pose, clip.info().skipped_without_pose), (1, 1), "{what}");
    }
    // A rotation rounded to three digits is accepted and normalised.
    let rounded = pose(7).map(|row| row.map(|v| (v * 1000.0).round() / 1000.0));
    let mut files = scannet("", &[0]);
    files.iter_mut().find(|(name, _)| name == "pose/0.txt").unwrap().1 = matrix_text(&rounded);
    let rotation =
        Clip::open(as_folder(&files).path()).unwrap().frames()[0].world_from_camera.unwrap().rotation;
    assert!((rotation.norm() - 1.0).abs() < 1e-12);
}

#[test]
fn frames_that_lack_a_picture_are_counted() {
    let mut files = scannet("", &[0, 1, 2, 3]);
    files.retain(|(name, _)| name != "color/1.jpg" && name != "depth/2.png" && name != "pose/3.txt");
    let clip = Clip::open(as_zip(&files).path()).unwrap();
    assert_eq!(clip.frames().iter().map(|f| f.number).collect::<Vec<_>>(), [0, 3]);
    assert_eq!((clip.info().skipped_incomplete, clip.info().skipped_without_pose), (2, 1));
}

/// Checks that a good clip with changed files is refused with `code`, as a folder and as a zip, and that the
/// message contains `naming`.
fn check_refused(write_files: Writer, change: impl FnOnce(&mut Files), code: &str, naming: &str) {
    let mut files = write_files("", &[0, 1, 2]);
    change(&mut files);
    refusals::check_files(&files, code, naming);
}

/// Checks that a good clip with changed files is a clip without poses, with a note.
fn check_without_poses(write_files: Writer, change: impl FnOnce(&mut Files)) {
    let mut files = write_files("", &[0, 1, 2]);
    change(&mut files);
    refusals::check_files_without_poses(&files);
}

fn drop_ending(files: &mut Files, ending: &str) {
    files.retain(|(name, _)| !name.ends_with(ending));
}

#[test]
fn clips_that_cannot_be_used_are_refused_by_name() {
    let color_file = "intrinsic/intrinsic_color.txt";
    let depth_file = "intrinsic/intrinsic_depth.txt";
    let twice = matrix_text(&[[2.0 * FX, 0.0, 2.0 * CX], [0.0, 2.0 * FY, 2.0 * CY], [0.0, 0.0, 1.0]]);
    let far = matrix_text(&[[2.0 * FX, 0.0, CX], [0.0, 2.0 * FY, CY], [0.0, 0.0, 1.0]]);
    let nan = matrix_text(&[[f64::NAN, 0.0, CX], [0.0, FY, CY], [0.0, 0.0, 1.0]]);
    let no_focal = matrix_text(&[[0.0, 0.0, CX], [0.0, FY, CY], [0.0, 0.0, 1.0]]);
    let full = matrix_text(&[[FX, 0.0, CX], [3.0, FY, CY], [0.0, 0.0, 1.0]]);

    check_refused(scannet, |f| f.clear(), "unknown_layout", "rgb.txt");
    check_refused(
        scannet,
        |f| f.retain(|(name, _)| name.starts_with("pose")),
        "unknown_layout",
        "color/0.jpg",
    );
    check_refused(scannet, |f| drop_ending(f, ".png"), "no_frames", "3 colour");
    check_refused(scannet, |f| drop_ending(f, color_file), "missing_intrinsics", color_file);
    check_refused(scannet, |f| drop_ending(f, depth_file), "missing_intrinsics", depth_file);
    for (text, naming) in [
        (&b"1 2 3"[..], "3x3"),
        (b"", "3x3"),
        (&twice, "another size"),
        (&nan, "finite"),
        (&no_focal, "focal"),
        (&full, "fx 0 cx"),
    ] {
        check_refused(scannet, |f| set(f, color_file, text), "bad_intrinsics", naming);
        check_refused(scannet, |f| set(f, depth_file, text), "bad_intrinsics", depth_file);
        check_refused(seven_scenes, |f| set(f, "camera-intrinsics.txt", text), "bad_intrinsics", naming);
    }
    check_refused(scannet, |f| set(f, color_file, [b'1'; 5000]), "file_too_large", color_file);
    check_refused(scannet, |f| drop_ending(f, ".txt"), "missing_intrinsics", color_file);
    check_without_poses(scannet, |f| f.retain(|(n, _)| !n.starts_with("pose")));
    check_without_poses(tum, |f| drop_ending(f, "groundtruth.txt"));
    check_without_poses(seven_scenes, |f| drop_ending(f, ".pose.txt"));
    check_refused(scannet, |f| set(f, "color/01.jpg", b""), "duplicate_frame", "color/01.jpg");
    check_refused(scannet, |f| f.extend(scannet("second/", &[0])), "several_clips", "second/");

    // Colour and depth that do not belong together.
    let renumber = |files: &mut Files| {
        for (name, _) in files.iter_mut().filter(|(name, _)| name.starts_with("depth/")) {
            *name = name.replace("depth/", "depth/10");
        }
    };
    check_refused(scannet, renumber, "color_depth_mismatch", "no frame has one of each");
    check_refused(scannet, |f| set(f, depth_file, far), "color_depth_mismatch", "at one metre");
    let portrait = color_jpeg(HEIGHT, WIDTH);
    let all_portrait = |files: &mut Files| {
        for (_, bytes) in files.iter_mut().filter(|(name, _)| name.ends_with(".jpg")) {
            bytes.clone_from(&portrait);
        }
    };
    check_refused(seven_scenes, all_portrait, "color_depth_mismatch", "24x32");

    for naming in ["color/0.jpg", "neither JPEG nor PNG", "copy the clip again, or remove this picture"] {
        check_refused(scannet, |f| set(f, "color/0.jpg", b"no picture"), "bad_picture", naming);
    }
    check_refused(
        scannet,
        |f| set(f, "depth/0.png", &depth_png(8, 6, |_, _| 1)[..40]),
        "bad_picture",
        "depth/0.png",
    );
    check_refused(tum, |f| set(f, "rgb.txt", b"1305031229.5\n"), "bad_index", "rgb.txt, line 1");
    check_refused(tum, |f| set(f, "depth.txt", b"# head\nx depth/0.png\n"), "bad_index", "depth.txt, line 2");
    check_refused(
        tum,
        |f| set(f, "groundtruth.txt", b"1 2 3 4 5 6 7\n"),
        "bad_index",
        "groundtruth.txt, line 1",
    );
    check_refused(tum, |f| set(f, "depth.txt", [0xff; 9]), "bad_index", "depth.txt");
}

#[test]
fn what_is_no_container_is_refused() {
    let check = |bytes: &[u8], code: &str| {
        let error = Clip::open(as_file(bytes).path()).err().unwrap();
        assert_eq!(error.code(), code, "{error}");
    };
    check(b"", "empty");
    // A file by itself can be a recording, but these are none.
    for bytes in [&b"P"[..], b"This is a text file that somebody sent by mistake.", &color_jpeg(8, 6)] {
        check(bytes, "unknown_layout");
        check(&gzip(bytes), "not_an_archive");
        check(&zstd(bytes), "not_an_archive");
    }
    let zip = zip_bytes(&scannet("", &[0, 1]));
    for cut in [5, 30, zip.len() / 2, zip.len() - 30, zip.len() - 21, zip.len() - 1] {
        check(&zip[..cut], "zip_truncated");
    }
    let missing = Clip::open(Path::new("no/such/clip.zip")).err().unwrap();
    assert_eq!(missing.code(), "unreadable");
}

/// Changes a picture of the second frame, and checks that the clip opens and only that frame is refused.
fn check_second_frame(name: &str, bytes: &[u8], code: &str) {
    let mut files = scannet("", &[0, 1, 2]);
    set(&mut files, name, bytes);
    let (folder, zip) = (as_folder(&files), as_zip(&files));
    for path in [folder.path(), zip.path()] {
        let clip = Clip::open(path).unwrap();
        assert!(clip.load(0).is_ok() && clip.load(2).is_ok());
        let error = clip.load(1).unwrap_err();
        assert_eq!(error.code(), code, "{error}");
        assert!(error.to_string().contains(name), "{error}");
    }
}

#[test]
fn pictures_are_checked_when_they_are_loaded() {
    let jpeg = color_jpeg(WIDTH, HEIGHT);
    let png = depth_png(WIDTH, HEIGHT, |_, _| 1234);
    let grey8 = encode(&image::DynamicImage::new_luma8(WIDTH, HEIGHT), image::ImageFormat::Png);
    let rgb16 = encode(&image::DynamicImage::new_rgb16(WIDTH, HEIGHT), image::ImageFormat::Png);
    check_second_frame("color/1.jpg", &color_jpeg(WIDTH * 2, HEIGHT * 2), "image_size_changed");
    check_second_frame("depth/1.png", &depth_png(HEIGHT, WIDTH, |_, _| 1), "image_size_changed");
    check_second_frame("depth/1.png", &grey8, "depth_not_grey16");
    check_second_frame("depth/1.png", &rgb16, "depth_not_grey16");
    check_second_frame("depth/1.png", &jpeg, "depth_not_grey16");
    check_second_frame("depth/1.png", &png[..png.len() / 2], "bad_picture");
    check_second_frame("color/1.jpg", &jpeg[..jpeg.len() / 2], "bad_picture");
    check_second_frame("color/1.jpg", b"", "bad_picture");
    // A header that promises 60 000 x 60 000 pixels.
    let mut huge = png.clone();
    huge[16..24].copy_from_slice(&[0, 0, 0xea, 0x60, 0, 0, 0xea, 0x60]);
    let crc = crc32(&huge[12..29]);
    huge[29..33].copy_from_slice(&crc.to_be_bytes());
    check_second_frame("depth/1.png", &huge, "picture_too_large");
}

#[test]
fn tum_poses_are_interpolated_and_the_kinect_is_assumed() {
    let mut files = tum("", &[0, 1, 2]);
    drop_ending(&mut files, "camera-intrinsics.txt");
    // Poses 10 ms before and after the middle row of each depth picture; for the last one the nearest is 30
    // ms away. A Kinect reads its rows in 30.6 ms.
    let mut poses = String::new();
    for (time_s, x_m) in [(29.49, 1.0), (29.51, 2.0), (29.59, 4.0), (29.61, 5.0), (29.67, 9.0)] {
        let middle_s: f64 = time_s - 0.0153;
        poses += &format!("13050312{middle_s:.4} {x_m} 0 0 0 0 0 1\n");
    }
    set(&mut files, "groundtruth.txt", poses.as_bytes());
    let folder = as_folder(&files);
    let clip = Clip::open(folder.path()).unwrap();
    let x_m: Vec<_> = clip
        .frames()
        .iter()
        .map(|f| f.world_from_camera.map(|p| (p.translation.x * 1e4).round() / 1e4))
        .collect();
    assert_eq!(x_m, [Some(1.5), Some(4.5), None]);
    assert!((clip.info().duration_s.unwrap() - 0.2).abs() < 1e-6);
    assert_eq!(clip.info().recorded_at_ms, Some(1_305_031_229_500));
    // 525 for a picture of 640 pixels is 26.25 for one of 32.
    assert_eq!(clip.load(0).unwrap().depth_camera.fx, 26.25);
    assert!(clip.info().notes.iter().any(|note| note.contains("assumed")), "{:?}", clip.info().notes);
}

/// The axes x and y of its accelerometer are opposite to those of its camera.
#[test]
fn tum_feels_gravity() {
    let mut files = tum("", &[0, 1, 2]);
    let felt = "# timestamp ax ay az\n1305031229.49 1 2 -9\n1305031229.51 3 4 -7\n1305031229.59 nan 0 0\n";
    set(&mut files, "accelerometer.txt", felt.as_bytes());
    let folder = as_folder(&files);
    let clip = Clip::open(folder.path()).unwrap();
    let forces: Vec<_> =
        clip.frames().iter().map(|frame| frame.force_in_camera.map(<[f64; 3]>::from)).collect();
    assert_eq!(forces, [Some([-2.0, -3.0, -8.0]), None, None]);
    assert_eq!(clip.up_in_world(), None, "one frame is not enough");
    check_refused(tum, |f| set(f, "accelerometer.txt", b"1 2 3\n"), "bad_index", "accelerometer.txt, line 1");
}

#[test]
fn only_times_of_day_tell_when_a_clip_was_recorded() {
    // Seconds since the device was started.
    let mut files = tum("", &[0, 1]);
    for (_, bytes) in files.iter_mut().filter(|(name, _)| name.ends_with(".txt")) {
        let text = String::from_utf8(std::mem::take(bytes)).unwrap();
        let lines = text.lines().map(|line| line.strip_prefix("13050312").unwrap_or(line));
        *bytes = lines.collect::<Vec<_>>().join("\n").into_bytes();
    }
    for files in [files, scannet("", &[0, 1])] {
        let folder = as_folder(&files);
        assert_eq!(Clip::open(folder.path()).unwrap().info().recorded_at_ms, None);
    }
}

#[cfg(unix)]
#[test]
fn links_in_a_folder_of_ones_own_are_followed() {
    use std::os::unix::fs::symlink;
    let whole = as_folder(&scannet("", &[0, 1]));
    let linked = tempfile::tempdir().unwrap();
    // Folders beside it, a file, a broken link, and links that would never end.
    for folder in ["color", "pose", "intrinsic"] {
        symlink(whole.path().join(folder), linked.path().join(folder)).unwrap();
    }
    std::fs::create_dir(linked.path().join("depth")).unwrap();
    for picture in ["depth/0.png", "depth/1.png"] {
        symlink(whole.path().join(picture), linked.path().join(picture)).unwrap();
    }
    symlink("nowhere", linked.path().join("depth/2.png")).unwrap();
    symlink(".", linked.path().join("again")).unwrap();
    symlink(linked.path(), whole.path().join("color/back")).unwrap();
    let clip = Clip::open(linked.path()).unwrap();
    assert_eq!(clip.info().frames, 2);
    assert!(clip.load(1).is_ok());
}
