//! Pieces of furniture: solids in their own frame, with a pose.

use super::finish::Finish;
use super::plan::Rect;
use super::solid::{Shape, Solid};
use viola_geometry::taxonomy::Class;
use viola_geometry::{Point2, Point3, Pose2};

/// A rotated rectangle on the floor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Footprint {
    pub centre: Point2,
    pub half: [f64; 2],
    pub yaw_rad: f64,
}

impl Footprint {
    pub fn of_rect(rect: &Rect) -> Footprint {
        let half = [rect.size(0) / 2.0, rect.size(1) / 2.0];
        Footprint { centre: rect.centre(), half, yaw_rad: 0.0 }
    }

    pub fn grown(&self, by_m: f64) -> Footprint {
        Footprint { half: self.half.map(|h| h + by_m), ..*self }
    }

    pub fn corners(&self) -> [Point2; 4] {
        let pose = Pose2::new(self.centre.x, self.centre.y, self.yaw_rad);
        let [w, h] = self.half;
        [[-w, -h], [w, -h], [w, h], [-w, h]].map(|[x, y]| pose.apply(&Point2::new(x, y)))
    }

    pub fn is_within(&self, rect: &Rect) -> bool {
        self.corners().iter().all(|corner| rect.contains(corner))
    }

    /// Returns whether two rectangles share area (separating axis test).
    pub fn overlaps(&self, other: &Footprint) -> bool {
        let (a, b) = (self.corners(), other.corners());
        let axes = [self.yaw_rad, other.yaw_rad];
        axes.iter().flat_map(|yaw| [*yaw, yaw + std::f64::consts::FRAC_PI_2]).all(|yaw| {
            let (s, c) = yaw.sin_cos();
            let range = |corners: &[Point2; 4]| {
                corners
                    .iter()
                    .map(|p| c * p.x + s * p.y)
                    .fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v), high.max(v)))
            };
            let ((a_low, a_high), (b_low, b_high)) = (range(&a), range(&b));
            a_low < b_high - 1e-9 && b_low < a_high - 1e-9
        })
    }

    pub fn contains(&self, point: &Point2) -> bool {
        let local = Pose2::new(self.centre.x, self.centre.y, self.yaw_rad).inverse().apply(point);
        local.x.abs() <= self.half[0] && local.y.abs() <= self.half[1]
    }
}

/// Mounting of a piece.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Mount {
    /// On the floor; blocks other pieces.
    Floor,
    /// Flat on the floor; pieces may stand on it.
    Flat,
    /// Above the floor, on a wall or from the ceiling.
    Hung,
}

/// Use of a level place: it decides which things people put there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum TopKind {
    Table,
    Desk,
    Kitchen,
    Bath,
    /// The top of a cabinet.
    Store,
    /// The seat of a sofa or a chair, or a bed.
    Soft,
}

/// A level place on a piece, in the piece's frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Top {
    pub centre: [f64; 3],
    /// Full size: width, depth.
    pub size: [f64; 2],
    /// Free height above it, in metres.
    pub above_m: f64,
    pub kind: TopKind,
}

/// A piece of furniture. Its own frame: x along its width, back at +y, floor at z = 0, origin in its middle.
#[derive(Debug, Clone)]
pub(super) struct Piece {
    pub class: Class,
    /// Full size: width, depth, height.
    pub size: [f64; 3],
    pub solids: Vec<Solid>,
    /// Level places that nothing stands on yet.
    pub tops: Vec<Top>,
    /// Place where a person's hips rest, in the piece's frame; none if nobody sits or lies on it.
    pub rest: Option<[f64; 3]>,
    pub mount: Mount,
    /// True if it may move on another day.
    pub movable: bool,
    pub room: usize,
    pub home_from_piece: Pose2,
}

impl Piece {
    pub fn new(class: Class, size: [f64; 3]) -> Piece {
        Piece {
            class,
            size,
            solids: vec![],
            tops: vec![],
            rest: None,
            mount: Mount::Floor,
            movable: false,
            room: 0,
            home_from_piece: Pose2::IDENTITY,
        }
    }

    pub fn movable(mut self) -> Piece {
        self.movable = true;
        self
    }

    /// Moves all of it up by `by_m`.
    pub fn raise(&mut self, by_m: f64) {
        self.solids.iter_mut().for_each(|solid| solid.centre.z += by_m);
        self.tops.iter_mut().for_each(|top| top.centre[2] += by_m);
        self.size[2] += by_m;
    }

    pub fn mounted(mut self, mount: Mount) -> Piece {
        self.mount = mount;
        self
    }

    /// Adds an upright block of the piece's class, by the centre of its bottom and its full size.
    pub fn block(&mut self, bottom: [f64; 3], size: [f64; 3], finish: Finish) -> &mut Solid {
        self.solid(Shape::Block, bottom, size, finish)
    }

