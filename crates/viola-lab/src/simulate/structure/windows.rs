//! Windows: frame, sashes, pane, sill and roller shutter.

use super::{faces, upright};
use crate::simulate::finish::{Finish, METAL, Pattern, WHITE, wood};
use crate::simulate::plan::{Opening, OpeningKind, Plan};
use crate::simulate::rng::Rng;
use crate::simulate::solid::Solid;
use viola_geometry::taxonomy::Class;

/// Adds a window with its pane. Everything is symmetric about its middle, because mirrored copies of a unit
/// share the details.
pub(super) fn window(plan: &Plan, opening: &Opening, out: &mut Vec<Solid>) {
    if opening.kind != OpeningKind::Window {
        return;
    }
    let mut rng = Rng::new(opening.detail);
    let [low_face, high_face] = faces(plan, opening.rooms, opening.line());
    // The face on the room's side, and the direction into the room.
    let (inner, inward) = if opening.rooms[0].is_some() { (low_face, -1.0) } else { (high_face, 1.0) };
    let thick = high_face - low_face;
    let depth = rng.between(0.25, 0.75) * thick;
    // An interval across the wall, by distances from the inner face outwards.
    let across = |near: f64, far: f64| {
        let (a, b) = (inner - inward * near, inner - inward * far);
        [a.min(b), a.max(b)]
    };
    let finish = match rng.count(0, 5) {
        0 => wood(&mut rng),
        1 => Finish::plain([0.25, 0.26, 0.28]).glossy(0.2),
        _ => Finish::plain(WHITE).glossy(0.2),
    };
    let (left, right) = (opening.at() - opening.width_m / 2.0, opening.at() + opening.width_m / 2.0);
    let (low, high) = (opening.sill_m, opening.head_m);
    let mut part = |along: [f64; 2], across: [f64; 2], up: [f64; 2], finish: Finish| {
        out.extend(upright(Class::Window, opening.along_x, along, across, up, finish));
    };
    let wide = rng.between(0.05, 0.09);
    let frame = across(depth - 0.035, depth + 0.035);
    part([left, left + wide], frame, [low, high], finish);
    part([right - wide, right], frame, [low, high], finish);
    part([left, right], frame, [high - wide, high], finish);
    part([left, right], frame, [low, low + wide], finish);
    let sashes = (opening.width_m / rng.between(0.6, 1.1)).round().max(1.0) as usize;
    for k in 1..sashes {
        let at = left + opening.width_m * k as f64 / sashes as f64;
        part([at - wide * 0.6, at + wide * 0.6], frame, [low, high], finish);
    }
    if rng.chance(0.15) {
        let at = high - rng.between(0.35, 0.5);
        part([left, right], frame, [at - 0.03, at + 0.03], finish);
    }
    part([left, right], across(depth - 0.006, depth + 0.006), [low, high], Finish::glass());
    if low > 0.3 && rng.chance(0.8) {
        let (board, overhang) = (rng.between(0.02, 0.04), rng.between(0.0, 0.1));
        let stone = Finish::plain(rng.pick([WHITE, [0.72, 0.70, 0.66], [0.40, 0.40, 0.42]])).glossy(0.3);
        part([left - 0.03, right + 0.03], across(-overhang, depth - 0.03), [low, low + board], stone);
    }
    if rng.chance(0.15) {
        let lowered = if rng.chance(0.5) { 1.0 } else { rng.between(0.2, 0.8) };
        let slats = Finish::plain(rng.pick([WHITE, METAL, [0.55, 0.50, 0.44]])).with(Pattern::Stripes, 0.04);
        let bottom = high - lowered * (high - low);
        let shutter = across((depth + 0.06).min(thick - 0.02), (depth + 0.075).min(thick));
        part([left, right], shutter, [bottom, high], slats);
    }
}
