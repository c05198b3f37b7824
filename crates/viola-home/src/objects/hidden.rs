//! Boxes of objects of which a part is hidden, not measured, or covered by things.

use super::fit::{self, UprightBox};
use super::fragment::{Decided, Fragment};
use super::kind;
use crate::map_point::MapPoint;
use viola_geometry::taxonomy::Class;

/// A counter whose underside is above this is a worktop.
pub const WORKTOP_M: f64 = 0.6;
/// Fraction of a worktop's points that its box leaves out below, and its usual thickness.
const WORKTOP_BEYOND: f64 = 0.1;
const WORKTOP_THICK_M: f64 = 0.04;
/// Largest height and least side of a shower's tray, and the usual height of its space.
const TRAY_M: f64 = 0.35;
const TRAY_SIDE_M: f64 = 0.6;
const SHOWER_M: f64 = 2.0;

/// Gives a shower of which only the tray was measured its usual height: glass is not seen.
pub fn raise_tray(bounds: &mut UprightBox, class: Class) {
    if class == Class::Shower && bounds.top_m() < TRAY_M && bounds.size_m[1] > TRAY_SIDE_M {
        set_heights(bounds, 0.0, SHOWER_M);
    }
}

/// Extends what stands on the floor down to it, and bounds sinks and worktops by their own heights.
pub fn complete(
    bounds: &mut UprightBox,
    decided: &Decided,
    fragment: &Fragment,
    members: &[u32],
    points: &[MapPoint],
) {
    if decided.kind.stands && (fragment.is_unit || bounds.bottom_m() < decided.reaches_down_m) {
        set_heights(bounds, 0.0, bounds.top_m());
    }
    if decided.class == Class::Sink && bounds.size_m[2] > kind::BASIN_M {
        set_heights(bounds, bounds.top_m() - kind::BASIN_M, bounds.top_m());
    }
    if decided.class == Class::Counter && bounds.bottom_m() > WORKTOP_M {
        // Other points are of things on it and of fronts below.
        let points = || members.iter().map(|i| &points[*i as usize].point);
        let height = |point: &viola_reconstruct::CloudPoint| f64::from(point.position_m[2]);
        let [top_m, _] = fit::span(points().filter(|point| point.normal[2] > 0.8).map(height), 0.5);
        if top_m > 0.0 {
            let [low_m, _] = fit::span(points().map(height), WORKTOP_BEYOND);
            set_heights(bounds, low_m.min(top_m - WORKTOP_THICK_M), top_m);
        }
    }
}

fn set_heights(bounds: &mut UprightBox, bottom_m: f64, top_m: f64) {
    (bounds.centre_m[2], bounds.size_m[2]) = ((bottom_m + top_m) / 2.0, top_m - bottom_m);
}
