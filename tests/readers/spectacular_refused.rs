//! Spectacular AI's recordings, damaged.

use crate::edits::*;
use crate::export_writers as writers;
use crate::refusals::{check, check_without_poses};
use crate::writers::Files;

#[test]
fn spectacular_ai() {
    let spectacular = writers::spectacular;
    let lines = "data.jsonl";
    let replaced = |from: &'static str, to: &'static str| {
        move |f: &mut Files| edit_lines(f, lines, |_, line| Some(line.replace(from, to)))
    };
    check(spectacular, |f| cut(f, lines, 0.99), "bad_index", "line");
    check(spectacular, |f| set(f, lines, " ".repeat(70_000)), "bad_index", "at most");
    check(
        spectacular,
        replaced("\"number\":1", "\"number\":-1"),
        "bad_index",
        "number: invalid value: integer `-1`",
    );
    check(spectacular, replaced("0.001", "1.0"), "not_metric", "depthScale");
    check(spectacular, replaced("0.001", "1e400"), "bad_index", "out of range");
    check(
        spectacular,
        replaced("cameraParameters", "otherParameters"),
        "missing_intrinsics",
        "cameraParameters",
    );
    check(
        spectacular,
        replaced("\"focalLengthX\":", "\"focalLengthX\":0,\"was\":"),
        "bad_intrinsics",
        "focal",
    );
    check_without_poses(spectacular, replaced("orientation", "direction"));
    check(spectacular, |f| set(f, "calibration.json", "{}"), "bad_metadata", "cameras");
    check(spectacular, |f| remove(f, |name| name.starts_with("frames/")), "no_frames", "3 depth");
    check(spectacular, |f| remove(f, |name| name.starts_with("frames2/")), "no_frames", "3 colour");
    let video = |f: &mut Files| {
        remove(f, |name| name.starts_with("frames2/"));
        set(f, "data2.mkv", "a video");
    };
    check(spectacular, video, "depth_video", "data2.mkv");
}
