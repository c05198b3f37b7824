//! Merges that are asked to stop.

use super::*;
use crate::describe::describe;
use crate::points::ClipNumbers;
use crate::rooms::tests::flat;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Requests a stop after it was asked some times whether one was requested.
struct StopAfter {
    times: usize,
    asked: AtomicUsize,
}

impl Progress for StopAfter {
    fn cancelled(&self) -> bool {
        self.asked.fetch_add(1, Ordering::Relaxed) >= self.times
    }
}

/// Checks that `work` ends soon after a stop, whenever it comes. Returns how often all of the work asks for it.
fn check<T>(work: impl Fn(&dyn Progress) -> Result<T, Cancelled>) -> usize {
    let run = |times: usize| {
        let progress = StopAfter { times, asked: AtomicUsize::new(0) };
        (work(&progress).is_ok(), progress.asked.into_inner())
    };
    let (is_done, all) = run(usize::MAX);
    assert!(is_done);
    // Other threads may be about to ask, too.
    let beside = 4 * rayon::current_num_threads();
    for times in 0..all {
        let (is_done, asked) = run(times);
        assert!(!is_done && asked <= times + 1 + beside, "{times} of {all}: {asked}");
    }
    all
}

#[test]
fn a_stop_ends_each_part_of_a_merge() {
    let clips = clips();
    let assembled = |progress: &dyn Progress| {
        let members = clips[..3].iter().map(|clip| clip.member.clone()).collect();
        let mut load = |member: &Member| Ok::<_, Cancelled>(contribution(&clips, member));
        assemble(&Manifest::default(), members, &mut load, progress)
    };
    let asked = check(assembled);
    assert!(asked > 10, "{asked}");

    let assembly = assembled(&Silent).unwrap();
    let labelled = |progress: &dyn Progress| assembly.clone().label(Tiles::new(), None, progress);
    let map = labelled(&Silent).unwrap();
    assert!(map.windows > 0);
    assert_eq!(check(labelled), map.windows + 1, "each window, and the end");

    let tiles: Vec<Tile> = map.tiles.into_values().collect();
    let numbers = ClipNumbers::new(map.manifest.clips.iter().map(|clip| &clip.clip));
    let asked = check(|progress| describe(&flat(0.0), &tiles, &numbers, progress));
    assert!(asked >= 3, "{asked}");
}
