use super::super::members::{Extent, PlacedBy};
use super::*;
use crate::carved::{BLOCK_CELLS, cell_of};
use proptest::prelude::*;
use std::collections::BTreeMap;
use viola_geometry::LevelName;
use viola_geometry::taxonomy::Class;
use viola_reconstruct::Label;

fn clip(number: usize, recorded_at_ms: Option<i64>) -> PlacedClip {
    PlacedClip {
        clip: Uuid::from_u128(number as u128),
        contribution: format!("contribution of {number}"),
        recorded_at_ms,
        by: PlacedBy::Alignment,
        probability: None,
        level: LevelName::MAIN,
        alone: Pose2::IDENTITY,
        rise_m: 0.0,
        map_from_clip: Pose2::new(0.125 * number as f64, 0.0, 0.0),
        floor_correction: FloorCorrection::default(),
        with: Vec::new(),
        extent: Extent { min_m: [0.0; 2], max_m: [1.0; 2] },
        tiles: Vec::new(),
        points: 0,
    }
}

/// Points in a row, from voxel `from` on, and the space of two blocks at `carved`.
fn part(from: i32, count: i32, carved: Option<i32>) -> Part {
    let point = |x: i32| CloudPoint {
        position_m: [(f64::from(x) + 0.4) * MAP_VOXEL_M, 0.01, 0.01].map(|c| c as f32),
        normal: [0.0, 0.0, 1.0],
        color: [x as u8, 2, 3],
        label: Label::new(Class::ALL[x.rem_euclid(7) as usize], 0.6, (x % 3) as u16),
        weight: (20 + x) as u16,
    };
    let carved = carved.map(|block| CarvedSpace::of_blocks(&[[block, 0, 0], [block, 0, 1]]));
    Part { points: (from..from + count).map(point).collect(), carved: carved.unwrap_or_default() }
}

/// Two clips of one time, and one without.
fn clips() -> Vec<(PlacedClip, Part)> {
    let times = [None, Some(1_000), Some(2_000), Some(2_000), Some(3_000), Some(4_000)];
    let parts = [
        part(0, 40, None),
        part(5, 40, Some(3)),
        part(10, 30, Some(0)),
        part(8, 50, Some(1)),
        part(20, 5, None),
        part(0, 12, Some(2)),
    ];
    let clips = times.into_iter().enumerate().map(|(number, time)| clip(number, time));
    clips.zip(parts).collect()
}

fn folded(mut fold: Fold, clips: &[(PlacedClip, Part)]) -> Fold {
    let count = fold.len();
    clips[count..].iter().for_each(|(clip, part)| fold.add(part, clip));
    fold
}

fn listed(clips: &[(PlacedClip, Part)]) -> Vec<(usize, &PlacedClip)> {
    // Numbers in the map have gaps: not all clips touch the tile.
    clips.iter().enumerate().map(|(at, (clip, _))| (3 * at + 1, clip)).collect()
}

/// The sums of the first clips, out of a file, with the others are those of all clips.
#[test]
fn kept_sums_are_those_of_all_clips() {
    let clips = clips();
    let all = folded(Fold::new(), &clips).finish(&listed(&clips));
    assert!(all.0.as_ref().is_some_and(|tile| tile.points.len() > 20 && tile.clips.len() > 1));
    for count in 0..=clips.len() {
        let first = folded(Fold::new(), &clips[..count]);
        let bytes = first.to_bytes();
        let read = Fold::read(&bytes, &listed(&clips)).unwrap();
        assert_eq!((read.len(), read.to_bytes()), (count, bytes));
        assert!(folded(read, &clips).finish(&listed(&clips)) == all, "{count}");
    }
}

/// The expected map by a plain loop: a point stays if no clip of a later time looked through it. A block is 16 voxels.
#[test]
fn later_clips_remove_what_they_looked_through() {
    let clips = clips();
    let side = BLOCK_CELLS * CELL_VOXELS;
    let mut weights: BTreeMap<i32, i64> = BTreeMap::new();
    for (at, (clip, part)) in clips.iter().enumerate() {
        for point in &part.points {
            let x = (f64::from(point.position_m[0]) / MAP_VOXEL_M) as i32;
            let is_gone = clips[at + 1..].iter().any(|(later, looked)| {
                let is_later = clip.recorded_at_ms.is_some() && later.recorded_at_ms > clip.recorded_at_ms;
                is_later && looked.carved.contains_cell(cell_of(point.position_m.map(f64::from)))
            });
            *weights.entry(x).or_default() += if is_gone { 0 } else { i64::from(point.weight) };
        }
    }
    assert!(weights.len() > 2 * side as usize);
    let (tile, looked) = folded(Fold::new(), &clips).finish(&listed(&clips));
    let tile = tile.unwrap();
    let found: BTreeMap<i32, i64> = tile
        .points
        .iter()
        .map(|point| ((f64::from(point.point.position_m[0]) / MAP_VOXEL_M) as i32, point.point.weight.into()))
        .collect();
    weights.retain(|_, weight| *weight >= 16);
    assert_eq!(found, weights);
    // The first block was looked through by the third clip only.
    assert_eq!((looked.at([0, 0, 0]), looked.at([0, 0, 9])), ([7, 7], [7, 7]));
    assert_eq!(looked.at([9, 0, 0]), [10, 10]);
}

#[test]
fn sums_of_other_clips_are_refused() {
    let clips = clips();
    let bytes = folded(Fold::new(), &clips[..4]).to_bytes();
    assert!(Fold::read(&bytes, &listed(&clips[..3])).is_err());
    assert!(Fold::read(&bytes, &listed(&clips[1..])).is_err());
    for change in [
        |clip: &mut PlacedClip| clip.contribution.push('x'),
        |clip: &mut PlacedClip| clip.map_from_clip.x_m += 0.001,
        |clip: &mut PlacedClip| clip.floor_correction.tilt_rad[1] = 1e-3,
        |clip: &mut PlacedClip| clip.recorded_at_ms = Some(7),
    ] {
        let mut others = self::clips();
        change(&mut others[3].0);
        assert!(Fold::read(&bytes, &listed(&others)).is_err());
    }
}

#[test]
fn a_flipped_bit_is_refused() {
    let clips = clips();
    let good = folded(Fold::new(), &clips).to_bytes();
    assert!(Fold::read(&good, &listed(&clips)).is_ok());
    for at in 0..good.len() {
        let mut bytes = good.clone();
        bytes[at] ^= 1 << (at % 8);
        assert!(Fold::read(&bytes, &listed(&clips)).is_err(), "byte {at}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    /// Other bytes with their checksum are read or refused without a panic.
    #[test]
    fn other_bytes_are_read_or_refused(at in any::<prop::sample::Index>(), byte in any::<u8>(), cut in any::<bool>()) {
        let clips = clips();
        let mut bytes = folded(Fold::new(), &clips).to_bytes();
        bytes.truncate(bytes.len() - CHECKSUM_BYTES);
        let at = at.index(bytes.len());
        let sealed = |bytes: &[u8]| [bytes, checksum(bytes).as_slice()].concat();
        if cut {
            prop_assert!(Fold::read(&bytes[..at], &listed(&clips)).is_err());
            prop_assert!(Fold::read(&sealed(&bytes[..at]), &listed(&clips)).is_err());
        } else {
            bytes[at] ^= byte;
            let _ = Fold::read(&sealed(&bytes), &listed(&clips));
        }
    }
}
