//! Damaged exports of apps: every refusal has its code, and its message names the fault.

use crate::edits::*;
use crate::export_writers as writers;
use crate::export_writers::lzfse;
use crate::exports::Writer;
use crate::refusals::*;
use crate::writers::{Files, as_folder, depth_png};
use serde_json::json;
use viola_formats::clip::Clip;

/// The common cases of all layouts of files: colour, depth and pose file of the last frame.
#[test]
fn frames_with_bad_pictures_are_refused_by_name() {
    let layouts: [(Writer, &str, &str); 6] = [
        (writers::stray, "rgb/000002.jpg", "depth/000002.png"),
        (writers::polycam, "keyframes/corrected_images/5000450000.jpg", "keyframes/depth/5000450000.png"),
        (writers::scanner_3d, "frame_00002.jpg", "depth_00002.png"),
        (writers::redwood, "color/000002.jpg", "depth/000002.png"),
        (writers::nerfstudio, "images/frame_00002.jpg", "depths/frame_00002.png"),
        (writers::arkit_scenes, "lowres_wide/41069021_5000.450.png", "lowres_depth/41069021_5000.450.png"),
    ];
    let jpeg = crate::writers::color_jpeg(64, 48);
    for (write, color, depth) in layouts {
        check_frame(write, |f| set(f, depth, grey8(32, 24)), "depth_not_grey16", depth);
        check_frame(write, |f| set(f, depth, jpeg.clone()), "image_size_changed", depth);
        check_frame(write, |f| set(f, depth, depth_png(24, 32, |_, _| 1)), "image_size_changed", depth);
        check_frame(write, |f| set(f, color, depth_png(8, 6, |_, _| 1)), "image_size_changed", color);
        check_frame(write, |f| cut(f, depth, 0.5), "bad_picture", depth);
        check_frame(write, |f| cut(f, color, 0.5), "bad_picture", color);
        check_frame(write, |f| set(f, color, *b"GIF89a"), "bad_picture", color);
        let only = |ending: &'static str| move |f: &mut Files| remove(f, |name| name.contains(ending));
        let folder = |name: &str| name.rsplit_once(['/', '_']).unwrap().0.to_string();
        let (color, depth) = (folder(color), folder(depth));
        check(write, only(Box::leak(depth.into_boxed_str())), "no_frames", "3 colour");
        // Polycam's recorded pictures replace missing corrected ones; two layouts are read by depth alone.
        if color != "frame" && !color.contains("corrected") && color != "rgb" && color != "color" {
            check(write, only(Box::leak(color.into_boxed_str())), "no_frames", "3 depth");
        }
    }
}

#[test]
fn stray_scanner() {
    let stray = writers::stray;
    let (odometry, matrix) = ("odometry.csv", "camera_matrix.csv");
    check(stray, |f| remove(f, |name| name == odometry), "unknown_layout", odometry);
    check(stray, |f| remove(f, |name| name == matrix), "missing_intrinsics", matrix);
    check(stray, |f| cut(f, matrix, 0.5), "bad_intrinsics", matrix);
    check(stray, |f| set(f, matrix, "nan, 0, 3\n0, 9, 3\n0, 0, 1\n"), "bad_intrinsics", "finite");
    check(stray, |f| set(f, matrix, "1e400, 0, 3\n0, 9, 3\n0, 0, 1\n"), "bad_intrinsics", "finite");
    check(stray, |f| set(f, matrix, "0, 0, 32\n0, 0, 24\n0, 0, 1\n"), "bad_intrinsics", "focal");
    check(stray, |f| set(f, matrix, "-56, 0, 32\n0, 57, 24\n0, 0, 1\n"), "bad_intrinsics", "focal");
    // The app's own intrinsics, for 1920x1440, beside scaled-down pictures.
    check(
        stray,
        |f| set(f, matrix, "1339, 0, 960\n0, 1339, 720\n0, 0, 1\n"),
        "bad_intrinsics",
        "another size",
    );
    check(stray, |f| edit_lines(f, odometry, |_, line| Some(format!("{line}, 1"))), "bad_index", "line 2");
    check(
        stray,
        |f| edit_lines(f, odometry, |_, line| Some(line.replace(" 000001,", ""))),
        "bad_index",
        "line 3",
    );
    check(
        stray,
        |f| edit_lines(f, odometry, |_, line| Some(line.replace("000001", "1.5"))),
        "bad_index",
        "whole",
    );
    check(
        stray,
        |f| edit_lines(f, odometry, |_, line| Some(line.replace("000001", "-1"))),
        "bad_index",
        "whole",
    );
    check(stray, |f| set(f, odometry, [0xff, 0xfe, 0, 0]), "bad_index", "not text");
    check_without_poses(stray, |f| set(f, odometry, ""));
    check_without_poses(stray, |f| edit_lines(f, odometry, |n, line| (n == 0).then(|| line.into())));
    check(stray, |f| set(f, "rgb/2.png", grey8(64, 48)), "duplicate_frame", "rgb/2.png");
    check(stray, |f| set(f, "b/odometry.csv", ""), "several_clips", "b/");
    let confidence = "confidence/000002.png";
    check_frame(stray, |f| set(f, confidence, depth_png(32, 24, |_, _| 2)), "bad_picture", confidence);
    check_frame(stray, |f| cut(f, confidence, 0.5), "bad_picture", confidence);
}

