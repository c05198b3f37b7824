//! Sofas: of blocks or of soft cushions, with a chaise, unfolded as a bed.

use super::sizes::{PILLOW, SOFA};
use crate::simulate::finish::{DARK, Finish, METAL, cloth, wood};
use crate::simulate::piece::{Piece, TopKind};
use crate::simulate::rng::Rng;
use viola_geometry::Pose2;
use viola_geometry::taxonomy::Class;

/// Measures of a sofa's parts.
struct Model {
    gap: f64,
    arm: f64,
    arm_top: f64,
    back: f64,
    seat: f64,
    top: f64,
    /// Lean of the back cushions.
    lean_rad: f64,
    /// True if the parts have rounded edges.
    soft: bool,
    finish: Finish,
    feet: Finish,
}

impl Model {
    fn draw(rng: &mut Rng) -> Model {
        Model {
            // A vacuum stops before some sofas and drives under others.
            gap: rng.pick([0.0, 0.05, 0.12, 0.16]),
            arm: rng.pick([0.0, 0.1, 0.15, 0.2, 0.26]),
            arm_top: rng.between(0.52, 0.68),
            back: rng.between(0.12, 0.24),
            seat: rng.between(0.40, 0.48),
            top: rng.within(SOFA.height_m),
            lean_rad: rng.between(0.1, 0.3),
            soft: rng.chance(0.75),
            finish: cloth(rng),
            feet: if rng.chance(0.5) { wood(rng) } else { Finish::plain(rng.pick([DARK, METAL])) },
        }
    }

    fn part(&self, piece: &mut Piece, bottom: [f64; 3], size: [f64; 3], finish: Finish, tilt_rad: f64) {
        let solid =
            if self.soft { piece.cushion(bottom, size, finish) } else { piece.block(bottom, size, finish) };
        solid.tilt_rad = tilt_rad;
    }

    /// Returns a straight sofa.
    fn straight(&self, width: f64, depth: f64, seats: usize, rng: &mut Rng) -> Piece {
        let mut sofa = Piece::new(Class::Sofa, [width, depth, self.top]);
        let base = 0.28;
        if self.gap > 0.0 {
            sofa.legs(width, depth, self.gap, 0.045, 0.03, self.feet);
        }
        sofa.block([0.0, 0.0, self.gap], [width - 0.02, depth - 0.04, base - self.gap], self.finish);
        let bottom = [0.0, (depth - self.back) / 2.0, self.gap];
        self.part(&mut sofa, bottom, [width, self.back, self.top - 0.06 - self.gap], self.finish, -0.06);
        if self.arm > 0.0 {
            for x in [-1.0, 1.0] {
                let bottom = [x * (width - self.arm) / 2.0, -0.01, self.gap];
                let size = [self.arm, depth - 0.02, self.arm_top - self.gap];
                self.part(&mut sofa, bottom, size, self.finish, 0.0);
            }
        }
        let inside = width - 2.0 * self.arm;
        let seat = inside / seats as f64;
        let lighter = Finish { rgb: self.finish.rgb.map(|c| (c * 1.08).min(0.95)), ..self.finish };
        for index in 0..seats {
            let x = seat * (index as f64 + 0.5) - inside / 2.0;
            let sunk = rng.between(-0.02, 0.02);
            let bottom = [x, -self.back / 2.0 - 0.01, base - 0.02];
            let size = [seat - 0.005, depth - self.back, self.seat + sunk - base + 0.02];
            self.part(&mut sofa, bottom, size, lighter, rng.between(-0.02, 0.03));
            let bottom = [x, depth / 2.0 - self.back - 0.07, self.seat - 0.03];
            let size = [seat - 0.02, 0.17, self.top - self.seat + rng.between(-0.06, 0.03)];
            self.part(&mut sofa, bottom, size, lighter, -self.lean_rad + rng.between(-0.05, 0.05));
        }
        sofa.rest = Some([seat * 0.5 - inside / 2.0, 0.02, self.seat]);
        let free = depth - self.back - 0.25;
        let middle = [0.0, (free - depth) / 2.0 + 0.05, self.seat];
        sofa.top(TopKind::Soft, middle, [inside - 0.1, free * 0.7], 0.5);
        sofa
    }
}

