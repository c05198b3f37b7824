//! The true floor plan of a simulated home: faces of walls, openings, areas of rooms.

use super::{Feature, OpeningKind, Plan, Rect};
use viola_geometry::Point2;
use viola_geometry::taxonomy::Class;

/// Distance of points on a wall's face.
const STEP_M: f64 = 0.05;

/// A point on a wall's face, and the face's direction: 0 along x, 1 along y.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FacePoint {
    pub at: Point2,
    pub axis: usize,
}

/// A true opening: the ends of its centre line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrueOpening {
    pub is_window: bool,
    pub ends: [Point2; 2],
}

/// A true room: its area without chimneys and pillars, a point in it, and its sides.
#[derive(Debug, Clone, PartialEq)]
pub struct RoomShape {
    pub centre: Point2,
    pub area_m2: f64,
    pub sides: Vec<[Point2; 2]>,
    pub faces: Vec<FacePoint>,
}

impl Plan {
    /// Returns the shape of every room.
    pub fn shapes(&self) -> Vec<RoomShape> {
        (0..self.rooms.len()).map(|room| self.shape(room)).collect()
    }

    fn shape(&self, room: usize) -> RoomShape {
        let inner = self.rooms[room].inner;
        // Chimneys, pillars and cut corners are walls; stairs are not.
        let is_wall = |feature: &&Feature| {
            feature.room == room && feature.solids.iter().all(|solid| solid.class == Class::Wall)
        };
        let blocks: Vec<Rect> = self.features.iter().filter(is_wall).map(bounds).collect();
        let wide = |p: &Point2| {
            self.openings
                .iter()
                .any(|opening| opening.kind == OpeningKind::Wide && opening.zone(0.3).contains(p))
        };
        let is_in = |block: &Rect, p: &Point2| block.shrunk(-0.01).contains(p);
        let mut faces: Vec<FacePoint> = edge_points(&inner);
        faces.retain(|face| !wide(&face.at) && !blocks.iter().any(|block| is_in(block, &face.at)));
        for block in &blocks {
            let own = edge_points(block).into_iter();
            faces.extend(own.filter(|face| inner.shrunk(0.01).contains(&face.at)));
        }
        let sides = corners(&inner);
        let taken_m2: f64 = blocks.iter().map(Rect::area_m2).sum();
        RoomShape {
            centre: inner.centre(),
            area_m2: inner.area_m2() - taken_m2,
            sides: (0..4).map(|i| [sides[i], sides[(i + 1) % 4]]).collect(),
            faces,
        }
    }

    /// Returns all openings but open-plan ones, which leave no wall to open.
    pub fn true_openings(&self) -> Vec<TrueOpening> {
        let drawn = self.openings.iter().filter(|opening| opening.kind != OpeningKind::Wide);
        drawn
            .map(|opening| {
                let half = opening.width_m / 2.0;
                let end = |sign: f64| {
                    let [x, y] = if opening.along_x { [sign * half, 0.0] } else { [0.0, sign * half] };
                    Point2::new(opening.centre.x + x, opening.centre.y + y)
                };
                TrueOpening { is_window: opening.kind == OpeningKind::Window, ends: [end(-1.0), end(1.0)] }
            })
            .collect()
    }
}

fn corners(rect: &Rect) -> [Point2; 4] {
    let ([a, b], [c, d]) = (rect.min, rect.max);
    [Point2::new(a, b), Point2::new(c, b), Point2::new(c, d), Point2::new(a, d)]
}

/// Returns the box of a feature's footprint.
fn bounds(feature: &Feature) -> Rect {
    let corners = feature.footprint.corners();
    let fold = |axis: usize, pick: fn(f64, f64) -> f64, start: f64| {
        corners.iter().map(|corner| corner[axis]).fold(start, pick)
    };
    Rect {
        min: [0, 1].map(|axis| fold(axis, f64::min, f64::INFINITY)),
        max: [0, 1].map(|axis| fold(axis, f64::max, f64::NEG_INFINITY)),
    }
}

fn edge_points(rect: &Rect) -> Vec<FacePoint> {
    let mut points = Vec::new();
    for axis in 0..2 {
        let count = (rect.size(axis) / STEP_M).floor() as usize;
        for side in [rect.min[1 - axis], rect.max[1 - axis]] {
            for i in 0..count {
                let along = rect.min[axis] + (i as f64 + 0.5) * STEP_M;
                let at = if axis == 0 { Point2::new(along, side) } else { Point2::new(side, along) };
                points.push(FacePoint { at, axis });
            }
        }
    }
    points
}