#[test]
fn stray_scanner_with_arrays_of_depth() {
    let name = "depth/000002.npy";
    let old = |f: &mut Files| crate::exports_tolerated::depth_as_npy(f, "<u2", "False", "(24, 32)");
    let check_npy = |change: &dyn Fn(&mut Files), naming: &str| {
        check_frame(
            writers::stray,
            |f| {
                old(f);
                change(f);
            },
            "bad_depth",
            naming,
        );
    };
    let with = |dtype: &str, fortran: &str, shape: &str| {
        let array = crate::exports_tolerated::npy(dtype, fortran, shape, &[0; 24 * 32 * 2]);
        move |f: &mut Files| set(f, name, array.clone())
    };
    check_npy(&|f| cut(f, name, 0.5), "readings");
    check_npy(&|f| cut(f, name, 0.01), ".npy");
    check_npy(&|f| set(f, name, *b"\x93NUMPY\x02\0\xff\xff\xff\xff"), ".npy");
    check_npy(&|f| set(f, name, *b"\x93NUMPY\x09\0\x01\0 "), ".npy");
    check_npy(&with("<f4", "False", "(24, 32)"), "<f4");
    check_npy(&with(">u2", "False", "(24, 32)"), ">u2");
    check_npy(&with("<u2", "True", "(24, 32)"), "row after row");
    check_npy(&with("<u2", "False", "(768,)"), "two sides");
    check_npy(&with("<u2", "False", "(24, 32, 1)"), "two sides");
    check_npy(&with("<u2", "False", "(-24, 32)"), "two sides");
    check_npy(&with("<u2", "False", "(0, 32)"), "no size");
    check_npy(&with("<u2", "False", "(4000000000, 4000000000)"), "no size");
    check_npy(&with("<u2", "False", "(48, 32)"), "readings");
    let turned = with("<u2", "False", "(32, 24)");
    check_frame(
        writers::stray,
        |f| {
            old(f);
            turned(f);
        },
        "image_size_changed",
        name,
    );
}

