//! Free space of a robot, and poses in it.

use super::area::for_cells;
use super::no_go::forbidden;
use super::{RobotLevel, RobotObject};
use crate::objects::UprightBox;
use crate::rooms::Room;
use crate::rooms::outline::pieces;
use crate::rooms::space::Space;
use viola_geometry::taxonomy::Class;
use viola_geometry::{DistanceField, Grid, GridFrame, Point2, Pose2};

/// Radius of a robot vacuum.
pub const RADIUS_M: f64 = 0.18;
/// An object whose lower side is below this is an obstacle for the robot.
const ROBOT_HEIGHT_M: f64 = 0.12;
/// Maximum distance of a goal from its object.
const REACH_M: f64 = 1.0;
/// Distance from the object that is worth a metre of distance from its middle: goals stand before the middle of
/// a side if they can.
const PER_METRE_ASIDE: f64 = 0.25;
/// Maximum distance of the dock from free space that belongs to it.
const DOCK_REACH_M: f64 = 1.0;

/// Cells at which the robot's centre can be, connected with its dock.
pub struct Drive {
    reachable: Grid<bool>,
}

impl Drive {
    /// Free cells are those of the robot's map without forbidden zones and without the footprints of objects that stand on
    /// the floor.
    pub fn new(level: &RobotLevel) -> Drive {
        let space = Space::new(level.lidar, &[]);
        let frame = space.frame;
        let mut blocked = Grid { frame, cells: space.free.iter().map(|free| !free).collect() };
        for object in level.objects.iter().filter(|object| is_obstacle(object)) {
            for (x, y) in cells_around(&frame, &object.bounds, 0.0) {
                if outside_m(&object.bounds, &frame.centre(x, y)) == 0.0 {
                    blocked.set(x, y, true);
                }
            }
        }
        for zone in forbidden(level) {
            for_cells(&frame, &zone.rings(), |index| blocked.cells[index] = true);
        }
        // The field counts from centre to centre, and an obstacle may reach to its cell's corner.
        let least_m = (RADIUS_M + frame.cell_m * std::f64::consts::FRAC_1_SQRT_2) as f32;
        let field = DistanceField::new(&blocked);
        let clear = Grid { frame, cells: field.grid().cells.iter().map(|m| *m >= least_m).collect() };
        Drive { reachable: connected(clear, level) }
    }

    /// Returns a pose beside an object, facing it, in its room; `None` without free space within `REACH_M`.
    pub fn beside(&self, object: &RobotObject, room: Option<&Room>) -> Option<Pose2> {
        let bounds = &object.bounds;
        let middle = Point2::new(bounds.centre_m[0], bounds.centre_m[1]);
        let mut best: Option<(f64, Point2)> = None;
        for (x, y) in cells_around(&self.reachable.frame, bounds, REACH_M) {
            if !self.reachable.get(x, y) {
                continue;
            }
            let at = self.reachable.frame.centre(x, y);
            let off_m = outside_m(bounds, &at);
            let cost = off_m + PER_METRE_ASIDE * (at - middle).norm();
            let is_beside = (RADIUS_M..=REACH_M).contains(&off_m);
            if is_beside
                && best.is_none_or(|(least, _)| cost < least - 1e-9)
                && room.is_none_or(|room| room.contains(&at))
            {
                best = Some((cost, at));
            }
        }
        let (_, at) = best?;
        Some(Pose2::new(at.x, at.y, (middle.y - at.y).atan2(middle.x - at.x)))
    }

    /// Returns the point of a room's free space that is nearest to the room's inner point.
    pub fn inside(&self, room: &Room) -> Option<Point2> {
        let frame = &self.reachable.frame;
        let label = Point2::from(room.label_at_m);
        let mut best: Option<(f64, Point2)> = None;
        for y in 0..frame.height {
            for x in 0..frame.width {
                let at = frame.centre(x, y);
                let off_m = (at - label).norm();
                if self.reachable.get(x, y)
                    && best.is_none_or(|(least, _)| off_m < least - 1e-9)
                    && room.contains(&at)
                {
                    best = Some((off_m, at));
                }
            }
        }
        best.map(|(_, at)| at)
    }
}

/// Returns whether a robot cannot drive below or over an object. Tables, desks and chairs stand on legs.
fn is_obstacle(object: &RobotObject) -> bool {
    use Class::*;
    object.bounds.bottom_m() < ROBOT_HEIGHT_M
        && !matches!(object.class, Table | Desk | Chair | Rug | Door | Curtain)
}

/// Returns the distance from a point to a footprint; 0 inside.
fn outside_m(bounds: &UprightBox, at: &Point2) -> f64 {
    let local = bounds.local(at.x, at.y);
    let [dx, dy] = [0, 1].map(|axis| (local[axis].abs() - bounds.size_m[axis] / 2.0).max(0.0));
    dx.hypot(dy)
}

/// Returns the cells of the box around a footprint that is grown by `by_m`.
fn cells_around(
    frame: &GridFrame,
    bounds: &UprightBox,
    by_m: f64,
) -> impl Iterator<Item = (usize, usize)> + use<> {
    let corners = bounds.corners();
    let range = |axis: usize, cells: usize| {
        let of = |m: f64| (m - frame.origin_m[axis]) / frame.cell_m;
        let low = corners.iter().map(|c| c[axis]).fold(f64::INFINITY, f64::min) - by_m;
        let high = corners.iter().map(|c| c[axis]).fold(f64::NEG_INFINITY, f64::max) + by_m;
        // Casts saturate, even for boxes far away.
        (of(low).floor() as usize).min(cells)..(of(high).ceil().max(0.0) as usize).min(cells)
    };
    let (columns, rows) = (range(0, frame.width), range(1, frame.height));
    rows.flat_map(move |y| columns.clone().map(move |x| (x, y)))
}

/// Returns the piece of the clear cells that is nearest to the dock; the largest one without a dock near it.
fn connected(clear: Grid<bool>, level: &RobotLevel) -> Grid<bool> {
    let (piece, count) = pieces(&clear);
    let mut sizes = vec![0usize; count + 1];
    piece.iter().for_each(|piece| sizes[*piece as usize] += 1);
    let largest = (1..=count).max_by(|a, b| sizes[*a].cmp(&sizes[*b]).then(b.cmp(a)));
    let at_dock = level.lidar.charger.and_then(|dock| {
        let dock = Point2::new(dock.x_m, dock.y_m);
        let cells = piece.iter().enumerate().filter(|(_, piece)| **piece > 0);
        let near = cells.map(|(index, piece)| {
            let centre = clear.frame.centre(index % clear.frame.width, index / clear.frame.width);
            ((centre - dock).norm(), *piece as usize)
        });
        near.filter(|(off_m, _)| *off_m <= DOCK_REACH_M).min_by(|a, b| a.0.total_cmp(&b.0))
    });
    let kept = at_dock.map(|(_, piece)| piece).or(largest).unwrap_or(0);
    let cells = piece.iter().map(|piece| *piece > 0 && *piece as usize == kept).collect();
    Grid { frame: clear.frame, cells }
}
