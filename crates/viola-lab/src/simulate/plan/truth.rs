//! The true floor plan of a simulated home: faces of walls, openings, areas of rooms.

use super::{Feature, OpeningKind, Plan, Rect};
use viola_geometry::taxonomy::Class;
use viola_geometry::{Point2, Vector2};

/// Distance of points on a wall's face.
const STEP_M: f64 = 0.05;

/// A point on a wall's face, and the unit vector along the face.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FacePoint {
    pub at: Point2,
    pub along: Vector2,
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
        let blocks: Vec<Block> = self.features.iter().filter(is_wall).map(Block::new).collect();
        let wide = |p: &Point2| {
            self.openings
                .iter()
                .any(|opening| opening.kind == OpeningKind::Wide && opening.zone(0.3).contains(p))
        };
        let is_in = |block: &Block, p: &Point2| block.bounds.shrunk(-0.01).contains(p);
        let mut faces: Vec<FacePoint> = edge_points(&corners(&inner));
        faces.retain(|face| !wide(&face.at) && !blocks.iter().any(|block| is_in(block, &face.at)));
        for block in &blocks {
            let own = edge_points(&block.ring).into_iter();
            faces.extend(own.filter(|face| inner.shrunk(0.01).contains(&face.at)));
        }
        let sides = corners(&inner);
        let taken_m2: f64 = blocks.iter().map(Block::area_m2).sum();
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

/// Part of a room that a feature of the building fills.
struct Block {
    bounds: Rect,
    /// Counter-clockwise.
    ring: Vec<Point2>,
}

impl Block {
    fn new(feature: &Feature) -> Block {
        let bounds = Rect::around(feature.footprint.corners());
        let mut ring = corners(&bounds).to_vec();
        // An oblique wall fills the half of its footprint behind it: its own centre is behind its face.
        if let Some(wall) = feature.solids.iter().find(|solid| is_oblique(solid.yaw_rad)) {
            let off_m = |corner: &Point2| (corner - wall.centre.xy()).norm();
            let before = (0..ring.len()).max_by(|a, b| off_m(&ring[*a]).total_cmp(&off_m(&ring[*b])));
            before.map(|corner| ring.remove(corner));
        }
        Block { bounds, ring }
    }

    fn area_m2(&self) -> f64 {
        let next = self.ring.iter().cycle().skip(1);
        self.ring.iter().zip(next).map(|(a, b)| a.coords.perp(&b.coords)).sum::<f64>() / 2.0
    }
}

fn is_oblique(yaw_rad: f64) -> bool {
    (2.0 * yaw_rad).sin().abs() > 0.02
}

/// Returns points at equal distances on the sides of a ring.
fn edge_points(ring: &[Point2]) -> Vec<FacePoint> {
    let mut points = Vec::new();
    for (a, b) in ring.iter().zip(ring.iter().cycle().skip(1)) {
        let along = (b - a).normalize();
        let count = ((b - a).norm() / STEP_M).floor() as usize;
        points.extend((0..count).map(|i| FacePoint { at: a + along * ((i as f64 + 0.5) * STEP_M), along }));
    }
    points
}

#[cfg(test)]
mod tests {
    use super::super::features::wall_block;
    use super::*;
    use crate::simulate::piece::Footprint;

    #[test]
    fn an_oblique_wall_fills_the_half_of_its_footprint_behind_it() {
        // A wall from (1, 0) to (0, 2), across the corner at the origin.
        let run = Vector2::new(-1.0, 2.0);
        let behind = Vector2::new(-2.0, -1.0).normalize() * 0.05;
        let half = [run.norm() / 2.0, 0.05];
        let wall = Footprint { centre: Point2::new(0.5, 1.0) + behind, half, yaw_rad: run.y.atan2(run.x) };
        let footprint = Footprint { centre: Point2::new(0.5, 1.0), half: [0.5, 1.0], yaw_rad: 0.0 };
        let block = Block::new(&Feature { footprint, ..wall_block(0, wall, [0.0, 2.4]) });
        assert!((block.area_m2() - 1.0).abs() < 1e-9);
        assert!(!block.ring.contains(&Point2::new(1.0, 2.0)) && block.ring.len() == 3);
        assert!(edge_points(&block.ring).iter().any(|face| face.along.perp(&run).abs() < 1e-9));
    }
}
