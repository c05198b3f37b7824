//! Things that stand and lie about on floors.

use super::colours::painted;
use super::goods;
use super::sizes::{BOX, TRASH_BIN};
use crate::simulate::finish::{DARK, Finish, METAL, Pattern, WHITE, cloth, wood};
use crate::simulate::piece::{Piece, TopKind};
use crate::simulate::plan::RoomKind;
use crate::simulate::rng::Rng;
use std::f64::consts::FRAC_PI_2;
use viola_geometry::Pose2;
use viola_geometry::taxonomy::Class;

type Make = fn(&mut Rng) -> Piece;

/// Returns a thing that stands on the floor of a room of this kind, mostly at a wall.
pub fn standing_thing(kind: RoomKind, rng: &mut Rng) -> Piece {
    let make: Make = match kind {
        RoomKind::Bathroom => rng.pick([hamper as Make, bin, drying_rack, scales, boxes]),
        RoomKind::Kitchen | RoomKind::Dining => rng.pick([bin as Make, bin, crate_of_bottles, boxes, carton]),
        RoomKind::Corridor => {
            rng.pick([shoes as Make, shoes, suitcase, bag, bicycle, umbrella_stand, ladder])
        }
        RoomKind::Storage => rng.pick([
            boxes as Make,
            carton,
            suitcase,
            vacuum,
            ironing_board,
            ladder,
            fan,
            drying_rack,
            bicycle,
        ]),
        RoomKind::Child => rng.pick([toys as Make, toys, hamper, bag, carton, guitar, bin]),
        RoomKind::Study => rng.pick([bin as Make, boxes, carton, bag, guitar, fan]),
        RoomKind::Bedroom => {
            rng.pick([hamper as Make, suitcase, bag, shoes, drying_rack, fan, ironing_board, carton, guitar])
        }
        RoomKind::Living | RoomKind::Studio => {
            rng.pick([carton as Make, boxes, bag, guitar, fan, toys, basket, bicycle, drying_rack, vacuum])
        }
    };
    make(rng)
}

/// Returns a thing that somebody dropped on the floor.
pub fn dropped(kind: RoomKind, rng: &mut Rng) -> Piece {
    let make: Make = match kind {
        RoomKind::Child => rng.pick([toys as Make, toys, goods::worn, goods::pillow]),
        RoomKind::Bathroom => goods::worn,
        RoomKind::Kitchen | RoomKind::Dining | RoomKind::Corridor => {
            rng.pick([shoes as Make, bag, goods::toy])
        }
        _ => rng.pick([goods::worn as Make, goods::worn, shoes, bag, goods::toy, goods::pillow, boxes]),
    };
    make(rng).movable()
}

fn thing(class: Class, size: [f64; 3]) -> Piece {
    Piece::new(class, size).movable()
}

fn bag(rng: &mut Rng) -> Piece {
    goods::bag(rng).movable()
}

/// Returns a cardboard box, closed or with its flaps up.
pub fn carton(rng: &mut Rng) -> Piece {
    let size = BOX.draw(rng);
    let [width, depth, height] = size;
    let mut piece = thing(Class::Box, size);
    let card = Finish::plain([0.70, 0.55, 0.38]);
    piece.block([0.0; 3], size, card);
    if rng.chance(0.35) {
        for side in [-1.0, 1.0] {
            let flap = piece.block([0.0, side * depth / 2.0, height - 0.02], [width, 0.006, 0.15], card);
            flap.tilt_rad = -side * rng.between(-0.2, 0.9);
        }
    }
    piece.top(TopKind::Store, [0.0, 0.0, height], [width * 0.8, depth * 0.8], 0.3);
    piece
}

/// Returns a pile of boxes that do not quite stand on each other.
fn boxes(rng: &mut Rng) -> Piece {
    let size = BOX.draw(rng);
    let mut pile = thing(Class::Box, size);
    let mut z = 0.0;
    for _ in 0..rng.count(1, 3) {
        let scale = rng.between(0.7, 1.0);
        let finish = if rng.chance(0.6) { Finish::plain([0.70, 0.55, 0.38]) } else { painted(rng) };
        let high = size[2] * rng.between(0.6, 1.0);
        let solid = pile.block([0.0, 0.0, z], [size[0] * scale, size[1] * scale, high], finish);
        solid.yaw_rad = rng.between(-0.15, 0.15);
        z += high;
    }
    pile.size[2] = z;
    pile
}

