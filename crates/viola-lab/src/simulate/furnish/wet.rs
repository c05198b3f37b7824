//! Washbasins and showers.

use super::colours::{ceramic, steel};
use crate::simulate::finish::{Finish, Pattern, cloth, front};
use crate::simulate::piece::Piece;
use crate::simulate::rng::Rng;
use viola_geometry::taxonomy::Class;

/// Returns a washbasin on a cabinet, on a pedestal, or on the wall, with a mirror above.
pub fn washbasin(rng: &mut Rng) -> Piece {
    let (width, depth) = (rng.between(0.5, 0.9), rng.between(0.42, 0.5));
    let mut piece = Piece::new(Class::Sink, [width, depth, 1.9]);
    match rng.count(0, 2) {
        0 => {
            let finish = front(rng);
            piece.block([0.0, 0.03, 0.0], [width - 0.04, depth - 0.1, 0.08], finish.darker(0.5));
            piece.block([0.0, 0.01, 0.08], [width, depth - 0.03, 0.68], finish);
        }
        1 => {
            piece.post([0.0, 0.08, 0.0], 0.1, 0.7, ceramic());
        }
        _ => {
            piece.block([0.0, 0.01, 0.4], [width, depth - 0.03, 0.36], front(rng));
        }
    }
    piece.block([0.0, 0.0, 0.76], [width, depth, 0.1], ceramic());
    piece.post([0.0, depth / 2.0 - 0.06, 0.86], 0.015, 0.14, steel());
    piece.block([0.0, depth / 2.0 - 0.012, 1.15], [width * 0.9, 0.02, 0.7], Finish::mirror()).class =
        Class::Mirror;
    piece
}

/// Returns a shower tray with a glass panel or a curtain drawn to one side.
pub fn shower(rng: &mut Rng) -> Piece {
    let side = rng.between(0.8, 0.95);
    let mut piece = Piece::new(Class::Shower, [side, side, 2.0]);
    let tray = rng.between(0.03, 0.14);
    piece.block([0.0, 0.0, 0.0], [side, side, tray], ceramic());
    piece.post([0.0, side / 2.0 - 0.03, 0.9], 0.015, 1.1, steel());
    piece.post([0.0, side / 2.0 - 0.12, 1.98], 0.1, 0.02, steel());
    piece.block([0.0, 0.02 - side / 2.0, 1.97], [side, 0.02, 0.02], steel());
    if rng.chance(0.6) {
        glass_panels(&mut piece, side, tray, rng);
        return piece;
    }
    let curtain = cloth(rng).with(Pattern::Stripes, 0.08);
    let drawn = rng.between(0.2, 0.5);
    let item = piece.block([(drawn - side) / 2.0, 0.03 - side / 2.0, 0.15], [drawn, 0.05, 1.82], curtain);
    item.class = Class::Curtain;
    piece
}

/// Adds a panel of glass at the front of a shower, and sometimes one at its side.
fn glass_panels(piece: &mut Piece, side: f64, tray: f64, rng: &mut Rng) {
    let (height, open) = (1.97 - tray, rng.between(0.0, 0.5));
    let width = side - open;
    let front = 0.02 - side / 2.0;
    piece.block([-open / 2.0, front, tray], [width, 0.008, height], Finish::glass());
    piece.block([(width - open) / 2.0 - 0.01, front, tray], [0.02, 0.025, height], steel());
    if rng.chance(0.6) {
        let x = rng.sign() * (side / 2.0 - 0.01);
        piece.block([x, 0.0, tray], [0.008, side - 0.03, height], Finish::glass());
    }
}
