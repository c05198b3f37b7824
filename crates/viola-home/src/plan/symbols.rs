//! Symbols of furniture, as lines in the plan's frame.

use super::axes::place;
use super::model::Furniture;
use std::f64::consts::TAU;
use viola_geometry::taxonomy::Class;

/// A line of a symbol.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Stroke {
    pub points_m: Vec<[f64; 2]>,
    pub is_closed: bool,
    /// Filled, as the outline of the piece.
    pub is_filled: bool,
}

/// A piece in its own coordinates: u along its back from 0 to 1, v from its back (0) to its front (1).
struct Local {
    origin_m: [f64; 2],
    u_m: [f64; 2],
    v_m: [f64; 2],
    recess: Option<[f64; 2]>,
    strokes: Vec<Stroke>,
}

impl Local {
    fn of(piece: &Furniture) -> Local {
        let corners = piece.corners_m();
        let back = usize::from(piece.back.unwrap_or(0));
        let corner = |i: usize| corners[(back + i) % 4];
        let towards = |to: [f64; 2]| [to[0] - corner(0)[0], to[1] - corner(0)[1]];
        let [u_m, v_m] = [1, 3].map(|i| towards(corner(i)));
        Local { origin_m: corner(0), u_m, v_m, recess: piece.recess, strokes: Vec::new() }
    }

    /// Returns the corners of the outline: of the rectangle, or of the L of a corner sofa.
    fn corners(&self) -> Vec<[f64; 2]> {
        let [u, v] = self.recess.unwrap_or_default().map(|part| 1.0 - part);
        let front = if self.recess.is_some() { vec![[1.0, v], [u, v], [u, 1.0]] } else { vec![[1.0, 1.0]] };
        [vec![[0.0, 0.0], [1.0, 0.0]], front, vec![[0.0, 1.0]]].concat()
    }

    fn place(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|axis| self.origin_m[axis] + u * self.u_m[axis] + v * self.v_m[axis])
    }

    /// Returns the lengths of the back and of the side.
    fn size_m(&self) -> [f64; 2] {
        [self.u_m, self.v_m].map(|side| side[0].hypot(side[1]))
    }

    fn add(&mut self, points: &[[f64; 2]], is_closed: bool, is_filled: bool) {
        let points_m = points.iter().map(|p| self.place(*p)).collect();
        self.strokes.push(Stroke { points_m, is_closed, is_filled });
    }

    fn outline(&mut self) {
        self.add(&self.corners(), true, true);
    }

    fn line(&mut self, a: [f64; 2], b: [f64; 2]) {
        self.add(&[a, b], false, false);
    }

    fn rectangle(&mut self, low: [f64; 2], high: [f64; 2]) {
        self.add(&[low, [high[0], low[1]], high, [low[0], high[1]]], true, false);
    }

    fn ellipse(&mut self, centre: [f64; 2], half: [f64; 2], is_filled: bool) {
        const SIDES: u32 = 28;
        let at = |i: u32| {
            let (sin, cos) = (f64::from(i) / f64::from(SIDES) * TAU).sin_cos();
            [centre[0] + half[0] * cos, centre[1] + half[1] * sin]
        };
        self.add(&(0..SIDES).map(at).collect::<Vec<_>>(), true, is_filled);
    }

    /// A circle of a radius in metres.
    fn circle(&mut self, centre: [f64; 2], radius_m: f64) {
        let [u, v] = self.size_m();
        self.ellipse(centre, [radius_m / u, radius_m / v], false);
    }
}

/// Returns the corners of a piece's outline, counter-clockwise: of its rectangle, or of the L of a corner sofa.
pub(super) fn outline_m(piece: &Furniture) -> Vec<[f64; 2]> {
    if piece.recess.is_none() {
        return piece.corners_m().to_vec();
    }
    let local = Local::of(piece);
    local.corners().into_iter().map(|corner| local.place(corner)).collect()
}

/// Returns the lines of a piece's symbol, the outline first.
pub(super) fn strokes(piece: &Furniture) -> Vec<Stroke> {
    let mut local = Local::of(piece);
    let [long_m, deep_m] = local.size_m();
    match piece.class {
        Class::Plant => plant(&mut local),
        Class::Toilet => toilet(&mut local),
        Class::Sink => {
            local.outline();
            local.ellipse([0.5, 0.55], [0.38, 0.34], false);
            local.circle([0.5, 0.5], 0.02);
        }
        class => {
            local.outline();
            match class {
                Class::Bed => bed(&mut local, long_m),
                Class::Sofa => match piece.recess {
                    Some(recess) => corner_sofa(&mut local, recess),
                    None => sofa(&mut local, long_m, deep_m),
                },
                Class::Chair if piece.back.is_some() => local.line([0.0, 0.22], [1.0, 0.22]),
                Class::Cabinet => local.line([0.0, 1.0], [1.0, 0.0]),
                Class::Shelf => shelf(&mut local, long_m),
                Class::Counter => local.line([0.0, 0.93], [1.0, 0.93]),
                Class::Desk => local.rectangle([0.3, 0.12], [0.7, 0.2]),
                Class::Refrigerator => {
                    local.line([0.0, 0.9], [1.0, 0.9]);
                    local.line([0.0, 0.0], [1.0, 0.9]);
                }
                Class::Stove => stove(&mut local, long_m.min(deep_m)),
                Class::WashingMachine => local.circle([0.5, 0.5], 0.32 * long_m.min(deep_m)),
                Class::Bathtub => bathtub(&mut local),
                Class::Shower => {
                    local.line([0.0, 0.0], [1.0, 1.0]);
                    local.line([1.0, 0.0], [0.0, 1.0]);
                    local.circle([0.5, 0.5], 0.05);
                }
                Class::Radiator => {
                    (1..8).for_each(|i| local.line([f64::from(i) / 8.0, 0.0], [f64::from(i) / 8.0, 1.0]));
                }
                Class::Television => local.line([0.15, 0.35], [0.85, 0.35]),
                _ => {}
            }
        }
    }
    local.strokes
}

