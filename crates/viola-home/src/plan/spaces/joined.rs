//! Parts of given rooms that are too small for a room.

use super::super::cells::Cells;
use super::{MIN_AREA_M2, areas};
use crate::rooms::outline;
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use viola_geometry::groups;

/// The piece and the given room of a region's cells.
pub(super) type Key = Option<(u32, u32)>;

/// Regions that join each other, by their numbers; joined ones have the lowest number of them.
struct Regions {
    parent: Vec<u32>,
    area_m2: Vec<f64>,
    key: Vec<Key>,
    /// Regions beside each one in its piece, by any number of theirs.
    beside: Vec<Vec<u32>>,
}

impl Regions {
    fn new(cells: &Cells, pieces: &[u32], key: &[Key], region: &[u32]) -> Regions {
        let area_m2 = areas(cells, region);
        let count = area_m2.len();
        let (mut keys, mut beside) = (vec![None; count], vec![Vec::new(); count]);
        for (at, own) in region.iter().enumerate().filter(|(_, own)| **own != 0) {
            keys[*own as usize] = key[at];
            for next in outline::beside(at, cells.count(0), cells.count(1)).into_iter().flatten() {
                if pieces[next] == pieces[at] && region[next] != 0 && region[next] != *own {
                    beside[*own as usize].push(region[next]);
                }
            }
        }
        Regions { parent: (0..count as u32).collect(), area_m2, key: keys, beside }
    }

    fn root(&mut self, region: u32) -> u32 {
        groups::root(&mut self.parent, region)
    }

    /// Returns the other regions beside one, each once.
    fn beside(&mut self, own: u32) -> Vec<u32> {
        let mut beside = std::mem::take(&mut self.beside[own as usize]);
        beside.iter_mut().for_each(|region| *region = self.root(*region));
        beside.retain(|region| *region != own);
        beside.sort_unstable();
        beside.dedup();
        self.beside[own as usize].clone_from(&beside);
        beside
    }

    /// Joins two regions of one key.
    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        if !groups::join(&mut self.parent, a, b) {
            return;
        }
        let (low, high) = (a.min(b) as usize, a.max(b) as usize);
        self.area_m2[low] += self.area_m2[high];
        let mut fewer = std::mem::take(&mut self.beside[high]);
        let more = &mut self.beside[low];
        if more.len() < fewer.len() {
            std::mem::swap(more, &mut fewer);
        }
        more.append(&mut fewer);
    }
}

/// Joins each region that is too small for a room with the largest one beside it, whose key its cells get; the smallest
/// region is the first. Returns the region of each cell. A map may have as many regions as the plan has cells.
pub(super) fn joined(cells: &Cells, pieces: &[u32], key: &mut [Key], mut region: Vec<u32>) -> Vec<u32> {
    let mut all = Regions::new(cells, pieces, key, &region);
    // The bits of positive numbers have the order of the numbers.
    let small = |all: &Regions, at: u32| {
        let area_m2 = all.area_m2[at as usize];
        (area_m2 < MIN_AREA_M2).then(|| Reverse((area_m2.to_bits(), at)))
    };
    let mut open: BinaryHeap<Reverse<(u64, u32)>> =
        (1..all.area_m2.len() as u32).filter_map(|at| small(&all, at)).collect();
    while let Some(Reverse((bits, at))) = open.pop() {
        if all.root(at) != at || all.area_m2[at as usize].to_bits() != bits {
            // It was joined with others since.
            continue;
        }
        let beside = all.beside(at);
        let area = |at: u32| all.area_m2[at as usize];
        let into = beside.iter().copied().max_by(|a, b| area(*a).total_cmp(&area(*b)).then(b.cmp(a)));
        let Some(into) = into else { continue };
        let into = all.key[into as usize];
        all.key[at as usize] = into;
        for next in beside {
            if all.key[next as usize] == into {
                all.join(at, next);
            }
        }
        let at = all.root(at);
        open.extend(small(&all, at));
    }
    for (region, key) in region.iter_mut().zip(key) {
        *region = all.root(*region);
        *key = all.key[*region as usize];
    }
    region
}
