//! Chairs for one person: dining chairs, stools, office chairs, armchairs, poufs.

use super::sizes::{ARMCHAIR, CHAIR, POUF, STOOL};
use crate::simulate::finish::{DARK, Finish, METAL, Pattern, WHITE, cloth, wood};
use crate::simulate::piece::{Piece, TopKind};
use crate::simulate::rng::Rng;
use std::f64::consts::TAU;
use viola_geometry::taxonomy::Class;

/// Radius of a chair's tubes and thin legs.
const TUBE_M: f64 = 0.012;

type Make = fn(Finish, &mut Rng) -> Piece;

/// Returns a chair for a table; a vacuum sees its legs as dots.
pub fn chair(finish: Finish, rng: &mut Rng) -> Piece {
    let make = rng.pick([wooden as Make, wooden, with_arms, upholstered, shell, folding]);
    make(finish, rng)
}

fn frame(rng: &mut Rng) -> (Piece, f64) {
    let size = CHAIR.draw(rng);
    let seat = rng.between(0.43, 0.48);
    let mut chair = Piece::new(Class::Chair, size).movable();
    chair.rest = Some([0.0, 0.02, seat]);
    chair.top(TopKind::Soft, [0.0, -0.02, seat], [size[0] - 0.1, size[1] - 0.12], 0.4);
    (chair, seat)
}

fn wooden(finish: Finish, rng: &mut Rng) -> Piece {
    let (mut chair, seat) = frame(rng);
    let [width, depth, top] = chair.size;
    let thick = rng.between(0.028, 0.042);
    chair.legs(width, depth, seat - 0.03, thick, 0.01, finish);
    chair.block([0.0, 0.0, seat - 0.035], [width, depth, 0.035], finish);
    let back = depth / 2.0 - 0.025;
    for x in [-1.0, 1.0] {
        chair.block([x * (width / 2.0 - 0.03), back, seat], [thick, thick, top - seat], finish);
    }
    match rng.count(0, 2) {
        0 => {
            chair.block([0.0, back, top - 0.24], [width - 0.04, 0.022, 0.22], finish);
        }
        1 => {
            for z in [0.35, 0.6, 0.88] {
                let bottom = [0.0, back, seat + z * (top - seat) - 0.03];
                chair.block(bottom, [width - 0.06, 0.018, 0.05], finish);
            }
        }
        _ => {
            chair.block([0.0, back, top - 0.06], [width - 0.04, 0.022, 0.06], finish);
            for k in -2..=2 {
                let x = f64::from(k) * (width - 0.1) / 5.0;
                chair.post([x, back, seat], 0.009, top - seat - 0.05, finish);
            }
        }
    }
    if rng.chance(0.3) {
        chair.cushion([0.0, -0.01, seat - 0.005], [width - 0.03, depth - 0.05, 0.06], cloth(rng));
    }
    chair
}

fn with_arms(finish: Finish, rng: &mut Rng) -> Piece {
    let mut chair = wooden(finish, rng);
    let [width, depth, _] = chair.size;
    for x in [-1.0, 1.0] {
        let x = x * (width / 2.0 - 0.02);
        chair.block([x, 0.02, 0.65], [0.04, depth - 0.06, 0.025], finish);
        chair.block([x, 0.06 - depth / 2.0, 0.44], [0.03, 0.03, 0.21], finish);
    }
    chair
}

fn upholstered(finish: Finish, rng: &mut Rng) -> Piece {
    let (mut chair, seat) = frame(rng);
    let [width, depth, top] = chair.size;
    let cover = cloth(rng);
    chair.legs(width - 0.04, depth - 0.04, seat - 0.08, 0.035, 0.0, finish);
    chair.cushion([0.0, -0.01, seat - 0.1], [width, depth, 0.12], cover);
    let back = chair.cushion([0.0, depth / 2.0 - 0.07, seat - 0.02], [width, 0.1, top - seat + 0.02], cover);
    back.tilt_rad = -rng.between(0.03, 0.12);
    chair
}

/// Returns a moulded seat on splayed legs.
fn shell(finish: Finish, rng: &mut Rng) -> Piece {
    let (mut chair, seat) = frame(rng);
    let [width, depth, top] = chair.size;
    let tone = cloth(rng).rgb;
    let plastic = Finish::plain(rng.pick([WHITE, DARK, tone])).glossy(0.3);
    for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
        let foot = [x * (width / 2.0 - 0.02), y * (depth / 2.0 - 0.02), 0.0];
        chair.bar(foot, [x * 0.1, y * 0.1, seat - 0.02], 0.014, finish);
    }
    chair.cushion([0.0, 0.0, seat - 0.03], [width, depth * 0.9, 0.05], plastic);
    let back = [0.0, depth / 2.0 - 0.06, seat];
    chair.cushion(back, [width * 0.95, 0.04, top - seat], plastic).tilt_rad = -0.15;
    chair
}

fn folding(_: Finish, rng: &mut Rng) -> Piece {
    let (mut chair, seat) = frame(rng);
    let [width, depth, top] = chair.size;
    let tube = Finish::plain(rng.pick([METAL, DARK, WHITE])).glossy(0.4);
    let cover = cloth(rng);
    for x in [-1.0, 1.0] {
        let x = x * (width / 2.0 - 0.02);
        chair.bar([x, 0.03 - depth / 2.0, 0.0], [x, depth / 2.0 - 0.06, top], TUBE_M, tube);
        chair.bar([x * 0.9, depth / 2.0 - 0.03, 0.0], [x * 0.9, 0.1 - depth / 2.0, seat], TUBE_M, tube);
    }
    chair.block([0.0, -0.03, seat - 0.02], [width - 0.06, depth * 0.75, 0.025], cover);
    chair.block([0.0, depth / 2.0 - 0.07, top - 0.22], [width - 0.05, 0.02, 0.2], cover).tilt_rad = -0.2;
    chair
}

