//! Desks: on legs or trestles, with drawers, in an L, with a hutch, for standing.

use super::sizes::DESK;
use crate::simulate::finish::{DARK, Finish, METAL, Pattern, WHITE, wood};
use crate::simulate::piece::{Piece, TopKind};
use crate::simulate::rng::Rng;
use viola_geometry::taxonomy::Class;

/// Free height above the front part of a desk, in metres.
const ABOVE_M: f64 = 0.35;

/// Returns a desk, mostly with a screen on it.
pub fn desk(rng: &mut Rng) -> Piece {
    let [width, depth, mut height] = DESK.draw(rng);
    let finish = if rng.chance(0.7) { wood(rng) } else { Finish::plain(WHITE).glossy(0.2) };
    let standing = rng.chance(0.1);
    if standing {
        height = rng.between(0.95, 1.15);
    }
    let mut desk = Piece::new(Class::Desk, [width, depth, height]);
    desk.block([0.0, 0.0, height - 0.03], [width, depth, 0.03], finish);
    let under = height - 0.03;
    let legs = Finish::plain(rng.pick([METAL, DARK, WHITE]));
    match rng.count(0, 4) {
        _ if standing => columns(&mut desk, under, legs),
        0 => {
            // Side walls, and a board at the back.
            for x in [-1.0, 1.0] {
                desk.block([x * (width / 2.0 - 0.015), 0.0, 0.0], [0.03, depth - 0.04, under], finish);
            }
            desk.block([0.0, depth / 2.0 - 0.08, under - 0.4], [width - 0.06, 0.015, 0.4], finish);
        }
        1 => {
            for x in [-0.4, 0.4] {
                for y in [-0.42, 0.42] {
                    desk.bar([x * width, y * depth, 0.0], [x * width, y * depth * 0.3, under], 0.02, legs);
                }
            }
        }
        _ => desk.legs(width, depth, under, 0.045, 0.01, legs),
    }
    let side = rng.sign();
    if rng.chance(0.55) {
        drawers(&mut desk, side, under, finish, rng);
    }
    let hutch = width < 1.6 && !standing && rng.chance(0.2);
    if hutch {
        shelf_above(&mut desk, finish, rng);
    }
    let screen = rng.chance(0.75).then(|| screens(&mut desk, height, hutch, rng));
    let free = if screen.is_some() { 0.45 } else { 0.85 } * depth;
    let front = (free - depth) / 2.0 + 0.02;
    desk.top(TopKind::Desk, [0.0, front, height], [width * 0.94, free], ABOVE_M);
    desk
}

/// Returns a desk in an L, whose wing reaches into the room; the piece is as deep as the wing is long.
pub fn corner_desk(rng: &mut Rng) -> Piece {
    let (width, reach) = (rng.between(1.4, 1.9), rng.between(1.1, 1.5));
    let (deep, height) = (rng.between(0.55, 0.7), rng.between(0.71, 0.76));
    let finish = wood(rng);
    let side = rng.sign();
    let mut desk = Piece::new(Class::Desk, [width, reach, height]);
    let (back, wing) = ((reach - deep) / 2.0, side * (width - deep) / 2.0);
    desk.block([0.0, back, height - 0.03], [width, deep, 0.03], finish);
    desk.block([wing, -deep / 2.0, height - 0.03], [deep, reach - deep, 0.03], finish);
    let legs = Finish::plain(METAL);
    for [x, y] in [
        [-side * (width / 2.0 - 0.05), reach / 2.0 - 0.05],
        [-side * (width / 2.0 - 0.05), reach / 2.0 - deep + 0.05],
        [side * (width / 2.0 - 0.05), reach / 2.0 - 0.05],
        [side * (width / 2.0 - 0.05), 0.05 - reach / 2.0],
        [side * (width / 2.0 - deep + 0.05), 0.05 - reach / 2.0],
    ] {
        desk.block([x, y, 0.0], [0.05, 0.05, height - 0.03], legs);
    }
    screen(&mut desk, [-side * 0.1, reach / 2.0 - 0.2, height], rng);
    desk.top(TopKind::Desk, [wing, -deep / 2.0, height], [deep * 0.9, reach - deep - 0.05], ABOVE_M);
    let rest = [-side * deep / 2.0, reach / 2.0 - deep + 0.18, height];
    desk.top(TopKind::Desk, rest, [width - deep - 0.1, 0.3], ABOVE_M);
    desk
}

