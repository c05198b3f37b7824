//! Floor plans: rectangular rooms, their walls, and the openings in the walls.

mod features;
mod fixtures;
mod openings;
mod programme;
mod row;
mod slicing;
mod slopes;
mod truth;
mod walls;

use super::piece::Footprint;
use super::rng::Rng;
use super::solid::Solid;
use serde::Serialize;
use viola_geometry::{Point2, Pose2};

pub(super) use slopes::Slope;
pub use truth::{FacePoint, RoomShape, TrueOpening};

/// Use of a room.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RoomKind {
    /// One room to live, cook and sleep in.
    Studio,
    Living,
    Kitchen,
    Dining,
    Bedroom,
    Child,
    Study,
    Bathroom,
    Corridor,
    Storage,
}

impl RoomKind {
    fn title(self) -> &'static str {
        match self {
            RoomKind::Studio => "Studio",
            RoomKind::Living => "Living room",
            RoomKind::Kitchen => "Kitchen",
            RoomKind::Dining => "Dining room",
            RoomKind::Bedroom => "Bedroom",
            RoomKind::Child => "Child's room",
            RoomKind::Study => "Study",
            RoomKind::Bathroom => "Bathroom",
            RoomKind::Corridor => "Corridor",
            RoomKind::Storage => "Storage",
        }
    }
}

/// An axis-aligned rectangle of the plan.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Rect {
    pub min: [f64; 2],
    pub max: [f64; 2],
}

impl Rect {
    /// Returns the bounding box of points.
    pub(super) fn around(points: impl IntoIterator<Item = Point2>) -> Rect {
        let empty = Rect { min: [f64::INFINITY; 2], max: [f64::NEG_INFINITY; 2] };
        points.into_iter().fold(empty, |Rect { min, max }, p| Rect {
            min: [min[0].min(p.x), min[1].min(p.y)],
            max: [max[0].max(p.x), max[1].max(p.y)],
        })
    }

    pub fn size(&self, axis: usize) -> f64 {
        self.max[axis] - self.min[axis]
    }

    pub fn area_m2(&self) -> f64 {
        self.size(0) * self.size(1)
    }

    pub fn centre(&self) -> Point2 {
        Point2::new((self.min[0] + self.max[0]) / 2.0, (self.min[1] + self.max[1]) / 2.0)
    }

    pub fn shrunk(&self, by_m: f64) -> Rect {
        Rect { min: self.min.map(|v| v + by_m), max: self.max.map(|v| v - by_m) }
    }

    pub fn contains(&self, point: &Point2) -> bool {
        (0..2).all(|axis| point[axis] >= self.min[axis] && point[axis] <= self.max[axis])
    }
}

/// A room. Its walls' inner faces bound `inner`; `outline` runs along the middle of the walls.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Room {
    pub kind: RoomKind,
    pub name: String,
    pub outline: Rect,
    pub inner: Rect,
    /// Copy of the repeated unit, and part of the unit.
    pub unit: Option<(usize, usize)>,
}

/// A straight wall between two rooms, or between a room and the outside.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Wall {
    /// True along x, false along y.
    pub along_x: bool,
    /// Coordinate of its centre line across the wall.
    pub line: f64,
    pub from: f64,
    pub to: f64,
    /// Rooms on the sides of smaller and of larger coordinates.
    pub rooms: [Option<usize>; 2],
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum OpeningKind {
    Door,
    /// The home's closed front door.
    Entrance,
    /// A doorway without a leaf.
    Passage,
    /// Open plan: most of the wall is missing.
    Wide,
    Window,
}

/// Mounting of a door's leaf.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Leaf {
    Hinged,
    /// Slides into the wall.
    Sliding,
}

/// A hole in a wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Opening {
    pub kind: OpeningKind,
    pub centre: Point2,
    pub along_x: bool,
    pub width_m: f64,
    pub sill_m: f64,
    pub head_m: f64,
    /// Rooms on the sides of smaller and of larger coordinates.
    pub rooms: [Option<usize>; 2],
    /// End of the hinge, -1 or 1 along the wall.
    pub hinge: f64,
    /// Side to which the leaf opens, -1 or 1 across the wall.
    pub swing: f64,
    /// Of a hinged leaf; a sliding leaf at 90 degrees is entirely in the wall.
    pub open_rad: f64,
    pub leaf: Leaf,
    /// Seed of the frame and the panes; copies of a unit share it.
    pub detail: u64,
}

impl Opening {
    pub fn line(&self) -> f64 {
        if self.along_x { self.centre.y } else { self.centre.x }
    }

    pub fn at(&self) -> f64 {
        if self.along_x { self.centre.x } else { self.centre.y }
    }

    /// Returns whether a person can walk through it.
    pub fn is_way(&self) -> bool {
        matches!(self.kind, OpeningKind::Door | OpeningKind::Passage | OpeningKind::Wide)
    }

