//! Beds, wardrobes, shelves, cabinets and their contents.

use crate::simulate::finish::{DARK, Finish, Pattern, WHITE, cloth, front, wood};
use crate::simulate::piece::Piece;
use crate::simulate::rng::Rng;
use viola_geometry::taxonomy::Class;

/// Returns a bed with its head at the wall; a vacuum drives under some and stops at the base of others.
pub fn bed(width: f64, rng: &mut Rng) -> Piece {
    let length = rng.between(2.0, 2.12);
    let frame = if rng.chance(0.5) { wood(rng) } else { cloth(rng) };
    let head = rng.between(0.75, 1.15);
    let mut bed = Piece::new(Class::Bed, [width, length, head]);
    let gap = match rng.count(0, 3) {
        0 => 0.0,
        1 => rng.between(0.04, 0.08),
        _ => rng.between(0.13, 0.22),
    };
    if gap > 0.1 {
        bed.legs(width, length, gap, 0.06, 0.03, frame);
    } else {
        // A plinth recessed from the edge.
        bed.block([0.0, 0.0, 0.0], [width - 0.1, length - 0.1, gap.max(0.02)], frame.darker(0.6));
    }
    let rim = 0.32;
    bed.block([0.0, 0.0, gap], [width, length, rim - gap], frame);
    bed.block([0.0, length / 2.0 - 0.03, rim], [width, 0.06, head - rim], frame);
    let sheet = Finish::plain(WHITE).with(Pattern::Grain, 0.02);
    bed.block([0.0, -0.03, rim], [width - 0.06, length - 0.1, 0.18], sheet);
    let cover = cloth(rng);
    let covered = rng.between(0.55, 0.75) * length;
    bed.block([0.0, -(length - covered) / 2.0 - 0.02, rim + 0.16], [width + 0.02, covered, 0.09], cover);
    let pillows = if width > 1.3 { 2 } else { 1 };
    for index in 0..pillows {
        let x = if pillows == 1 { 0.0 } else { (f64::from(index) - 0.5) * width / 2.0 };
        let pillow = bed.ball([x, length / 2.0 - 0.34, rim + 0.15], [0.62, 0.42, 0.2], sheet);
        pillow.class = Class::Pillow;
    }
    bed
}

/// Returns a closed cabinet on a plinth or on feet: nightstand, dresser, sideboard, wardrobe.
pub fn cabinet(class: Class, size: [f64; 3], rng: &mut Rng) -> Piece {
    let [width, depth, height] = size;
    let finish = front(rng);
    let mut piece = Piece::new(class, size);
    if rng.chance(0.4) {
        let gap = rng.between(0.06, 0.16);
        piece.legs(width, depth, gap, 0.035, 0.02, finish.darker(0.7));
        piece.block([0.0, 0.0, gap], [width, depth, height - gap], finish);
    } else {
        piece.block([0.0, 0.02, 0.0], [width - 0.02, depth - 0.05, 0.07], finish.darker(0.6));
        piece.block([0.0, 0.0, 0.07], [width, depth, height - 0.07], finish);
    }
    // Gaps between its doors or drawers.
    let shadow = Finish::plain(finish.rgb).darker(0.45);
    let doors = (width / 0.5).round().max(1.0) as usize;
    for door in 1..doors {
        let x = width * door as f64 / doors as f64 - width / 2.0;
        piece.block([x, -depth / 2.0, 0.1], [0.006, 0.006, height - 0.14], shadow);
    }
    if height < 1.3 {
        for row in 1..(height / 0.25) as usize {
            piece.block([0.0, -depth / 2.0, row as f64 * 0.25], [width - 0.03, 0.006, 0.006], shadow);
        }
    }
    piece
}

