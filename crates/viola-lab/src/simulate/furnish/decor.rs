//! Lamps, plants, pictures, rugs, curtains, radiators.

use crate::simulate::finish::{DARK, Finish, METAL, Pattern, WHITE, cloth, wood};
use crate::simulate::piece::{Mount, Piece};
use crate::simulate::rng::Rng;
use viola_geometry::taxonomy::Class;

pub fn floor_lamp(rng: &mut Rng) -> Piece {
    let top = rng.between(1.45, 1.75);
    let mut piece = Piece::new(Class::Lamp, [0.4, 0.4, top]).movable();
    let pole = Finish::plain(rng.pick([DARK, METAL]));
    piece.post([0.0; 3], rng.between(0.12, 0.16), 0.025, pole);
    piece.post([0.0, 0.0, 0.02], 0.013, top - 0.25, pole);
    piece.post([0.0, 0.0, top - 0.28], rng.between(0.14, 0.2), 0.28, Finish::plain([0.93, 0.88, 0.75]));
    piece
}

pub fn table_lamp(rng: &mut Rng) -> Piece {
    let mut piece = Piece::new(Class::Lamp, [0.2, 0.2, 0.4]);
    piece.post([0.0; 3], 0.06, 0.02, Finish::plain(DARK));
    piece.post([0.0; 3], 0.015, 0.25, Finish::plain(METAL));
    piece.post([0.0, 0.0, 0.22], rng.between(0.08, 0.11), 0.16, Finish::plain([0.93, 0.88, 0.75]));
    piece
}

/// Returns a lamp on a ceiling of the given height; the origin of its frame is on the floor below.
pub fn ceiling_lamp(ceiling_m: f64, rng: &mut Rng) -> Piece {
    let mut piece = Piece::new(Class::Lamp, [0.5, 0.5, ceiling_m]).mounted(Mount::Hung);
    let shade = Finish::plain([0.95, 0.93, 0.86]);
    if rng.chance(0.5) {
        let drop = rng.between(0.25, 0.6);
        piece.post([0.0, 0.0, ceiling_m - drop], 0.008, drop, Finish::plain(DARK));
        let size = rng.between(0.3, 0.45);
        piece.ball([0.0, 0.0, ceiling_m - drop - size * 0.7], [size, size, size * 0.75], shade);
    } else {
        piece.post([0.0, 0.0, ceiling_m - 0.09], rng.between(0.15, 0.24), 0.09, shade);
    }
    piece
}

pub fn plant(rng: &mut Rng) -> Piece {
    let (pot, height) = (rng.between(0.12, 0.2), rng.between(0.6, 1.6));
    let mut piece = Piece::new(Class::Plant, [2.2 * pot, 2.2 * pot, height]).movable();
    piece.post(
        [0.0; 3],
        pot,
        rng.between(0.22, 0.38),
        Finish::plain(rng.pick([WHITE, [0.62, 0.36, 0.25], DARK])),
    );
    piece.post([0.0, 0.0, 0.2], 0.015, height - 0.3, Finish::plain([0.35, 0.28, 0.18]));
    let leaves = Finish::plain([0.20, 0.42, 0.20]).with(Pattern::Grain, 0.02);
    for _ in 0..rng.count(3, 7) {
        let size = rng.between(0.14, 0.34) * height.min(1.2);
        let (x, y) = (rng.between(-0.16, 0.16), rng.between(-0.16, 0.16));
        let z = rng.between(0.4, 0.95) * height - size / 2.0;
        piece.ball([x, y, z.max(0.3)], [size, size, size * 0.8], leaves);
    }
    piece
}

/// Returns a picture on the wall behind it.
pub fn picture(rng: &mut Rng) -> Piece {
    let (width, height) = (rng.between(0.25, 1.1), rng.between(0.25, 0.8));
    let bottom = rng.between(1.2, 1.5);
    let mut piece = Piece::new(Class::Picture, [width, 0.03, bottom + height]).mounted(Mount::Hung).movable();
    let frame = wood(rng);
    piece.block([0.0, 0.0, bottom], [width, 0.024, height], frame);
    let tone = [rng.between(0.2, 0.9) as f32, rng.between(0.2, 0.9) as f32, rng.between(0.2, 0.9) as f32];
    let print = Finish::plain(tone).with(Pattern::Picture, rng.between(0.05, 0.16) as f32).glossy(0.2);
    piece.block([0.0, -0.008, bottom + 0.03], [width - 0.06, 0.016, height - 0.06], print);
    piece
}

/// Returns a board on the wall with books on it.
pub fn wall_shelf(rng: &mut Rng) -> Piece {
    let width = rng.between(0.6, 1.3);
    let bottom = rng.between(1.3, 1.6);
    let mut piece = Piece::new(Class::Shelf, [width, 0.25, bottom + 0.4]).mounted(Mount::Hung);
    piece.block([0.0, 0.0, bottom], [width, 0.25, 0.03], wood(rng));
    let mut x = 0.1 - width / 2.0;
    while x < width / 2.0 - 0.15 {
        let run = rng.between(0.08, 0.3);
        let books = Finish::plain(WHITE).with(Pattern::Books, 0.035);
        piece.block([x + run / 2.0, 0.04, bottom + 0.03], [run, 0.15, rng.between(0.16, 0.3)], books);
        x += run + rng.between(0.02, 0.2);
    }
    piece
}

pub fn rug(width: f64, depth: f64, rng: &mut Rng) -> Piece {
    let thick = rng.between(0.006, 0.014);
    let mut piece = Piece::new(Class::Rug, [width, depth, thick]).mounted(Mount::Flat).movable();
    let scale = rng.between(0.08, 0.3) as f32;
    let pattern = if rng.chance(0.5) { Pattern::Picture } else { Pattern::Grain };
    piece.block([0.0; 3], [width, depth, thick], cloth(rng).with(pattern, scale));
    piece
}

/// Returns both curtains of a window of the given width, with their rail; the piece's back is at the wall.
pub fn curtains(window_m: f64, to_floor: bool, sill_m: f64, head_m: f64, rng: &mut Rng) -> Piece {
    let width = window_m + 0.4;
    let top = head_m + 0.12;
    let mut piece = Piece::new(Class::Curtain, [width, 0.12, top]);
    piece.mount = if to_floor { Mount::Floor } else { Mount::Hung };
    piece.block([0.0, 0.0, top - 0.025], [width, 0.025, 0.025], Finish::plain(METAL));
    let bottom = if to_floor { rng.between(0.01, 0.05) } else { (sill_m - 0.1).max(0.05) };
    let finish = cloth(rng).with(Pattern::Stripes, 0.09);
    let drawn = rng.between(0.12, 0.42) * width;
    let (left, right) = (drawn, drawn * rng.between(0.6, 1.0));
    let height = top - 0.02 - bottom;
    piece.block([(left - width) / 2.0, 0.0, bottom], [left, 0.07, height], finish);
    piece.block([(width - right) / 2.0, 0.0, bottom], [right, 0.07, height], finish);
    piece
}

pub fn radiator(width: f64) -> Piece {
    let mut piece = Piece::new(Class::Radiator, [width, 0.12, 0.62]);
    piece.block([0.0, 0.0, 0.12], [width, 0.08, 0.5], Finish::plain(WHITE).with(Pattern::Stripes, 0.05));
    for x in [-1.0, 1.0] {
        piece.post([x * (width / 2.0 - 0.05), 0.02, 0.0], 0.01, 0.14, Finish::plain(WHITE));
    }
    piece
}