/// Returns a basket of any use.
fn basket(rng: &mut Rng) -> Piece {
    let (radius, tall) = (rng.between(0.15, 0.26), rng.between(0.22, 0.45));
    let mut piece = thing(Class::Box, [2.0 * radius, 2.0 * radius, tall]);
    piece.post([0.0; 3], radius, tall, wood(rng).with(Pattern::Stripes, 0.03));
    piece.ball([0.0, 0.0, tall - 0.08], [1.7 * radius, 1.7 * radius, 0.16], cloth(rng)).class =
        Class::Clothes;
    piece
}

/// Returns a laundry basket with or without laundry.
fn hamper(rng: &mut Rng) -> Piece {
    let size = [rng.between(0.35, 0.6), rng.between(0.3, 0.45), rng.between(0.35, 0.65)];
    let [width, depth, height] = size;
    let mut piece = thing(Class::Box, size);
    piece.block([0.0; 3], size, painted(rng).with(Pattern::Tiles, 0.04));
    if rng.chance(0.7) {
        for _ in 0..rng.count(1, 3) {
            let at = [rng.between(-0.1, 0.1) * width, rng.between(-0.1, 0.1) * depth, height - 0.1];
            let heap = piece.cushion(at, [width * 0.75, depth * 0.75, rng.between(0.15, 0.3)], cloth(rng));
            heap.class = Class::Clothes;
            heap.roll_rad = rng.between(-0.25, 0.25);
        }
    }
    piece
}

pub fn bin(rng: &mut Rng) -> Piece {
    let [width, depth, height] = TRASH_BIN.draw(rng);
    let mut piece = thing(Class::Box, [width, depth, height]);
    let tone = cloth(rng).rgb;
    let finish = Finish::plain(rng.pick([METAL, DARK, WHITE, tone])).glossy(0.3);
    if rng.chance(0.5) {
        let radius = width.min(depth) / 2.0;
        piece.size = [2.0 * radius, 2.0 * radius, height];
        piece.post([0.0; 3], radius, height - 0.05, finish);
        piece.ball([0.0, 0.0, height - 0.1], [2.0 * radius, 2.0 * radius, 0.1], finish.darker(0.8));
    } else {
        piece.block([0.0; 3], [width, depth, height - 0.06], finish);
        piece.cushion([0.0, 0.0, height - 0.08], [width, depth, 0.08], finish.darker(0.7));
    }
    piece
}

fn crate_of_bottles(rng: &mut Rng) -> Piece {
    let mut piece = thing(Class::Box, [0.4, 0.3, 0.33]);
    piece.block([0.0; 3], [0.4, 0.3, 0.24], painted(rng));
    for k in 0..rng.count(2, 6) {
        let at = [(k % 3) as f64 * 0.12 - 0.12, (k / 3) as f64 * 0.12 - 0.06, 0.22];
        piece.post(at, 0.035, 0.1, Finish::plain([0.2, 0.3, 0.15]).glossy(0.5)).class = Class::Other;
    }
    piece
}

fn scales(rng: &mut Rng) -> Piece {
    let mut piece = thing(Class::Other, [0.3, 0.3, 0.04]);
    piece.block([0.0; 3], [0.3, 0.3, 0.035], painted(rng).glossy(0.5));
    piece
}

/// Returns pairs of shoes that stand side by side or lie about.
fn shoes(rng: &mut Rng) -> Piece {
    let pairs = rng.count(1, 3);
    let width = 0.26 * pairs as f64;
    let mut piece = thing(Class::Clothes, [width, 0.32, 0.12]);
    for pair in 0..pairs {
        let finish = cloth(rng).darker(0.7);
        let (tall, turn) = (rng.between(0.08, 0.13), rng.between(-0.3, 0.3));
        for foot in [-0.055, 0.055] {
            let x = 0.26 * (pair as f64 + 0.5) - width / 2.0 + foot;
            let y = rng.between(-0.02, 0.02);
            let sole = piece.cushion([x, y, 0.0], [0.095, 0.28, tall * 0.65], finish);
            sole.yaw_rad = turn;
            let (s, c) = turn.sin_cos();
            piece.cushion([x - 0.06 * s, y + 0.06 * c, 0.0], [0.085, 0.13, tall], finish).yaw_rad = turn;
        }
    }
    piece
}

fn suitcase(rng: &mut Rng) -> Piece {
    let (wide, deep, tall) = (rng.between(0.36, 0.5), rng.between(0.22, 0.32), rng.between(0.52, 0.74));
    let mut piece = thing(Class::Box, [wide, deep, tall]);
    let shell = painted(rng).with(Pattern::Stripes, 0.04);
    piece.cushion([0.0, 0.0, 0.03], [wide, deep, tall - 0.03], shell);
    piece.block([0.0, 0.0, 0.05], [wide * 0.9, deep * 0.8, tall - 0.09], shell);
    for x in [-0.4, 0.4] {
        for y in [-0.3, 0.3] {
            piece.post([x * wide, y * deep, 0.0], 0.025, 0.06, Finish::plain(DARK));
        }
    }
    if rng.chance(0.4) {
        for x in [-0.08, 0.08] {
            piece.post([x, deep * 0.3, tall - 0.05], 0.008, 0.4, Finish::plain(METAL));
        }
        piece.block([0.0, deep * 0.3, tall + 0.34], [0.2, 0.025, 0.025], Finish::plain(DARK));
    }
    piece
}

