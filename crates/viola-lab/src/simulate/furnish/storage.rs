//! Cabinets, wardrobes, and what belongs to them.

use super::sizes::{DRESSER, TELEVISION, TV_STAND};
use crate::simulate::finish::{DARK, Finish, METAL, cloth, front};
use crate::simulate::piece::{Piece, TopKind};
use crate::simulate::rng::Rng;
use viola_geometry::taxonomy::Class;

/// Height up to which people put things on a cabinet, in metres.
const REACH_M: f64 = 2.1;

/// Returns a closed cabinet on a plinth or on feet: nightstand, dresser, sideboard, wardrobe.
pub fn cabinet(class: Class, size: [f64; 3], rng: &mut Rng) -> Piece {
    let [width, depth, height] = size;
    let finish = front(rng);
    let mut piece = Piece::new(class, size);
    let foot = if rng.chance(0.4) {
        let gap = rng.between(0.06, 0.18);
        piece.legs(width, depth, gap, 0.035, 0.02, finish.darker(0.7));
        gap
    } else {
        piece.block([0.0, 0.02, 0.0], [width - 0.02, depth - 0.05, 0.07], finish.darker(0.6));
        0.07
    };
    piece.block([0.0, 0.0, foot], [width, depth, height - foot], finish);
    let doors = (width / rng.between(0.38, 0.55)).round().max(1.0) as usize;
    let rows = if height < 1.3 { ((height - foot) / rng.between(0.18, 0.3)) as usize } else { 1 };
    face(&mut piece, foot, finish, [doors, rows], rng);
    if height < REACH_M {
        piece.top(TopKind::Store, [0.0, 0.0, height], [width * 0.95, depth * 0.9], 0.45);
    }
    piece
}

/// Adds the gaps between doors or drawers, and their handles.
fn face(piece: &mut Piece, foot: f64, finish: Finish, [doors, rows]: [usize; 2], rng: &mut Rng) {
    let [width, depth, height] = piece.size;
    let shadow = finish.darker(0.45);
    let y = -depth / 2.0;
    for door in 1..doors {
        let x = width * door as f64 / doors as f64 - width / 2.0;
        piece.block([x, y, foot + 0.03], [0.006, 0.006, height - foot - 0.05], shadow);
    }
    let step = (height - foot) / rows.max(1) as f64;
    for row in 1..rows {
        piece.block([0.0, y, foot + row as f64 * step], [width - 0.03, 0.006, 0.006], shadow);
    }
    if doors * rows.max(1) > 8 || rng.chance(0.3) {
        return;
    }
    let steel = Finish::plain(rng.pick([METAL, DARK])).glossy(0.6);
    for door in 0..doors {
        let middle = width * (door as f64 + 0.5) / doors as f64 - width / 2.0;
        if rows > 1 {
            for row in 0..rows {
                let z = foot + (row as f64 + 0.6) * step;
                piece.block([middle, y - 0.01, z], [0.12, 0.02, 0.012], steel);
            }
        } else {
            let side = if door % 2 == 0 { 0.4 } else { -0.4 } * width / doors as f64;
            piece.block([middle + side, y - 0.01, foot + (height - foot) * 0.5], [0.015, 0.02, 0.16], steel);
        }
    }
}

/// Returns a dresser or sideboard of a usual size.
pub fn dresser(rng: &mut Rng) -> Piece {
    let size = DRESSER.draw(rng);
    cabinet(Class::Cabinet, size, rng).movable()
}

/// Returns an office cabinet of steel with drawers for files.
pub fn filing_cabinet(rng: &mut Rng) -> Piece {
    let (drawers, finish) = (rng.count(2, 4), Finish::plain(rng.pick([METAL, DARK, [0.8, 0.8, 0.78]])));
    let height = 0.33 * drawers as f64 + 0.06;
    let mut piece = Piece::new(Class::Cabinet, [0.46, 0.62, height]);
    piece.block([0.0; 3], [0.46, 0.62, height], finish.glossy(0.3));
    for row in 0..drawers {
        let z = 0.04 + 0.33 * row as f64;
        piece.block([0.0, -0.31, z], [0.42, 0.02, 0.31], finish.glossy(0.4));
        piece.block([0.0, -0.325, z + 0.2], [0.14, 0.02, 0.025], finish.darker(0.5));
    }
    piece.top(TopKind::Store, [0.0, 0.0, height], [0.42, 0.55], 0.4);
    piece
}

