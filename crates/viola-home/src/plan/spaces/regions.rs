//! Connected cells and their areas.

use super::super::cells::Cells;
use super::super::gaps::Gap;
use crate::rooms::outline::beside;

/// Returns the connected piece of each inside cell, from 1; 0 outside and in gaps.
pub(super) fn pieces(cells: &Cells, closed: &[Gap]) -> Vec<u32> {
    let mut open = cells.inside.clone();
    for at in closed.iter().flat_map(|gap| &gap.cells) {
        open[*at] = false;
    }
    regions(cells, |at| open[at].then_some(()))
}

/// Returns the connected region of equal keys of each cell, from 1; 0 without a key.
pub(super) fn regions<K: PartialEq>(cells: &Cells, key: impl Fn(usize) -> Option<K>) -> Vec<u32> {
    let mut region = vec![0u32; cells.inside.len()];
    let mut count = 0;
    for start in 0..region.len() {
        let Some(own) = key(start).filter(|_| region[start] == 0) else { continue };
        count += 1;
        let mut stack = vec![start];
        region[start] = count;
        while let Some(at) = stack.pop() {
            for next in beside(at, cells.count(0), cells.count(1)).into_iter().flatten() {
                if region[next] == 0 && key(next).as_ref() == Some(&own) {
                    region[next] = count;
                    stack.push(next);
                }
            }
        }
    }
    region
}

/// Returns the area of each piece, by its number.
pub(super) fn areas(cells: &Cells, pieces: &[u32]) -> Vec<f64> {
    let count = pieces.iter().max().map_or(0, |most| *most as usize);
    let mut areas = vec![0.0; count + 1];
    for (at, piece) in pieces.iter().enumerate() {
        areas[*piece as usize] += cells.area_m2(at);
    }
    areas
}
