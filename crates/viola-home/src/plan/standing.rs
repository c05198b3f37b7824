//! Ground below standing furniture: nobody saw it, but no wall is there.

use super::axes;
use crate::objects::{Object, UprightBox, is_furniture};
use crate::rooms::space::Space;
use viola_geometry::Point2;

/// Minimum confidence of an object.
const MIN_CONFIDENCE: f64 = 0.5;
/// A box reaches at most this far into the walls around it, because its points are noisy.
const IN_WALL_M: f64 = 0.1;
/// Samples along a side, and their distances from it: before the side, and where a wall would be.
const SAMPLES: usize = 8;
const BEFORE_M: [f64; 2] = [0.1, 0.2];
const NEAR_M: [f64; 7] = [-0.15, -0.1, -0.05, 0.0, 0.05, 0.1, 0.15];
/// A bound on work: more steps across a footprint are wider.
const MAX_STEPS: f64 = 200.0;

/// Surface in the cells of the LiDAR map's raster.
pub(super) struct Surface<'a> {
    pub space: &'a Space,
    /// Cells with level surface that clips saw.
    pub level: &'a [bool],
    /// Cells with wall up to the ceiling that clips saw.
    pub wall: &'a [bool],
}

impl Surface<'_> {
    fn is_open(&self, at: &Point2) -> bool {
        self.space.index(at).is_some_and(|at| self.space.free[at] || self.level[at])
    }

    fn is_wall(&self, at: &Point2) -> bool {
        let is_of_map = |at: usize| self.space.occupied[at] && !self.space.furniture[at];
        self.space.index(at).is_some_and(|at| self.wall[at] || is_of_map(at))
    }
}

/// Returns the cells below standing furniture. Cells at walls of the box, and those that a wall hides from its centre, are left
/// out.
pub(super) fn standing_cells(surface: &Surface, objects: &[Object]) -> Vec<bool> {
    let space = surface.space;
    let mut standing = vec![false; space.frame.len()];
    for bounds in objects.iter().filter(|object| is_evidence(object)).map(Object::bounds) {
        let Some([low, high]) = footprint(&bounds, surface) else { continue };
        let longest_m = (high[0] - low[0]).max(high[1] - low[1]);
        let step_m = (space.frame.cell_m / 2.0).max(longest_m / MAX_STEPS);
        let steps = |axis: usize| {
            let count = ((high[axis] - low[axis]) / step_m).ceil().max(1.0) as usize;
            let part = move |i: usize| low[axis] + (i as f64 + 0.5) / count as f64 * (high[axis] - low[axis]);
            (0..count).map(part)
        };
        let is_hidden = |local: [f64; 2]| {
            let count = (local[0].hypot(local[1]) / step_m).ceil().max(1.0) as usize;
            let way = |i: usize| place(&bounds, local.map(|m| m * i as f64 / count as f64));
            (0..=count).any(|i| surface.is_wall(&way(i)))
        };
        for local in steps(0).flat_map(|x| steps(1).map(move |y| [x, y])) {
            if let Some(at) = space.index(&place(&bounds, local))
                && !standing[at]
            {
                standing[at] = !is_hidden(local);
            }
        }
    }
    standing
}

/// Returns whether an object is sure enough, and no wall can be below it.
pub(super) fn is_evidence(object: &Object) -> bool {
    object.confidence >= MIN_CONFIDENCE && is_furniture(object.class) && object.bounds().stands()
}

/// Returns the lower and the upper corner, in the box's own frame, of the part of a footprint without the walls beside it. `None`
/// if no side has open floor before it: no room is known to have the object.
fn footprint(bounds: &UprightBox, surface: &Surface) -> Option<[[f64; 2]; 2]> {
    let half_m = [0, 1].map(|axis| bounds.size_m[axis] / 2.0);
    let mut corners = [half_m.map(|m| -m), half_m];
    let mut has_front = false;
    for axis in 0..2 {
        for (end, sign) in [-1.0, 1.0].into_iter().enumerate() {
            let shows = |offs_m: &[f64], is: &dyn Fn(&Point2) -> bool| {
                let sample = |i: usize, off_m: f64| {
                    let along = 2.0 * (i as f64 + 0.5) / SAMPLES as f64 - 1.0;
                    let off_m = sign * (half_m[axis] + off_m);
                    place(bounds, axes::place(axis, off_m, along * half_m[1 - axis]))
                };
                let seen = (0..SAMPLES).filter(|i| offs_m.iter().any(|off_m| is(&sample(*i, *off_m))));
                2 * seen.count() >= SAMPLES
            };
            let is_front = shows(&BEFORE_M, &|at: &Point2| surface.is_open(at));
            has_front |= is_front;
            if !is_front || shows(&NEAR_M, &|at: &Point2| surface.is_wall(at)) {
                corners[end][axis] -= sign * IN_WALL_M.min(half_m[axis] / 2.0);
            }
        }
    }
    has_front.then_some(corners)
}

/// Returns the place in the map of a point of a box's own frame.
fn place(bounds: &UprightBox, [x, y]: [f64; 2]) -> Point2 {
    let (sin, cos) = bounds.yaw_rad.sin_cos();
    Point2::new(bounds.centre_m[0] + cos * x - sin * y, bounds.centre_m[1] + sin * x + cos * y)
}
