//! Kitchens and bathrooms.

use crate::simulate::finish::{DARK, Finish, METAL, Pattern, WHITE, cloth, front};
use crate::simulate::piece::Piece;
use crate::simulate::rng::Rng;
use viola_geometry::taxonomy::Class;

fn ceramic() -> Finish {
    Finish::plain([0.94, 0.94, 0.93]).glossy(0.5)
}

/// Returns a run of kitchen units on a recessed plinth, with sink, stove and wall cabinets.
pub fn kitchen_run(width: f64, tall_ok: bool, rng: &mut Rng) -> Piece {
    let depth = 0.62;
    let finish = front(rng);
    let mut run = Piece::new(Class::Counter, [width, depth, 0.9]);
    run.block([0.0, 0.03, 0.0], [width, depth - 0.07, 0.1], finish.darker(0.45));
    run.block([0.0, 0.01, 0.1], [width, depth - 0.03, 0.76], finish);
    let top =
        Finish::plain(rng.pick([[0.35, 0.33, 0.32], [0.75, 0.72, 0.68], [0.55, 0.42, 0.30]])).glossy(0.3);
    run.block([0.0, 0.0, 0.86], [width, depth, 0.04], top.with(Pattern::Grain, 0.02));
    for joint in 1..(width / 0.6) as usize {
        let x = joint as f64 * 0.6 - width / 2.0;
        run.block([x, 0.025 - depth / 2.0, 0.12], [0.006, 0.01, 0.7], finish.darker(0.4));
    }
    let steel = Finish::plain(METAL).glossy(0.8);
    let side = rng.sign();
    let stove = side * (width / 4.0);
    run.block([stove, 0.0, 0.9], [0.56, 0.5, 0.006], Finish::plain([0.05; 3]).glossy(0.8)).class =
        Class::Stove;
    run.block([stove, 0.022 - depth / 2.0, 0.2], [0.56, 0.01, 0.55], Finish::plain(DARK).glossy(0.7)).class =
        Class::Stove;
    if width > 1.5 {
        run.block([-stove, 0.0, 0.9], [0.5, 0.42, 0.008], steel).class = Class::Sink;
        run.post([-stove, 0.24, 0.9], 0.015, 0.26, steel).class = Class::Sink;
    }
    for _ in 0..rng.count(1, 4) {
        let item = [rng.between(0.1, 0.3), rng.between(0.1, 0.25), rng.between(0.12, 0.35)];
        let at = [rng.between(-0.45, 0.45) * width, 0.12, 0.9];
        run.block(at, item, cloth(rng)).class = Class::Box;
    }
    if tall_ok {
        let (low, high) = (1.42, rng.between(2.0, 2.25));
        run.block([0.0, depth / 2.0 - 0.18, low], [width, 0.36, high - low], finish);
        for joint in 1..(width / 0.6) as usize {
            let x = joint as f64 * 0.6 - width / 2.0;
            run.block([x, depth / 2.0 - 0.36, low], [0.006, 0.01, high - low], finish.darker(0.4));
        }
        run.size[2] = high;
    }
    run
}

/// Returns a kitchen island: a plinth, a body, and an overhanging worktop.
pub fn island(rng: &mut Rng) -> Piece {
    let (width, depth) = (rng.between(1.2, 2.0), rng.between(0.7, 0.95));
    let finish = front(rng);
    let mut piece = Piece::new(Class::Counter, [width, depth, 0.92]);
    piece.block([0.0, 0.0, 0.0], [width - 0.3, depth - 0.3, 0.1], finish.darker(0.5));
    piece.block([0.0, 0.0, 0.1], [width - 0.2, depth - 0.2, 0.78], finish);
    piece.block([0.0, 0.0, 0.88], [width, depth, 0.04], finish.darker(0.7).glossy(0.3));
    piece
}