/// Returns a stool or a bar stool.
pub fn stool(rng: &mut Rng) -> Piece {
    let [width, _, height] = STOOL.draw(rng);
    let mut stool = Piece::new(Class::Chair, [width, width, height]).movable();
    let finish = if rng.chance(0.6) { wood(rng) } else { Finish::plain(METAL) };
    stool.top(TopKind::Soft, [0.0, 0.0, height], [width * 0.6, width * 0.6], 0.4);
    if rng.chance(0.3) {
        stool.post([0.0; 3], width / 2.0, 0.02, Finish::plain(METAL).glossy(0.6));
        stool.post([0.0; 3], 0.03, height - 0.03, Finish::plain(METAL).glossy(0.6));
    } else {
        for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
            let reach = width * 0.35;
            let foot = [x * reach, y * reach, 0.0];
            stool.bar(foot, [x * width * 0.25, y * width * 0.25, height - 0.03], 0.016, finish);
        }
    }
    stool.post(
        [0.0, 0.0, height - 0.05],
        width / 2.0,
        0.05,
        if rng.chance(0.5) { cloth(rng) } else { finish },
    );
    stool
}

/// Returns an office chair: a post on five castors, with or without arms and a headrest.
pub fn office_chair(rng: &mut Rng) -> Piece {
    let black = Finish::plain(DARK);
    let seat = cloth(rng).darker(0.6);
    let top = rng.between(0.85, 1.25);
    let mut chair = Piece::new(Class::Chair, [0.62, 0.62, top]).movable();
    chair.rest = Some([0.0, 0.0, 0.5]);
    for arm in 0..5 {
        let angle = f64::from(arm) * TAU / 5.0;
        let (s, c) = angle.sin_cos();
        chair.block([0.14 * c, 0.14 * s, 0.06], [0.30, 0.045, 0.035], black).yaw_rad = angle;
        chair.post([0.28 * c, 0.28 * s, 0.0], 0.03, 0.06, black);
    }
    chair.post([0.0, 0.0, 0.08], 0.03, 0.36, Finish::plain(METAL).glossy(0.7));
    chair.cushion([0.0, 0.0, 0.42], [0.5, 0.5, 0.11], seat);
    let back = [0.0, 0.23, 0.54];
    chair.cushion(back, [rng.between(0.40, 0.48), 0.09, top - 0.56], seat).tilt_rad = -0.13;
    if rng.chance(0.6) {
        for x in [-0.27, 0.27] {
            chair.block([x, 0.02, 0.66], [0.06, 0.26, 0.03], black);
            chair.block([x, 0.08, 0.44], [0.03, 0.05, 0.23], black);
        }
    }
    chair
}

/// Returns a soft chair: on legs, wrapped around the seat, or a recliner with its footrest out.
pub fn armchair(rng: &mut Rng) -> Piece {
    let [width, depth, top] = ARMCHAIR.draw(rng);
    let cover = cloth(rng);
    let recliner = rng.chance(0.2);
    let long = if recliner { depth + 0.35 } else { depth };
    let mut chair = Piece::new(Class::Chair, [width, long, top]).movable();
    let shift = (long - depth) / 2.0;
    let gap = rng.pick([0.02, 0.05, 0.14, 0.18]);
    let (arm, seat) = (rng.between(0.09, 0.18), rng.between(0.40, 0.46));
    chair.legs(width - 0.06, depth - 0.06, gap, 0.035, 0.0, wood(rng));
    let sides = width - 2.0 * arm;
    chair.block([0.0, shift - 0.02, gap], [width - 0.04, depth - 0.06, 0.28 - gap], cover);
    chair.cushion([0.0, shift - 0.06, 0.24], [sides + 0.04, depth - 0.18, seat - 0.24], cover);
    let back = [0.0, shift + depth / 2.0 - 0.13, 0.26];
    chair.cushion(back, [width - 0.04, 0.2, top - 0.28], cover).tilt_rad = -rng.between(0.08, 0.25);
    for x in [-1.0, 1.0] {
        let bottom = [x * (width - arm) / 2.0, shift - 0.05, gap];
        chair.cushion(bottom, [arm + 0.02, depth - 0.12, rng.between(0.54, 0.62) - gap], cover);
    }
    if recliner {
        let rest = [0.0, 0.2 - long / 2.0, 0.26];
        chair.cushion(rest, [sides, 0.4, 0.12], cover).tilt_rad = 0.25;
    }
    chair.rest = Some([0.0, shift, seat]);
    chair.top(TopKind::Soft, [0.0, shift - 0.1, seat], [sides * 0.7, depth * 0.4], 0.3);
    chair
}

/// Returns a pouf or a bean bag.
pub fn pouf(rng: &mut Rng) -> Piece {
    let [width, depth, height] = POUF.draw(rng);
    let mut pouf = Piece::new(Class::Chair, [width, depth, height]).movable();
    let cover = cloth(rng).with(Pattern::Grain, 0.02);
    match rng.count(0, 2) {
        0 => {
            pouf.cushion([0.0; 3], [width, depth, height], cover);
        }
        1 => {
            pouf.size = [width, width, height];
            pouf.post([0.0; 3], width / 2.0, height - 0.03, cover);
            pouf.ball([0.0, 0.0, height - 0.1], [width, width, 0.12], cover);
        }
        _ => {
            pouf.size = [0.8, 0.8, 0.7];
            pouf.ball([0.0, 0.0, -0.05], [0.8, 0.8, 0.5], cover);
            pouf.ball([0.0, 0.12, 0.2], [0.6, 0.5, 0.48], cover);
        }
    }
    pouf
}
