//! Small things that stand and lie on level places.

use super::colours::painted;
use super::crockery;
use super::lamps::table_lamp;
use super::sizes::{BOOK, BOX, LAPTOP, PILLOW};
use crate::simulate::finish::{DARK, Finish, METAL, Pattern, WHITE, cloth, wood};
use crate::simulate::piece::{Piece, TopKind};
use crate::simulate::rng::Rng;
use viola_geometry::taxonomy::Class;

type Make = fn(&mut Rng) -> Piece;

/// Returns a random thing that people put on a place of this kind.
pub fn thing_for(kind: TopKind, rng: &mut Rng) -> Piece {
    let make: Make = match kind {
        TopKind::Table => rng.pick([
            crockery::cup as Make,
            crockery::cup,
            crockery::bottle,
            crockery::plate,
            crockery::bowl,
            books,
            laptop,
            flowers,
            candles,
            papers,
            carton,
            pot_plant,
            keepsake,
        ]),
        TopKind::Desk => rng.pick([
            crockery::cup as Make,
            books,
            books,
            papers,
            papers,
            laptop,
            table_lamp,
            pens,
            carton,
            speaker,
            pot_plant,
            crockery::bottle,
            printer,
            frame,
        ]),
        TopKind::Kitchen => rng.pick([
            crockery::cup as Make,
            crockery::bottle,
            crockery::bottle,
            crockery::bowl,
            crockery::toaster,
            crockery::kettle,
            crockery::machine,
            crockery::microwave,
            crockery::knives,
            crockery::plates,
            crockery::board,
            crockery::roll,
            pot_plant,
            crockery::loaf,
            carton,
        ]),
        TopKind::Bath => rng.pick([flask as Make, flask, folded, crockery::roll, pens, candles, carton]),
        TopKind::Store => rng.pick([
            books as Make,
            table_lamp,
            pot_plant,
            frame,
            frame,
            candles,
            keepsake,
            carton,
            carton,
            speaker,
            flowers,
            folded,
            crockery::bowl,
            clock,
        ]),
        TopKind::Soft => rng.pick([worn as Make, worn, folded, pillow, bag, papers, books, toy]),
    };
    make(rng)
}

/// Returns a bottle of soap or shampoo.
fn flask(rng: &mut Rng) -> Piece {
    let size = [rng.between(0.05, 0.09), rng.between(0.04, 0.06), rng.between(0.12, 0.26)];
    let mut flask = Piece::new(Class::Other, size);
    let finish = painted(rng);
    flask.cushion([0.0; 3], [size[0], size[1], size[2] * 0.85], finish);
    flask.post([0.0, 0.0, size[2] * 0.8], 0.012, size[2] * 0.2, finish.darker(0.6));
    flask
}

/// Returns a pile of books or magazines.
fn books(rng: &mut Rng) -> Piece {
    let [width, depth, _] = BOOK.draw(rng);
    let mut pile = Piece::new(Class::Other, [depth, width, 0.0]);
    let mut z = 0.0;
    for _ in 0..rng.count(1, 5) {
        let thick = rng.within(BOOK.height_m);
        let size = [depth * rng.between(0.75, 1.0), width * rng.between(0.75, 1.0), thick];
        pile.block([0.0, 0.0, z], size, painted(rng)).yaw_rad = rng.between(-0.2, 0.2);
        z += thick;
    }
    pile.size[2] = z;
    pile
}

fn papers(rng: &mut Rng) -> Piece {
    let mut papers = Piece::new(Class::Other, [0.34, 0.32, 0.02]);
    for _ in 0..rng.count(1, 3) {
        let at = [rng.between(-0.05, 0.05), rng.between(-0.04, 0.04), 0.0];
        let white = Finish::plain(WHITE).with(Pattern::Picture, 0.04);
        papers.block(at, [0.21, 0.297, rng.between(0.003, 0.02)], white).yaw_rad = rng.between(-0.7, 0.7);
    }
    papers
}

fn laptop(rng: &mut Rng) -> Piece {
    let [width, depth, height] = LAPTOP.draw(rng);
    let finish = Finish::plain(rng.pick([METAL, DARK])).glossy(0.4);
    let open = rng.chance(0.75);
    let mut laptop = Piece::new(Class::Television, [width, depth + 0.06, if open { height } else { 0.03 }]);
    laptop.block([0.0, -0.03, 0.0], [width, depth, 0.018], finish);
    if open {
        let lean = -rng.between(0.1, 0.4);
        let back = [0.0, depth / 2.0 - 0.01, 0.012];
        laptop.block(back, [width, 0.01, height], finish.darker(0.6)).tilt_rad = lean;
    }
    laptop
}

