//! Open shelves and what stands in them.

use super::sizes::SHELVING;
use crate::simulate::finish::{DARK, Finish, METAL, Pattern, WHITE, cloth, wood};
use crate::simulate::piece::{Mount, Piece, TopKind};
use crate::simulate::rng::Rng;
use viola_geometry::taxonomy::Class;

/// Returns a shelf that stands at a wall.
pub fn shelf(rng: &mut Rng) -> Piece {
    let size = SHELVING.draw(rng);
    match rng.count(0, 9) {
        0 | 1 => rack(size, rng),
        2 => ladder(size, rng),
        3 | 4 => cubes(rng),
        _ => bookcase(size, rng),
    }
}

/// Returns a case with a back wall, full of books to a random degree.
fn bookcase([width, depth, height]: [f64; 3], rng: &mut Rng) -> Piece {
    let depth = depth.max(0.24);
    let finish = if rng.chance(0.5) { wood(rng) } else { Finish::plain(rng.pick([WHITE, DARK])) };
    let mut shelf = Piece::new(Class::Shelf, [width, depth, height]);
    for x in [-1.0, 1.0] {
        shelf.block([x * (width / 2.0 - 0.01), 0.0, 0.0], [0.02, depth, height], finish);
    }
    shelf.block([0.0, depth / 2.0 - 0.005, 0.0], [width, 0.01, height], finish.darker(0.85));
    let foot = rng.between(0.02, 0.08);
    shelf.block([0.0, 0.02, 0.0], [width - 0.04, depth - 0.06, foot], finish.darker(0.8));
    let levels = ((height - foot) / rng.between(0.3, 0.42)).round().max(1.0);
    let step = (height - foot - 0.02) / levels;
    let full = rng.between(0.3, 1.0);
    for level in 0..=levels as usize {
        let z = foot + level as f64 * step;
        shelf.block([0.0, 0.0, z], [width - 0.03, depth, 0.02], finish);
        if level < levels as usize {
            fill(&mut shelf, [width - 0.05, depth], z + 0.02, step - 0.03, full, rng);
        }
    }
    if height < 2.0 {
        shelf.top(TopKind::Store, [0.0, 0.0, height], [width * 0.9, depth * 0.9], 0.4);
    }
    shelf
}

/// Returns boards between four posts, without walls.
fn rack([width, depth, height]: [f64; 3], rng: &mut Rng) -> Piece {
    let depth = depth.max(0.3);
    let frame = Finish::plain(rng.pick([METAL, DARK, WHITE])).glossy(0.3);
    let boards = if rng.chance(0.5) { wood(rng) } else { frame };
    let mut shelf = Piece::new(Class::Shelf, [width, depth, height]);
    shelf.legs(width, depth, height, 0.03, 0.0, frame);
    let levels = rng.count(3, 5);
    let step = (height - 0.15) / (levels - 1) as f64;
    for level in 0..levels {
        let z = 0.12 + step * level as f64;
        shelf.block([0.0, 0.0, z], [width, depth, 0.025], boards);
        if level + 1 < levels {
            fill(&mut shelf, [width - 0.08, depth], z + 0.025, step - 0.06, 0.6, rng);
        }
    }
    shelf.top(TopKind::Store, [0.0, 0.0, height - 0.005], [width * 0.85, depth * 0.8], 0.4);
    shelf
}

/// Returns a shelf that leans at the wall, with boards that become deeper downwards.
fn ladder([width, _, height]: [f64; 3], rng: &mut Rng) -> Piece {
    let (width, depth, height) = (width.min(0.8), 0.4, height.max(1.5));
    let finish = if rng.chance(0.6) { wood(rng) } else { Finish::plain(DARK) };
    let mut shelf = Piece::new(Class::Shelf, [width, depth, height]).movable();
    for x in [-1.0, 1.0] {
        let x = x * (width / 2.0 - 0.02);
        shelf.bar([x, 0.02 - depth / 2.0, 0.0], [x, depth / 2.0 - 0.02, height], 0.018, finish);
    }
    for level in 0..4 {
        let z = 0.25 + f64::from(level) * (height - 0.4) / 4.0;
        let deep = depth * (1.0 - z / height) + 0.08;
        let y = (depth - deep) / 2.0;
        shelf.block([0.0, y, z], [width - 0.04, deep, 0.02], finish);
        shelf.top(TopKind::Store, [0.0, y, z + 0.02], [width * 0.8, deep * 0.8], (height - 0.4) / 4.0 - 0.05);
    }
    shelf
}