/// Returns a nightstand: with drawers, or an open cube.
pub fn nightstand(rng: &mut Rng) -> Piece {
    let size = [rng.between(0.34, 0.55), rng.between(0.32, 0.45), rng.between(0.38, 0.65)];
    if rng.chance(0.65) {
        return cabinet(Class::Cabinet, size, rng).movable();
    }
    let [width, depth, height] = size;
    let finish = front(rng);
    let mut stand = Piece::new(Class::Cabinet, size).movable();
    for x in [-1.0, 1.0] {
        stand.block([x * (width / 2.0 - 0.01), 0.0, 0.0], [0.02, depth, height], finish);
    }
    for z in [0.08, height * 0.55, height - 0.02] {
        stand.block([0.0, 0.0, z], [width, depth, 0.02], finish);
    }
    stand.top(TopKind::Store, [0.0, 0.0, height * 0.55 + 0.02], [width * 0.7, depth * 0.8], height * 0.35);
    stand.top(TopKind::Store, [0.0, 0.0, height], [width * 0.9, depth * 0.9], 0.5);
    stand
}

/// Returns a wardrobe: closed, with a door ajar, or an open rail with clothes.
pub fn wardrobe(width: f64, rng: &mut Rng) -> Piece {
    let size = [width, rng.between(0.52, 0.66), rng.between(1.85, 2.3)];
    match rng.count(0, 9) {
        0..=5 => closed(size, rng),
        6 | 7 => ajar(size, rng),
        _ => open_wardrobe(size, rng),
    }
}

fn closed(size: [f64; 3], rng: &mut Rng) -> Piece {
    let [width, depth, height] = size;
    let mut piece = cabinet(Class::Cabinet, size, rng);
    if rng.chance(0.2) {
        let mirror = Finish::mirror();
        let wide = (width * 0.45).min(0.7);
        let x = (rng.sign() * (width - wide) / 2.0) * 0.95;
        let door = piece.block([x, -depth / 2.0 - 0.002, 0.1], [wide, 0.008, height - 0.16], mirror);
        door.class = Class::Mirror;
    }
    if piece.tops.is_empty() {
        piece.top(TopKind::Store, [0.0, 0.0, height], [width * 0.95, depth * 0.8], 0.28);
    }
    piece
}

/// Returns the case of a wardrobe with open front, 2 cm thick.
fn case(size: [f64; 3], finish: Finish) -> Piece {
    let [width, depth, height] = size;
    let mut piece = Piece::new(Class::Cabinet, size);
    for x in [-1.0, 1.0] {
        piece.block([x * (width / 2.0 - 0.01), 0.0, 0.0], [0.02, depth, height], finish);
    }
    piece.block([0.0, depth / 2.0 - 0.005, 0.0], [width, 0.01, height], finish.darker(0.9));
    for z in [0.0, height - 0.02] {
        piece.block([0.0, 0.0, z], [width, depth, if z == 0.0 { 0.08 } else { 0.02 }], finish);
    }
    piece.top(TopKind::Store, [0.0, 0.0, height], [width * 0.95, depth * 0.8], 0.25);
    piece
}

fn open_wardrobe(size: [f64; 3], rng: &mut Rng) -> Piece {
    let [width, _, height] = size;
    let finish = front(rng);
    let mut piece = case(size, finish);
    let rail = height - 0.35;
    piece.block([0.0, 0.0, rail + 0.1], [width - 0.04, size[1] - 0.02, 0.02], finish);
    hang_clothes(&mut piece, [0.05 - width / 2.0, width / 2.0 - 0.05], 0.0, rail, rng);
    piece.top(TopKind::Soft, [0.0, 0.0, 0.08], [width * 0.8, size[1] * 0.7], 0.3);
    piece.top(TopKind::Soft, [0.0, 0.0, rail + 0.12], [width * 0.9, size[1] * 0.8], 0.2);
    piece
}

/// Returns a wardrobe of which one door stands open.
fn ajar(size: [f64; 3], rng: &mut Rng) -> Piece {
    let [width, depth, height] = size;
    let finish = front(rng);
    let doors = (width / 0.5).round().max(1.0) as usize;
    let wide = width / doors as f64;
    let open = rng.count(0, doors - 1);
    let mut piece = case([width, depth, height], finish);
    let swing = rng.between(0.3, 1.7);
    for door in 0..doors {
        let left = wide * door as f64 - width / 2.0;
        if door == open {
            // Its hinge is on the left.
            let (s, c) = swing.sin_cos();
            let (x, y) = (left + wide / 2.0 * c, -depth / 2.0 - wide / 2.0 * s);
            piece.block([x, y, 0.08], [wide - 0.01, 0.02, height - 0.1], finish).yaw_rad = -swing;
        } else {
            let bottom = [left + wide / 2.0, -depth / 2.0, 0.08];
            piece.block(bottom, [wide - 0.006, 0.02, height - 0.1], finish);
        }
    }
    let left = wide * open as f64 - width / 2.0;
    hang_clothes(&mut piece, [left + 0.05, left + wide - 0.05], 0.0, height - 0.25, rng);
    piece
}

