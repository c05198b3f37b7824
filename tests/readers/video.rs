//! Videos: every decoder returns the frames, numbers and times of ffmpeg; and refusals.

mod children;

use image::RgbImage;
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sha2::{Digest, Sha256};
use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};
use viola_formats::container::Region;
use viola_formats::video::{self, Codec, Tools, VideoError};

const FIXTURES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/video");
const VIOLA: &str = env!("CARGO_BIN_EXE_viola");

fn fixture(name: &str) -> Region {
    Region::whole(File::open(Path::new(FIXTURES).join(name)).unwrap()).unwrap()
}

/// Returns name, seconds and sum of each frame, as ffmpeg printed them for the fixtures.
fn expected() -> Vec<(String, Vec<(f64, String)>)> {
    let mut files: Vec<(String, Vec<(f64, String)>)> = Vec::new();
    for line in fs::read_to_string(Path::new(FIXTURES).join("frames.txt")).unwrap().lines() {
        let [file, _, seconds, sum] = line.split(' ').collect::<Vec<_>>()[..] else { panic!("{line}") };
        if files.last().is_none_or(|(name, _)| name != file) {
            files.push((file.to_owned(), Vec::new()));
        }
        files.last_mut().unwrap().1.push((seconds.parse().unwrap(), sum.to_owned()));
    }
    files
}

fn hex(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

fn sums(region: &Region, wanted: &[usize]) -> Vec<String> {
    let planes = video::decode_planes(region, wanted).unwrap().map(|frame| frame.unwrap());
    planes
        .zip(wanted)
        .map(|((number, planes), wanted)| {
            assert_eq!(number, *wanted);
            hex(&planes.bytes())
        })
        .collect()
}

fn pictures(region: &Region, wanted: &[usize], tools: &Tools) -> Result<Vec<RgbImage>, VideoError> {
    let frames = video::decode(region, wanted, tools)?.collect::<Result<Vec<_>, _>>()?;
    assert_eq!(frames.iter().map(|(number, _)| *number).collect::<Vec<_>>(), wanted);
    Ok(frames.into_iter().map(|(_, picture)| picture).collect())
}

fn child() -> Tools {
    Tools { viola: Some(VIOLA.into()), ..Tools::default() }
}

/// Returns the path of ffmpeg; skips with a message if it is not installed.
fn ffmpeg() -> Option<PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let found = std::env::split_paths(&path).map(|folder| folder.join("ffmpeg")).find(|file| file.is_file());
    if found.is_none() {
        viola_testing::skipped("videos beside ffmpeg", "install ffmpeg");
    }
    found
}

#[test]
fn frames_and_times_are_ffmpegs() {
    let files = expected();
    assert_eq!(files.len(), 14);
    for (name, frames) in files {
        let region = fixture(&name);
        let info = video::inspect(&region).unwrap();
        assert_eq!(info.time_s.len(), frames.len(), "{name}");
        for (number, (ours, (theirs, _))) in info.time_s.iter().zip(&frames).enumerate() {
            // ffmpeg's are written with six digits.
            assert!(
                (ours - theirs).abs() < 1e-6,
                "{name}, frame {number}: {ours} s, and {theirs} s by ffmpeg"
            );
        }
        let all: Vec<usize> = (0..frames.len()).collect();
        let theirs: Vec<String> = frames.into_iter().map(|(_, sum)| sum).collect();
        assert_eq!(sums(&region, &all), theirs, "{name}");
    }
}

#[test]
fn tables_are_understood() {
    let check = |name: &str, codec: Codec, size: (u32, u32), rotation_deg: u16| {
        let info = video::inspect(&fixture(name)).unwrap();
        assert_eq!(
            (info.codec, (info.width, info.height), info.rotation_deg),
            (codec, size, rotation_deg),
            "{name}"
        );
    };
    check("h264_b.mp4", Codec::H264, (160, 120), 0);
    check("hevc_b.mov", Codec::Hevc, (160, 120), 0);
    check("hevc_10.mp4", Codec::Hevc, (160, 120), 0);
    check("bt709.mov", Codec::H264, (154, 118), 0);
    check("rotated.mp4", Codec::H264, (160, 120), 90);
    check("hevc_rotated.mp4", Codec::Hevc, (160, 120), 90);
    check("hevc_upright.mp4", Codec::Hevc, (120, 160), 0);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..ProptestConfig::default() })]

    /// A frame does not depend on the other wanted frames.
    #[test]
    fn any_subset_gives_the_same_frames(file in 0usize..14, chosen in prop::collection::vec(any::<bool>(), 30)) {
        let (name, frames) = &expected()[file];
        let wanted: Vec<usize> = (0..frames.len()).filter(|number| chosen[*number]).collect();
        let theirs: Vec<String> = wanted.iter().map(|number| frames[*number].1.clone()).collect();
        prop_assert_eq!(sums(&fixture(name), &wanted), theirs, "{} {:?}", name, wanted);
    }
}

#[test]
fn single_frames_are_the_same_frames() {
    for (name, frames) in expected() {
        for (number, (_, sum)) in frames.iter().enumerate() {
            assert_eq!(&sums(&fixture(&name), &[number])[0], sum, "{name}, frame {number}");
        }
    }
}

