//! Chairs, sofas, tables, desks.

use crate::simulate::finish::{DARK, Finish, METAL, cloth, wood};
use crate::simulate::piece::Piece;
use crate::simulate::rng::Rng;
use std::f64::consts::{PI, TAU};
use viola_geometry::Pose2;
use viola_geometry::taxonomy::Class;

/// Returns a chair with four legs: four dots to a vacuum.
pub fn chair(finish: Finish, rng: &mut Rng) -> Piece {
    let (width, depth) = (rng.between(0.40, 0.48), rng.between(0.42, 0.50));
    let seat = rng.between(0.44, 0.47);
    let top = rng.between(0.82, 1.0);
    let thick = rng.between(0.028, 0.042);
    let mut chair = Piece::new(Class::Chair, [width, depth, top]).movable();
    chair.legs(width, depth, seat - 0.03, thick, 0.01, finish);
    chair.block([0.0, 0.0, seat - 0.03], [width, depth, 0.035], finish);
    for x in [-1.0, 1.0] {
        let post = [x * (width / 2.0 - 0.03), depth / 2.0 - 0.025, seat];
        chair.block(post, [thick, thick, top - seat], finish);
    }
    chair.block([0.0, depth / 2.0 - 0.025, top - 0.24], [width - 0.04, 0.022, 0.22], finish);
    chair
}

/// Returns an office chair: a post on five castors.
pub fn office_chair(rng: &mut Rng) -> Piece {
    let black = Finish::plain(DARK);
    let seat = cloth(rng).darker(0.6);
    let mut chair = Piece::new(Class::Chair, [0.62, 0.62, 1.05]).movable();
    for arm in 0..5 {
        let angle = f64::from(arm) * TAU / 5.0;
        let (s, c) = angle.sin_cos();
        chair.block([0.14 * c, 0.14 * s, 0.06], [0.30, 0.045, 0.035], black).yaw_rad = angle;
        chair.post([0.28 * c, 0.28 * s, 0.0], 0.03, 0.06, black);
    }
    chair.post([0.0, 0.0, 0.08], 0.03, 0.36, Finish::plain(METAL).glossy(0.7));
    chair.block([0.0, 0.0, 0.44], [0.48, 0.48, 0.08], seat);
    chair.block([0.0, 0.22, 0.56], [0.44, 0.07, 0.48], seat).tilt_rad = -0.15;
    chair
}

/// Returns a sofa of two or three seats, on legs or down to the floor.
pub fn sofa(rng: &mut Rng) -> Piece {
    let width = rng.between(1.5, 2.3);
    let depth = rng.between(0.82, 0.98);
    seats(Class::Sofa, width, depth, if width > 1.9 { 3 } else { 2 }, rng).movable()
}

/// Returns a sofa with a chaise at one end.
pub fn corner_sofa(rng: &mut Rng) -> Piece {
    let (width, depth, reach) = (rng.between(2.2, 2.8), 0.92, rng.between(1.5, 1.75));
    let finish = cloth(rng);
    let gap = under(rng);
    let side = rng.sign();
    let mut sofa = Piece::new(Class::Sofa, [width, reach, 0.82]);
    let main = upholstery(Class::Sofa, width, depth, 3, gap, finish, rng);
    sofa.join(&main, &Pose2::new(0.0, (reach - depth) / 2.0, 0.0), 0.0);
    let chaise = [side * (width - depth) / 2.0, (depth - reach) / 2.0 - depth / 2.0];
    let front = reach - depth;
    sofa.block([chaise[0], -reach / 2.0 + front / 2.0, gap], [depth, front, 0.42 - gap], finish);
    if gap > 0.0 {
        let feet = Finish::plain(DARK);
        for x in [-1.0, 1.0] {
            sofa.post([chaise[0] + x * (depth / 2.0 - 0.06), 0.06 - reach / 2.0, 0.0], 0.02, gap, feet);
        }
    }
    sofa
}

pub fn armchair(rng: &mut Rng) -> Piece {
    let (width, depth) = (rng.between(0.72, 0.9), rng.between(0.75, 0.9));
    seats(Class::Chair, width, depth, 1, rng).movable()
}

fn seats(class: Class, width: f64, depth: f64, count: usize, rng: &mut Rng) -> Piece {
    let gap = under(rng);
    let finish = cloth(rng);
    upholstery(class, width, depth, count, gap, finish, rng)
}

/// Returns the gap under a seat: none, too low for a vacuum, or high enough.
fn under(rng: &mut Rng) -> f64 {
    match rng.count(0, 3) {
        0 => 0.0,
        1 => rng.between(0.03, 0.07),
        _ => rng.between(0.11, 0.17),
    }
}

