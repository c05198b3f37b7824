//! Toilets, bathtubs, and what hangs and lies in bathrooms.

use super::colours::{ceramic, steel};
use crate::simulate::finish::{Finish, METAL, Pattern, WHITE, cloth};
use crate::simulate::piece::{Mount, Piece, TopKind};
use crate::simulate::rng::Rng;
use viola_geometry::taxonomy::Class;

/// Returns a toilet: on a foot with a tank, or hung at the wall; the lid is up or down.
pub fn toilet(rng: &mut Rng) -> Piece {
    let hung = rng.chance(0.35);
    let mut piece = Piece::new(Class::Toilet, [0.38, if hung { 0.56 } else { 0.68 }, 0.8]);
    let back = piece.size[1] / 2.0;
    if hung {
        piece.ball([0.0, -0.02, 0.12], [0.34, 0.44, 0.36], ceramic());
        piece.block([0.0, back - 0.06, 0.18], [0.3, 0.12, 0.2], ceramic());
        let plate = [0.0, back - 0.01, 1.0];
        piece.block(plate, [0.24, 0.015, 0.16], steel());
    } else {
        piece.block([0.0, 0.08, 0.0], [0.2, 0.42, 0.34], ceramic());
        piece.block([0.0, back - 0.08, 0.36], [0.38, 0.14, rng.between(0.36, 0.44)], ceramic());
        piece.top(TopKind::Bath, [0.0, back - 0.08, 0.8], [0.3, 0.12], 0.3);
        piece.tops[0].centre[2] = piece.solids[1].top_m();
    }
    let bowl = [0.0, -0.05, 0.2];
    piece.post(bowl, 0.18, 0.2, ceramic()).half.y = 0.24;
    let seat = Finish::plain(if rng.chance(0.85) { WHITE } else { [0.45, 0.32, 0.2] }).glossy(0.3);
    piece.post([0.0, -0.05, 0.4], 0.185, 0.02, seat).half.y = 0.235;
    if rng.chance(0.45) {
        // The lid leans at the tank.
        let lid = piece.bar([0.0, 0.17, 0.62], [0.0, 0.19, 0.625], 0.185, seat);
        lid.half.y = 0.21;
    } else {
        piece.post([0.0, -0.05, 0.42], 0.18, 0.015, seat).half.y = 0.23;
    }
    piece
}

/// Returns a bathtub: built in, in a corner with a curtain, or free-standing.
pub fn bathtub(rng: &mut Rng) -> Piece {
    if rng.chance(0.2) {
        return free_bathtub(rng);
    }
    let (width, depth, height) = (rng.between(1.5, 1.8), rng.between(0.7, 0.85), rng.between(0.52, 0.62));
    let mut piece = Piece::new(Class::Bathtub, [width, depth, height]);
    piece.block([0.0, 0.0, 0.0], [width, depth, 0.16], ceramic());
    for y in [-1.0, 1.0] {
        piece.block([0.0, y * (depth / 2.0 - 0.035), 0.16], [width, 0.07, height - 0.16], ceramic());
    }
    for x in [-1.0, 1.0] {
        piece.block([x * (width / 2.0 - 0.05), 0.0, 0.16], [0.1, depth - 0.14, height - 0.16], ceramic());
    }
    piece.post([-width / 2.0 + 0.1, depth / 2.0 - 0.03, height], 0.012, 1.3, steel());
    piece.ball([-width / 2.0 + 0.1, depth / 2.0 - 0.12, height + 1.25], [0.16, 0.16, 0.05], steel());
    if rng.chance(0.35) {
        let y = 0.03 - depth / 2.0;
        piece.bar([-width / 2.0, y, 1.97], [width / 2.0, y, 1.97], 0.012, steel());
        let drawn = rng.between(0.25, 0.9) * width;
        let tone = cloth(rng).rgb;
        let folds = Finish::plain(rng.pick([WHITE, tone])).with(Pattern::Stripes, 0.09);
        let bottom = [(drawn - width) / 2.0, y, 0.25];
        piece.block(bottom, [drawn, 0.05, 1.7], folds).class = Class::Curtain;
    }
    for x in [-0.35, 0.3] {
        let at = [x * width, depth / 2.0 - 0.035, height];
        piece.top(TopKind::Bath, at, [0.3, 0.06], 0.3);
    }
    piece
}