fn flowers(rng: &mut Rng) -> Piece {
    let (radius, tall) = (rng.between(0.04, 0.08), rng.between(0.12, 0.26));
    let mut vase = Piece::new(Class::Plant, [0.24, 0.24, tall + 0.25]);
    vase.post([0.0; 3], radius, tall, painted(rng));
    for _ in 0..rng.count(3, 5) {
        let (x, y) = (rng.between(-0.1, 0.1), rng.between(-0.1, 0.1));
        let z = tall + rng.between(0.05, 0.22);
        vase.bar([0.0, 0.0, tall], [x, y, z], 0.004, Finish::plain([0.2, 0.4, 0.2]));
        vase.ball([x, y, z - 0.03], [0.07, 0.07, 0.06], painted(rng));
    }
    vase
}

fn pot_plant(rng: &mut Rng) -> Piece {
    let (radius, tall) = (rng.between(0.05, 0.09), rng.between(0.08, 0.15));
    let mut plant = Piece::new(Class::Plant, [0.26, 0.26, tall + 0.22]);
    plant.post([0.0; 3], radius, tall, painted(rng));
    let leaves = Finish::plain([0.20, 0.42, 0.20]).with(Pattern::Grain, 0.02);
    for _ in 0..rng.count(1, 4) {
        let size = rng.between(0.1, 0.2);
        let at = [rng.between(-0.05, 0.05), rng.between(-0.05, 0.05), tall + rng.between(-0.04, 0.05)];
        let leaf = plant.ball(at, [size, size * 0.8, size], leaves);
        leaf.tilt_rad = rng.between(-0.6, 0.6);
    }
    plant
}

fn candles(rng: &mut Rng) -> Piece {
    let mut candles = Piece::new(Class::Other, [0.2, 0.1, 0.2]);
    for k in 0..rng.count(1, 3) {
        let at = [k as f64 * 0.07 - 0.07, rng.between(-0.02, 0.02), 0.0];
        candles.post(at, rng.between(0.012, 0.04), rng.between(0.06, 0.22), Finish::plain([0.9, 0.86, 0.75]));
    }
    candles
}

fn carton(rng: &mut Rng) -> Piece {
    let [width, depth, height] = BOX.draw(rng);
    let scale = rng.between(0.35, 0.8);
    let size = [width * scale, depth * scale, height * scale];
    let mut carton = Piece::new(Class::Box, size);
    let finish = if rng.chance(0.5) { Finish::plain([0.70, 0.55, 0.38]) } else { painted(rng) };
    carton.block([0.0; 3], size, finish);
    carton
}

fn keepsake(rng: &mut Rng) -> Piece {
    let (wide, tall) = (rng.between(0.1, 0.2), rng.between(0.15, 0.45));
    let mut figure = Piece::new(Class::Other, [wide, wide, tall]);
    let finish = painted(rng);
    figure.post([0.0; 3], wide * 0.4, tall * 0.1, finish.darker(0.7));
    figure.cushion([0.0, 0.0, tall * 0.1], [wide * 0.7, wide * 0.5, tall * 0.65], finish);
    figure.ball([0.0, 0.0, tall * 0.72], [wide * 0.45, wide * 0.45, tall * 0.28], finish);
    figure
}

fn pens(rng: &mut Rng) -> Piece {
    let mut pens = Piece::new(Class::Other, [0.09, 0.09, 0.2]);
    pens.post([0.0; 3], 0.04, 0.1, painted(rng));
    for _ in 0..3 {
        let lean = [rng.between(-0.04, 0.04), rng.between(-0.04, 0.04), 0.19];
        pens.bar([0.0, 0.0, 0.08], lean, 0.005, painted(rng));
    }
    pens
}

fn speaker(rng: &mut Rng) -> Piece {
    let size = [rng.between(0.1, 0.2), rng.between(0.1, 0.2), rng.between(0.15, 0.34)];
    let mut speaker = Piece::new(Class::Other, size);
    speaker.block([0.0; 3], size, Finish::plain(DARK));
    speaker
}

fn printer(rng: &mut Rng) -> Piece {
    let size = [rng.between(0.38, 0.46), rng.between(0.3, 0.36), rng.between(0.14, 0.28)];
    let mut printer = Piece::new(Class::Other, size);
    let finish = Finish::plain(rng.pick([WHITE, DARK]));
    printer.block([0.0; 3], size, finish);
    printer.block([0.0, -0.1, size[2]], [0.3, 0.1, 0.02], finish.darker(0.8));
    printer
}

