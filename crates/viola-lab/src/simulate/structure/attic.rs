//! Sloped ceilings with their roof windows.

use crate::simulate::finish::{Finish, WHITE};
use crate::simulate::plan::Slope;
use crate::simulate::solid::{Shape, Solid};
use std::f64::consts::{FRAC_PI_2, PI};
use viola_geometry::taxonomy::Class;
use viola_geometry::{Point3, Vector3};

/// Thickness of the roof, and its reach into the walls and above the ceiling.
const ROOF_M: f64 = 0.22;
const REACH_M: f64 = 0.15;

/// Adds the slabs of a slope around its windows, and the windows.
pub(super) fn slope(slope: &Slope, finish: Finish, out: &mut Vec<Solid>) {
    let up = [-REACH_M, slope.length_m() + REACH_M];
    let along = [slope.along[0] - 0.04, slope.along[1] + 0.04];
    let roof = [0.0, ROOF_M];
    let mut left = along[0];
    for window in &slope.windows {
        let [from, to] = window.along;
        out.push(plate(slope, Class::Ceiling, [left, from], up, roof, finish));
        out.push(plate(slope, Class::Ceiling, window.along, [up[0], window.up[0]], roof, finish));
        out.push(plate(slope, Class::Ceiling, window.along, [window.up[1], up[1]], roof, finish));
        let white = Finish::plain(WHITE).glossy(0.2);
        let (wide, deep) = (0.06, [ROOF_M - 0.1, ROOF_M]);
        let mut bar = |along: [f64; 2], up: [f64; 2], finish: Finish, deep: [f64; 2]| {
            out.push(plate(slope, Class::Window, along, up, deep, finish));
        };
        bar([from, from + wide], window.up, white, deep);
        bar([to - wide, to], window.up, white, deep);
        bar(window.along, [window.up[0], window.up[0] + wide], white, deep);
        bar(window.along, [window.up[1] - wide, window.up[1]], white, deep);
        bar(window.along, window.up, Finish::glass(), [ROOF_M - 0.05, ROOF_M - 0.04]);
        left = to;
    }
    out.push(plate(slope, Class::Ceiling, [left, along[1]], up, roof, finish));
}

/// Returns a block in the slope's coordinates: along the wall, up the slope, and out of the room.
fn plate(
    slope: &Slope,
    class: Class,
    along: [f64; 2],
    up: [f64; 2],
    outward: [f64; 2],
    finish: Finish,
) -> Solid {
    let middle = |interval: [f64; 2]| (interval[0] + interval[1]) / 2.0;
    let half = |interval: [f64; 2]| (interval[1] - interval[0]) / 2.0;
    let tilt_rad = (slope.heights_m[1] - slope.heights_m[0]).atan2(slope.run_m);
    let (s, c) = tilt_rad.sin_cos();
    let across = slope.face + slope.inward * (middle(up) * c - middle(outward) * s);
    let height = slope.heights_m[0] + middle(up) * s + middle(outward) * c;
    // The block's y points into the room.
    let (x, y, yaw_rad) = match (slope.along_x, slope.inward > 0.0) {
        (true, true) => (middle(along), across, 0.0),
        (true, false) => (middle(along), across, PI),
        (false, true) => (across, middle(along), -FRAC_PI_2),
        (false, false) => (across, middle(along), FRAC_PI_2),
    };
    Solid {
        shape: Shape::Block,
        centre: Point3::new(x, y, height),
        half: Vector3::new(half(along), half(up), half(outward)),
        yaw_rad,
        tilt_rad,
        roll_rad: 0.0,
        class,
        finish,
    }
}