#[test]
fn record3d() {
    let record3d = writers::record3d;
    let json = "metadata";
    let member = |member: &'static str, value: serde_json::Value| {
        move |f: &mut Files| edit_json(f, json, |file| file[member] = value)
    };
    check(record3d, |f| remove(f, |name| name == json), "unknown_layout", json);
    check(record3d, |f| cut(f, json, 0.5), "bad_metadata", json);
    check(record3d, |f| set(f, json, ""), "bad_metadata", json);
    check(record3d, |f| set(f, json, "[]"), "bad_metadata", json);
    check(record3d, |f| drop_member(f, json, "K"), "bad_metadata", "`K`");
    check(record3d, |f| drop_member(f, json, "w"), "bad_metadata", "`w`");
    check_without_poses(record3d, |f| drop_member(f, json, "poses"));
    check(record3d, member("K", json!([1.0, 2.0])), "bad_metadata", "array of length 9");
    check(record3d, member("w", json!("64")), "bad_metadata", "string");
    check(record3d, member("w", json!(-64)), "bad_metadata", "-64");
    check(record3d, member("w", json!(0)), "color_depth_mismatch", "0x48");
    check(record3d, member("h", json!(1_000_000_000)), "color_depth_mismatch", "1000000000");
    check(
        record3d,
        member("poses", json!([[0.0, 0.0, 0.0, 1.0, 0.0, 0.0]])),
        "bad_metadata",
        "array of length 7",
    );
    check(record3d, |f| set_raw(f, json, "fps", "NaN"), "bad_metadata", json);
    check(record3d, |f| set_raw(f, json, "fps", "1e400"), "bad_metadata", "out of range");
    check(record3d, |f| set_raw(f, json, "poses", &"[".repeat(1000)), "bad_metadata", json);
    for (dw, dh) in [(0, 24), (32, 0), (1_000_000_000, 1_000_000_000), (65_536, 65_536)] {
        let sizes = move |f: &mut Files| edit_json(f, json, |m| (m["dw"], m["dh"]) = (json!(dw), json!(dh)));
        check(record3d, sizes, "bad_depth", "no size");
    }
    // Intrinsics for a picture of 1920x1440.
    let double =
        |f: &mut Files| edit_json(f, json, |m| m["K"] = json!([56., 0, 0, 0, 56., 0, 960., 720., 1]));
    check(record3d, double, "bad_intrinsics", "another size");
    let no_focal = json!([0, 0, 0, 0, 0, 0, 31.5, 23.5, 1]);
    check(record3d, member("K", no_focal), "bad_intrinsics", "focal");
    check(record3d, |f| remove(f, |name| name.ends_with(".depth")), "no_frames", "3 colour");
    check(record3d, |f| remove(f, |name| name.ends_with(".jpg")), "no_frames", "3 depth");
    check(
        record3d,
        |f| {
            edit_json(f, json, |m| (m["dw"], m["dh"]) = (json!(null), json!(null)));
            set(f, "rgbd/0.depth", lzfse(&[0; 400], true));
        },
        "bad_depth",
        "400 bytes",
    );
    let (depth, trust) = ("rgbd/2.depth", "rgbd/2.conf");
    check_frame(record3d, |f| cut(f, depth, 0.5), "bad_depth", "LZFSE");
    check_frame(record3d, |f| set(f, depth, ""), "bad_depth", "LZFSE");
    check_frame(record3d, |f| set(f, depth, [0; 32 * 24 * 4]), "bad_depth", "LZFSE");
    check_frame(record3d, |f| set(f, depth, lzfse(&[0; 32 * 23 * 4], true)), "bad_depth", "2944 bytes");
    check_frame(record3d, |f| set(f, depth, lzfse(&vec![0; 64 << 20], false)), "bad_depth", "more than 3072");
    // A block that declares 4 GiB.
    check_frame(record3d, |f| set(f, depth, *b"bvx-\xff\xff\xff\xff0123bvx$"), "bad_depth", "LZFSE");
    check_frame(record3d, |f| cut(f, trust, 0.5), "bad_depth", trust);
    check_frame(record3d, |f| set(f, trust, lzfse(&[2; 100], true)), "bad_depth", "100 bytes");
    check_frame(record3d, |f| set(f, trust, lzfse(&vec![2; 64 << 20], false)), "bad_depth", "more than 768");
}

#[test]
fn polycam() {
    let polycam = writers::polycam;
    let json = "keyframes/corrected_cameras/5000250000.json";
    let member = |member: &'static str, value: serde_json::Value| {
        move |f: &mut Files| edit_json(f, json, |file| file[member] = value)
    };
    check(polycam, |f| cut(f, json, 0.5), "bad_metadata", json);
    check(polycam, |f| drop_member(f, json, "t_23"), "bad_metadata", "t_23");
    check(polycam, |f| drop_member(f, json, "fx"), "bad_metadata", "fx");
    check(polycam, member("fx", json!("56.5")), "bad_metadata", "string");
    check(polycam, |f| set_raw(f, json, "t_00", "NaN"), "bad_metadata", json);
    check(polycam, |f| set_raw(f, json, "t_00", "-1e400"), "bad_metadata", "out of range");
    check(polycam, member("width", json!(0)), "color_depth_mismatch", "0x48");
    check(polycam, member("width", json!(-64)), "bad_metadata", "-64");
    check(polycam, member("height", json!(1_000_000_000)), "color_depth_mismatch", "1000000000");
    check(polycam, member("fx", json!(-56.5)), "bad_intrinsics", "focal");
    check(polycam, member("cx", json!(960)), "bad_intrinsics", "another size");
    check(polycam, |f| remove(f, |name| name.contains("cameras/")), "unknown_layout", "keyframes/cameras");
    check(
        polycam,
        |f| {
            remove(f, |name| name.contains("corrected_"));
            remove(f, |name| name.contains("images/"));
        },
        "no_frames",
        "0 colour",
    );
}

