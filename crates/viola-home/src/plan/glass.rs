//! Floor and furniture outside, seen through glass: they belong to no room.

use crate::rooms::space::Space;

/// Ground outside begins this near the glass that it was seen through.
const NEAR_M: f64 = 0.3;

/// Returns the open cells that are connected with no room but across a window. `glass` has the cells with windows, `level` those
/// with level surface, `owner` the room of each cell, 0 for none.
pub(super) fn beyond(space: &Space, glass: Vec<bool>, level: &[bool], owner: &[u32]) -> Vec<bool> {
    let none = vec![false; space.frame.len()];
    let glass = dilated(space, glass, 1);
    if !glass.contains(&true) || owner.iter().all(|owner| *owner == 0) {
        return none;
    }
    let is_open = |at: usize| (space.free[at] || level[at]) && !glass[at];
    let inside = flooded(space, (0..none.len()).filter(|at| owner[*at] != 0 && is_open(*at)), is_open);
    let steps = (NEAR_M / space.frame.cell_m).ceil() as usize;
    let near = dilated(space, glass.clone(), steps);
    let is_beyond = |at: usize| is_open(at) && !inside[at];
    flooded(space, (0..none.len()).filter(|at| near[*at] && is_beyond(*at)), is_beyond)
}

/// Returns the cells within some steps of marked ones, along the axes and diagonally.
fn dilated(space: &Space, mut marked: Vec<bool>, steps: usize) -> Vec<bool> {
    let (width, height) = (space.frame.width, space.frame.height);
    for stride in [1, width] {
        let before = marked.clone();
        for at in (0..before.len()).filter(|at| before[*at]) {
            // The place in the row, or in the column.
            let (place, count) = if stride == 1 { (at % width, width) } else { (at / width, height) };
            for other in place.saturating_sub(steps)..=(place + steps).min(count - 1) {
                marked[at + other * stride - place * stride] = true;
            }
        }
    }
    marked
}

/// Returns the cells that are connected with some of them through cells of a kind.
fn flooded(space: &Space, from: impl Iterator<Item = usize>, is: impl Fn(usize) -> bool) -> Vec<bool> {
    let mut reached = vec![false; space.frame.len()];
    let mut open: Vec<usize> = from.collect();
    open.iter().for_each(|at| reached[*at] = true);
    while let Some(at) = open.pop() {
        let around = crate::rooms::outline::beside(at, space.frame.width, space.frame.height);
        for next in around.into_iter().flatten() {
            if !reached[next] && is(next) {
                reached[next] = true;
                open.push(next);
            }
        }
    }
    reached
}
