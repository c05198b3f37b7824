//! Free space of a robot, and poses in it.

use super::area::{box_around, for_cells};
use super::no_go::forbidden;
use super::{RobotLevel, RobotObject, round};
use crate::objects::UprightBox;
use crate::rooms::Room;
use crate::rooms::bands::Bands;
use crate::rooms::outline::pieces;
use crate::rooms::space::Space;
use serde::Serialize;
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
/// Free space at the dock counts from this fraction of the largest free space on: below it is a pocket, such as the
/// niche in which the dock stands, that obstacles of the map separate from the rooms.
const MIN_DOCK_FRACTION: f64 = 0.25;

/// Cells at which goals can be, connected with each other by passages.
pub struct Drive {
    reachable: Grid<bool>,
    pub area: GoalArea,
}

/// The connected free space that has all goals of a level.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GoalArea {
    /// True for free space at the dock; else it is the largest free space.
    pub is_at_dock: bool,
    /// Why it is not that at the dock; null if it is.
    pub reason: Option<NotAtDock>,
    /// Area of the places where a goal can be, in square metres.
    pub area_m2: f64,
}

/// Why the goals are not connected with the dock.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum NotAtDock {
    /// The map has no dock.
    NoDock,
    /// No free space is within a metre of the dock.
    NoFreeSpace,
    /// The free space at the dock has less than a quarter of the area of the largest free space.
    SmallArea,
}

impl Drive {
    /// Free cells are those of the robot's map without forbidden zones and without the footprints of objects that stand on
    /// the floor.
    pub fn new(level: &RobotLevel) -> Drive {
        let space = Space::new(level.lidar, &[]);
        let frame = space.frame;
        let mut blocked = Grid { frame, cells: space.free.iter().map(|free| !free).collect() };
        for object in level.objects.iter().filter(|object| is_obstacle(object)) {
            for (x, y) in cells_between(&frame, &object.bounds.corners(), 0.0) {
                if outside_m(&object.bounds, &frame.centre(x, y)) == 0.0 {
                    blocked.set(x, y, true);
                }
            }
        }
        for zone in forbidden(level) {
            for_cells(&frame, &zone.rings(), |index| blocked.cells[index] = true);
        }
        // The field counts from centre to centre.
        let field = DistanceField::new(&blocked);
        let apart = |least_m: f64| {
            let cells = field.grid().cells.iter().map(|m| *m >= least_m as f32);
            Grid { frame, cells: cells.collect() }
        };
        // An obstacle may reach to its cell's corner, but a robot has passed gaps that look too narrow for this reason.
        let clear = apart(RADIUS_M + frame.cell_m * std::f64::consts::FRAC_1_SQRT_2);
        let passable = apart(RADIUS_M);
        let dock = level.lidar.charger.map(|dock| Point2::new(dock.x_m, dock.y_m));
        let (reachable, area) = connected(&passable, &clear, dock);
        Drive { reachable, area }
    }

    /// Returns a pose beside an object, facing it, in its room; `None` without free space within `REACH_M`.
    pub fn beside(&self, object: &RobotObject, room: Option<&Room>) -> Option<Pose2> {
        let bounds = &object.bounds;
        let middle = Point2::new(bounds.centre_m[0], bounds.centre_m[1]);
        let cost = |at: &Point2| outside_m(bounds, at) + PER_METRE_ASIDE * (at - middle).norm();
        let is_allowed = |at: &Point2| {
            (RADIUS_M..=REACH_M).contains(&outside_m(bounds, at)) && room.is_none_or(|room| room.contains(at))
        };
        let at = self.cheapest(&bounds.corners(), REACH_M, cost, is_allowed)?;
        Some(Pose2::new(at.x, at.y, (middle.y - at.y).atan2(middle.x - at.x)))
    }

    /// Returns the point of a room's free space that is nearest to the room's inner point.
    pub fn inside(&self, room: &Room) -> Option<Point2> {
        let label = Point2::from(room.label_at_m);
        let bands = Bands::new(&room.polygon_m, &room.holes_m);
        self.cheapest(&room.polygon_m, 0.0, |at| (at - label).norm(), |at| bands.contains(at))
    }

