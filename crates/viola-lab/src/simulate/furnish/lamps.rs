//! Lamps on the floor, on tables and on the ceiling.

use super::sizes::FLOOR_LAMP;
use crate::simulate::finish::{DARK, Finish, METAL, WHITE, wood};
use crate::simulate::piece::{Mount, Piece};
use crate::simulate::rng::Rng;
use viola_geometry::taxonomy::Class;

fn shade(rng: &mut Rng) -> Finish {
    Finish::plain(rng.pick([[0.93, 0.88, 0.75], [0.95, 0.93, 0.86], [0.3, 0.3, 0.32], [0.7, 0.5, 0.35]]))
}

fn pole(rng: &mut Rng) -> Finish {
    Finish::plain(rng.pick([DARK, METAL, WHITE]))
}

/// Returns a lamp on one pole, on three legs, or on an arc.
pub fn floor_lamp(rng: &mut Rng) -> Piece {
    let [width, _, top] = FLOOR_LAMP.draw(rng);
    let mut piece = Piece::new(Class::Lamp, [width, width, top]).movable();
    let (pole, shade) = (pole(rng), shade(rng));
    match rng.count(0, 3) {
        0 => {
            let legs = if rng.chance(0.6) { wood(rng) } else { pole };
            for k in 0..3 {
                let (s, c) = (f64::from(k) * std::f64::consts::TAU / 3.0).sin_cos();
                let reach = width * 0.46;
                piece.bar([reach * c, reach * s, 0.0], [0.02 * c, 0.02 * s, top - 0.3], 0.014, legs);
            }
            piece.post([0.0, 0.0, top - 0.32], width * 0.45, 0.32, shade);
        }
        1 => {
            // The foot is at the back, the shade at the front end of an arc.
            let reach = rng.between(0.7, 1.1);
            piece.size[1] = reach;
            let back = reach / 2.0 - 0.16;
            piece.post([0.0, back, 0.0], 0.15, 0.04, pole);
            let arc = [
                [0.0, back, 0.03],
                [0.0, back, top - 0.35],
                [0.0, back - 0.2 * reach, top - 0.06],
                [0.0, back - 0.5 * reach, top],
                [0.0, 0.15 - reach / 2.0, top - 0.12],
            ];
            for pair in arc.windows(2) {
                piece.bar(pair[0], pair[1], 0.013, pole);
            }
            piece.ball([0.0, 0.15 - reach / 2.0, top - 0.36], [0.3, 0.3, 0.26], shade);
        }
        _ => {
            piece.post([0.0; 3], rng.between(0.12, 0.16), 0.025, pole);
            piece.post([0.0, 0.0, 0.02], 0.013, top - 0.25, pole);
            let radius = rng.between(0.12, 0.2);
            if rng.chance(0.3) {
                piece.ball([0.0, 0.0, top - 0.3], [2.0 * radius, 2.0 * radius, 0.3], shade);
            } else {
                piece.post([0.0, 0.0, top - 0.28], radius, 0.28, shade);
            }
        }
    }
    piece
}

/// Returns a lamp for a table, a desk or a nightstand.
pub fn table_lamp(rng: &mut Rng) -> Piece {
    let tall = rng.between(0.3, 0.5);
    let mut piece = Piece::new(Class::Lamp, [0.24, 0.24, tall]);
    let (pole, shade) = (pole(rng), shade(rng));
    match rng.count(0, 2) {
        0 => {
            // A desk lamp with a joint.
            piece.post([0.0; 3], 0.08, 0.02, pole);
            piece.bar([0.0, 0.0, 0.02], [0.0, 0.1, tall * 0.6], 0.01, pole);
            piece.bar([0.0, 0.1, tall * 0.6], [0.0, -0.08, tall], 0.01, pole);
            piece.ball([0.0, -0.1, tall - 0.06], [0.14, 0.14, 0.09], pole);
        }
        1 => {
            let wide = tall * 0.45;
            piece.ball([0.0; 3], [wide, wide, tall * 0.55], shade.darker(0.6));
            piece.post([0.0, 0.0, tall * 0.5], 0.11, tall * 0.5, shade);
        }
        _ => {
            piece.post([0.0; 3], 0.06, 0.02, pole);
            piece.post([0.0; 3], 0.015, tall - 0.15, pole);
            piece.post([0.0, 0.0, tall - 0.18], rng.between(0.08, 0.11), 0.18, shade);
        }
    }
    piece
}

/// Returns a lamp on a ceiling of the given height; the origin of its frame is on the floor below.
pub fn ceiling_lamp(ceiling_m: f64, rng: &mut Rng) -> Piece {
    let mut piece = Piece::new(Class::Lamp, [0.5, 0.5, ceiling_m]).mounted(Mount::Hung);
    let (pole, shade) = (pole(rng), shade(rng));
    match rng.count(0, 4) {
        0 | 1 => {
            let drop = rng.between(0.25, 0.7);
            let size = rng.between(0.26, 0.46);
            piece.post([0.0, 0.0, ceiling_m - drop], 0.008, drop, pole);
            let bottom = [0.0, 0.0, ceiling_m - drop - size * 0.7];
            if rng.chance(0.5) {
                piece.ball(bottom, [size, size, size * 0.75], shade);
            } else {
                piece.post(bottom, size / 2.0, size * 0.7, shade);
            }
        }
        2 => {
            // Spots on a rail.
            piece.block([0.0, 0.0, ceiling_m - 0.04], [0.9, 0.04, 0.04], pole);
            for x in [-0.35, 0.0, 0.35] {
                let to = [x + rng.between(-0.1, 0.1), rng.between(-0.1, 0.1), ceiling_m - 0.18];
                piece.bar([x, 0.0, ceiling_m - 0.06], to, 0.035, pole);
            }
            piece.size[0] = 0.9;
        }
        3 => {
            // A fan with five blades.
            piece.post([0.0, 0.0, ceiling_m - 0.3], 0.02, 0.3, pole);
            piece.post([0.0, 0.0, ceiling_m - 0.38], 0.1, 0.12, pole);
            let turn = rng.between(0.0, 1.0);
            for k in 0..5 {
                let angle = turn + f64::from(k) * std::f64::consts::TAU / 5.0;
                let (s, c) = angle.sin_cos();
                let blade = piece.block([0.34 * c, 0.34 * s, ceiling_m - 0.3], [0.46, 0.12, 0.01], pole);
                blade.yaw_rad = angle;
                blade.class = Class::Other;
            }
            piece.ball([0.0, 0.0, ceiling_m - 0.46], [0.2, 0.2, 0.14], shade);
            piece.size = [1.1, 1.1, ceiling_m];
        }
        _ => {
            piece.post([0.0, 0.0, ceiling_m - 0.09], rng.between(0.15, 0.24), 0.09, shade);
        }
    }
    piece
}