fn columns(desk: &mut Piece, under: f64, legs: Finish) {
    let [width, depth, _] = desk.size;
    for x in [-1.0, 1.0] {
        let x = x * (width / 2.0 - 0.2);
        desk.block([x, 0.0, 0.0], [0.08, depth - 0.06, 0.035], legs);
        desk.block([x, 0.0, 0.03], [0.08, 0.06, under - 0.03], legs);
    }
}

/// Adds a unit of drawers under one end, on castors or on the floor.
fn drawers(desk: &mut Piece, side: f64, under: f64, finish: Finish, rng: &mut Rng) {
    let [width, depth, _] = desk.size;
    let bottom = rng.pick([0.01, 0.06]);
    let x = side * (width / 2.0 - 0.27);
    let high = under.min(0.7) - bottom - 0.02;
    desk.block([x, 0.03, bottom], [0.4, depth - 0.1, high], finish.darker(0.92));
    for row in 1..3 {
        let z = bottom + high * f64::from(row) / 3.0;
        desk.block([x, 0.078 - depth / 2.0, z], [0.38, 0.006, 0.008], finish.darker(0.4));
    }
}

/// Adds boards on side walls above the desk's back.
fn shelf_above(desk: &mut Piece, finish: Finish, rng: &mut Rng) {
    let [width, depth, height] = desk.size;
    let top = rng.between(0.6, 0.85);
    let y = depth / 2.0 - 0.12;
    for x in [-1.0, 1.0] {
        desk.block([x * (width / 2.0 - 0.01), y, height], [0.02, 0.22, top], finish);
    }
    for z in [0.55, top - 0.02] {
        desk.block([0.0, y, height + z], [width, 0.22, 0.02], finish);
    }
    let books = Finish::plain(DARK).with(Pattern::Books, 0.03);
    let run = rng.between(0.2, 0.6) * width;
    desk.block([(run - width) / 2.0 + 0.03, y, height + top], [run, 0.16, 0.23], books);
    desk.size[2] = height + top + 0.23;
}

/// Adds one or two screens and a keyboard.
fn screens(desk: &mut Piece, height: f64, hutch: bool, rng: &mut Rng) {
    let [width, depth, _] = desk.size;
    let y = depth / 2.0 - 0.16;
    if width > 1.3 && !hutch && rng.chance(0.3) {
        for side in [-1.0, 1.0] {
            screen(desk, [side * 0.31, y, height], rng);
        }
    } else {
        screen(desk, [rng.between(-0.15, 0.15), y, height], rng);
    }
    let keys = Finish::plain(rng.pick([DARK, [0.3, 0.3, 0.32], WHITE]));
    let x = rng.between(-0.1, 0.1);
    desk.block([x, 0.0, height], [0.42, 0.14, 0.02], keys).class = Class::Other;
    desk.ball([x + 0.3, 0.0, height], [0.06, 0.1, 0.035], keys).class = Class::Other;
}

fn screen(desk: &mut Piece, at: [f64; 3], rng: &mut Rng) {
    let black = Finish::plain(DARK).glossy(0.5);
    let [x, y, z] = at;
    let turn = rng.between(-0.15, 0.15);
    let wide = rng.between(0.48, 0.62);
    for (bottom, size) in [
        ([x, y - 0.02, z], [0.24, 0.18, 0.015]),
        ([x, y + 0.02, z], [0.05, 0.03, 0.2]),
        ([x, y, z + 0.09], [wide, 0.03, wide * 0.58]),
    ] {
        let solid = desk.block(bottom, size, black);
        solid.class = Class::Television;
        solid.yaw_rad = turn;
    }
}
