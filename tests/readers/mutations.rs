//! Valid small files with random damage: a reader may refuse them or not, but it neither panics nor takes
//! much time or memory.

use crate::drawing::{text, valetudo};
use crate::memory::peak_bytes;
use crate::robot_files::{dreame, dreame_inflated, viomi_inflated, zlib};
use crate::writers::*;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::time::{Duration, Instant};
use viola::clip::Clip;
use viola::lidar::LidarMap;

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

fn check_bounded(what: &str, work: impl FnOnce()) {
    let start = Instant::now();
    let ((), peak) = peak_bytes(work);
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

#[test]
fn damaged_clips_end_quickly() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    for files in [scannet("s/", &[0, 1, 2]), seven_scenes("", &[0, 1, 2]), tum("", &[0, 1, 2])] {
        let zip = zip_bytes(&files);
        for round in 0..300 {
            let file = as_file(&damage(&zip, &mut random));
            check_bounded(&format!("zip {round}"), || read_clip(file.path()));
        }
        let folder = as_folder(&files);
        for round in 0..300 {
            let (name, bytes) = &files[random.random_range(0..files.len())];
            write(&folder.path().join(name), &damage(bytes, &mut random));
            check_bounded(&format!("folder {round}, {name}"), || read_clip(folder.path()));
            write(&folder.path().join(name), bytes);
        }
    }
}

/// Compression hides damage behind its checksum; here what was compressed is damaged before.
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