    /// Adds an upright cylinder of the given radius.
    pub fn post(&mut self, bottom: [f64; 3], radius: f64, height: f64, finish: Finish) -> &mut Solid {
        self.solid(Shape::Cylinder, bottom, [2.0 * radius, 2.0 * radius, height], finish)
    }

    /// Adds an ellipsoid, by the centre of its bottom and its full size.
    pub fn ball(&mut self, bottom: [f64; 3], size: [f64; 3], finish: Finish) -> &mut Solid {
        self.solid(Shape::Ball, bottom, size, finish)
    }

    /// Adds a soft block, by the centre of its bottom and its full size.
    pub fn cushion(&mut self, bottom: [f64; 3], size: [f64; 3], finish: Finish) -> &mut Solid {
        self.solid(Shape::Cushion, bottom, size, finish)
    }

    /// Adds a cylinder between two points.
    pub fn bar(&mut self, from: [f64; 3], to: [f64; 3], radius: f64, finish: Finish) -> &mut Solid {
        let (from, to) = (Point3::from(from), Point3::from(to));
        let along = to - from;
        let length = along.norm().max(1e-6);
        let solid = self.solid(Shape::Cylinder, [0.0; 3], [2.0 * radius, 2.0 * radius, length], finish);
        solid.centre = nalgebra::center(&from, &to);
        // The axis z, tilted about x and then turned about z, points along the bar.
        solid.tilt_rad = (along.z / length).clamp(-1.0, 1.0).acos();
        solid.yaw_rad = along.x.atan2(-along.y);
        solid
    }

    /// Adds a level place on which things may stand.
    pub fn top(&mut self, kind: TopKind, centre: [f64; 3], size: [f64; 2], above_m: f64) {
        self.tops.push(Top { centre, size, above_m, kind });
    }

    fn solid(&mut self, shape: Shape, bottom: [f64; 3], size: [f64; 3], finish: Finish) -> &mut Solid {
        let index = self.solids.len();
        self.solids.push(Solid { shape, ..Solid::block(self.class, bottom, size, finish) });
        &mut self.solids[index]
    }

    /// Adds four legs under a `width` x `depth` top, `inset` from its edges.
    pub fn legs(&mut self, width: f64, depth: f64, height: f64, thick: f64, inset: f64, finish: Finish) {
        let (x, y) = (width / 2.0 - inset - thick / 2.0, depth / 2.0 - inset - thick / 2.0);
        for (sx, sy) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
            self.block([sx * x, sy * y, 0.0], [thick, thick, height], finish);
        }
    }

    /// Adds the solids of another piece, at a pose in this one's frame and `up_m` higher.
    pub fn join(&mut self, other: &Piece, pose: &Pose2, up_m: f64) {
        self.solids.extend(other.solids.iter().map(|solid| {
            let mut moved = solid.moved(pose);
            moved.centre.z += up_m;
            moved
        }));
    }

    /// Returns the mirror image of a piece in its own frame, x to -x.
    pub fn mirrored(&self) -> Piece {
        Piece { solids: self.solids.iter().map(Solid::mirrored).collect(), ..self.clone() }
    }

    pub fn footprint(&self) -> Footprint {
        self.footprint_at(&self.home_from_piece)
    }

    pub fn footprint_at(&self, pose: &Pose2) -> Footprint {
        let half = [self.size[0] / 2.0, self.size[1] / 2.0];
        Footprint { centre: Point2::new(pose.x_m, pose.y_m), half, yaw_rad: pose.yaw_rad }
    }

    /// Returns its solids at its pose.
    pub fn placed(&self) -> impl Iterator<Item = Solid> + '_ {
        self.solids.iter().map(|solid| solid.moved(&self.home_from_piece))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turned_rectangles_overlap_where_they_do() {
        let square =
            |x: f64, y: f64, yaw_rad: f64| Footprint { centre: Point2::new(x, y), half: [0.5, 0.5], yaw_rad };
        let cases = [
            (square(0.0, 0.0, 0.0), square(0.9, 0.0, 0.0), true),
            (square(0.0, 0.0, 0.0), square(1.1, 0.0, 0.0), false),
            // Adjacent diamonds: only their bounding boxes overlap.
            (square(0.0, 0.0, 0.785), square(1.05, 1.05, 0.785), false),
            (square(0.0, 0.0, 0.0), square(1.15, 0.0, 0.785), true),
            (square(0.0, 0.0, 0.0), square(1.25, 0.0, 0.785), false),
        ];
        for (a, b, expected) in cases {
            assert_eq!(a.overlaps(&b), expected, "{a:?} {b:?}");
            assert_eq!(b.overlaps(&a), expected, "{b:?} {a:?}");
        }
    }
}