    /// Returns the rectangle on both sides of it, up to `reach_m` from the wall's centre line.
    pub fn zone(&self, reach_m: f64) -> Footprint {
        let half = [self.width_m / 2.0, reach_m];
        let half = if self.along_x { half } else { [half[1], half[0]] };
        Footprint { centre: self.centre, half, yaw_rad: 0.0 }
    }
}

/// A part of the building in a room: a chimney breast, a pillar, a cut corner, stairs.
#[derive(Debug, Clone)]
pub(super) struct Feature {
    pub room: usize,
    pub solids: Vec<Solid>,
    /// Occupied floor.
    pub footprint: Footprint,
}

/// Placement of a copy of the repeated unit: mirrored (x to -x) if set, then moved.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct UnitPlace {
    pub mirrored: bool,
    pub home_from_unit: Pose2,
}

/// A floor plan.
#[derive(Debug, Clone)]
pub struct Plan {
    pub rooms: Vec<Room>,
    pub ceiling_m: f64,
    /// Thickness of the inner walls.
    pub wall_m: f64,
    /// Thickness of the outer walls.
    pub outer_m: f64,
    pub units: Vec<UnitPlace>,
    pub(super) walls: Vec<Wall>,
    pub(super) openings: Vec<Opening>,
    pub(super) features: Vec<Feature>,
    pub(super) slopes: Vec<Slope>,
}

/// A room before it has walls.
struct Cell {
    kind: RoomKind,
    outline: Rect,
    unit: Option<(usize, usize)>,
}

impl Plan {
    /// Generates a flat or a house of 1 to 12 rooms. The outer walls of a glazed home are glass.
    pub(super) fn of_a_home(glazed: bool, rng: &mut Rng) -> Plan {
        let cells = slicing::layout(&mut rng.fork("layout", 0));
        let mut plan = Plan::with_walls(cells, rng);
        openings::open_doors(&mut plan, &mut rng.fork("doors", 0));
        openings::open_windows(&mut plan, glazed, &mut rng.fork("windows", 0));
        slopes::add(&mut plan, &mut rng.fork("slopes", 0));
        plan.features = features::add(&plan, &mut rng.fork("features", 0));
        plan
    }

    /// Generates a corridor with a row of look-alike rooms.
    pub(super) fn of_a_row(rng: &mut Rng) -> Plan {
        row::layout(rng)
    }

    fn with_walls(cells: Vec<Cell>, rng: &mut Rng) -> Plan {
        let wall_m = rng.pick([0.08, 0.10, 0.10, 0.12, 0.12, 0.15, 0.18]);
        let mut counts = std::collections::BTreeMap::new();
        let rooms: Vec<Room> = cells
            .iter()
            .map(|cell| {
                let count = counts.entry(cell.kind.title()).or_insert(0);
                *count += 1;
                let title = cell.kind.title();
                let name = if *count == 1 { title.to_owned() } else { format!("{title} {count}") };
                let inner = cell.outline.shrunk(wall_m / 2.0);
                Room { kind: cell.kind, name, outline: cell.outline, inner, unit: cell.unit }
            })
            .collect();
        let walls = walls::between(&rooms);
        let (lowest, highest) = rng.pick([(2.2, 2.4), (2.4, 2.7), (2.4, 2.7), (2.4, 2.7), (2.7, 3.2)]);
        Plan {
            rooms,
            ceiling_m: rng.between(lowest, highest),
            wall_m,
            outer_m: rng.between(0.24, 0.45),
            units: vec![],
            walls,
            openings: vec![],
            features: vec![],
            slopes: vec![],
        }
    }

    /// Returns the room whose inside contains a point.
    pub fn room_at(&self, point: &Point2) -> Option<usize> {
        self.rooms.iter().position(|room| room.inner.contains(point))
    }

    /// Returns the lowest height of the ceiling over a footprint in a room.
    pub(super) fn headroom_m(&self, room: usize, footprint: &Footprint) -> f64 {
        let slopes = self.slopes.iter().filter(|slope| slope.room == room);
        slopes
            .flat_map(|slope| footprint.corners().map(|corner| slope.height_at(&corner)))
            .fold(self.ceiling_m, f64::min)
    }

    /// Returns the greatest height of the upper edge of doors and windows.
    pub(super) fn head_limit_m(&self) -> f64 {
        self.ceiling_m - 0.12
    }

    /// Returns the bounding box of all rooms.
    pub fn bounds(&self) -> Rect {
        let corners = |room: &Room| [room.outline.min, room.outline.max].map(Point2::from);
        Rect::around(self.rooms.iter().flat_map(corners))
    }

    /// Returns the sum of the rooms' inner areas.
    pub fn area_m2(&self) -> f64 {
        self.rooms.iter().map(|room| room.inner.area_m2()).sum()
    }
}

/// Snaps to the plan's 5 cm raster, so that walls meet exactly.
fn snap(value: f64) -> f64 {
    (value * 20.0).round() / 20.0
}