/// Returns toys and building blocks spread over a patch of floor.
fn toys(rng: &mut Rng) -> Piece {
    let mut patch = thing(Class::Other, [0.7, 0.6, 0.25]);
    for _ in 0..rng.count(2, 7) {
        let at = [rng.between(-0.28, 0.28), rng.between(-0.22, 0.22), 0.0];
        let side = rng.between(0.04, 0.12);
        let finish = painted(rng);
        let solid = match rng.count(0, 2) {
            0 => patch.block(at, [side, side, side], finish),
            1 => patch.block(at, [side * 2.0, side, side * 0.7], finish),
            _ => patch.ball(at, [side, side, side], finish),
        };
        solid.yaw_rad = rng.between(-1.5, 1.5);
    }
    if rng.chance(0.5) {
        let toy = goods::toy(rng);
        patch.join(&toy, &Pose2::new(rng.between(-0.2, 0.2), 0.15, rng.between(-3.0, 3.0)), 0.0);
    }
    patch
}

/// Returns a bicycle, upright along x.
fn bicycle(rng: &mut Rng) -> Piece {
    let radius = rng.between(0.28, 0.35);
    let half = radius * 1.55;
    let length = 2.0 * (half + radius);
    let mut bike = thing(Class::Other, [length, 0.45, 1.0]);
    let (frame, tyre) = (painted(rng), Finish::plain(DARK));
    let (rear, front) = ([-half, 0.0, radius], [half, 0.0, radius]);
    for hub in [rear, front] {
        // The tyre is a ring of bars.
        for k in 0..12 {
            let at = |step: i32| {
                let (s, c) = (f64::from(step) * std::f64::consts::TAU / 12.0).sin_cos();
                [hub[0] + (radius - 0.02) * c, 0.0, hub[2] + (radius - 0.02) * s]
            };
            bike.bar(at(k), at(k + 1), 0.02, tyre);
        }
    }
    let (crank, seat, head) = ([-0.08, 0.0, radius], [-0.2, 0.0, 0.78], [half - 0.16, 0.0, 0.82]);
    for (from, to) in [(rear, crank), (rear, seat), (crank, seat), (crank, head), (seat, head), (front, head)]
    {
        bike.bar(from, to, 0.017, frame);
    }
    bike.cushion([-0.22, 0.0, 0.8], [0.26, 0.14, 0.07], tyre);
    bike.bar([head[0], -0.22, 0.95], [head[0], 0.22, 0.95], 0.014, tyre);
    bike.bar(head, [head[0], 0.0, 0.95], 0.015, frame);
    bike.bar([crank[0], 0.0, radius], [crank[0] + 0.02, -0.12, 0.02], 0.01, frame);
    bike
}

/// Returns a guitar on a stand.
fn guitar(rng: &mut Rng) -> Piece {
    let mut piece = thing(Class::Other, [0.4, 0.32, 1.05]);
    let body = wood(rng).glossy(0.5);
    let lean = -0.18;
    for (z, wide) in [(0.08, 0.38), (0.34, 0.29)] {
        let solid = piece.ball([0.0, 0.1 * (z - 0.4), z], [wide, 0.1, wide * 0.95], body);
        solid.tilt_rad = lean;
    }
    piece.bar([0.0, 0.02, 0.5], [0.0, 0.11, 1.03], 0.024, body.darker(0.5));
    for x in [-0.14, 0.14] {
        piece.bar([x, -0.14, 0.0], [0.0, 0.06, 0.5], 0.01, Finish::plain(DARK));
    }
    piece.bar([0.0, 0.15, 0.0], [0.0, 0.06, 0.5], 0.01, Finish::plain(DARK));
    piece
}

/// Returns a fan on a stand.
fn fan(rng: &mut Rng) -> Piece {
    let top = rng.between(0.9, 1.3);
    let mut piece = thing(Class::Other, [0.42, 0.42, top + 0.2]);
    let finish = Finish::plain(rng.pick([WHITE, DARK]));
    piece.post([0.0; 3], 0.2, 0.03, finish);
    piece.post([0.0; 3], 0.014, top, finish);
    piece.bar([0.0, -0.09, top], [0.0, 0.01, top], 0.2, finish.darker(0.9));
    piece.bar([0.0, 0.0, top], [0.0, 0.14, top], 0.06, finish);
    piece
}