    /// Returns the centre with the least cost of the reachable cells in the box around corners that is grown by `by_m`. Only
    /// cheaper ones than the best so far are asked whether they are allowed, which takes longer.
    fn cheapest(
        &self,
        corners: &[[f64; 2]],
        by_m: f64,
        cost: impl Fn(&Point2) -> f64,
        is_allowed: impl Fn(&Point2) -> bool,
    ) -> Option<Point2> {
        let frame = &self.reachable.frame;
        let mut best: Option<(f64, Point2)> = None;
        for (x, y) in cells_between(frame, corners, by_m).filter(|(x, y)| self.reachable.get(*x, *y)) {
            let at = frame.centre(x, y);
            let cost = cost(&at);
            if best.is_none_or(|(least, _)| cost < least - 1e-9) && is_allowed(&at) {
                best = Some((cost, at));
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

/// Returns the cells of the box around corners that is grown by `by_m`, row by row.
fn cells_between(
    frame: &GridFrame,
    corners: &[[f64; 2]],
    by_m: f64,
) -> impl Iterator<Item = (usize, usize)> + use<> {
    let [low, high] = box_around(corners);
    let range = |axis: usize, cells: usize| {
        let of = |m: f64| (m - frame.origin_m[axis]) / frame.cell_m;
        // Casts saturate, even for boxes far away.
        let first = (of(low[axis] - by_m).floor() as usize).min(cells);
        first..(of(high[axis] + by_m).ceil().max(0.0) as usize).min(cells)
    };
    let (columns, rows) = (range(0, frame.width), range(1, frame.height));
    rows.flat_map(move |y| columns.clone().map(move |x| (x, y)))
}

/// Returns the cells of the goals: clear cells that passable ones connect, the largest piece in reach of the dock, or the largest
/// of all if there is none or it is smaller than [`MIN_DOCK_FRACTION`] of that.
fn connected(passable: &Grid<bool>, clear: &Grid<bool>, dock: Option<Point2>) -> (Grid<bool>, GoalArea) {
    let (mut piece, count) = pieces(passable);
    piece.iter_mut().zip(&clear.cells).filter(|(_, is_clear)| !**is_clear).for_each(|(piece, _)| *piece = 0);
    let mut sizes = vec![0usize; count + 1];
    piece.iter().for_each(|piece| sizes[*piece as usize] += 1);
    // Of equal sizes the first piece is taken.
    let smaller = |a: &usize, b: &usize| sizes[*a].cmp(&sizes[*b]).then(b.cmp(a));
    let largest = (1..=count).max_by(smaller).unwrap_or(0);
    let is_near = |index: usize, dock: &Point2| {
        let centre = clear.frame.centre(index % clear.frame.width, index / clear.frame.width);
        (centre - dock).norm() <= DOCK_REACH_M
    };
    let at_dock = dock.and_then(|dock| {
        let near = piece.iter().enumerate().filter(|(index, piece)| **piece > 0 && is_near(*index, &dock));
        near.map(|(_, piece)| *piece as usize).max_by(smaller)
    });
    let (kept, reason) = match at_dock {
        Some(piece) if sizes[piece] as f64 >= MIN_DOCK_FRACTION * sizes[largest] as f64 => (piece, None),
        Some(_) => (largest, Some(NotAtDock::SmallArea)),
        None if dock.is_some() => (largest, Some(NotAtDock::NoFreeSpace)),
        None => (largest, Some(NotAtDock::NoDock)),
    };
    let cells: Vec<bool> = piece.iter().map(|piece| *piece > 0 && *piece as usize == kept).collect();
    let count = cells.iter().filter(|cell| **cell).count();
    let area_m2 = round(count as f64 * clear.frame.cell_m * clear.frame.cell_m);
    let area = GoalArea { is_at_dock: reason.is_none(), reason, area_m2 };
    (Grid { frame: clear.frame, cells }, area)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Draws cells of 0.5 m from text, the uppermost row first: `.` is clear.
    fn drawn(rows: &[&str]) -> Grid<bool> {
        let frame = GridFrame { origin_m: [0.0; 2], cell_m: 0.5, width: rows[0].len(), height: rows.len() };
        let cells = rows.iter().rev().flat_map(|row| row.bytes().map(|byte| byte == b'.')).collect();
        Grid { frame, cells }
    }

    #[test]
    fn a_pocket_at_the_dock_leaves_the_goals_in_the_rooms() {
        use NotAtDock::{NoDock, NoFreeSpace, SmallArea};
        // Pieces of 2, 6, 16 and 4 cells.
        let rooms = drawn(&[
            "..#....#........",
            "####..##........",
            "################",
            "##############..",
            "##############..",
        ]);
        for (dock, cells, reason) in [
            // Two of 16 cells are less than a quarter, and four are not.
            (Some([0.5, 2.25]), 16, Some(SmallArea)),
            (Some([7.5, 0.25]), 4, None),
            (Some([2.5, 2.25]), 6, None),
            (Some([6.0, 1.75]), 16, None),
            // Between two pieces the larger one counts, even if the other is nearer.
            (Some([1.2, 2.25]), 6, None),
            (Some([7.5, 1.25]), 16, None),
            (Some([1.0, 0.25]), 16, Some(NoFreeSpace)),
            (None, 16, Some(NoDock)),
        ] {
            let (kept, area) = connected(&rooms, &rooms, dock.map(Point2::from));
            let found = kept.cells.iter().filter(|cell| **cell).count();
            assert_eq!((found, area.reason), (cells, reason), "{dock:?}");
            assert_eq!((area.is_at_dock, area.area_m2), (reason.is_none(), 0.25 * cells as f64), "{dock:?}");
        }
    }

    #[test]
    fn a_room_is_searched_in_its_own_box() {
        let frame = GridFrame { origin_m: [-1.0, 2.0], cell_m: 0.5, width: 2000, height: 1000 };
        let room = Room { label_at_m: [3.1, 5.65], ..Room::rectangle("1", [2.0, 5.0], [4.0, 6.5]) };
        let cells: Vec<(usize, usize)> = cells_between(&frame, &room.polygon_m, 0.0).collect();
        assert_eq!((cells.len(), cells.first(), cells.last()), (12, Some(&(6, 6)), Some(&(9, 8))));
        let reachable = Grid { frame, cells: vec![true; frame.len()] };
        let area = GoalArea { is_at_dock: false, reason: None, area_m2: 1.0 };
        let mut drive = Drive { reachable, area };
        assert_eq!(drive.inside(&room), Some(Point2::new(3.25, 5.75)));
        drive.reachable.set(8, 7, false);
        assert_eq!(drive.inside(&room), Some(Point2::new(2.75, 5.75)));
        cells.iter().for_each(|(x, y)| drive.reachable.set(*x, *y, false));
        assert_eq!(drive.inside(&room), None);
    }

    #[test]
    fn a_map_without_free_space_has_no_goals() {
        let full = drawn(&["##", "##"]);
        let (kept, area) = connected(&full, &full, Some(Point2::new(0.5, 0.5)));
        assert!(kept.cells.iter().all(|cell| !cell));
        assert_eq!((area.reason, area.area_m2), (Some(NotAtDock::NoFreeSpace), 0.0));
    }
}