#[test]
fn scanner_3d_app() {
    let scanner = writers::scanner_3d;
    let json = "frame_00000.json";
    let member = |member: &'static str, value: serde_json::Value| {
        move |f: &mut Files| edit_json(f, json, |file| file[member] = value)
    };
    check(scanner, |f| cut(f, json, 0.5), "bad_metadata", json);
    check(scanner, |f| drop_member(f, json, "cameraPoseARFrame"), "bad_metadata", "cameraPoseARFrame");
    check(scanner, |f| drop_member(f, json, "intrinsics"), "bad_metadata", "intrinsics");
    check(scanner, member("intrinsics", json!([1, 2, 3])), "bad_metadata", "array of length 9");
    check(scanner, member("cameraPoseARFrame", json!(vec![1; 12])), "bad_metadata", "array of length 16");
    check(scanner, member("time", json!("now")), "bad_metadata", "string");
    check(scanner, |f| set_raw(f, json, "time", "1e400"), "bad_metadata", "out of range");
    let full_size = json!([1339, 0, 960, 0, 1339, 720, 0, 0, 1]);
    check(scanner, member("intrinsics", full_size), "bad_intrinsics", "another size");
    check(scanner, member("intrinsics", json!(vec![0; 9])), "bad_intrinsics", "focal");
    check(scanner, |f| remove(f, |name| name.ends_with(".jpg")), "no_frames", "3 depth");
}

#[test]
fn arkit_scenes() {
    let scenes = writers::arkit_scenes;
    let (trajectory, pincam) = ("lowres_wide.traj", "lowres_wide_intrinsics/41069021_5000.250.pincam");
    let camera = |text: &'static str| move |f: &mut Files| set(f, pincam, text);
    check(scenes, |f| remove(f, |name| name.ends_with(".pincam")), "missing_intrinsics", ".pincam");
    check(scenes, camera("64 48 56 57 31"), "bad_intrinsics", "6 numbers");
    check(scenes, camera("64 48 56 57 31 23 1"), "bad_intrinsics", "6 numbers");
    check(scenes, camera("64 48 56 57 31 x"), "bad_intrinsics", "6 numbers");
    check(scenes, camera("0 48 56 57 31 23"), "bad_intrinsics", "width");
    check(scenes, camera("64 1e9 56 57 31 23"), "bad_intrinsics", "width");
    check(scenes, camera("64.5 48 56 57 31 23"), "bad_intrinsics", "width");
    check(scenes, camera("64 48 nan 57 31 23"), "bad_intrinsics", "focal");
    check(scenes, camera("64 48 56 1e400 31 23"), "bad_intrinsics", "focal");
    check(scenes, camera("64 48 1339 1339 960 720"), "bad_intrinsics", "another size");
    check(scenes, camera("48 64 56 57 23 31"), "color_depth_mismatch", "48x64");
    check(scenes, |f| edit_lines(f, trajectory, |_, line| Some(format!("{line} 1"))), "bad_index", "line 1");
    check(scenes, |f| set_word(f, trajectory, 1, 3, "x"), "bad_index", "line 2");
    check_without_poses(scenes, |f| set(f, trajectory, ""));
    check(scenes, |f| remove(f, |name| name == trajectory), "unknown_layout", trajectory);
}

#[test]
fn redwood() {
    let redwood = writers::redwood;
    let (log, camera) = ("scene/trajectory.log", "camera_intrinsic.json");
    let matrix = |values: serde_json::Value| {
        move |f: &mut Files| edit_json(f, camera, |file| file["intrinsic_matrix"] = values)
    };
    check_without_poses(redwood, |f| remove(f, |name| name == log));
    check(redwood, |f| set(f, log, "INFO it began\n"), "bad_index", log);
    check(redwood, |f| set(f, log, ""), "bad_index", log);
    check(redwood, |f| edit_lines(f, log, |n, line| (n != 7).then(|| line.into())), "bad_index", "line 10");
    check(redwood, |f| set_word(f, log, 6, 1, "x"), "bad_index", "line 7");
    check(redwood, |f| set_word(f, log, 5, 2, "0"), "bad_index", "from 1");
    check(redwood, |f| set_word(f, log, 5, 2, "1e99"), "bad_index", "from 1");
    check(redwood, |f| edit_lines(f, log, |n, line| (n != 5).then(|| line.into())), "bad_index", "line 6");
    let second = |f: &mut Files| {
        let copy = content(f, log).clone();
        set(f, "scene/other.log", copy);
    };
    check(redwood, second, "several_trajectories", "scene/other.log");
    check(redwood, |f| cut(f, camera, 0.5), "bad_metadata", camera);
    check(redwood, |f| drop_member(f, camera, "intrinsic_matrix"), "bad_metadata", "intrinsic_matrix");
    check(redwood, matrix(json!([1, 2])), "bad_metadata", "array of length 9");
    check(redwood, matrix(json!([0, 0, 0, 0, 0, 0, 31, 23, 1])), "bad_intrinsics", "focal");
    check(redwood, matrix(json!([1339, 0, 0, 0, 1339, 0, 960, 720, 1])), "bad_intrinsics", "another size");
    check(redwood, |f| edit_json(f, camera, |c| c["width"] = json!(0)), "color_depth_mismatch", "0x48");
    check(
        redwood,
        |f| edit_json(f, camera, |c| c["height"] = json!(1_000_000_000)),
        "color_depth_mismatch",
        "x1000000000",
    );
    check(redwood, |f| set(f, "depth/1.png", grey8(32, 24)), "duplicate_frame", "depth/1.png");
    check(redwood, |f| set(f, "b/depth/1.png", grey8(32, 24)), "several_clips", "b/");
}

