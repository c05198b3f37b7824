//! Curtains, blinds and rugs.

use crate::simulate::finish::{DARK, Finish, METAL, Pattern, WHITE, cloth};
use crate::simulate::piece::{Mount, Piece};
use crate::simulate::rng::Rng;
use viola_geometry::taxonomy::Class;

/// Distance between the folds of drapes, in metres.
const FOLD_M: f64 = 0.13;

/// Size of a window as its curtains see it, in metres.
#[derive(Debug, Clone, Copy)]
pub struct Pane {
    pub width_m: f64,
    pub sill_m: f64,
    pub head_m: f64,
}

/// Returns a rug of the given size: of one colour, with a border, or round.
pub fn rug(width: f64, depth: f64, rng: &mut Rng) -> Piece {
    let thick = rng.between(0.006, 0.014);
    let mut piece = Piece::new(Class::Rug, [width, depth, thick]).mounted(Mount::Flat).movable();
    let scale = rng.between(0.08, 0.3) as f32;
    let pattern = rng.pick([Pattern::Picture, Pattern::Grain, Pattern::Stripes, Pattern::Tiles]);
    let finish = cloth(rng).with(pattern, scale);
    if width < 2.0 && rng.chance(0.2) {
        piece.post([0.0; 3], width / 2.0, thick, finish).half.y = depth / 2.0;
        return piece;
    }
    piece.block([0.0; 3], [width, depth, thick], finish);
    if rng.chance(0.35) {
        let inner = [width * 0.84, depth * 0.8, thick + 0.001];
        piece.block([0.0; 3], inner, cloth(rng).with(Pattern::Picture, 0.1));
    }
    piece
}

/// Returns what hangs at a window: drapes, sheers, a roller blind. The piece's back is at the wall.
pub fn curtains(pane: Pane, to_floor: bool, rng: &mut Rng) -> Piece {
    if !to_floor && rng.chance(0.35) {
        return roller_blind(pane, rng);
    }
    let width = pane.width_m + 0.4;
    let top = pane.head_m + 0.12;
    let mut piece = Piece::new(Class::Curtain, [width, 0.14, top]);
    piece.mount = if to_floor { Mount::Floor } else { Mount::Hung };
    let rail = Finish::plain(rng.pick([METAL, DARK, WHITE]));
    piece.bar([-width / 2.0, 0.0, top - 0.012], [width / 2.0, 0.0, top - 0.012], 0.012, rail);
    let bottom = if to_floor { rng.between(0.01, 0.05) } else { (pane.sill_m - 0.1).max(0.05) };
    let finish = cloth(rng).with(rng.pick([Pattern::Stripes, Pattern::Grain]), 0.09);
    // Open at the sides, half drawn, or closed.
    let (left, right) = match rng.count(0, 5) {
        0 => (0.5, 0.5),
        1 => (rng.between(0.5, 0.75), rng.between(0.1, 0.25)),
        _ => (rng.between(0.1, 0.3), rng.between(0.1, 0.3)),
    };
    let folded = rng.chance(0.6);
    for (side, fraction) in [(-1.0, left), (1.0, right)] {
        let drawn = fraction * width;
        let middle = side * (width - drawn) / 2.0;
        let size = [drawn, top - 0.02 - bottom];
        if folded {
            folds(&mut piece, [middle, bottom], size, finish, rng);
        } else {
            piece.block([middle, 0.0, bottom], [size[0], 0.06, size[1]], finish);
        }
    }
    piece
}

/// Adds one curtain as a row of upright ellipses: wide folds if it is drawn, narrow ones if not.
fn folds(
    piece: &mut Piece,
    [middle, bottom]: [f64; 2],
    [wide, tall]: [f64; 2],
    finish: Finish,
    rng: &mut Rng,
) {
    let count = (wide / FOLD_M).ceil().clamp(2.0, 9.0) as usize;
    let pitch = wide / count as f64;
    let deep = (0.09 - 0.2 * (pitch - 0.08)).clamp(0.05, 0.1);
    for fold in 0..count {
        let x = middle + pitch * (fold as f64 + 0.5) - wide / 2.0;
        let y = if fold % 2 == 0 { 0.012 } else { -0.012 };
        let post = piece.post([x, y, bottom], pitch * rng.between(0.58, 0.66), tall, finish);
        post.half.y = deep / 2.0;
    }
}

fn roller_blind(pane: Pane, rng: &mut Rng) -> Piece {
    let (width, top) = (pane.width_m + 0.1, pane.head_m + 0.08);
    let mut piece = Piece::new(Class::Curtain, [width, 0.1, top]).mounted(Mount::Hung);
    let finish = if rng.chance(0.5) { Finish::plain(WHITE) } else { cloth(rng) };
    let axis = top - 0.05;
    piece.bar([-width / 2.0, 0.01, axis], [width / 2.0, 0.01, axis], 0.035, finish);
    let drop = rng.between(0.1, 1.0) * (pane.head_m - pane.sill_m);
    let bottom = top - 0.05 - drop;
    piece.block([0.0, 0.0, bottom], [width - 0.04, 0.012, drop], finish.with(Pattern::Stripes, 0.2));
    piece.block([0.0, 0.0, bottom - 0.02], [width - 0.04, 0.025, 0.03], finish.darker(0.8));
    piece
}