/// Returns a photograph in a frame that leans.
fn frame(rng: &mut Rng) -> Piece {
    let (wide, tall) = (rng.between(0.12, 0.4), rng.between(0.15, 0.4));
    let mut frame = Piece::new(Class::Picture, [wide, 0.1, tall]);
    let print = Finish::plain(cloth(rng).rgb).with(Pattern::Picture, 0.05);
    for (y, inset, finish) in [(0.0, 0.0, wood(rng)), (-0.008, 0.03, print)] {
        let solid = frame.block([0.0, y, inset / 2.0], [wide - inset, 0.014, tall - inset], finish);
        solid.tilt_rad = -0.15;
    }
    frame
}

fn clock(rng: &mut Rng) -> Piece {
    let side = rng.between(0.1, 0.2);
    let mut clock = Piece::new(Class::Other, [side, 0.08, side]);
    clock.block([0.0; 3], [side, 0.07, side], painted(rng));
    clock
}

/// Returns a pile of folded laundry or towels.
fn folded(rng: &mut Rng) -> Piece {
    let (wide, deep) = (rng.between(0.26, 0.4), rng.between(0.22, 0.32));
    let mut pile = Piece::new(Class::Clothes, [wide, deep, 0.0]);
    let mut z = 0.0;
    for _ in 0..rng.count(1, 5) {
        let thick = rng.between(0.03, 0.07);
        let size = [wide * rng.between(0.85, 1.0), deep * rng.between(0.85, 1.0), thick + 0.01];
        pile.cushion([0.0, 0.0, z], size, cloth(rng));
        z += thick;
    }
    pile.size[2] = z;
    pile
}

/// Returns clothes as somebody dropped them.
pub fn worn(rng: &mut Rng) -> Piece {
    let spread = rng.between(0.3, 0.5);
    let mut pile = Piece::new(Class::Clothes, [spread, spread, 0.2]);
    for _ in 0..rng.count(2, 5) {
        let size = [spread * rng.between(0.4, 0.8), spread * rng.between(0.3, 0.6), rng.between(0.05, 0.15)];
        let reach = 0.22 * spread;
        let at = [rng.between(-reach, reach), rng.between(-reach, reach), -0.01];
        let part = pile.cushion(at, size, cloth(rng));
        part.yaw_rad = rng.between(-1.5, 1.5);
        part.tilt_rad = rng.between(-0.15, 0.15);
        part.roll_rad = rng.between(-0.15, 0.15);
    }
    pile
}

pub fn pillow(rng: &mut Rng) -> Piece {
    let [wide, deep, thick] = PILLOW.draw(rng);
    let mut pillow = Piece::new(Class::Pillow, [wide, deep, thick]);
    let solid = pillow.cushion([0.0; 3], [wide, deep, thick], cloth(rng));
    solid.roll_rad = rng.between(-0.1, 0.1);
    pillow
}

pub fn bag(rng: &mut Rng) -> Piece {
    let size = [rng.between(0.28, 0.42), rng.between(0.14, 0.24), rng.between(0.25, 0.42)];
    let mut bag = Piece::new(Class::Box, size);
    let finish = cloth(rng).darker(0.8);
    bag.cushion([0.0; 3], size, finish).tilt_rad = rng.between(-0.2, 0.2);
    let strap = size[2] + 0.1;
    bag.bar([-0.06, 0.0, size[2] - 0.04], [0.0, 0.0, strap], 0.008, finish);
    bag.bar([0.06, 0.0, size[2] - 0.04], [0.0, 0.0, strap], 0.008, finish);
    bag
}

/// Returns a stuffed animal or a ball.
pub fn toy(rng: &mut Rng) -> Piece {
    let finish = cloth(rng);
    let big = rng.between(0.7, 1.4);
    let mut toy = Piece::new(Class::Other, [0.26 * big, 0.2 * big, 0.3 * big]);
    if rng.chance(0.3) {
        toy.ball([0.0; 3], [0.2 * big, 0.2 * big, 0.2 * big], painted(rng));
        return toy;
    }
    toy.ball([0.0; 3], [0.18 * big, 0.14 * big, 0.2 * big], finish);
    toy.ball([0.0, -0.01, 0.17 * big], [0.13 * big, 0.12 * big, 0.13 * big], finish);
    for x in [-0.09, 0.09] {
        toy.ball([x * big, -0.03, 0.0], [0.07 * big, 0.14 * big, 0.07 * big], finish);
    }
    toy
}