#[test]
fn nerfstudio_and_nerf_capture() {
    let nerfstudio = writers::nerfstudio;
    let json = "transforms.json";
    let member = |member: &'static str, value: serde_json::Value| {
        move |f: &mut Files| edit_json(f, json, |file| file[member] = value)
    };
    check(nerfstudio, |f| cut(f, json, 0.5), "bad_metadata", json);
    check(nerfstudio, |f| set(f, json, "{}"), "bad_metadata", "frames");
    check(nerfstudio, |f| drop_member(f, json, "fl_x"), "missing_intrinsics", "fl_x");
    check(nerfstudio, |f| drop_member(f, json, "cy"), "missing_intrinsics", "cy");
    check(nerfstudio, member("fl_x", json!("56.5")), "bad_metadata", "fl_x: invalid type: string");
    check(nerfstudio, member("fl_x", json!(0)), "bad_intrinsics", "focal");
    check(nerfstudio, |f| set_raw(f, json, "fl_x", "1e400"), "bad_metadata", "out of range");
    check(nerfstudio, |f| set_raw(f, json, "cx", "Infinity"), "bad_metadata", json);
    for side in [json!(0), json!(-64), json!(1e9), json!(64.5)] {
        check(nerfstudio, member("w", side), "bad_intrinsics", "w and h");
    }
    check(nerfstudio, member("w", json!(1920)), "color_depth_mismatch", "1920x48");
    check(nerfstudio, member("cx", json!(960)), "bad_intrinsics", "another size");
    check(nerfstudio, member("frames", json!([])), "no_frames", "0 colour");
    check(nerfstudio, member("applied_scale", json!(0)), "not_metric", "applied_scale");
    for scale in [json!(1.0), json!(0), json!(-0.001), json!(1e300)] {
        check(nerfstudio, member("integer_depth_scale", scale), "not_metric", "integer_depth_scale");
    }
    let frame = |member: &'static str, value: serde_json::Value| {
        move |f: &mut Files| edit_json(f, json, |file| file["frames"][1][member] = value)
    };
    check(
        nerfstudio,
        frame("transform_matrix", json!([[1, 0], [0, 1]])),
        "bad_metadata",
        "array of length 4",
    );
    check(nerfstudio, frame("file_path", json!(7)), "bad_metadata", "frames[1].file_path: invalid type");
    let nothing_there = |f: &mut Files| {
        edit_json(f, json, |file| {
            for frame in file["frames"].as_array_mut().unwrap() {
                frame["file_path"] = json!("../../etc/passwd");
            }
        });
    };
    check(nerfstudio, nothing_there, "no_frames", "3 depth");

    // NeRFCapture's export without a network: depth goes through a picture of eight bits, and its scale is 1.
    let offline = |scale: serde_json::Value| {
        move |f: &mut Files| {
            edit_json(f, json, |file| file["depth_integer_scale"] = scale);
            for number in 0..3 {
                set(f, &format!("images/{number}.depth.png"), grey8(64, 48));
            }
        }
    };
    check(writers::nerf_capture, offline(json!(1.0)), "not_metric", "integer_depth_scale");
    let clip = as_folder(&changed(writers::nerf_capture, offline(json!(0.001))));
    let error = Clip::open(clip.path()).unwrap().load(0).err().unwrap();
    check_error(error, "depth_not_grey16", "images/0.depth.png");
}
