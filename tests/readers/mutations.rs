//! Valid small files with random damage: a reader may accept or refuse them, but it neither panics nor takes
//! much time or memory.

use crate::archives::{archives, gzip, zstd};
use crate::drawing::{text, valetudo};
use crate::exports::EXPORTS;
use crate::memory::peak_bytes;
use crate::recording::Recording;
use crate::robot_files::{dreame, dreame_inflated, viomi_inflated, zlib};
use crate::writers::*;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::sync::LazyLock;
use std::time::{Duration, Instant};
use viola_formats::clip::Clip;
use viola_formats::container;
use viola_formats::lidar::LidarMap;

const MAX_BYTES: usize = 48 << 20;
const MAX_TIME: Duration = Duration::from_secs(5);

/// Changes a few places of `bytes`: bits, whole bytes, numbers; or cuts, repeats or drops a part.
fn damage(bytes: &[u8], random: &mut ChaCha8Rng) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..random.random_range(1..4) {
        if bytes.is_empty() {
            break;
        }
        let at = random.random_range(0..bytes.len());
        let until = random.random_range(at..=bytes.len().min(at + 64));
        match random.random_range(0..7) {
            0 => bytes[at] ^= 1 << random.random_range(0..8),
            1 => bytes[at] = random.next_u32() as u8,
            2 => bytes[at..until].fill(0xff),
            3 => bytes[at] = b"0123456789-e.[]{},\n"[random.random_range(0..19)],
            4 => bytes.truncate(at),
            5 => drop(bytes.drain(at..until)),
            _ => {
                let part = bytes[at..until].to_vec();
                bytes.splice(at..at, part);
            }
        }
    }
    bytes
}

static ALONE: LazyLock<rayon::ThreadPool> =
    LazyLock::new(|| rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap());

fn check_bounded(what: &str, work: impl FnOnce() + Send) {
    let start = Instant::now();
    // A pool's threads decode pictures, but only one thread's memory is counted: this pool has only one.
    let ((), peak) = ALONE.install(|| peak_bytes(work));
    assert!(peak < MAX_BYTES, "{what}: {peak} bytes at once");
    assert!(start.elapsed() < MAX_TIME, "{what}: {:?}", start.elapsed());
}

fn read_clip(path: &std::path::Path) {
    let Ok(clip) = Clip::open(path) else { return };
    for (index, header) in clip.frames().iter().enumerate() {
        if let Some(pose) = header.world_from_camera {
            assert!(pose.to_homogeneous().iter().all(|v| v.is_finite()));
        }
        if let Ok(frame) = clip.load(index) {
            assert!(frame.depth.depth_m.iter().all(|d| d.is_finite() && *d >= 0.0));
            assert!(frame.color_camera.is_plausible() && frame.depth_camera.is_plausible());
        }
    }
}

/// Damages the zip of a clip as a whole, and one file of its folder at a time.
fn check_damaged(layout: &str, files: &Files, random: &mut ChaCha8Rng) {
    let zip = zip_bytes(files);
    for round in 0..150 {
        let file = as_file(&damage(&zip, random));
        check_bounded(&format!("{layout}, zip {round}"), || read_clip(file.path()));
    }
    let folder = as_folder(files);
    for round in 0..300 {
        let (name, bytes) = &files[random.random_range(0..files.len())];
        write(&folder.path().join(name), &damage(bytes, random));
        check_bounded(&format!("{layout}, folder {round}, {name}"), || read_clip(folder.path()));
        write(&folder.path().join(name), bytes);
    }
}

#[test]
fn damaged_clips_end_quickly() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let numbers = [0, 1, 2];
    check_damaged("scannet", &scannet("s/", &numbers), &mut random);
    check_damaged("seven_scenes", &seven_scenes("", &numbers), &mut random);
    check_damaged("tum", &tum("", &numbers), &mut random);
}

#[test]
fn damaged_exports_end_quickly() {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    for (layout, write, _) in EXPORTS {
        check_damaged(layout, &write("a/", &Recording::small(3)), &mut random);
    }
    let mut old = crate::export_writers::stray("", &Recording::small(3));
    crate::exports_tolerated::depth_as_npy(&mut old, "<u2", "False", "(24, 32)");
    check_damaged("stray_scanner, npy", &old, &mut random);
}

/// Checks that every readable file is the same in whole and in part.
fn read_archive(path: &std::path::Path) {
    let Ok(archive) = container::open(path) else { return };
    for name in archive.names() {
        // A stored entry's checksum is checked only if it is read whole, and a damaged one is refused.
        if let Ok(whole) = archive.read(name, 1 << 20) {
            let region = archive.region(name, 1 << 20).unwrap_or_else(|error| panic!("{name}: {error}"));
            let mut part = vec![0; whole.len()];
            region.read_exact_at(0, &mut part).unwrap();
            assert!(part == whole, "{name}");
        }
    }
}

#[test]
fn damaged_archives_end_quickly() {
    let mut random = ChaCha8Rng::seed_from_u64(4);
    let files = [("a/b.txt".to_owned(), b"some text".repeat(90)), ("c.bin".to_owned(), vec![7; 3000])];
    for (what, bytes) in archives(&files) {
        for round in 0..600 {
            let damaged = damage(&bytes, &mut random);
            check_bounded(&format!("{what} {round}"), || read_archive(as_file(&damaged).path()));
            // Compression hides damage of the content.
            if what == "tar" || what == "tar, pax" {
                for packed in [gzip(&damaged), zstd(&damaged)] {
                    check_bounded(&format!("{what}, packed, {round}"), || {
                        read_archive(as_file(&packed).path())
                    });
                }
            }
        }
    }
}

/// A checksum of the compression hides later damage; here the content is damaged before it is compressed.
#[test]
fn maps_damaged_before_they_were_compressed_end_quickly() {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    type Wrap = fn(&[u8]) -> Vec<u8>;
    let inner: [(&str, Vec<u8>, Wrap); 3] = [
        ("dreame", dreame_inflated(b'I'), dreame),
        ("viomi", viomi_inflated(77), zlib),
        ("valetudo", text(&valetudo(true, true)), zlib),
    ];
    for (name, bytes, pack) in inner {
        for round in 0..1500 {
            let damaged = pack(&damage(&bytes, &mut random));
            check_bounded(&format!("{name} {round}"), || {
                let Ok(map) = LidarMap::read(&damaged) else { return };
                assert!(map.charger.is_none_or(|pose| pose.is_finite()), "{name} {round}");
                let marks = &map.info.marks;
                assert!(marks.zones.iter().flat_map(|z| &z.outline_m).flatten().all(|v| v.is_finite()));
            });
        }
    }
}

#[test]
fn damaged_maps_end_quickly() {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    for (name, bytes) in crate::drawing::one_of_each_format() {
        assert!(LidarMap::read(&bytes).is_ok(), "{name}");
        for round in 0..600 {
            let damaged = damage(&bytes, &mut random);
            check_bounded(&format!("{name} {round}"), || {
                let Ok(map) = LidarMap::read(&damaged) else { return };
                assert!(map.occupied_m.iter().all(|p| p.x.is_finite() && p.y.is_finite()), "{name} {round}");
                assert!(map.info.occupied_points > 0 && map.info.min_m[0] <= map.info.max_m[0]);
            });
        }
    }
}