#[test]
fn every_way_of_decoding_gives_the_same_pixels() {
    let mut ways = vec![("viola", child())];
    if let Some(ffmpeg) = ffmpeg() {
        ways.push(("ffmpeg", Tools { ffmpeg: Some(ffmpeg), ..Tools::default() }));
    }
    for (name, frames) in expected() {
        let most: Vec<usize> = (0..frames.len()).filter(|number| number % 7 != 3).collect();
        let some: Vec<usize> = (0..frames.len()).step_by(2).collect();
        for wanted in [most, some] {
            let inside = pictures(&fixture(&name), &wanted, &Tools::default()).unwrap();
            for (way, tools) in &ways {
                assert!(pictures(&fixture(&name), &wanted, tools).unwrap() == inside, "{name} by {way}");
            }
        }
    }
}

/// Every decoder decodes a part of a larger file in place, without reading beyond it or moving the handle.
#[test]
fn a_video_inside_of_a_file_is_decoded_in_place() {
    let bytes = fs::read(Path::new(FIXTURES).join("hevc_b.mp4")).unwrap();
    let mut file = tempfile::tempfile().unwrap();
    file.write_all(&[&[7; 1234][..], &bytes, &[9; 99]].concat()).unwrap();
    let region = Region::whole(file).unwrap().part(1234, bytes.len() as u64).unwrap();
    let whole = pictures(&fixture("hevc_b.mp4"), &[3, 17], &Tools::default()).unwrap();
    let tools = [Tools::default(), child(), Tools { ffmpeg: ffmpeg(), ..child() }];
    for tools in tools {
        assert!(pictures(&region, &[3, 17], &tools).unwrap() == whole, "{tools:?}");
    }
}

/// Colours of BT.709 in full range by the formulas of ITU-T H.273, from the planes.
#[test]
fn colours_are_those_the_stream_says() {
    let region = fixture("bt709.mov");
    let rgb = pictures(&region, &[4], &Tools::default()).unwrap().remove(0);
    let (_, planes) = video::decode_planes(&region, &[4]).unwrap().next().unwrap().unwrap();
    let video::Samples::Bytes([luma, blue, red]) = &planes.samples else { panic!("eight bits") };
    for (x, y, pixel) in rgb.enumerate_pixels() {
        let luma = f64::from(luma[(y * 154 + x) as usize]);
        let at = (y / 2 * 77 + x / 2) as usize;
        let (blue, red) = (f64::from(blue[at]) - 128.0, f64::from(red[at]) - 128.0);
        let exact = [luma + 1.5748 * red, luma - 0.18733 * blue - 0.46813 * red, luma + 1.85560 * blue];
        for (ours, exact) in pixel.0.iter().zip(exact) {
            assert!(
                (f64::from(*ours) - exact.clamp(0.0, 255.0)).abs() < 0.6,
                "({x}, {y}): {ours}, not {exact}"
            );
        }
    }
}

#[test]
fn what_is_not_read_is_refused_by_name() {
    let check = |name: &str, code: &str| {
        let refused = video::inspect(&fixture(name)).unwrap_err();
        assert_eq!(refused.code(), code, "{name}: {refused}");
    };
    check("fragmented.mp4", "video_fragmented");
    check("interlaced.mp4", "video_unsupported");
    check("chroma_422.mp4", "video_unsupported");
    check("mpeg4.mp4", "video_codec");
    check("make.sh", "not_video");
    let wanted =
        |wanted: &[usize]| video::decode(&fixture("h264_b.mp4"), wanted, &Tools::default()).map(|_| ());
    assert_eq!(wanted(&[30]).unwrap_err().code(), "no_such_frame");
    assert_eq!(wanted(&[4, 3]).unwrap_err().code(), "frames_not_ascending");
    assert_eq!(wanted(&[4, 4]).unwrap_err().code(), "frames_not_ascending");
    assert!(wanted(&[]).is_ok());
}

fn region_of(bytes: &[u8]) -> Region {
    let mut file = tempfile::tempfile().unwrap();
    file.write_all(bytes).unwrap();
    Region::whole(file).unwrap()
}

/// Returns a file with `value` in box `kind` at offset `at` after its four letters.
fn patched(name: &str, kind: &[u8; 4], at: usize, value: &[u8]) -> Region {
    let mut bytes = fs::read(Path::new(FIXTURES).join(name)).unwrap();
    let found = bytes.windows(4).position(|four| four == kind).unwrap();
    bytes[found + 4 + at..][..value.len()].copy_from_slice(value);
    region_of(&bytes)
}

