//! Trim of a home: skirting boards, door casings, beams.

use super::upright;
use crate::simulate::finish::{Finish, WHITE, wood};
use crate::simulate::plan::{Plan, RoomKind, Wall};
use crate::simulate::rng::Rng;
use crate::simulate::solid::Solid;
use viola_geometry::taxonomy::Class;

/// The style of a home's trim.
pub(super) struct Trim {
    /// Height of the skirting boards; infinite without them.
    pub skirting_m: f64,
    skirting_thick_m: f64,
    /// Width of the boards around doors; 0 without them.
    pub casing_m: f64,
    pub finish: Finish,
}

impl Trim {
    pub fn of_a_home(rng: &mut Rng) -> Trim {
        let finish = if rng.chance(0.7) { Finish::plain(WHITE).glossy(0.2) } else { wood(rng) };
        Trim {
            skirting_m: if rng.chance(0.75) { rng.between(0.04, 0.14) } else { f64::INFINITY },
            skirting_thick_m: rng.between(0.01, 0.018),
            casing_m: if rng.chance(0.7) { rng.between(0.05, 0.09) } else { 0.0 },
            finish,
        }
    }

    /// Adds skirting boards to both sides of a part of a wall.
    pub fn skirting(&self, wall: &Wall, along: [f64; 2], across: [f64; 2], out: &mut Vec<Solid>) {
        let thick = self.skirting_thick_m;
        let sides = [[across[0] - thick, across[0]], [across[1], across[1] + thick]];
        // Boards stop at the end of their wall: beyond it they would stick out of the next room's wall.
        let along = [along[0].max(wall.from), along[1].min(wall.to)];
        for (room, side) in wall.rooms.iter().zip(sides) {
            if room.is_some() {
                let up = [0.0, self.skirting_m];
                out.extend(upright(Class::Wall, wall.along_x, along, side, up, self.finish));
            }
        }
    }
}

/// Adds beams below the level ceilings of some rooms.
pub(super) fn beams(plan: &Plan, rng: &mut Rng, out: &mut Vec<Solid>) {
    // Copies of a unit look alike, so only homes without units have beams.
    if !plan.units.is_empty() || plan.ceiling_m < 2.35 || !rng.chance(0.12) {
        return;
    }
    let finish = if rng.chance(0.7) { wood(rng) } else { Finish::plain(WHITE) };
    let (wide, high) = (rng.between(0.08, 0.2), rng.between(0.08, 0.22));
    let pitch = rng.between(0.6, 1.4);
    for (index, room) in plan.rooms.iter().enumerate() {
        let sloped = plan.slopes.iter().any(|slope| slope.room == index);
        if sloped || room.kind == RoomKind::Bathroom || room.inner.area_m2() < 8.0 {
            continue;
        }
        // Across the shorter side.
        let axis = if room.inner.size(0) < room.inner.size(1) { 0 } else { 1 };
        let (length, span) = (room.inner.size(1 - axis), [room.inner.min[axis], room.inner.max[axis]]);
        let count = (length / pitch) as usize;
        for k in 1..=count {
            let at = room.inner.min[1 - axis] + length * k as f64 / (count + 1) as f64;
            let across = [at - wide / 2.0, at + wide / 2.0];
            let up = [plan.ceiling_m - high, plan.ceiling_m];
            out.extend(upright(Class::Ceiling, axis == 0, span, across, up, finish));
        }
    }
}
