//! Small things of kitchens and dining tables.

use super::colours::painted;
use crate::simulate::finish::{DARK, Finish, METAL, WHITE, wood};
use crate::simulate::piece::Piece;
use crate::simulate::rng::Rng;
use viola_geometry::taxonomy::Class;

pub fn cup(rng: &mut Rng) -> Piece {
    let (radius, tall) = (rng.between(0.035, 0.05), rng.between(0.08, 0.13));
    let mut cup = Piece::new(Class::Other, [2.0 * radius, 2.0 * radius, tall]);
    cup.post([0.0; 3], radius, tall, painted(rng));
    cup
}

pub fn bottle(rng: &mut Rng) -> Piece {
    let (radius, tall) = (rng.between(0.03, 0.05), rng.between(0.2, 0.33));
    let mut bottle = Piece::new(Class::Other, [2.0 * radius, 2.0 * radius, tall]);
    let finish = painted(rng);
    bottle.post([0.0; 3], radius, tall * 0.65, finish);
    bottle.post([0.0, 0.0, tall * 0.65], radius * 0.4, tall * 0.35, finish.darker(0.7));
    bottle
}

pub fn plate(rng: &mut Rng) -> Piece {
    let radius = rng.between(0.095, 0.145);
    let mut plate = Piece::new(Class::Other, [2.0 * radius, 2.0 * radius, 0.06]);
    plate.post([0.0; 3], radius, 0.02, painted(rng));
    if rng.chance(0.5) {
        plate.ball([0.0, 0.0, 0.005], [radius, radius * 0.9, 0.05], Finish::plain([0.65, 0.5, 0.3]));
    }
    plate
}

/// Returns a pile of plates or bowls.
pub fn plates(rng: &mut Rng) -> Piece {
    let (radius, tall) = (rng.between(0.095, 0.145), rng.between(0.04, 0.12));
    let mut pile = Piece::new(Class::Other, [2.0 * radius, 2.0 * radius, tall]);
    pile.post([0.0; 3], radius, tall, painted(rng));
    pile.post([0.01, 0.0, tall], radius * 0.6, 0.05, painted(rng));
    pile
}

/// Returns a bowl of fruit.
pub fn bowl(rng: &mut Rng) -> Piece {
    let radius = rng.between(0.08, 0.15);
    let mut bowl = Piece::new(Class::Other, [2.0 * radius, 2.0 * radius, 0.14]);
    bowl.post([0.0; 3], radius * 0.6, 0.03, painted(rng));
    bowl.post([0.0, 0.0, 0.03], radius, 0.05, painted(rng));
    for k in 0..rng.count(0, 4) {
        let (s, c) = (k as f64 * 1.6).sin_cos();
        let fruit = Finish::plain(rng.pick([[0.8, 0.2, 0.15], [0.85, 0.6, 0.1], [0.4, 0.65, 0.2]]));
        bowl.ball([c * radius * 0.45, s * radius * 0.45, 0.05], [0.08, 0.08, 0.08], fruit);
    }
    bowl
}

pub fn toaster(rng: &mut Rng) -> Piece {
    let mut toaster = Piece::new(Class::Other, [0.3, 0.18, 0.2]);
    let shell = Finish::plain(rng.pick([METAL, WHITE, DARK, [0.6, 0.15, 0.12]])).glossy(0.6);
    toaster.cushion([0.0; 3], [0.3, 0.18, 0.2], shell);
    toaster
}

pub fn kettle(rng: &mut Rng) -> Piece {
    let mut kettle = Piece::new(Class::Other, [0.24, 0.18, 0.24]);
    let shell = Finish::plain(rng.pick([METAL, WHITE, DARK])).glossy(0.6);
    kettle.post([0.0; 3], 0.08, 0.17, shell);
    kettle.ball([0.0, 0.0, 0.12], [0.16, 0.16, 0.11], shell);
    kettle.bar([0.07, 0.0, 0.19], [0.11, 0.0, 0.06], 0.012, Finish::plain(DARK));
    kettle
}

/// Returns a coffee machine.
pub fn machine(rng: &mut Rng) -> Piece {
    let size = [rng.between(0.2, 0.32), rng.between(0.3, 0.42), rng.between(0.3, 0.42)];
    let [width, depth, height] = size;
    let mut machine = Piece::new(Class::Other, size);
    let shell = Finish::plain(rng.pick([METAL, DARK])).glossy(0.5);
    machine.block([0.0, 0.06, 0.0], [width, depth - 0.12, height], shell);
    machine.block([0.0, 0.0, height * 0.7], [width, depth, height * 0.3], shell);
    machine.block([0.0, 0.0, 0.0], [width, depth, 0.04], shell.darker(0.6));
    machine
}

pub fn microwave(rng: &mut Rng) -> Piece {
    let size = [rng.between(0.45, 0.52), rng.between(0.33, 0.4), rng.between(0.26, 0.31)];
    let mut oven = Piece::new(Class::Stove, size);
    oven.block([0.0; 3], size, Finish::plain(rng.pick([WHITE, METAL, DARK])).glossy(0.4));
    let door = [-0.05, -size[1] / 2.0, 0.03];
    oven.block(door, [size[0] * 0.7, 0.01, size[2] - 0.06], Finish::plain(DARK).glossy(0.8));
    oven
}

pub fn knives(rng: &mut Rng) -> Piece {
    let mut block = Piece::new(Class::Other, [0.12, 0.2, 0.3]);
    block.block([0.0, 0.0, 0.0], [0.1, 0.13, 0.22], wood(rng)).tilt_rad = -0.3;
    for x in [-0.03, 0.0, 0.03] {
        block.bar([x, 0.03, 0.2], [x, -0.05, 0.29], 0.01, Finish::plain(DARK));
    }
    block
}

/// Returns a chopping board that leans backwards.
pub fn board(rng: &mut Rng) -> Piece {
    let (wide, tall) = (rng.between(0.2, 0.35), rng.between(0.28, 0.4));
    let mut board = Piece::new(Class::Other, [wide, 0.14, tall]);
    board.block([0.0, 0.0, 0.0], [wide, 0.02, tall], wood(rng)).tilt_rad = -0.2;
    board
}

pub fn roll(_: &mut Rng) -> Piece {
    let mut roll = Piece::new(Class::Other, [0.12, 0.12, 0.26]);
    roll.post([0.0; 3], 0.055, 0.24, Finish::plain(WHITE));
    roll
}

pub fn loaf(rng: &mut Rng) -> Piece {
    let size = [rng.between(0.22, 0.34), 0.14, 0.11];
    let mut loaf = Piece::new(Class::Other, size);
    loaf.cushion([0.0; 3], size, Finish::plain([0.65, 0.45, 0.25]));
    loaf
}