pub fn fridge(rng: &mut Rng) -> Piece {
    let size = [rng.between(0.56, 0.68), rng.between(0.6, 0.68), rng.between(1.5, 1.95)];
    let finish = Finish::plain(rng.pick([WHITE, METAL])).glossy(0.5);
    let mut piece = Piece::new(Class::Refrigerator, size);
    piece.block([0.0, 0.03, 0.0], [size[0] - 0.04, size[1] - 0.08, 0.05], Finish::plain(DARK));
    piece.block([0.0, 0.0, 0.05], [size[0], size[1], size[2] - 0.05], finish);
    piece.block([0.0, -size[1] / 2.0, size[2] * 0.62], [size[0], 0.008, 0.01], Finish::plain(DARK));
    piece.block(
        [size[0] * 0.38, -size[1] / 2.0 - 0.02, size[2] * 0.4],
        [0.025, 0.03, 0.3],
        finish.darker(0.6),
    );
    piece
}

pub fn washing_machine() -> Piece {
    let mut piece = Piece::new(Class::WashingMachine, [0.6, 0.6, 0.85]);
    piece.block([0.0, 0.02, 0.0], [0.58, 0.54, 0.03], Finish::plain(DARK));
    piece.block([0.0, 0.0, 0.03], [0.6, 0.6, 0.82], ceramic());
    // The round door in the front.
    let door =
        piece.ball([0.0, -0.3, 0.25], [0.36, 0.05, 0.36], Finish::plain([0.2, 0.22, 0.25]).glossy(0.7));
    door.class = Class::WashingMachine;
    piece
}

pub fn toilet() -> Piece {
    let mut piece = Piece::new(Class::Toilet, [0.38, 0.66, 0.8]);
    piece.block([0.0, 0.08, 0.0], [0.2, 0.42, 0.34], ceramic());
    piece.solid_bowl();
    piece.block([0.0, 0.26, 0.36], [0.38, 0.14, 0.42], ceramic());
    piece
}

impl Piece {
    fn solid_bowl(&mut self) {
        let bowl = self.post([0.0, -0.08, 0.2], 0.18, 0.2, ceramic());
        bowl.half.y = 0.25;
    }
}

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
    piece.post([0.0, depth / 2.0 - 0.06, 0.86], 0.015, 0.14, Finish::plain(METAL).glossy(0.8));
    let mirror = Finish::plain([0.72, 0.77, 0.80]).glossy(0.9);
    piece.block([0.0, depth / 2.0 - 0.012, 1.15], [width * 0.9, 0.02, 0.7], mirror).class = Class::Mirror;
    piece
}

/// Returns a bathtub: four sides and a bottom.
pub fn bathtub(rng: &mut Rng) -> Piece {
    let (width, depth, height) = (rng.between(1.5, 1.75), rng.between(0.7, 0.8), 0.58);
    let mut piece = Piece::new(Class::Bathtub, [width, depth, height]);
    piece.block([0.0, 0.0, 0.0], [width, depth, 0.16], ceramic());
    for y in [-1.0, 1.0] {
        piece.block([0.0, y * (depth / 2.0 - 0.035), 0.16], [width, 0.07, height - 0.16], ceramic());
    }
    for x in [-1.0, 1.0] {
        piece.block([x * (width / 2.0 - 0.05), 0.0, 0.16], [0.1, depth - 0.14, height - 0.16], ceramic());
    }
    let steel = Finish::plain(METAL).glossy(0.8);
    piece.post([-width / 2.0 + 0.1, depth / 2.0 - 0.03, height], 0.012, 1.3, steel);
    piece
}

/// Returns a shower tray with a curtain drawn to one side.
pub fn shower(rng: &mut Rng) -> Piece {
    let side = rng.between(0.8, 0.95);
    let mut piece = Piece::new(Class::Shower, [side, side, 2.0]);
    piece.block([0.0, 0.0, 0.0], [side, side, rng.between(0.03, 0.14)], ceramic());
    let steel = Finish::plain(METAL).glossy(0.8);
    piece.post([0.0, side / 2.0 - 0.03, 0.9], 0.015, 1.1, steel);
    piece.post([0.0, side / 2.0 - 0.12, 1.98], 0.1, 0.02, steel);
    piece.block([0.0, 0.02 - side / 2.0, 1.97], [side, 0.02, 0.02], steel);
    let curtain = cloth(rng).with(Pattern::Stripes, 0.08);
    let drawn = rng.between(0.2, 0.5);
    let item = piece.block([(drawn - side) / 2.0, 0.03 - side / 2.0, 0.15], [drawn, 0.05, 1.82], curtain);
    item.class = Class::Curtain;
    piece
}
