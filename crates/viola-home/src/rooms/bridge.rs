//! Joins the pieces of a room that furniture or unseen floor divides.

use super::outline::{beside, pieces};
use viola_geometry::{Grid, groups};

/// Largest gap between two pieces of a room.
const MAX_GAP_M: f64 = 1.0;
/// A smaller piece is a speck.
const MIN_PIECE_M2: f64 = 0.5;
/// Half the width of a bridge: a narrower one would be lost in the polygon's simplification.
const HALF_WIDTH_M: f64 = 0.15;

/// The shortest way from a piece to a cell.
#[derive(Clone, Copy)]
struct Way {
    piece: u32,
    steps: usize,
    /// The cell before it; the cell itself at the border of the piece.
    from: usize,
}

/// Joins pieces of a mask that are near each other by bridges of cells that are `open`. Of several bridges the shortest
/// ones are set, none between pieces that others join already.
pub fn bridge(mask: &mut Grid<bool>, open: impl Fn(usize) -> bool) {
    let frame = mask.frame;
    let (piece, count) = pieces(mask);
    let mut sizes = vec![0usize; count + 1];
    piece.iter().for_each(|piece| sizes[*piece as usize] += 1);
    let least = (MIN_PIECE_M2 / (frame.cell_m * frame.cell_m)).round() as usize;
    let is_large = |piece: u32| piece != 0 && sizes[piece as usize] >= least;
    if (1..=count as u32).filter(|piece| is_large(*piece)).count() < 2 {
        return;
    }
    let ways = ways(mask, &piece, is_large, &open);
    // A bridge is a side between two cells that are reached from different pieces.
    let most = (MAX_GAP_M / frame.cell_m).round() as usize;
    let mut bridges: Vec<(usize, usize, usize)> = Vec::new();
    for at in 0..frame.len() {
        for next in beside(at, frame.width, frame.height).into_iter().flatten().filter(|next| *next > at) {
            let (Some(a), Some(b)) = (ways[at], ways[next]) else { continue };
            if a.piece != b.piece && a.steps + b.steps <= most {
                bridges.push((a.steps + b.steps, at, next));
            }
        }
    }
    bridges.sort_unstable();
    let mut group: Vec<u32> = (0..=count as u32).collect();
    for (_, at, next) in bridges {
        let [a, b] = [at, next].map(|cell| ways[cell].map_or(0, |way| way.piece));
        if !groups::join(&mut group, a, b) {
            continue;
        }
        for mut cell in [at, next] {
            set_around(mask, cell, &open);
            while let Some(way) = ways[cell].filter(|way| way.from != cell) {
                cell = way.from;
                set_around(mask, cell, &open);
            }
        }
    }
}

/// Returns the way to each open cell from the nearest large piece, no longer than a gap.
fn ways(
    mask: &Grid<bool>,
    piece: &[u32],
    is_large: impl Fn(u32) -> bool,
    open: impl Fn(usize) -> bool,
) -> Vec<Option<Way>> {
    let frame = mask.frame;
    let most = (MAX_GAP_M / frame.cell_m).round() as usize;
    let mut ways: Vec<Option<Way>> = vec![None; frame.len()];
    let mut border: Vec<usize> = (0..frame.len()).filter(|at| is_large(piece[*at])).collect();
    for at in &border {
        ways[*at] = Some(Way { piece: piece[*at], steps: 0, from: *at });
    }
    for steps in 1..=most {
        let mut reached = Vec::new();
        for at in border {
            let Some(way) = ways[at] else { continue };
            for next in beside(at, frame.width, frame.height).into_iter().flatten() {
                if ways[next].is_none() && (mask.cells[next] || open(next)) {
                    ways[next] = Some(Way { piece: way.piece, steps, from: at });
                    reached.push(next);
                }
            }
        }
        border = reached;
    }
    ways
}

/// Sets the open cells around a cell of a bridge.
fn set_around(mask: &mut Grid<bool>, at: usize, open: impl Fn(usize) -> bool) {
    let (width, height) = (mask.frame.width, mask.frame.height);
    let reach = (HALF_WIDTH_M / mask.frame.cell_m).round() as usize;
    let (x, y) = (at % width, at / width);
    for y in y.saturating_sub(reach)..(y + reach + 1).min(height) {
        for x in x.saturating_sub(reach)..(x + reach + 1).min(width) {
            mask.cells[y * width + x] |= open(y * width + x);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use viola_geometry::GridFrame;

    #[test]
    fn only_near_pieces_without_a_wall_between_them_are_joined() {
        // Two pieces of 1 m x 1 m beside each other, and a speck above the gap.
        for (name, gap, wall, speck, want) in [
            ("beside each other", 0.5, None, false, 1),
            ("too far apart", 1.5, None, false, 2),
            ("a wall between them", 0.5, Some(0.0..2.0), false, 2),
            ("a wall that ends", 0.5, Some(0.0..0.6), false, 1),
            ("a speck", 1.5, None, true, 3),
        ] {
            let frame = GridFrame { origin_m: [0.0; 2], cell_m: 0.05, width: 80, height: 40 };
            let is_wall = |index: usize| {
                let at = frame.centre(index % frame.width, index / frame.width);
                let is_across = (1.2..1.3).contains(&at.x);
                is_across && wall.as_ref().is_some_and(|wall: &std::ops::Range<f64>| wall.contains(&at.y))
            };
            let is_set = |index: usize| {
                let at = frame.centre(index % frame.width, index / frame.width);
                let is_in_piece = at.y < 1.0 && (at.x < 1.0 || (1.0 + gap..2.0 + gap).contains(&at.x));
                is_in_piece || speck && (1.7..1.8).contains(&at.x) && (0.4..0.5).contains(&at.y)
            };
            let mut mask = Grid { frame, cells: (0..frame.len()).map(is_set).collect() };
            let before = mask.cells.clone();
            bridge(&mut mask, |index| !is_wall(index));
            assert_eq!(pieces(&mask).1, want, "{name}");
            let is_kept = (0..frame.len()).all(|i| mask.cells[i] || !before[i]);
            assert!(is_kept && !(0..frame.len()).any(|i| mask.cells[i] && is_wall(i)), "{name}");
        }
    }
}