/// Returns an open shelf with books and boxes.
pub fn shelf(width: f64, height: f64, rng: &mut Rng) -> Piece {
    let depth = rng.between(0.26, 0.38);
    let finish = if rng.chance(0.5) { wood(rng) } else { Finish::plain(WHITE) };
    let mut shelf = Piece::new(Class::Shelf, [width, depth, height]);
    for x in [-1.0, 1.0] {
        shelf.block([x * (width / 2.0 - 0.01), 0.0, 0.0], [0.02, depth, height], finish);
    }
    shelf.block([0.0, depth / 2.0 - 0.005, 0.0], [width, 0.01, height], finish.darker(0.85));
    let foot = rng.between(0.02, 0.08);
    shelf.block([0.0, 0.02, 0.0], [width - 0.04, depth - 0.06, foot], finish.darker(0.8));
    let levels = ((height - foot) / rng.between(0.3, 0.42)).round().max(1.0);
    let step = (height - foot - 0.02) / levels;
    for level in 0..=levels as usize {
        let z = foot + level as f64 * step;
        shelf.block([0.0, 0.0, z], [width - 0.03, depth, 0.02], finish);
        if level == levels as usize {
            continue;
        }
        let mut x = 0.02 - width / 2.0;
        while x < width / 2.0 - 0.1 {
            let run = rng.between(0.1, 0.45).min(width / 2.0 - 0.02 - x);
            let room = step - 0.03;
            match rng.count(0, 3) {
                0 => {}
                1 => {
                    let side = run.min(room) * rng.between(0.5, 0.9);
                    let finish = cloth(rng);
                    let item = shelf.block(
                        [x + run / 2.0, 0.0, z + 0.02],
                        [side, depth * 0.7, side.min(room)],
                        finish,
                    );
                    item.class = Class::Box;
                }
                _ => {
                    let books = Finish::plain([0.5, 0.4, 0.3]).with(Pattern::Books, 0.035);
                    let tall = room * rng.between(0.6, 0.92);
                    shelf.block([x + run / 2.0, 0.03, z + 0.02], [run, depth * 0.65, tall], books);
                }
            }
            x += run + rng.between(0.0, 0.15);
        }
    }
    shelf
}

/// Returns a low cabinet with a television on it.
pub fn tv_stand(rng: &mut Rng) -> Piece {
    let width = rng.between(1.2, 1.9);
    let mut piece = cabinet(Class::Cabinet, [width, 0.42, rng.between(0.4, 0.55)], rng);
    let top = piece.size[2];
    let screen = rng.between(0.9, 1.4).min(width);
    let black = Finish::plain([0.04, 0.04, 0.05]).glossy(0.8);
    for (bottom, size) in [
        ([0.0, 0.05, top], [0.4, 0.2, 0.015]),
        ([0.0, 0.08, top], [0.08, 0.05, 0.1]),
        ([0.0, 0.05, top + 0.07], [screen, 0.05, screen * 0.57]),
    ] {
        piece.block(bottom, size, black).class = Class::Television;
    }
    piece.size[2] = top + 0.07 + screen * 0.57;
    piece.movable()
}

/// Returns clutter: a cardboard box, a basket or a suitcase.
pub fn clutter(rng: &mut Rng) -> Piece {
    let size = [rng.between(0.2, 0.5), rng.between(0.2, 0.4), rng.between(0.12, 0.5)];
    let mut piece = Piece::new(Class::Box, size).movable();
    let finish = if rng.chance(0.5) { Finish::plain([0.70, 0.55, 0.38]) } else { cloth(rng) };
    if rng.chance(0.25) {
        let radius = size[0].min(size[1]) / 2.0;
        piece.size = [2.0 * radius, 2.0 * radius, size[2]];
        piece.post([0.0; 3], radius, size[2], finish);
    } else {
        piece.block([0.0; 3], size, finish);
    }
    piece
}

/// Returns coats on a rail, above the vacuum.
pub fn coats(rng: &mut Rng) -> Piece {
    let width = rng.between(0.5, 1.1);
    let mut piece = Piece::new(Class::Clothes, [width, 0.3, 1.75]);
    piece.block([0.0, 0.13, 1.65], [width, 0.03, 0.08], Finish::plain(DARK)).class = Class::Shelf;
    let mut x = 0.12 - width / 2.0;
    while x < width / 2.0 - 0.08 {
        let long = rng.between(0.6, 1.1);
        let finish = cloth(rng).darker(0.7);
        piece.block([x, 0.03, 1.68 - long], [0.1, rng.between(0.16, 0.26), long], finish);
        x += rng.between(0.11, 0.25);
    }
    piece
}
