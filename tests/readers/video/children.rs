//! Decoding processes that fail, stall or lie, and harm nothing else.

use super::{FIXTURES, child, ffmpeg, fixture, pictures, region_of};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::time::Duration;
use tempfile::TempDir;
use viola_formats::video::{self, Limits, Tools};

/// Writes a program that replaces the child.
fn script(folder: &TempDir, lines: &str) -> PathBuf {
    let path = folder.path().join("child");
    fs::write(&path, format!("#!/bin/sh\n{lines}\n")).unwrap();
    fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
    path
}

#[test]
fn a_child_that_fails_is_a_refusal_and_hurts_nothing_else() {
    let region = fixture("h264_b.mp4");
    let check = |lines: &str, code: &str| {
        let folder = tempfile::tempdir().unwrap();
        let limits = Limits { silence: Duration::from_millis(300), ..Limits::default() };
        let tools = Tools { viola: Some(script(&folder, lines)), limits, ..Tools::default() };
        let mut frames = video::decode(&region, &[0, 5], &tools).unwrap();
        let refused = frames.find_map(Result::err).unwrap();
        assert_eq!(refused.code(), code, "{lines}: {refused}");
        assert!(frames.next().is_none(), "{lines}: there is more after an error");
    };
    let frame =
        |size: &str| format!("printf 'viola v1F\\0\\0\\0\\0{size}'; head -c 57600 /dev/zero; printf D");
    check("kill -9 $$", "video_child_ended");
    check("exit 3", "video_child_ended");
    check("printf 'viola v1..'; kill -9 $$", "video_child_ended");
    check("exec /usr/bin/tail -f /dev/null", "video_child_silent");
    check("exec /bin/cat /dev/zero", "video_child_lied");
    check("printf 'viola v1'; exec /bin/cat /dev/zero", "video_child_lied");
    check("printf 'viola v1'; exec /usr/bin/yes .", "video_child_lied");
    check("printf 'viola v1'; while :; do printf ...; done", "video_child_lied");
    check(&frame("\\377\\377\\377\\377\\170\\0\\0\\0"), "video_child_lied");
    check(&frame("\\240\\0\\0\\0\\170\\0\\0\\0"), "video_child_lied");
    check("printf 'viola v1E\\003\\0sad'", "video_damaged");
    let none = Tools { viola: Some("/there/is/none".into()), ..Tools::default() };
    assert_eq!(video::decode(&region, &[0], &none).err().unwrap().code(), "video_child_start");
    assert_eq!(pictures(&region, &[0, 5], &child()).unwrap().len(), 2);
}

#[test]
fn a_child_has_its_limits_before_it_does_anything() {
    let folder = tempfile::tempdir().unwrap();
    let told = folder.path().join("told");
    let tools = Tools {
        viola: Some(script(&folder, &format!("{{ ulimit -v; ulimit -t; ulimit -c; }} > {}", told.display()))),
        ..Tools::default()
    };
    assert!(pictures(&fixture("h264_b.mp4"), &[0], &tools).is_err());
    // Kilobytes, seconds with half a second for each of 30 samples, blocks.
    assert_eq!(fs::read_to_string(told).unwrap(), "1572864\n75\n0\n");
}

/// The real child with about a thousandth of its memory limit.
#[test]
fn a_child_without_memory_is_a_refusal() {
    let tools = Tools { limits: Limits { memory_bytes: 2 << 20, ..Limits::default() }, ..child() };
    let refused = pictures(&fixture("hevc_b.mp4"), &[20], &tools).map(|_| ()).unwrap_err();
    assert!(refused.code().starts_with("video_child"), "{refused}");
}

/// The parent passes on a refusal of the child, in its words.
#[test]
fn a_hostile_file_is_refused_through_the_child() {
    let mut bytes = fs::read(Path::new(FIXTURES).join("hevc_b.mp4")).unwrap();
    // The pictures lie between the head and the tables: they become noise, the tables stay valid.
    let media = bytes.windows(4).position(|four| four == b"mdat").unwrap() + 4;
    let tables = bytes.windows(4).position(|four| four == b"moov").unwrap() - 4;
    ChaCha8Rng::seed_from_u64(3).fill_bytes(&mut bytes[media..tables]);
    let region = region_of(&bytes);
    let mut tools = vec![Tools::default(), child()];
    tools.extend(ffmpeg().map(|ffmpeg| Tools { ffmpeg: Some(ffmpeg), ..child() }));
    for tools in tools {
        let refused = pictures(&region, &[0, 20], &tools).map(|_| ()).unwrap_err();
        assert_eq!(refused.code(), "video_damaged", "{tools:?}: {refused}");
    }
}

