//! A home of more clips than the first block has: sums of tiles are kept from merge to merge.

use super::seen::{point, seen};
use super::*;
use std::collections::BTreeSet;
use viola_geometry::Vector3;

/// A corner of two walls with a pillar, seen by a clip at `map_from_clip`.
fn corner(map_from_clip: &Pose2) -> ClipContribution {
    let mut points = Vec::new();
    let mut add = |position: [f64; 3], normal: Vector3, class: Class| {
        points.push(point(position, normal, class, [90, 120, 160]));
    };
    let step = 0.03;
    for (along, up) in (0..50).flat_map(|along| (0..30).map(move |up| (along, up))) {
        let (s, z) = (f64::from(along) * step, f64::from(up) * step);
        add([s, 0.0, z], Vector3::y(), Class::Wall);
        add([0.0, s, z], Vector3::x(), Class::Wall);
        if along < 10 {
            add([0.6 + s, 0.6, z], -Vector3::y(), Class::Box);
            add([0.6, 0.6 + s, z], -Vector3::x(), Class::Box);
        }
    }
    seen(points, map_from_clip)
}

/// Clips a minute apart, two of them at the same time. Every fifth looked through a place.
fn many(count: usize) -> Vec<Clip> {
    let clip = |number: usize| {
        let off = |salt: f64| 0.02 * (2.0 * ((number as f64 + 1.0) * salt).fract() - 1.0);
        let truth = Pose2::new(0.4 + 0.02 * number as f64, 0.3, 0.2 * number as f64);
        let own = Pose2::new(truth.x_m + off(0.618), truth.y_m + off(0.755), truth.yaw_rad + 0.2 * off(0.57));
        let mut contribution = corner(&truth);
        if number % 5 == 4 {
            contribution.views = [0.0, 0.1].map(|x| view(&truth, [0.7 + x, -1.2], 1.5)).to_vec();
        }
        let minute = if number == 7 { 6 } else { number };
        let name = format!("{number:02}");
        let clip = Uuid::from_u128(number as u128);
        let recorded_at_ms = Some(60_000 * minute as i64);
        Clip { member: Member { recorded_at_ms, clip, ..member(&name, own) }, contribution }
    };
    (0..count).map(clip).collect()
}

/// Clips, the sums of the last map, and the clips that were read.
struct WithSums<'a> {
    clips: &'a [&'a Clip],
    sums: BTreeMap<TileKey, Vec<u8>>,
    read: BTreeSet<String>,
}

impl LoadClips<Cancelled> for WithSums<'_> {
    fn contributions(&mut self, members: &[&Member]) -> Result<Vec<ClipContribution>, Cancelled> {
        self.read.extend(members.iter().map(|member| member.sha256.clone()));
        Ok(members.iter().map(|member| contribution(self.clips.iter().copied(), member)).collect())
    }

    fn features(&mut self, members: &[&Member]) -> Result<Vec<Vec<viola_reconstruct::Feature>>, Cancelled> {
        Ok(vec![Vec::new(); members.len()])
    }

    fn sums(&mut self, tiles: &[TileKey]) -> Result<Vec<Option<Vec<u8>>>, Cancelled> {
        Ok(tiles.iter().map(|tile| self.sums.get(tile).cloned()).collect())
    }
}

/// A map with the sums that are kept beside it.
struct Kept {
    map: LabelledMap,
    sums: BTreeMap<TileKey, Vec<u8>>,
    read: BTreeSet<String>,
}

fn merged(last: &Kept, clips: &[&Clip]) -> Kept {
    let mut load = WithSums { clips, sums: last.sums.clone(), read: BTreeSet::new() };
    let members = clips.iter().map(|clip| clip.member.clone()).collect();
    let assembly = assemble(&last.map.manifest, members, &mut load, &Silent).unwrap();
    let map = assembly.label(last.map.tiles.clone(), None, &Silent).unwrap();
    let mut sums = load.sums;
    for (key, bytes) in &map.sums {
        match bytes {
            Some(bytes) => sums.insert(*key, bytes.clone()),
            None => sums.remove(key),
        };
    }
    Kept { map, sums, read: load.read }
}

fn empty() -> Kept {
    Kept { map: nothing(), sums: BTreeMap::new(), read: BTreeSet::new() }
}

fn assert_same(one: &Kept, other: &Kept) {
    assert_eq!(one.map.manifest.clips, other.map.manifest.clips);
    assert_eq!(one.map.manifest.tiles, other.map.manifest.tiles);
    assert!(one.map.tiles == other.map.tiles);
}

#[test]
fn kept_sums_change_nothing_but_what_is_read() {
    let clips = many(36);
    let all: Vec<&Clip> = clips.iter().collect();
    let at_once = merged(&empty(), &all);
    let mut last = merged(&empty(), &all[..31]);
    assert!(!last.sums.is_empty());
    for count in 32..=36 {
        last = merged(&last, &all[..count]);
    }
    assert_same(&last, &at_once);
    // The last clip is read with the other three of its block and at most twice eight of those before it.
    assert!(last.read.len() <= 20, "{:?}", last.read);
    // A clip that comes late with an early time, and one that goes.
    let without: Vec<&Clip> = all.iter().copied().filter(|clip| clip.member.sha256 != "03").collect();
    let less = merged(&last, &without);
    assert_same(&less, &merged(&empty(), &without));
    assert_same(&merged(&less, &all), &at_once);
}

/// The sums are a cache: without them, or with damaged ones, the map is the same.
#[test]
fn lost_sums_are_made_again() {
    let clips = many(18);
    let all: Vec<&Clip> = clips.iter().collect();
    let first = merged(&empty(), &all[..17]);
    let next = merged(&first, &all);
    let cut = |bytes: &Vec<u8>| bytes[..bytes.len() / 2].to_vec();
    let damaged = first.sums.iter().map(|(key, bytes)| (*key, cut(bytes))).collect();
    for sums in [BTreeMap::new(), damaged] {
        let again = merged(&Kept { map: first.map.clone(), sums, read: BTreeSet::new() }, &all);
        assert_same(&again, &next);
        assert!(again.read.len() > next.read.len(), "{} {}", again.read.len(), next.read.len());
    }
}

#[test]
fn no_sums_of_deleted_clips_stay() {
    let clips = many(17);
    let all: Vec<&Clip> = clips.iter().collect();
    let first = merged(&empty(), &all);
    assert!(!first.sums.is_empty());
    let few = merged(&first, &all[..5]);
    assert!(few.sums.is_empty() && !few.map.tiles.is_empty());
}

/// The checksums of the manifest tell damaged files of tiles from those of the last map.
#[test]
fn a_kept_tile_is_read_only_as_it_was() {
    let clips = clips();
    let all: Vec<&Clip> = vec![&clips[0]];
    let last = labelled(&nothing(), &all);
    let (same, anew) = (made(&last.manifest, &all), made(&Manifest::default(), &all));
    assert!(!last.tiles.is_empty());
    assert_eq!((same.kept().count(), anew.kept().count()), (last.tiles.len(), 0));
    for (key, tile) in &last.tiles {
        let good = tile.to_bytes();
        assert_eq!(same.read_kept(key, &good).as_ref(), Ok(tile));
        // The position, the normal and the colour of the first point, and the labels of the last one.
        let first = 16 + 16 * tile.clips.len();
        for at in [first, first + 13, first + 25, good.len() - 1] {
            let mut bytes = good.clone();
            bytes[at] ^= 1;
            assert!(same.read_kept(key, &bytes).is_err(), "byte {at}");
        }
    }
}