/// Returns a sofa of one of several kinds; `big` allows a chaise.
pub fn sofa(big: bool, rng: &mut Rng) -> Piece {
    let model = Model::draw(rng);
    let depth = rng.within(SOFA.depth_m);
    let width = rng.within(SOFA.width_m) - if big { 0.0 } else { 0.3 };
    let seats = rng.pick([1, 2, 2, 3]).max((width / 0.95).round() as usize).min(4);
    let mut sofa = match rng.count(0, if big { 9 } else { 5 }) {
        0 => sofa_bed(&model, width.max(1.5), rng),
        6.. => with_chaise(&model, width.max(2.1), depth, seats, rng),
        _ => model.straight(width.max(1.3), depth, seats, rng).movable(),
    };
    throw(&mut sofa, depth, &model, rng);
    sofa
}

fn with_chaise(model: &Model, width: f64, depth: f64, seats: usize, rng: &mut Rng) -> Piece {
    let reach = depth + rng.between(0.5, 0.8);
    let side = rng.sign();
    let mut sofa = Piece::new(Class::Sofa, [width, reach, model.top]);
    let main = model.straight(width, depth, seats, rng);
    let shift = (reach - depth) / 2.0;
    sofa.join(&main, &Pose2::new(0.0, shift, 0.0), 0.0);
    sofa.rest = main.rest.map(|[x, y, z]| [side * -x.abs(), y + shift, z]);
    let front = reach - depth + 0.06;
    let x = side * (width - depth) / 2.0;
    let y = front / 2.0 - reach / 2.0;
    sofa.block([x, y, model.gap], [depth - 0.03, front, 0.28 - model.gap], model.finish);
    model.part(&mut sofa, [x, y, 0.26], [depth, front, model.seat - 0.26], model.finish, 0.0);
    if model.gap > 0.0 {
        for side in [-1.0, 1.0] {
            sofa.post(
                [x + side * (depth / 2.0 - 0.06), 0.06 - reach / 2.0, 0.0],
                0.02,
                model.gap,
                model.feet,
            );
        }
    }
    sofa.top(TopKind::Soft, [x, y, model.seat], [depth * 0.7, front * 0.7], 0.5);
    sofa
}

/// Returns a sofa that is unfolded as a bed, with bedding on it.
fn sofa_bed(model: &Model, width: f64, rng: &mut Rng) -> Piece {
    let length = rng.between(1.8, 2.0);
    let mut sofa = Piece::new(Class::Sofa, [width, length, model.top]).movable();
    let back = [0.0, (length - model.back) / 2.0, model.gap];
    model.part(&mut sofa, back, [width, model.back, model.top - model.gap], model.finish, -0.05);
    sofa.block([0.0, -0.02, model.gap], [width - 0.1, length - 0.1, 0.2], model.finish.darker(0.8));
    for half in [-1.0, 1.0] {
        let bottom = [0.0, half * length / 4.0 - 0.02, model.gap + 0.15];
        model.part(&mut sofa, bottom, [width, length / 2.0, 0.22], model.finish, 0.0);
    }
    let level = model.gap + 0.36;
    let blanket = cloth(rng);
    let at = [rng.between(-0.2, 0.2), rng.between(-0.5, 0.1), level - 0.03];
    sofa.cushion(at, [width * 0.7, 1.0, 0.12], blanket).yaw_rad = rng.between(-0.4, 0.4);
    sofa.top(TopKind::Soft, [0.0, 0.0, level], [width * 0.7, length * 0.5], 0.5);
    sofa
}

/// Adds throw pillows and a blanket.
fn throw(sofa: &mut Piece, depth: f64, model: &Model, rng: &mut Rng) {
    let [width, reach, _] = sofa.size;
    let lean = reach / 2.0 - model.back;
    for _ in 0..rng.count(0, 4) {
        let [wide, tall, thick] = PILLOW.draw(rng);
        let x = rng.between(-0.5, 0.5) * (width - 2.0 * model.arm - wide).max(0.0);
        let bottom = [x, lean - rng.between(0.2, 0.32), model.seat - 0.03];
        let pillow = sofa.cushion(bottom, [wide, thick, tall.max(0.3)], cloth(rng));
        pillow.class = Class::Pillow;
        pillow.tilt_rad = -rng.between(0.15, 0.5);
        pillow.roll_rad = rng.between(-0.25, 0.25);
        pillow.yaw_rad = rng.between(-0.3, 0.3);
    }
    if rng.chance(0.3) {
        // A blanket hangs over the seat's front.
        let x = rng.between(-0.3, 0.3) * width;
        let wide = rng.between(0.4, 0.8).min(width * 0.4);
        let blanket = cloth(rng);
        let y = lean - (depth - model.back) / 2.0;
        sofa.block([x, y, model.seat], [wide, depth - model.back - 0.1, 0.025], blanket);
        let front = lean - depth + model.back;
        sofa.block([x, front + 0.01, model.seat - 0.25], [wide, 0.025, 0.27], blanket);
    }
}