fn upholstery(
    class: Class,
    width: f64,
    depth: f64,
    count: usize,
    gap: f64,
    finish: Finish,
    rng: &mut Rng,
) -> Piece {
    let (arm, back, top) = (rng.between(0.12, 0.2), 0.22, rng.between(0.74, 0.9));
    let mut piece = Piece::new(class, [width, depth, top]);
    if gap > 0.0 {
        let feet = Finish::plain(if rng.chance(0.5) { DARK } else { METAL });
        piece.legs(width, depth, gap, 0.045, 0.03, feet);
    }
    piece.block([0.0, 0.0, gap], [width, depth, 0.30 - gap], finish);
    piece.block([0.0, (depth - back) / 2.0, 0.30], [width, back, top - 0.30], finish);
    for x in [-1.0, 1.0] {
        piece.block([x * (width - arm) / 2.0, -0.02, 0.30], [arm, depth - 0.04, 0.28], finish);
    }
    let seat = (width - 2.0 * arm) / count as f64;
    let lighter = Finish { rgb: finish.rgb.map(|c| (c * 1.08).min(0.95)), ..finish };
    for index in 0..count {
        let x = seat * (index as f64 + 0.5) - seat * count as f64 / 2.0;
        piece.block([x, -back / 2.0 + 0.01, 0.30], [seat - 0.015, depth - back - 0.02, 0.14], lighter);
        piece.block([x, depth / 2.0 - back - 0.06, 0.44], [seat - 0.03, 0.14, 0.34], lighter).tilt_rad = -0.2;
    }
    for _ in 0..rng.count(0, count) {
        let pillow = cloth(rng);
        let x = rng.between(-0.5, 0.5) * (width - 2.0 * arm - 0.4);
        let ball = piece.ball([x, depth / 2.0 - back - 0.22, 0.44], [0.42, 0.16, 0.38], pillow);
        ball.class = Class::Pillow;
    }
    piece
}

/// Returns a table: four legs, or a pedestal under a round top.
pub fn table(width: f64, depth: f64, height: f64, finish: Finish, rng: &mut Rng) -> Piece {
    let mut table = Piece::new(Class::Table, [width, depth, height]).movable();
    let thick = rng.between(0.025, 0.04);
    if (width - depth).abs() < 0.05 && rng.chance(0.5) {
        table.post([0.0, 0.0, height - thick], width / 2.0, thick, finish);
        table.post([0.0, 0.0, 0.03], 0.05, height - thick - 0.03, finish);
        table.post([0.0, 0.0, 0.0], width * 0.28, 0.03, finish);
    } else {
        table.block([0.0, 0.0, height - thick], [width, depth, thick], finish);
        let leg = rng.between(0.04, 0.08);
        let inset = rng.between(0.0, 0.05);
        table.legs(width, depth, height - thick, leg, inset, finish);
        if rng.chance(0.5) {
            let rail = height - thick - 0.08;
            for y in [-1.0, 1.0] {
                table.block(
                    [0.0, y * (depth / 2.0 - inset - leg / 2.0), rail],
                    [width - 0.1, 0.02, 0.08],
                    finish,
                );
            }
        }
    }
    table
}

/// Returns a dining table, and its chairs with their poses in the table's frame, as people left them.
pub fn dining_set(seats: usize, rng: &mut Rng) -> (Piece, Vec<(Piece, Pose2)>) {
    let finish = wood(rng);
    let pairs = seats.div_ceil(2).max(1);
    let (width, depth) = match pairs {
        1 => (rng.between(0.7, 0.8), rng.between(0.7, 0.75)),
        _ => (0.25 + 0.58 * pairs as f64 + rng.between(0.0, 0.1), rng.between(0.75, 0.95)),
    };
    let table = table(width, depth, rng.between(0.72, 0.76), finish, rng);
    let chair_finish = if rng.chance(0.6) { finish } else { wood(rng) };
    let model = chair(chair_finish, rng);
    let mut chairs = vec![];
    for index in 0..seats {
        let side = if index % 2 == 0 { -1.0 } else { 1.0 };
        let x = width * ((index / 2) as f64 + 0.5) / pairs as f64 - width / 2.0 + rng.between(-0.04, 0.04);
        // Pushed in, or pulled out a little.
        let out = rng.between(-0.12, 0.22);
        let yaw = if side < 0.0 { PI } else { 0.0 } + rng.between(-0.2, 0.2);
        chairs.push((model.clone(), Pose2::new(x, side * (depth / 2.0 + 0.12 + out), yaw)));
    }
    (table, chairs)
}

/// Returns a desk on legs, sometimes with a drawer unit under one end, with a screen on it.
pub fn desk(rng: &mut Rng) -> Piece {
    let (width, depth, height) = (rng.between(1.1, 1.6), rng.between(0.6, 0.75), 0.74);
    let finish = wood(rng);
    let mut desk = Piece::new(Class::Desk, [width, depth, height]);
    desk.block([0.0, 0.0, height - 0.03], [width, depth, 0.03], finish);
    desk.legs(width, depth, height - 0.03, 0.045, 0.01, Finish::plain(METAL));
    if rng.chance(0.5) {
        let side = rng.sign();
        desk.block([side * (width / 2.0 - 0.28), 0.03, 0.06], [0.4, depth - 0.1, 0.55], finish.darker(0.9));
    }
    let black = Finish::plain(DARK).glossy(0.5);
    let x = rng.between(-0.2, 0.2);
    for (bottom, size) in [
        ([x, 0.15, height], [0.24, 0.18, 0.015]),
        ([x, 0.17, height], [0.05, 0.04, 0.16]),
        ([x, 0.16, height + 0.12], [rng.between(0.5, 0.7), 0.03, 0.34]),
    ] {
        desk.block(bottom, size, black).class = Class::Television;
    }
    desk.block([x, -0.12, height], [0.42, 0.14, 0.02], Finish::plain([0.3, 0.3, 0.32])).class = Class::Box;
    desk
}