/// Returns an oval tub: its shell is a ring of upright cushions around the bottom.
fn free_bathtub(rng: &mut Rng) -> Piece {
    let (width, depth, height) = (rng.between(1.55, 1.75), rng.between(0.74, 0.82), 0.58);
    let mut piece = Piece::new(Class::Bathtub, [width, depth, height]);
    piece.post([0.0; 3], depth / 2.0 - 0.05, 0.2, ceramic()).half.x = width / 2.0 - 0.06;
    let parts = 16;
    for part in 0..parts {
        let angle = f64::from(part) / f64::from(parts) * std::f64::consts::TAU;
        let (s, c) = angle.sin_cos();
        let (rx, ry) = (width / 2.0 - 0.04, depth / 2.0 - 0.04);
        let along = (rx * s).hypot(ry * c) * std::f64::consts::TAU / f64::from(parts);
        let side = piece.block([rx * c, ry * s, 0.02], [along + 0.02, 0.06, height - 0.02], ceramic());
        side.yaw_rad = (ry * c).atan2(-rx * s);
    }
    piece.post([0.0, depth / 2.0 - 0.03, 0.0], 0.018, 0.95, steel());
    piece.bar([0.0, depth / 2.0 - 0.03, 0.93], [0.0, depth / 2.0 - 0.22, 0.9], 0.015, steel());
    piece
}

/// Returns towels on a rail or on hooks at the wall.
pub fn towels(rng: &mut Rng) -> Piece {
    let width = rng.between(0.4, 0.75);
    let rail = rng.between(1.15, 1.5);
    let mut piece = Piece::new(Class::Clothes, [width, 0.1, rail + 0.05]).mounted(Mount::Hung).movable();
    piece.bar([-width / 2.0, 0.0, rail], [width / 2.0, 0.0, rail], 0.01, steel()).class = Class::Other;
    let mut x = -width / 2.0;
    while x < width / 2.0 - 0.2 {
        let wide = rng.between(0.2, 0.45).min(width / 2.0 - x);
        let long = rng.between(0.35, 0.75);
        piece.block([x + wide / 2.0, 0.0, rail - long], [wide, 0.035, long + 0.015], cloth(rng));
        x += wide + rng.between(0.02, 0.2);
    }
    piece
}

/// Returns a heated rail of pipes with or without a towel.
pub fn towel_radiator(rng: &mut Rng) -> Piece {
    let (width, height) = (rng.between(0.45, 0.6), rng.between(1.1, 1.75));
    let mut piece = Piece::new(Class::Radiator, [width, 0.1, height]).mounted(Mount::Hung);
    let white = Finish::plain(rng.pick([WHITE, METAL])).glossy(0.4);
    for x in [-1.0, 1.0] {
        piece.post([x * (width / 2.0 - 0.02), 0.0, 0.35], 0.018, height - 0.35, white);
    }
    let pipes = ((height - 0.4) / 0.09) as usize;
    for pipe in (0..pipes).filter(|pipe| pipe % 6 != 5) {
        let z = 0.4 + 0.09 * pipe as f64;
        piece.bar([-width / 2.0, 0.0, z], [width / 2.0, 0.0, z], 0.012, white);
    }
    if rng.chance(0.6) {
        let towel = [rng.between(-0.05, 0.05), -0.01, height - 0.75];
        piece.block(towel, [width * 0.7, 0.07, 0.7], cloth(rng)).class = Class::Clothes;
    }
    piece
}