/// Returns a grid of cubes with baskets and books.
fn cubes(rng: &mut Rng) -> Piece {
    let (columns, rows) = (rng.count(1, 4), rng.count(1, 4));
    let pitch = rng.between(0.34, 0.4);
    let (width, height) = (pitch * columns as f64 + 0.04, pitch * rows as f64 + 0.04);
    let finish = if rng.chance(0.4) { wood(rng) } else { Finish::plain(rng.pick([WHITE, WHITE, DARK])) };
    let mut shelf = Piece::new(Class::Shelf, [width, 0.39, height]);
    for column in 0..=columns {
        let x = pitch * column as f64 - (width - 0.04) / 2.0;
        shelf.block([x, 0.0, 0.0], [0.03, 0.39, height], finish);
    }
    for row in 0..=rows {
        shelf.block([0.0, 0.0, pitch * row as f64], [width, 0.39, 0.03], finish);
    }
    let basket = cloth(rng);
    for column in 0..columns {
        for row in 0..rows {
            let (x, z) = (pitch * (column as f64 + 0.5) - (width - 0.04) / 2.0, pitch * row as f64 + 0.03);
            match rng.count(0, 3) {
                0 => {
                    let size = [pitch - 0.05, 0.34, pitch * rng.between(0.6, 0.85)];
                    shelf.block([x, -0.02, z], size, basket).class = Class::Box;
                }
                1 => {
                    let books = Finish::plain([0.5, 0.4, 0.3]).with(Pattern::Books, 0.03);
                    let run = rng.between(0.3, 0.95) * (pitch - 0.04);
                    let tall = rng.between(0.55, 0.85) * pitch;
                    shelf.block([x - (pitch - 0.04 - run) / 2.0, 0.05, z], [run, 0.22, tall], books);
                }
                2 => shelf.top(TopKind::Store, [x, -0.03, z], [pitch - 0.08, 0.28], pitch - 0.06),
                _ => {}
            }
        }
    }
    if height < 1.6 {
        shelf.top(TopKind::Store, [0.0, 0.0, height], [width * 0.95, 0.34], 0.45);
    }
    shelf
}

/// Adds books, boxes and gaps to one level.
fn fill(shelf: &mut Piece, [width, depth]: [f64; 2], z: f64, room: f64, full: f64, rng: &mut Rng) {
    let mut x = -width / 2.0;
    while x < width / 2.0 - 0.08 {
        let run = rng.between(0.1, 0.4).min(width / 2.0 - x);
        if rng.chance(full) {
            if rng.chance(0.25) {
                let side = run.min(room) * rng.between(0.5, 0.95);
                let bottom = [x + run / 2.0, 0.0, z];
                let finish = cloth(rng);
                shelf.block(bottom, [side, depth * 0.7, side.min(room)], finish).class = Class::Box;
            } else {
                let books = Finish::plain([0.5, 0.4, 0.3]).with(Pattern::Books, 0.035);
                let tall = room.min(0.34) * rng.between(0.6, 0.95);
                let deep = depth * rng.between(0.5, 0.75);
                let y = depth / 2.0 - 0.02 - deep / 2.0 - rng.between(0.0, 0.04);
                shelf.block([x + run / 2.0, y, z], [run, deep, tall], books);
                if rng.chance(0.3) {
                    // The last book leans.
                    let at = [x + run + tall * 0.12, y, z];
                    let book = shelf.block(at, [0.025, deep, tall * 0.95], cloth(rng));
                    book.roll_rad = -0.2;
                    x += 0.07;
                }
            }
        }
        x += run + rng.between(0.0, 0.12);
    }
}

/// Returns one or more boards on the wall with books and small things.
pub fn wall_shelf(rng: &mut Rng) -> Piece {
    let width = rng.between(0.5, 1.4);
    let depth = rng.between(0.15, 0.28);
    let bottom = rng.between(1.25, 1.55);
    let boards = rng.count(1, 2);
    let top = bottom + 0.38 * boards as f64;
    let mut piece = Piece::new(Class::Shelf, [width, depth, top]).mounted(Mount::Hung);
    let finish = if rng.chance(0.6) { wood(rng) } else { Finish::plain(WHITE) };
    for board in 0..boards {
        let z = bottom + 0.38 * board as f64;
        piece.block([0.0, 0.0, z], [width, depth, 0.03], finish);
        fill(&mut piece, [width - 0.06, depth * 0.9], z + 0.03, 0.3, rng.between(0.2, 0.9), rng);
        piece.top(TopKind::Store, [0.0, -depth * 0.2, z + 0.03], [width * 0.9, depth * 0.4], 0.3);
    }
    piece
}
