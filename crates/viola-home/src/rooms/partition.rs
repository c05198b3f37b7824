//! Splits free space at narrow places by a watershed of the distance to walls (Meyer, 1994; for rooms of
//! occupancy maps: Bormann et al., 2016).

use super::outline::beside;
use super::space::Space;
use rustc_hash::FxHashMap;
use std::cmp::Reverse;
use viola_geometry::{DistanceField, Grid, groups};

/// Half of a door's maximum width. Doors are up to 1 m wide, double doors somewhat more.
pub(crate) const DOOR_HALF_M: f64 = 0.55;
/// An opening splits only if its distance to walls is below this fraction of the smaller basin's peak, ...
const NECK_FRACTION: f64 = 0.8;
/// and if both sides are this large.
pub(super) const MIN_AREA_M2: f64 = 1.2;

/// Basins of the watershed.
struct Basins {
    parent: Vec<u32>,
    /// Largest distance to a wall in each basin, in metres.
    peak_m: Vec<f32>,
    cells: Vec<u32>,
}

impl Basins {
    fn root(&mut self, basin: u32) -> u32 {
        groups::root(&mut self.parent, basin)
    }

    /// Joins two basins; the lower number stays.
    fn join(&mut self, a: u32, b: u32) {
        let (keep, gone) = (a.min(b), a.max(b));
        self.parent[gone as usize] = keep;
        self.peak_m[keep as usize] = self.peak_m[keep as usize].max(self.peak_m[gone as usize]);
        self.cells[keep as usize] += self.cells[gone as usize];
    }
}

/// Numbers the rooms in `owner` from 1, and returns their count: of more than `most` the largest.
pub(super) fn partition(space: &Space, owner: &mut Grid<u32>, most: usize) -> usize {
    let (width, height) = (space.frame.width, space.frame.height);
    let open = open(space);
    if !open.cells.contains(&true) {
        return 0;
    }
    let depth = DistanceField::new(&super::outside(&open));
    let depth = &depth.grid().cells;
    let mut order: Vec<u32> = (0..open.cells.len() as u32).filter(|i| open.cells[*i as usize]).collect();
    order.sort_unstable_by(|a, b| depth[*b as usize].total_cmp(&depth[*a as usize]).then(a.cmp(b)));
    let mut basins = Basins { parent: vec![0], peak_m: vec![0.0], cells: vec![0] };
    for &index in &order {
        let at = index as usize;
        let mut mine = 0;
        // The neighbour furthest from walls comes first.
        let mut around: Vec<u32> = beside(at, width, height)
            .into_iter()
            .flatten()
            .filter(|next| owner.cells[*next] != 0)
            .map(|next| next as u32)
            .collect();
        around.sort_unstable_by(|a, b| depth[*b as usize].total_cmp(&depth[*a as usize]).then(a.cmp(b)));
        for next in around {
            let other = basins.root(owner.cells[next as usize]);
            if mine == 0 {
                mine = other;
            } else if other != mine && !divides(&basins, mine, other, depth[at], space) {
                basins.join(mine, other);
                mine = mine.min(other);
            }
        }
        if mine == 0 {
            mine = basins.parent.len() as u32;
            basins.parent.push(mine);
            basins.peak_m.push(depth[at]);
            basins.cells.push(0);
        }
        basins.cells[mine as usize] += 1;
        owner.cells[at] = mine;
    }
    owner.cells.iter_mut().filter(|owner| **owner != 0).for_each(|owner| *owner = basins.root(*owner));
    absorb(owner, &mut basins, space);
    keep_largest(owner, most);
    number(owner)
}

/// Returns the free cells and those under furniture, without door leaves, which count as walls.
fn open(space: &Space) -> Grid<bool> {
    let mut open = Grid { frame: space.frame, cells: space.free.clone() };
    for (index, cell) in open.cells.iter_mut().enumerate() {
        *cell = (*cell || space.furniture[index] || space.low_furniture[index]) && !space.door[index];
    }
    // Specks are furniture legs; larger ones may be a wall between two doors.
    let most = (0.12 / (space.frame.cell_m * space.frame.cell_m)) as usize;
    super::fill_holes(&mut open, most, |index| space.door[index]);
    open
}

fn divides(basins: &Basins, a: u32, b: u32, depth_m: f32, space: &Space) -> bool {
    let lower = basins.peak_m[a as usize].min(basins.peak_m[b as usize]);
    let fewer = basins.cells[a as usize].min(basins.cells[b as usize]);
    let cell_m2 = space.frame.cell_m * space.frame.cell_m;
    f64::from(depth_m) <= DOOR_HALF_M
        && f64::from(depth_m) < NECK_FRACTION * f64::from(lower)
        // A basin may still be growing when it meets the next one: a tenth of the area is enough.
        && f64::from(fewer) * cell_m2 > 0.1 * MIN_AREA_M2
}

/// Joins basins too small for a room to the neighbour with the longest common border.
fn absorb(owner: &mut Grid<u32>, basins: &mut Basins, space: &Space) {
    let (width, height) = (space.frame.width, space.frame.height);
    let least = (MIN_AREA_M2 / (space.frame.cell_m * space.frame.cell_m)) as u32;
    let mut borders: std::collections::BTreeMap<(u32, u32), u32> = std::collections::BTreeMap::new();
    for at in 0..owner.cells.len() {
        for next in beside(at, width, height).into_iter().flatten() {
            let (a, b) = (owner.cells[at], owner.cells[next]);
            if a != 0 && b != 0 && a != b {
                *borders.entry((a, b)).or_default() += 1;
            }
        }
    }
    // Smallest first: a room that grew by one may be large enough.
    let mut small: Vec<u32> = borders.keys().map(|(a, _)| *a).collect();
    small.dedup();
    small.sort_by_key(|basin| (basins.cells[*basin as usize], *basin));
    for basin in small {
        let root = basins.root(basin);
        if basins.cells[root as usize] >= least {
            continue;
        }
        let mut best = (0, 0);
        for ((_, other), length) in borders.range((basin, 0)..(basin + 1, 0)) {
            let other = basins.root(*other);
            if other != root && *length > best.0 {
                best = (*length, other);
            }
        }
        if best.1 != 0 {
            basins.join(root, best.1);
        }
    }
    owner.cells.iter_mut().filter(|owner| **owner != 0).for_each(|owner| *owner = basins.root(*owner));
}

/// Removes all but the largest rooms. A map may have hundreds of specks of floor that the robot saw through windows.
fn keep_largest(owner: &mut Grid<u32>, most: usize) {
    let mut sizes: FxHashMap<u32, usize> = FxHashMap::default();
    owner.cells.iter().filter(|owner| **owner != 0).for_each(|owner| *sizes.entry(*owner).or_default() += 1);
    if sizes.len() <= most {
        return;
    }
    let mut order: Vec<(Reverse<usize>, u32)> =
        sizes.into_iter().map(|(owner, size)| (Reverse(size), owner)).collect();
    order.sort_unstable();
    let mut kept: Vec<u32> = order.into_iter().take(most).map(|(_, owner)| owner).collect();
    kept.sort_unstable();
    owner.cells.iter_mut().filter(|owner| kept.binary_search(owner).is_err()).for_each(|owner| *owner = 0);
}

/// Renumbers from 1 without gaps, in the order of the first cells.
fn number(owner: &mut Grid<u32>) -> usize {
    let mut numbers = FxHashMap::default();
    for cell in owner.cells.iter_mut().filter(|cell| **cell != 0) {
        let next = numbers.len() as u32 + 1;
        *cell = *numbers.entry(*cell).or_insert(next);
    }
    numbers.len()
}
