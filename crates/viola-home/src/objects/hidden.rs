//! Boxes of objects of which a part is hidden, not measured, or covered by things.

use super::cells::Cells;
use super::fit::{self, UprightBox};
use super::fragment::{Decided, Fragment};
use super::kind;
use viola_geometry::taxonomy::Class;
use viola_reconstruct::CloudPoint;

/// A counter whose underside is above this is a worktop.
pub const WORKTOP_M: f64 = 0.6;
/// Fraction of a worktop's points that its box leaves out below, and its usual thickness.
const WORKTOP_BEYOND: f64 = 0.1;
const WORKTOP_THICK_M: f64 = 0.04;
/// Largest height and least side of a shower's tray, and the usual height of its space.
const TRAY_M: f64 = 0.35;
const TRAY_SIDE_M: f64 = 0.6;
const SHOWER_M: f64 = 2.0;
/// Lowest part of a basin's foot that is looked for.
const FOOT_LOW_M: f64 = 0.15;
/// Largest height of a sink of which only the rim was measured, the usual depth of its basin, and the usual height of its tap.
const RIM_M: f64 = 0.1;
const BASIN_LOW_M: f64 = 0.12;
const TAP_M: f64 = 0.15;
/// Largest depth and least sides of an appliance's front, and the usual depth of appliances.
pub const FRONT_M: f64 = 0.2;
const FRONT_SIDE_M: f64 = 0.4;
pub const APPLIANCE_M: f64 = 0.6;
/// Minimum part of the upright surface that faces one way, for an appliance of which a bit of a side was measured too: a
/// free-standing one shows both sides.
const MIN_FRONT_FRACTION: f64 = 0.5;

/// Gives a shower of which only the tray was measured its usual height: glass is not seen.
pub fn raise_tray(bounds: &mut UprightBox, class: Class) {
    if class == Class::Shower && bounds.top_m() < TRAY_M && bounds.size_m[1] > TRAY_SIDE_M {
        set_heights(bounds, 0.0, SHOWER_M);
    }
}

/// Returns whether a box is the front of an appliance that is built in.
pub fn is_front(bounds: &UprightBox, class: Class) -> bool {
    is_shallower(bounds, class, FRONT_M)
}

/// Returns whether a box is an appliance that is built in, with less than this depth.
fn is_shallower(bounds: &UprightBox, class: Class, depth_m: f64) -> bool {
    let [long_m, short_m, high_m] = bounds.size_m;
    let is_closed = matches!(class, Class::WashingMachine | Class::Refrigerator);
    is_closed && short_m < depth_m && long_m > FRONT_SIDE_M && high_m > FRONT_SIDE_M
}

/// Gives units below a worktop and appliances of which only the front was measured, or the front and less of a side than any
/// such appliance has, their usual depth: they are built in or stand at a wall.
pub fn deepen_front(bounds: &mut UprightBox, fragment: &Fragment, own: &[&CloudPoint]) {
    let class = fragment.class;
    let (sin, cos) = bounds.yaw_rad.sin_cos();
    let (mut out, mut upright) = (0.0, 0.0);
    for point in own {
        let [x, y, _] = point.normal.map(f64::from);
        out += cos * y - sin * x;
        upright += x.hypot(y);
    }
    let least_m = kind::kind(class).map_or(0.0, |kind| kind.short_m.start);
    let is_facing = upright > 0.0 && out.abs() >= MIN_FRONT_FRACTION * upright;
    let shows_front = is_shallower(bounds, class, least_m) && is_facing;
    let is_front_of_unit = fragment.is_unit && bounds.size_m[1] < FRONT_M;
    if !is_front(bounds, class) && !shows_front && !is_front_of_unit {
        return;
    }
    let by_m = (APPLIANCE_M - bounds.size_m[1]) / 2.0 * out.signum();
    bounds.centre_m[0] += sin * by_m;
    bounds.centre_m[1] -= cos * by_m;
    bounds.size_m[1] = APPLIANCE_M;
    bounds.normalise();
}

/// Extends what stands on the floor down to it, and bounds sinks and worktops by their own heights.
pub fn complete(
    bounds: &mut UprightBox,
    decided: &Decided,
    fragment: &Fragment,
    own: &[&CloudPoint],
    cells: &Cells,
) {
    if decided.kind.stands && (fragment.is_unit || bounds.bottom_m() < decided.reaches_down_m) {
        set_heights(bounds, 0.0, bounds.top_m());
    }
    if decided.class == Class::Sink && bounds.size_m[2] > kind::BASIN_M {
        set_heights(bounds, bounds.top_m() - kind::BASIN_M, bounds.top_m());
    }
    if decided.class == Class::Sink && bounds.bottom_m() > FOOT_LOW_M && has_foot(bounds, cells) {
        set_heights(bounds, 0.0, bounds.top_m());
    }
    if decided.class == Class::Sink && bounds.size_m[2] < RIM_M {
        set_heights(bounds, bounds.bottom_m() - BASIN_LOW_M, bounds.top_m() + TAP_M);
    }
    if decided.class == Class::Counter && bounds.bottom_m() > WORKTOP_M {
        // Other points are of things on it and of fronts below.
        let height = |point: &&CloudPoint| f64::from(point.position_m[2]);
        let [top_m, _] = fit::span(own.iter().filter(|point| point.normal[2] > 0.8).map(height), 0.5);
        if top_m > 0.0 {
            let [low_m, _] = fit::span(own.iter().map(height), WORKTOP_BEYOND);
            set_heights(bounds, low_m.min(top_m - WORKTOP_THICK_M), top_m);
        }
    }
}

/// Returns whether a foot is below the middle of a basin, and no furniture that it is built into.
fn has_foot(bounds: &UprightBox, cells: &Cells) -> bool {
    /// Half the side of the square that holds the foot.
    const REACH_M: f64 = 0.18;
    /// Minimum fraction of the heights at which it was measured.
    const MIN_MEASURED_FRACTION: f64 = 0.6;
    let [x, y, _] = bounds.centre_m;
    let steps = |from_m: f64, to_m: f64| {
        let count = ((to_m - from_m) / cells.side_m).max(0.0) as usize;
        (0..=count).map(move |i| from_m + i as f64 * cells.side_m)
    };
    let (mut heights, mut measured, mut stored, mut all) = (0usize, 0usize, 0f32, 0f32);
    for z in steps(FOOT_LOW_M, bounds.bottom_m() - cells.side_m) {
        let square = || steps(-REACH_M, REACH_M);
        let here: Vec<u32> = square()
            .flat_map(|dx| square().map(move |dy| [x + dx, y + dy, z]))
            .filter_map(|place| cells.at(&place))
            .collect();
        heights += 1;
        measured += usize::from(!here.is_empty());
        for likelihoods in here.into_iter().map(|cell| cells.likelihoods(cell)) {
            let said = |class: Class| likelihoods[class as usize];
            stored += said(Class::Cabinet)
                + said(Class::Shelf)
                + said(Class::Counter)
                + said(Class::WashingMachine);
            all += 1.0;
        }
    }
    measured as f64 >= MIN_MEASURED_FRACTION * heights.max(1) as f64 && stored < 0.4 * all
}

fn set_heights(bounds: &mut UprightBox, bottom_m: f64, top_m: f64) {
    (bounds.centre_m[2], bounds.size_m[2]) = ((bottom_m + top_m) / 2.0, top_m - bottom_m);
}