#[test]
fn damaged_tables_are_refused() {
    const MANY: [u8; 4] = u32::MAX.to_be_bytes();
    let check = |what: &str, region: &Region, code: &str| {
        let refused = video::inspect(region).unwrap_err();
        assert_eq!(refused.code(), code, "{what}: {refused}");
    };
    // The tables come last in these files.
    let bytes = fs::read(Path::new(FIXTURES).join("h264_b.mp4")).unwrap();
    check("cut within the tables", &region_of(&bytes[..bytes.len() - 100]), "video_truncated");
    check("cut before the tables", &region_of(&bytes[..9000]), "video_truncated");
    check("empty", &region_of(&[]), "not_video");
    check(
        "a large table",
        &{
            let file = tempfile::tempfile().unwrap();
            file.set_len(50 << 20).unwrap();
            (&file).write_all(b"\x03\x00\x00\x00moov").unwrap();
            Region::whole(file).unwrap()
        },
        "video_too_large",
    );
    check("more samples than bytes", &patched("h264_b.mp4", b"stsz", 8, &[0, 0, 1, 0]), "bad_video");
    check("a billion samples", &patched("h264_b.mp4", b"stsz", 8, &MANY), "too_many_frames");
    check("a sample without bytes", &patched("h264_b.mp4", b"stsz", 12, &[0; 4]), "bad_video");
    check("a large sample", &patched("h264_b.mp4", b"stsz", 12, &MANY), "video_too_large");
    check("samples outside", &patched("h264_b.mp4", b"stco", 8, &MANY), "video_truncated");
    check("chunks that are not there", &patched("h264_b.mp4", b"stco", 4, &MANY), "bad_video");
    check("chunks without samples", &patched("h264_b.mp4", b"stsc", 12, &[0; 4]), "bad_video");
    check("another description", &patched("h264_b.mp4", b"stsc", 16, &[0, 0, 0, 2]), "video_changes");
    check("fewer times than samples", &patched("h264_b.mp4", b"stts", 8, &[0, 0, 0, 3]), "bad_video");
    check("no clock", &patched("h264_b.mp4", b"mdhd", 12, &[0; 4]), "bad_video");
    check("a sync sample outside", &patched("h264_b.mp4", b"stss", 8, &MANY), "bad_video");
    check("no video", &patched("h264_b.mp4", b"hdlr", 8, b"soun"), "no_video_track");
    check("encrypted", &patched("h264_b.mp4", b"stsd", 12, b"encv"), "video_encrypted");
    check("another speed", &patched("h264_b.mp4", b"elst", 16, &[0, 2]), "video_edit_list");
    check("broken parameters", &patched("hevc_b.mp4", b"hvcC", 30, &[0xff; 60]), "bad_video");
    check("a box larger than its parent", &patched("h264_b.mp4", b"minf", 0, &MANY), "bad_video");
    let refused = video::inspect(&absurd()).unwrap_err();
    assert!(matches!(refused, VideoError::Size { .. }), "{refused}");
}

/// Returns a video whose parameter set declares a picture 16 382 wide and 0 high instead of 160 by 120.
fn absurd() -> Region {
    let mut bytes = fs::read(Path::new(FIXTURES).join("hevc_b.mp4")).unwrap();
    let hvcc = bytes.windows(4).position(|four| four == b"hvcC").unwrap();
    // The array of the one sequence parameter set: its kind, a count of one, its length, and its own head.
    let set = hvcc
        + bytes[hvcc..].windows(3).position(|three| three[0] & 63 == 33 && three[1..] == [0, 1]).unwrap()
        + 3;
    let length = usize::from(u16::from_be_bytes([bytes[set], bytes[set + 1]]));
    let payload = &mut bytes[set + 2..][..length];
    // Twelve bytes of profile follow two of head and one of layers. Escapes lie in between, so this searches:
    // an id of 0 (1), chroma format 1 (010), and 160 (15 bits of Exp-Golomb 000000010100001).
    let bits: String = payload.iter().map(|byte| format!("{byte:08b}")).collect();
    let at = bits.find(concat!("1", "010", "000000010100001")).unwrap() + 4;
    // In the 28 bits of both: 16 382 (27 bits), and nothing (one bit).
    let changed = format!("{}{}{}1{}", &bits[..at], "0".repeat(13), "1".repeat(14), &bits[at + 28..]);
    for (byte, bits) in payload.iter_mut().zip(changed.as_bytes().chunks(8)) {
        *byte = u8::from_str_radix(std::str::from_utf8(bits).unwrap(), 2).unwrap();
    }
    region_of(&bytes)
}

/// Any changed bytes give an answer or a refusal, never a panic, and always end.
#[test]
fn random_damage_ends() {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    for name in ["h264_b.mp4", "h264_open.mp4", "hevc_b.mp4", "hevc_10.mp4"] {
        let sound = fs::read(Path::new(FIXTURES).join(name)).unwrap();
        let mut decoded = 0;
        for round in 0..60 {
            let mut bytes = sound.clone();
            for _ in 0..1 << (round % 6) {
                let at = rng.random_range(0..bytes.len());
                bytes[at] = rng.random();
            }
            let region = region_of(&bytes);
            let Ok(info) = video::inspect(&region) else { continue };
            let all: Vec<usize> = (0..info.time_s.len()).collect();
            let Ok(frames) = video::decode(&region, &all, &Tools::default()) else { continue };
            decoded += frames.filter(Result::is_ok).count();
        }
        assert!(decoded > 100, "{name}: damage was hit so hard that nothing was tested");
    }
}