fn bed(local: &mut Local, wide_m: f64) {
    if wide_m > 1.2 {
        local.rectangle([0.08, 0.05], [0.46, 0.2]);
        local.rectangle([0.54, 0.05], [0.92, 0.2]);
    } else {
        local.rectangle([0.18, 0.05], [0.82, 0.2]);
    }
    local.line([0.0, 0.28], [1.0, 0.28]);
    local.line([0.0, 0.36], [1.0, 0.36]);
}

/// Thickness of the arms and of the back of a sofa.
const ARM_M: f64 = 0.16;
const BACK_M: f64 = 0.22;

fn sofa(local: &mut Local, long_m: f64, deep_m: f64) {
    let (arm, back) = ((ARM_M / long_m).min(0.2), (BACK_M / deep_m).min(0.35));
    local.rectangle([arm, back], [1.0 - arm, 1.0]);
    seats(arm, 1.0 - 2.0 * arm, long_m).for_each(|u| local.line([u, back], [u, 1.0]));
}

/// A seat in the corner and those along both legs, with a back at each outer side and an arm at each end.
fn corner_sofa(local: &mut Local, recess: [f64; 2]) {
    let size_m = local.size_m();
    let leg = recess.map(|part| 1.0 - part);
    let back = [0, 1].map(|axis| (BACK_M / size_m[axis]).min(0.35 * leg[axis]));
    let arm = [0, 1].map(|axis| (ARM_M / size_m[axis]).min(0.2 * recess[axis]));
    let end = arm.map(|arm| 1.0 - arm);
    local.add(
        &[back, [end[0], back[1]], [end[0], leg[1]], leg, [leg[0], end[1]], [back[0], end[1]]],
        true,
        false,
    );
    for axis in 0..2 {
        let across = 1 - axis;
        let others = seats(leg[axis], recess[axis] - arm[axis], size_m[axis]);
        for at in std::iter::once(leg[axis]).chain(others) {
            local.line(place(axis, at, back[across]), place(axis, at, leg[across]));
        }
    }
}

/// Returns where the seats along a part of a side meet. `width` is the fraction of the side.
fn seats(from: f64, width: f64, side_m: f64) -> impl Iterator<Item = f64> {
    let seats = ((width * side_m / 0.7).round() as u32).clamp(1, 6);
    (1..seats).map(move |i| from + width * f64::from(i) / f64::from(seats))
}

fn shelf(local: &mut Local, long_m: f64) {
    let parts = ((long_m / 0.5).round() as u32).clamp(1, 12);
    (1..parts).for_each(|i| {
        local.line([f64::from(i) / f64::from(parts), 0.0], [f64::from(i) / f64::from(parts), 1.0])
    });
}

fn stove(local: &mut Local, side_m: f64) {
    for u in [0.28, 0.72] {
        for v in [0.28, 0.72] {
            local.circle([u, v], 0.15 * side_m);
        }
    }
}

fn bathtub(local: &mut Local) {
    let [long_m, deep_m] = local.size_m();
    let rim = [0.07 / long_m, 0.07 / deep_m].map(|part| part.min(0.2));
    local.rectangle(rim, [1.0 - rim[0], 1.0 - rim[1]]);
    let drain = if long_m > deep_m { [1.0 - 3.0 * rim[0], 0.5] } else { [0.5, 1.0 - 3.0 * rim[1]] };
    local.circle(drain, 0.03);
}

fn toilet(local: &mut Local) {
    local.add(&[[0.05, 0.0], [0.95, 0.0], [0.95, 0.26], [0.05, 0.26]], true, true);
    local.ellipse([0.5, 0.63], [0.42, 0.37], true);
    local.ellipse([0.5, 0.63], [0.28, 0.26], false);
}

fn plant(local: &mut Local) {
    local.ellipse([0.5; 2], [0.5; 2], true);
    for i in 0..6 {
        let (sin, cos) = (f64::from(i) / 6.0 * TAU).sin_cos();
        local.line([0.5, 0.5], [0.5 + 0.42 * cos, 0.5 + 0.42 * sin]);
    }
}