/// Returns a vacuum cleaner with its hose, or an upright one.
fn vacuum(rng: &mut Rng) -> Piece {
    let finish = painted(rng).glossy(0.5);
    let pipe = Finish::plain(DARK);
    let mut piece = thing(Class::Other, [0.4, 0.5, 1.05]);
    if rng.chance(0.5) {
        piece.ball([0.05, 0.0, 0.0], [0.28, 0.42, 0.26], finish);
        piece.bar([0.05, -0.18, 0.16], [-0.12, -0.2, 0.02], 0.02, pipe);
        piece.bar([-0.12, -0.2, 0.03], [-0.15, 0.15, 1.0], 0.016, pipe);
        piece.block([-0.12, -0.2, 0.0], [0.26, 0.1, 0.05], pipe);
    } else {
        piece.cushion([0.0, -0.12, 0.0], [0.3, 0.25, 0.1], pipe);
        piece.bar([0.0, -0.08, 0.08], [0.0, 0.08, 0.7], 0.07, finish);
        piece.bar([0.0, 0.08, 0.7], [0.0, 0.16, 1.03], 0.016, pipe);
    }
    piece
}

/// Returns a folding rack with laundry on it.
fn drying_rack(rng: &mut Rng) -> Piece {
    let (width, top) = (rng.between(0.9, 1.3), rng.between(0.85, 1.0));
    let mut rack = thing(Class::Other, [width, 0.56, top]);
    let wire = Finish::plain(WHITE).glossy(0.4);
    for x in [-0.47, 0.47] {
        rack.bar([x * width, -0.26, 0.0], [x * width, 0.2, top], 0.01, wire);
        rack.bar([x * width, 0.26, 0.0], [x * width, -0.2, top], 0.01, wire);
    }
    for k in 0..5 {
        let y = f64::from(k) * 0.1 - 0.2;
        rack.bar([-width / 2.0, y, top], [width / 2.0, y, top], 0.006, wire);
        if rng.chance(0.65) {
            let wide = rng.between(0.25, 0.7) * width;
            let long = rng.between(0.25, 0.6);
            let x = rng.between(-0.5, 0.5) * (width - wide);
            let item = rack.block([x, y, top - long], [wide, 0.025, long + 0.01], cloth(rng));
            item.class = Class::Clothes;
        }
    }
    rack
}

fn ironing_board(rng: &mut Rng) -> Piece {
    let (length, top) = (1.25, rng.between(0.8, 0.95));
    let mut board = thing(Class::Other, [length, 0.38, top]);
    let cover = cloth(rng).with(Pattern::Picture, 0.06);
    board.block([-0.1, 0.0, top - 0.03], [length - 0.25, 0.36, 0.03], cover);
    board.post([length / 2.0 - 0.22, 0.0, top - 0.03], 0.18, 0.03, cover);
    let tube = Finish::plain(METAL);
    for y in [-0.12, 0.12] {
        board.bar([-0.4, y, 0.0], [0.35, y * 0.5, top - 0.03], 0.013, tube);
        board.bar([0.4, y, 0.0], [-0.35, y * 0.5, top - 0.03], 0.013, tube);
    }
    board
}

/// Returns a stepladder.
fn ladder(rng: &mut Rng) -> Piece {
    let top = rng.between(0.9, 1.6);
    let mut ladder = thing(Class::Other, [0.45, 0.7, top]);
    let alloy = Finish::plain(METAL).glossy(0.4);
    for x in [-0.2, 0.2] {
        ladder.bar([x, -0.33, 0.0], [x * 0.8, 0.0, top], 0.02, alloy);
        ladder.bar([x, 0.33, 0.0], [x * 0.8, 0.02, top], 0.016, alloy);
    }
    let steps = (top / 0.25) as usize;
    for step in 1..steps {
        let z = 0.25 * step as f64;
        ladder.block([0.0, -0.33 * (1.0 - z / top), z], [0.38, 0.09, 0.025], alloy);
    }
    ladder
}

fn umbrella_stand(rng: &mut Rng) -> Piece {
    let mut stand = thing(Class::Other, [0.24, 0.24, 0.8]);
    stand.post([0.0; 3], 0.11, 0.45, painted(rng));
    for k in 0..rng.count(1, 3) {
        let (s, c) = (k as f64 * 2.0 + FRAC_PI_2).sin_cos();
        stand.bar(
            [0.0, 0.0, 0.1],
            [0.08 * c, 0.08 * s, rng.between(0.65, 0.82)],
            0.02,
            cloth(rng).darker(0.6),
        );
    }
    stand
}
