//! Surroundings of the windows: balconies and the facades of other houses.

use super::{faces, upright};
use crate::simulate::finish::{Finish, METAL, Pattern};
use crate::simulate::plan::{Opening, OpeningKind, Plan};
use crate::simulate::rng::Rng;
use crate::simulate::solid::Solid;
use viola_geometry::taxonomy::Class;

/// Adds balconies before some French windows, and facades before some windows. Copies of a unit look alike,
/// so only homes without units have them.
pub(super) fn around(plan: &Plan, rng: &mut Rng, out: &mut Vec<Solid>) {
    if !plan.units.is_empty() {
        return;
    }
    for window in plan.openings.iter().filter(|opening| opening.kind == OpeningKind::Window) {
        let mut rng = rng.fork("window", window.detail);
        if window.sill_m < 0.1 && rng.chance(0.6) {
            balcony(plan, window, &mut rng, out);
        } else if rng.chance(0.15) {
            facade(plan, window, &mut rng, out);
        }
    }
}

/// A strip along an outer wall, by distances from its outer face.
struct Strip<'a> {
    window: &'a Opening,
    face: f64,
    outward: f64,
    along: [f64; 2],
}

impl<'a> Strip<'a> {
    /// Returns the strip before a window, up to `depth_m`; none if the home itself is there.
    fn before(plan: &Plan, window: &'a Opening, half_m: f64, depth_m: f64) -> Option<Strip<'a>> {
        let faces = faces(plan, window.rooms, window.line());
        let (face, outward) = if window.rooms[0].is_some() { (faces[1], 1.0) } else { (faces[0], -1.0) };
        let strip = Strip { window, face, outward, along: [window.at() - half_m, window.at() + half_m] };
        let across = strip.across([0.05, depth_m]);
        let (x, y) = if window.along_x { (strip.along, across) } else { (across, strip.along) };
        let margin = plan.outer_m;
        let free = plan.rooms.iter().all(|room| {
            let apart = |interval: [f64; 2], axis: usize| {
                interval[1] < room.outline.min[axis] - margin || interval[0] > room.outline.max[axis] + margin
            };
            // The window's own wall is at the strip's edge.
            let own = window.rooms.iter().flatten().any(|&own| plan.rooms[own] == *room);
            own || apart(x, 0) || apart(y, 1)
        });
        free.then_some(strip)
    }

    fn across(&self, away: [f64; 2]) -> [f64; 2] {
        let [a, b] = away.map(|away| self.face + self.outward * away);
        [a.min(b), a.max(b)]
    }

    fn block(
        &self,
        class: Class,
        along: [f64; 2],
        away: [f64; 2],
        up: [f64; 2],
        finish: Finish,
    ) -> Option<Solid> {
        upright(class, self.window.along_x, along, self.across(away), up, finish)
    }
}

/// Adds a slab with a rail of bars.
fn balcony(plan: &Plan, window: &Opening, rng: &mut Rng, out: &mut Vec<Solid>) {
    let (depth, half) = (rng.between(1.0, 1.8), window.width_m / 2.0 + rng.between(0.2, 0.8));
    let Some(strip) = Strip::before(plan, window, half, depth) else { return };
    let stone = Finish::plain([0.60, 0.60, 0.58]).with(Pattern::Tiles, 0.4);
    out.extend(strip.block(Class::Other, strip.along, [0.0, depth], [-0.12, 0.0], stone));
    let metal = Finish::plain(rng.pick([METAL, [0.15, 0.15, 0.16]])).glossy(0.3);
    let at_edge = [depth - 0.05, depth - 0.02];
    out.extend(strip.block(Class::Other, strip.along, at_edge, [0.97, 1.02], metal));
    let count = (2.0 * half / 0.13) as usize;
    for k in 0..=count {
        let at = strip.along[0] + 2.0 * half * k as f64 / count as f64;
        out.extend(strip.block(Class::Other, [at - 0.01, at + 0.01], at_edge, [0.0, 0.98], metal));
    }
}

/// Adds the wall of another house within a sensor's range.
fn facade(plan: &Plan, window: &Opening, rng: &mut Rng, out: &mut Vec<Solid>) {
    let (near, half) = (rng.between(1.8, 4.0), rng.between(2.0, 4.0));
    let Some(strip) = Strip::before(plan, window, half, near + 0.3) else { return };
    let tone = rng.pick([[0.75, 0.70, 0.60], [0.62, 0.36, 0.28], [0.80, 0.80, 0.78]]);
    let plaster = Finish::plain(tone).with(Pattern::Grain, 0.03);
    out.extend(strip.block(Class::Other, strip.along, [near, near + 0.3], [-1.0, 4.0], plaster));
}