/// Adds clothes on a rail from x = `from` to `to`.
fn hang_clothes(piece: &mut Piece, [from, to]: [f64; 2], y: f64, rail: f64, rng: &mut Rng) {
    piece.bar([from - 0.04, y, rail], [to + 0.04, y, rail], 0.012, Finish::plain(METAL).glossy(0.6));
    let mut x = from;
    while x < to - 0.04 {
        let thick = rng.between(0.035, 0.09);
        let long = rng.between(0.6, 1.15).min(rail - 0.2);
        let finish = cloth(rng).darker(rng.between(0.5, 1.0) as f32);
        let bottom = [x + thick / 2.0, y, rail - long - 0.02];
        let item = piece.cushion(bottom, [thick * 1.15, rng.between(0.36, 0.48), long], finish);
        item.class = Class::Clothes;
        item.yaw_rad = rng.between(-0.12, 0.12);
        x += thick + rng.between(0.005, 0.12);
    }
}

/// Returns a free clothes rail, or coats on hooks, above the vacuum.
pub fn coats(rng: &mut Rng) -> Piece {
    let width = rng.between(0.5, 1.1);
    let mut piece = Piece::new(Class::Clothes, [width, 0.32, 1.75]);
    if rng.chance(0.3) {
        piece = Piece::new(Class::Clothes, [width, 0.46, 1.65]).movable();
        let steel = Finish::plain(rng.pick([METAL, DARK]));
        for x in [-1.0, 1.0] {
            let x = x * (width / 2.0 - 0.02);
            piece.post([x, 0.0, 0.0], 0.012, 1.62, steel).class = Class::Other;
            piece.block([x, 0.0, 0.0], [0.03, 0.44, 0.025], steel).class = Class::Other;
        }
        hang_clothes(&mut piece, [0.06 - width / 2.0, width / 2.0 - 0.06], 0.0, 1.6, rng);
        return piece;
    }
    piece.block([0.0, 0.14, 1.65], [width, 0.03, 0.08], Finish::plain(DARK)).class = Class::Shelf;
    let mut x = 0.14 - width / 2.0;
    while x < width / 2.0 - 0.1 {
        let long = rng.between(0.6, 1.1);
        let finish = cloth(rng).darker(0.7);
        let size = [rng.between(0.18, 0.34), rng.between(0.14, 0.26), long];
        piece.cushion([x, 0.02, 1.68 - long], size, finish);
        if rng.chance(0.2) {
            piece.cushion([x, -0.05, 1.05], [0.26, 0.16, 0.42], cloth(rng)).class = Class::Box;
        }
        x += rng.between(0.14, 0.28);
    }
    piece
}

/// Returns a low cabinet, an open bench or a wall-hung box, with a television on it or above it.
pub fn tv_stand(rng: &mut Rng) -> Piece {
    let size = TV_STAND.draw(rng);
    let [width, depth, top] = size;
    let mut piece = if rng.chance(0.7) {
        cabinet(Class::Cabinet, size, rng)
    } else {
        let finish = front(rng);
        let mut bench = Piece::new(Class::Cabinet, size);
        for x in [-1.0, 0.0, 1.0] {
            bench.block([x * (width / 2.0 - 0.015), 0.0, 0.0], [0.03, depth, top], finish);
        }
        for z in [0.08, top - 0.03] {
            bench.block([0.0, 0.0, z], [width, depth, 0.03], finish);
        }
        let player = [rng.sign() * width * 0.25, 0.0, 0.11];
        bench.block(player, [0.4, 0.28, 0.07], Finish::plain(DARK)).class = Class::Other;
        bench
    };
    piece.tops.clear();
    let [wide, _, high] = TELEVISION.draw(rng);
    let screen = wide.min(width + 0.1);
    let high = high.min(screen * 0.6);
    let black = Finish::plain([0.04, 0.04, 0.05]).glossy(0.8);
    if rng.chance(0.3) {
        // On the wall behind the stand.
        let bottom = top + rng.between(0.1, 0.45);
        piece.block([0.0, depth / 2.0 - 0.03, bottom], [screen, 0.05, high], black).class = Class::Television;
        piece.size[2] = bottom + high;
    } else {
        for (bottom, size) in [
            ([0.0, 0.05, top], [0.4, 0.2, 0.015]),
            ([0.0, 0.08, top], [0.08, 0.05, 0.1]),
            ([0.0, 0.05, top + 0.07], [screen, 0.05, high]),
        ] {
            piece.block(bottom, size, black).class = Class::Television;
        }
        piece.size[2] = top + 0.07 + high;
    }
    if rng.chance(0.35) {
        let bar = [0.0, -depth / 2.0 + 0.1, top];
        piece.block(bar, [screen * 0.8, 0.08, 0.06], black).class = Class::Other;
    } else {
        for x in [-1.0, 1.0] {
            piece.top(TopKind::Store, [x * width * 0.4, -0.06, top], [width * 0.18, depth * 0.6], 0.4);
        }
    }
    piece.movable()
}
