//! Plants, pictures, mirrors, boards, radiators.

use super::sizes::{PAINTING, PLANT};
use crate::simulate::finish::{DARK, Finish, Pattern, WHITE, wood};
use crate::simulate::piece::{Mount, Piece, TopKind};
use crate::simulate::rng::Rng;
use viola_geometry::taxonomy::Class;

/// Returns a plant in a pot: bushy, a small tree, or with long leaves.
pub fn plant(rng: &mut Rng) -> Piece {
    let [width, _, height] = PLANT.draw(rng);
    let pot = (width * 0.4).clamp(0.1, 0.19);
    let mut piece = Piece::new(Class::Plant, [2.4 * pot, 2.4 * pot, height]).movable();
    let clay = Finish::plain(rng.pick([WHITE, [0.62, 0.36, 0.25], DARK]));
    let tall = rng.between(0.2, 0.36).min(height * 0.5);
    piece.post([0.0; 3], pot, tall, clay);
    let green = rng.pick([[0.20, 0.42, 0.20], [0.30, 0.48, 0.22], [0.16, 0.32, 0.18]]);
    let leaves = Finish::plain(green).with(Pattern::Grain, 0.02);
    if rng.chance(0.35) {
        // Long leaves that bend outwards.
        for k in 0..rng.count(5, 9) {
            let (s, c) = (k as f64 * 2.4).sin_cos();
            let reach = rng.between(0.1, 0.28) * height.min(1.2);
            let rise = tall + (height - tall) * rng.between(0.55, 0.98);
            let middle = [c * reach * 0.4, s * reach * 0.4, (tall + rise) / 2.0];
            piece.bar([0.0, 0.0, tall - 0.02], middle, 0.012, leaves);
            let leaf = piece.bar(middle, [c * reach, s * reach, rise], 0.03, leaves);
            leaf.half.y = 0.008;
        }
        return piece;
    }
    piece.post(
        [0.0, 0.0, tall - 0.02],
        0.015,
        (height - tall - 0.1).max(0.05),
        Finish::plain([0.35, 0.28, 0.18]),
    );
    for _ in 0..rng.count(3, 8) {
        let size = rng.between(0.14, 0.34) * height.min(1.2);
        let (x, y) = (rng.between(-0.16, 0.16), rng.between(-0.16, 0.16));
        let z = (rng.between(0.45, 0.95) * height - size / 2.0).max(tall);
        let leaf = piece.ball([x, y, z], [size, size, size * rng.between(0.4, 0.9)], leaves);
        leaf.tilt_rad = rng.between(-0.5, 0.5);
    }
    piece
}

/// Returns a picture, a poster or a whiteboard on the wall behind it.
pub fn picture(rng: &mut Rng) -> Piece {
    let [width, _, height] = PAINTING.draw(rng);
    let bottom = rng.between(1.15, 1.5);
    let mut piece = Piece::new(Class::Picture, [width, 0.03, bottom + height]).mounted(Mount::Hung).movable();
    let tone = [rng.between(0.2, 0.9) as f32, rng.between(0.2, 0.9) as f32, rng.between(0.2, 0.9) as f32];
    let print = Finish::plain(tone).with(Pattern::Picture, rng.between(0.05, 0.16) as f32).glossy(0.2);
    let askew = if rng.chance(0.2) { rng.between(-0.04, 0.04) } else { 0.0 };
    match rng.count(0, 5) {
        0 => {
            // A poster without a frame.
            piece.block([0.0, 0.012, bottom], [width, 0.003, height], print).roll_rad = askew;
        }
        1 if width > 0.7 => {
            let white = Finish::plain(WHITE).glossy(0.4);
            piece.block([0.0, 0.0, bottom], [width, 0.02, height], white);
            piece.block([0.0, -0.01, bottom], [width, 0.05, 0.02], white.darker(0.7));
        }
        _ => {
            let frame = wood(rng);
            piece.block([0.0, 0.0, bottom], [width, 0.024, height], frame).roll_rad = askew;
            let inset = [width - 0.06, 0.016, height - 0.06];
            piece.block([0.0, -0.008, bottom + 0.03], inset, print).roll_rad = askew;
        }
    }
    piece
}

/// Returns a tall mirror that leans at the wall behind it.
pub fn leaning_mirror(rng: &mut Rng) -> Piece {
    let (width, height) = (rng.between(0.4, 0.8), rng.between(1.4, 1.8));
    let lean = rng.between(0.06, 0.12);
    let deep = height * lean + 0.05;
    let mut piece = Piece::new(Class::Mirror, [width, deep, height]).movable();
    piece.block([0.0, 0.0, 0.0], [width, 0.025, height], wood(rng)).tilt_rad = -lean;
    let glass = piece.block([0.0, -0.01, 0.04], [width - 0.08, 0.015, height - 0.08], Finish::mirror());
    glass.tilt_rad = -lean;
    piece
}

/// Returns a radiator of the given width: a panel, or a row of columns.
pub fn radiator(width: f64, rng: &mut Rng) -> Piece {
    let height = rng.between(0.5, 0.62);
    let mut piece = Piece::new(Class::Radiator, [width, 0.12, height]);
    let white = Finish::plain(WHITE);
    if rng.chance(0.4) {
        let columns = ((width / 0.075) as usize).min(14);
        let pitch = width / columns as f64;
        for column in 0..columns {
            let x = pitch * (column as f64 + 0.5) - width / 2.0;
            piece.post([x, 0.0, 0.12], pitch * 0.4, height - 0.12, white).half.y = 0.05;
        }
        for z in [0.16, height - 0.06] {
            piece.bar([-width / 2.0, 0.0, z], [width / 2.0, 0.0, z], 0.02, white);
        }
    } else {
        piece.block([0.0, 0.0, 0.12], [width, 0.08, height - 0.12], white.with(Pattern::Stripes, 0.05));
    }
    for x in [-1.0, 1.0] {
        piece.post([x * (width / 2.0 - 0.05), 0.02, 0.0], 0.01, 0.14, white);
    }
    piece
}

/// Returns the board of a window's sill, which reaches into the room.
pub fn sill(width: f64, height: f64, rng: &mut Rng) -> Piece {
    let deep = rng.between(0.12, 0.22);
    let mut piece = Piece::new(Class::Window, [width, deep, height]).mounted(Mount::Hung);
    piece.block([0.0, 0.0, height - 0.03], [width, deep, 0.03], Finish::plain(WHITE).glossy(0.2));
    piece.top(TopKind::Store, [0.0, 0.0, height], [width * 0.9, deep * 0.95], 0.4);
    piece
}
