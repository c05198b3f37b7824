//! Area of the walls beside oblique sides.

use super::axes::{are_apart, span};
use super::model::{Opening, OpeningKind, Wall, by_filming, direction, strip};
use super::shape::{THICKEST_M, USUAL_M};
use crate::rooms::outline::{Outline, signed_area_m2};
use geo::{Area, BooleanOps, Coord, LineString, MultiPolygon, Polygon, unary_union};

/// Outer walls made of cells reach this far beyond their straight outer face.
const BEYOND_M: f64 = 0.5;
/// Openings reach this much into the rooms, so that no seam remains before them.
const SEAM_M: f64 = 0.02;
/// Corners nearer than this are one.
const SAME_CORNER_M: f64 = 0.005;
/// Parts of an area that are narrower than this are rounding.
const SPIKE_M: f64 = 1e-4;
/// Smaller pieces of masonry are remains of stairs.
const MIN_AREA_M2: f64 = 0.01;
/// A smaller hole is a seam between walls.
const MIN_HOLE_M2: f64 = 1e-4;

/// Returns the area of the walls, with the stairs of cells put on the straight oblique walls.
pub(super) fn with_oblique(
    base: Vec<Outline>,
    rooms: &[Outline],
    straight: &[Wall],
    oblique: &[Wall],
    openings: &[Opening],
) -> Vec<Outline> {
    if oblique.is_empty() {
        return base;
    }
    let (base, rooms) = (area(&base), area(rooms));
    let ways = openings.iter().filter(|opening| opening.kind != OpeningKind::Window);
    let ways = unary_union(
        &ways.map(|way| ring(&strip(way.from_m, way.to_m, way.thickness_m + SEAM_M))).collect::<Vec<_>>(),
    );
    // Walls reach into their corners.
    let bodies: Vec<Polygon> = straight.iter().chain(oblique).map(|wall| body(wall, USUAL_M / 2.0)).collect();
    let beyond: Vec<Polygon> = oblique.iter().filter(|wall| !wall.is_measured).map(beyond).collect();
    let beyond = unary_union(&beyond).difference(&unary_union(&bodies));
    let walls = unary_union(&oblique.iter().map(|wall| body(wall, 0.0)).collect::<Vec<_>>());
    let masonry = base.difference(&beyond).union(&walls).difference(&rooms).difference(&ways);
    pieces(&masonry)
}

/// Returns the part of the masonry that belongs to the walls of the LiDAR map only. A corner with a wall that clips filmed
/// belongs to that one.
pub(super) fn unfilmed(masonry: &[Outline], walls: &[Wall]) -> Vec<Outline> {
    let (filmed, unfilmed) = by_filming(walls);
    if unfilmed.is_empty() {
        return Vec::new();
    }
    let bodies = |walls: &[&Wall], by_m: f64| {
        unary_union(&walls.iter().map(|wall| body(wall, by_m)).collect::<Vec<_>>())
    };
    let own = bodies(&unfilmed, 0.0).difference(&bodies(&filmed, 0.0));
    let corners = bodies(&unfilmed, THICKEST_M).difference(&bodies(&filmed, THICKEST_M));
    pieces(&area(masonry).intersection(&own.union(&corners)))
}

/// Returns masonry without a part of it.
pub(super) fn without(masonry: &[Outline], part: &[Outline]) -> Vec<Outline> {
    if part.is_empty() { masonry.to_vec() } else { pieces(&area(masonry).difference(&area(part))) }
}

/// Returns the area that outlines have together.
pub(super) fn united(outlines: &[Outline]) -> Vec<Outline> {
    pieces(&unary_union(&outlines.iter().map(polygon).collect::<Vec<_>>()))
}

fn area(outlines: &[Outline]) -> MultiPolygon {
    MultiPolygon(outlines.iter().map(polygon).collect())
}

pub(super) fn pieces(area: &MultiPolygon) -> Vec<Outline> {
    area.0.iter().filter(|piece| piece.unsigned_area() >= MIN_AREA_M2).map(outline).collect()
}

/// Returns the area of a wall, extended at its ends.
fn body(wall: &Wall, by_m: f64) -> Polygon {
    let along = direction(wall.from_m, wall.to_m).map(|part| part * by_m);
    let from_m = [0, 1].map(|axis| wall.from_m[axis] - along[axis]);
    let to_m = [0, 1].map(|axis| wall.to_m[axis] + along[axis]);
    ring(&strip(from_m, to_m, wall.thickness_m + 2e-3))
}

/// Returns what lies behind the outer face of a wall, which is on the right of its way.
fn beyond(wall: &Wall) -> Polygon {
    let [x, y] = direction(wall.from_m, wall.to_m);
    let off_m = (wall.thickness_m + BEYOND_M) / 2.0;
    let moved = |p: [f64; 2]| [p[0] + off_m * y, p[1] - off_m * x];
    let behind =
        Wall { from_m: moved(wall.from_m), to_m: moved(wall.to_m), thickness_m: BEYOND_M, ..wall.clone() };
    body(&behind, USUAL_M)
}

/// Returns the common area of two outlines.
pub(super) fn common_m2(a: &Outline, b: &Outline) -> f64 {
    if are_apart(&[a, b].map(|outline| span(&outline.ring_m))) {
        0.0
    } else {
        polygon(a).intersection(&polygon(b)).unsigned_area()
    }
}

fn ring(corners: &[[f64; 2]]) -> Polygon {
    Polygon::new(line_string(corners), Vec::new())
}

fn line_string(corners: &[[f64; 2]]) -> LineString {
    LineString(corners.iter().map(|[x, y]| Coord { x: *x, y: *y }).collect())
}