#[test]
fn dropping_the_frames_ends_the_child() {
    let folder = tempfile::tempdir().unwrap();
    let told = folder.path().join("pid");
    let lines = format!("echo $$ > {}; printf 'viola v1.'; exec /usr/bin/tail -f /dev/null", told.display());
    let limits = Limits { silence: Duration::from_millis(300), ..Limits::default() };
    let tools = Tools { viola: Some(script(&folder, &lines)), limits, ..Tools::default() };
    let mut frames = video::decode(&fixture("h264_b.mp4"), &[0], &tools).unwrap();
    assert_eq!(frames.next().unwrap().unwrap_err().code(), "video_child_silent");
    drop(frames);
    let process: i32 = fs::read_to_string(told).unwrap().trim().parse().unwrap();
    let process = rustix::process::Pid::from_raw(process).unwrap();
    assert_eq!(rustix::process::test_kill_process(process), Err(rustix::io::Errno::SRCH), "it lives on");
}

/// If ffmpeg fails, before the first frame or after some, the other decoder returns the missing frames.
#[test]
fn where_ffmpeg_fails_the_other_decoder_goes_on() {
    let region = fixture("h264_b.mp4");
    let wanted = [0, 1, 9, 28];
    let whole = pictures(&region, &wanted, &Tools::default()).unwrap();
    let mut ways = vec!["exit 1".to_owned(), "exec /bin/cat /dev/zero".to_owned(), "kill -9 $$".to_owned()];
    // Five pictures of 28 806 bytes and a head.
    ways.extend(ffmpeg().map(|ffmpeg| format!("{} \"$@\" | /usr/bin/head -c 150000", ffmpeg.display())));
    for lines in ways {
        let folder = tempfile::tempdir().unwrap();
        for mut tools in [Tools::default(), child()] {
            tools.ffmpeg = Some(script(&folder, &lines));
            assert!(pictures(&region, &wanted, &tools).unwrap() == whole, "{lines}");
        }
    }
}

/// The decoder makes no system call for the network, and opens no file besides its video.
#[cfg(target_os = "linux")]
#[test]
fn a_decoder_is_confined_by_two_filters() {
    use std::process::{Command, Stdio};
    let folder = tempfile::tempdir().unwrap();
    let told = folder.path().join("told");
    let lines = format!(
        "{{ while read -r line; do echo \"$line\"; done < /proc/self/status; }} > {}",
        told.display()
    );
    let tools = Tools { viola: Some(script(&folder, &lines)), ..Tools::default() };
    assert!(pictures(&fixture("h264_b.mp4"), &[0], &tools).is_err());
    let status = fs::read_to_string(&told).unwrap();
    assert!(status.contains("Seccomp:\t2") && status.contains("NoNewPrivs:\t1"), "{status}");

    // The real decoder adds its own filter. It waits at its second frame, since nobody reads.
    let video = Path::new(FIXTURES).join("h264_b.mp4");
    let bytes = fs::metadata(&video).unwrap().len().to_string();
    let mut decoder = Command::new(super::VIOLA);
    decoder.args(["decode-video", "--offset", "0", "--bytes", &bytes, "--frames", "0-20"]);
    let mut decoder = decoder.stdin(fs::File::open(&video).unwrap()).stdout(Stdio::piped()).spawn().unwrap();
    let status = Path::new("/proc").join(decoder.id().to_string()).join("status");
    let is_confined = || fs::read_to_string(&status).unwrap().contains("Seccomp:\t2");
    let until = std::time::Instant::now() + Duration::from_secs(30);
    while !is_confined() && std::time::Instant::now() < until {
        std::thread::yield_now();
    }
    assert!(is_confined());
    decoder.kill().unwrap();
    decoder.wait().unwrap();
}
