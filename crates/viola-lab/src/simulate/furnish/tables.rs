//! Tables for eating, for the sofa, and for the side.

use super::chairs;
use super::sizes::{COFFEE_TABLE, SIDE_TABLE};
use crate::simulate::finish::{DARK, Finish, METAL, WHITE, wood};
use crate::simulate::piece::{Piece, TopKind};
use crate::simulate::rng::Rng;
use std::f64::consts::PI;
use viola_geometry::Pose2;
use viola_geometry::taxonomy::Class;

/// Returns a table of a size; round ones are as wide as deep.
pub fn table(size: [f64; 3], finish: Finish, rng: &mut Rng) -> Piece {
    let [width, depth, height] = size;
    let mut table = Piece::new(Class::Table, size).movable();
    let thick = rng.between(0.022, 0.045);
    let round = (width / depth - 1.0).abs() < 0.15 && rng.chance(0.5);
    let oval = !round && rng.chance(0.15);
    if round {
        let side = width.min(depth);
        table.size = [side, side, height];
        table.post([0.0, 0.0, height - thick], side / 2.0, thick, finish);
    } else if oval {
        table.post([0.0, 0.0, height - thick], depth / 2.0, thick, finish).half.x = width / 2.0;
    } else {
        table.block([0.0, 0.0, height - thick], [width, depth, thick], finish);
    }
    let [width, depth, _] = table.size;
    let under = height - thick;
    let legs = if rng.chance(0.7) { finish } else { Finish::plain(rng.pick([DARK, METAL, WHITE])) };
    let narrow = if round || oval { 0.7 } else { 1.0 };
    match rng.count(0, 5) {
        0 if round => pedestal(&mut table, under, legs),
        1 => trestles(&mut table, under, legs),
        2 => splayed(&mut table, [width * narrow, depth * narrow], under, legs),
        _ => {
            let leg = rng.between(0.035, 0.08);
            let inset = rng.between(0.0, 0.05);
            let (wide, deep) = (width * narrow, depth * narrow);
            table.legs(wide, deep, under, leg, inset, legs);
            if height > 0.6 && rng.chance(0.5) {
                for y in [-1.0, 1.0] {
                    let bottom = [0.0, y * (deep / 2.0 - inset - leg / 2.0), under - 0.08];
                    table.block(bottom, [wide - 0.1, 0.02, 0.08], legs);
                }
            }
        }
    }
    let inner = if round || oval { 0.66 } else { 0.92 };
    table.top(TopKind::Table, [0.0, 0.0, height], [width * inner, depth * inner], 0.5);
    table
}

fn pedestal(table: &mut Piece, under: f64, legs: Finish) {
    let [width, _, _] = table.size;
    table.post([0.0, 0.0, 0.03], 0.05, under - 0.03, legs);
    table.post([0.0; 3], width * 0.28, 0.03, legs);
}

fn trestles(table: &mut Piece, under: f64, legs: Finish) {
    let [width, depth, _] = table.size;
    let deep = depth * 0.4;
    for x in [-0.42, 0.42] {
        let x = x * width * 0.85;
        for y in [-1.0, 1.0] {
            table.bar([x, y * deep, 0.0], [x, y * deep * 0.3, under], 0.022, legs);
        }
        table.block([x, 0.0, under - 0.04], [0.05, 2.0 * deep, 0.04], legs);
    }
}

fn splayed(table: &mut Piece, size: [f64; 2], under: f64, legs: Finish) {
    let [x, y] = size.map(|s| s / 2.0 - 0.05);
    for (sx, sy) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
        table.bar([sx * x, sy * y, 0.0], [sx * x * 0.8, sy * y * 0.8, under], 0.02, legs);
    }
}

/// Returns a low table for a sofa: on legs, with a lower board, a closed box, or a nest of two.
pub fn coffee_table(rng: &mut Rng) -> Piece {
    let size = COFFEE_TABLE.draw(rng);
    let [width, depth, height] = size;
    let finish = if rng.chance(0.75) { wood(rng) } else { Finish::plain(WHITE).glossy(0.3) };
    match rng.count(0, 5) {
        0 => {
            let mut table = Piece::new(Class::Table, size).movable();
            table.block([0.0; 3], [width - 0.06, depth - 0.06, height - 0.04], finish.darker(0.9));
            table.block([0.0, 0.0, height - 0.04], [width, depth, 0.04], finish);
            table.top(TopKind::Table, [0.0, 0.0, height], [width * 0.9, depth * 0.9], 0.5);
            table
        }
        1 => {
            let mut nest = table([width, depth, height], finish, rng);
            let low = table([width * 0.6, depth * 0.7, height * 0.75], finish, rng);
            let beside = Pose2::new(width * 0.35, -depth * 0.2, 0.0);
            nest.join(&low, &beside, 0.0);
            nest
        }
        kind => {
            let mut table = table(size, finish, rng);
            if kind == 2 {
                let [width, depth, _] = table.size;
                table.block([0.0, 0.0, 0.13], [width * 0.68, depth * 0.68, 0.02], finish);
            }
            table
        }
    }
}

/// Returns a side table, round or square, with one post or four legs.
pub fn side_table(rng: &mut Rng) -> Piece {
    let [width, depth, height] = SIDE_TABLE.draw(rng);
    let finish = wood(rng);
    let side = if rng.chance(0.5) { width } else { depth };
    table([width, side, height], finish, rng)
}

/// Returns a dining table, and its chairs with their poses in the table's frame, as people left them.
pub fn dining_set(seats: usize, mess: f64, rng: &mut Rng) -> (Piece, Vec<(Piece, Pose2)>) {
    let finish = wood(rng);
    let pairs = seats.div_ceil(2).max(1);
    let (width, depth) = match pairs {
        1 => (rng.between(0.7, 0.95), rng.between(0.7, 0.85)),
        _ => (0.25 + 0.58 * pairs as f64 + rng.between(0.0, 0.2), rng.between(0.75, 1.0)),
    };
    let table = table([width, depth, rng.between(0.71, 0.77)], finish, rng);
    let chair_finish = if rng.chance(0.6) { finish } else { wood(rng) };
    let model = chairs::chair(chair_finish, rng);
    let mut around = vec![];
    let [width, depth, _] = table.size;
    for index in 0..seats {
        let side = if index % 2 == 0 { -1.0 } else { 1.0 };
        let x = width * ((index / 2) as f64 + 0.5) / pairs as f64 - width / 2.0 + rng.between(-0.04, 0.04);
        // Pushed in, or pulled out and turned: more so in messy homes.
        let out = rng.between(-0.12, 0.12 + 0.25 * mess);
        let turn = rng.between(-0.15, 0.15) * (1.0 + 3.0 * mess);
        let yaw = if side < 0.0 { PI } else { 0.0 } + turn;
        let other = (rng.chance(0.12)).then(|| chairs::chair(wood(rng), rng));
        let chair = other.unwrap_or_else(|| model.clone());
        around.push((chair, Pose2::new(x, side * (depth / 2.0 + 0.14 + out), yaw)));
    }
    (table, around)
}