pub(super) fn polygon(outline: &Outline) -> Polygon {
    Polygon::new(line_string(&outline.ring_m), outline.holes_m.iter().map(|hole| line_string(hole)).collect())
}

fn is_ring(corners: &[[f64; 2]]) -> bool {
    corners.len() >= 3 && signed_area_m2(corners).abs() > MIN_HOLE_M2
}

/// Returns a polygon with its outer ring counter-clockwise and its holes clockwise, as `geo` returns them.
fn outline(polygon: &Polygon) -> Outline {
    let corners = |ring: &LineString| {
        let mut corners: Vec<[f64; 2]> = ring.0.iter().map(|corner| [corner.x, corner.y]).collect();
        corners.pop();
        let is_same = |a: &[f64; 2], b: &[f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]) < SAME_CORNER_M;
        corners.dedup_by(|a, b| is_same(a, b));
        if corners.len() > 3 && is_same(&corners[0], &corners[corners.len() - 1]) {
            corners.pop();
        }
        without_spikes(corners)
    };
    Outline {
        ring_m: corners(polygon.exterior()),
        // Corners that became one may leave a hole without area, which is no ring (RFC 7946, 3.1.6).
        holes_m: polygon.interiors().iter().map(corners).filter(|hole| is_ring(hole)).collect(),
    }
}

/// Returns a ring without corners at which it turns back along itself, as rounding leaves them where areas with a common
/// border were subtracted.
fn without_spikes(mut corners: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    while corners.len() > 3 {
        let count = corners.len();
        let corner = |at: usize| corners[at % count];
        let Some(at) = (0..count).find(|at| is_spike(corner(at + count - 1), corner(*at), corner(at + 1)))
        else {
            break;
        };
        corners.remove(at);
    }
    corners
}

/// Returns whether the end of the shorter side at a corner is on the longer side.
fn is_spike(before: [f64; 2], corner: [f64; 2], after: [f64; 2]) -> bool {
    let [p, q] = [before, after].map(|end| [end[0] - corner[0], end[1] - corner[1]]);
    let (dot, cross) = (p[0] * q[0] + p[1] * q[1], p[0] * q[1] - p[1] * q[0]);
    dot >= 0.0 && cross.abs() <= SPIKE_M * p[0].hypot(p[1]).max(q[0].hypot(q[1]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wall(from_m: [f64; 2], to_m: [f64; 2], filmed_fraction: f64) -> Wall {
        Wall { filmed_fraction, ..Wall::new([from_m, to_m], 0.2) }
    }

    fn area_m2(outlines: &[Outline]) -> f64 {
        outlines.iter().map(Outline::area_m2).sum()
    }

    /// A room of 4 m by 3 m with walls of 0.2 m: below, on the right, above, on the left.
    #[test]
    fn a_corner_belongs_to_a_filmed_wall() {
        let ring_m = vec![[-0.2, -0.2], [4.2, -0.2], [4.2, 3.2], [-0.2, 3.2]];
        let holes_m = vec![vec![[0.0, 0.0], [0.0, 3.0], [4.0, 3.0], [4.0, 0.0]]];
        let masonry = [Outline { ring_m, holes_m }];
        let all_m2 = 4.4 * 3.4 - 4.0 * 3.0;
        for (fractions, unfilmed_m2) in [
            ([1.0, 0.0, 0.1, 0.2], 0.2 * (3.0 + 4.0) + 0.2 * 0.2),
            ([1.0, 0.0, 0.9, 0.2], 0.2 * 3.0),
            ([1.0, 0.0, 0.0, 0.0], all_m2 - 0.2 * 4.4),
            ([1.0, 0.5, 0.9, 0.2], 0.0),
            // No clip filmed any wall.
            ([0.1, 0.0, 0.0, 0.0], 0.0),
        ] {
            let [below, right, above, left] = fractions;
            let walls = [
                wall([0.0, -0.1], [4.0, -0.1], below),
                wall([4.1, 0.0], [4.1, 3.0], right),
                wall([4.0, 3.1], [0.0, 3.1], above),
                wall([-0.1, 3.0], [-0.1, 0.0], left),
            ];
            let unfilmed = unfilmed(&masonry, &walls);
            assert_eq!(unfilmed.is_empty(), unfilmed_m2 == 0.0, "{fractions:?}");
            assert!((area_m2(&unfilmed) - unfilmed_m2).abs() < 0.01, "{fractions:?} {unfilmed:?}");
            let rest_m2 = area_m2(&without(&masonry, &unfilmed));
            assert!((rest_m2 + area_m2(&unfilmed) - all_m2).abs() < 0.01, "{fractions:?} {rest_m2}");
        }
    }

    /// A room that was divided at x = 2.3, with the border of the other part.
    #[test]
    fn a_ring_does_not_turn_back_along_itself() {
        let straight = [[0.0, 0.0], [2.3, 0.0], [2.2, 1.3], [0.0, 1.3]];
        for spike in [vec![], vec![[4.0, 0.0], [4.02, 1.3], [4.0, 1e-9]], vec![[4.0, 0.0], [3.0, 1e-9]]] {
            let corners = [&straight[..1], &spike[..], &straight[1..]].concat();
            let holes = vec![line_string(&[[0.5, 0.5], [0.5, 1.0], [1.0, 1.0], [1.0, 0.5]])];
            let found = outline(&Polygon::new(line_string(&corners), holes));
            assert_eq!(found.ring_m, straight, "{spike:?}");
            assert_eq!(found.holes_m.len(), 1);
        }
    }
}
