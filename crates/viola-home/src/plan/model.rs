//! A floor plan: walls, openings, rooms and furniture, in metres.

use super::axes::span;
use crate::rooms::outline::{Outline, contains};
use serde::Serialize;
use viola_geometry::taxonomy::Class;
use viola_geometry::{LevelName, Point2, Pose2};

/// Walls with a smaller filmed fraction are drawn as walls of the LiDAR map only.
const MIN_FILMED_FRACTION: f64 = 0.2;

/// A floor plan. All coordinates are in the plan's own frame: the LiDAR map's, turned about its origin so that
/// the main direction of the walls is horizontal.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Level and name of the home, for the title.
    pub level: LevelName,
    pub home_name: Option<String>,
    /// Rotation of the plan's frame into the LiDAR map's.
    pub map_from_plan: Pose2,
    pub walls: Vec<Wall>,
    /// Area of the walls without doors and passages.
    pub masonry: Vec<Outline>,
    /// The part of `masonry` of the walls that are in the LiDAR map only.
    pub unfilmed_masonry: Vec<Outline>,
    pub openings: Vec<Opening>,
    pub rooms: Vec<PlanRoom>,
    pub furniture: Vec<Furniture>,
}

/// A straight wall: its centre line and its thickness. Openings do not interrupt it.
#[derive(Debug, Clone, PartialEq)]
pub struct Wall {
    pub id: String,
    pub from_m: [f64; 2],
    pub to_m: [f64; 2],
    pub thickness_m: f64,
    /// True if both faces were seen; else the thickness is a usual one, and one face was seen.
    pub is_measured: bool,
    /// Fraction of its length without doors and passages, 0 to 1, where clips saw upright surface at one of its faces.
    pub filmed_fraction: f64,
    /// Indices of the rooms on its sides.
    pub rooms: Vec<usize>,
}

/// Kind of an opening.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum OpeningKind {
    Door,
    /// Wider than a door.
    Passage,
    Window,
}

/// A door, passage or window in a wall.
#[derive(Debug, Clone, PartialEq)]
pub struct Opening {
    pub id: String,
    pub kind: OpeningKind,
    /// Ends of its centre line.
    pub from_m: [f64; 2],
    pub to_m: [f64; 2],
    /// Thickness of its wall.
    pub thickness_m: f64,
    /// Heights of its lower and its upper edge above the floor, if they were seen.
    pub sill_m: Option<f64>,
    pub head_m: Option<f64>,
    pub swing: Option<Swing>,
}

/// Leaf of a door where it was seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Swing {
    pub hinge_m: [f64; 2],
    /// End of the leaf at a right angle to the wall.
    pub open_m: [f64; 2],
    /// End of the closed leaf.
    pub closed_m: [f64; 2],
}

/// A room: a polygon along the faces of its walls.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanRoom {
    /// Id of the map's room, of which it may be a part; none for a room that the map does not know.
    pub id: Option<String>,
    pub name: Option<String>,
    pub outline: Outline,
    pub area_m2: f64,
    pub label_at_m: [f64; 2],
}

/// A piece of furniture: a rectangle along the plan's axes where it nearly is. Later ones are drawn over earlier ones.
#[derive(Debug, Clone, PartialEq)]
pub struct Furniture {
    /// Id of the object.
    pub id: String,
    pub class: Class,
    pub centre_m: [f64; 2],
    /// Along its own x and y.
    pub size_m: [f64; 2],
    pub yaw_rad: f64,
    /// Direction of its back, in quarter turns of its own frame from -y; none if neither a wall nor its points tell it.
    pub back: Option<u8>,
    /// Fractions of its back and of the side across it that the recess of a corner sofa has; none for other pieces. The recess is
    /// at the front, at the end of the back.
    pub recess: Option<[f64; 2]>,
}

impl PlanRoom {
    /// Returns the name to show: the given one, else `Room` and the id.
    pub fn title(&self) -> String {
        crate::rooms::title(self.name.as_deref(), self.id.as_deref())
    }

    /// Returns whether a point of the plan is in the room.
    pub fn contains(&self, [x, y]: [f64; 2]) -> bool {
        let point = Point2::new(x, y);
        contains(&self.outline.ring_m, &point)
            && !self.outline.holes_m.iter().any(|hole| contains(hole, &point))
    }
}

impl Wall {
    /// A wall beside no room, of which one face was seen and nothing filmed, by the ends of its centre line.
    pub(super) fn new([from_m, to_m]: [[f64; 2]; 2], thickness_m: f64) -> Wall {
        let id = String::new();
        Wall { id, from_m, to_m, thickness_m, is_measured: false, filmed_fraction: 0.0, rooms: Vec::new() }
    }

    pub fn length_m(&self) -> f64 {
        length_m(self.from_m, self.to_m)
    }

    /// Returns a place on its centre line.
    pub(super) fn at(&self, along_m: f64) -> [f64; 2] {
        let part = along_m / self.length_m().max(1e-9);
        [0, 1].map(|axis| self.from_m[axis] + part * (self.to_m[axis] - self.from_m[axis]))
    }

    fn is_filmed(&self) -> bool {
        self.filmed_fraction >= MIN_FILMED_FRACTION
    }
}

impl Opening {
    /// An opening without an id, heights and a leaf, by the ends of its centre line.
    pub(super) fn new(kind: OpeningKind, [from_m, to_m]: [[f64; 2]; 2], thickness_m: f64) -> Opening {
        let id = String::new();
        Opening { id, kind, from_m, to_m, thickness_m, sill_m: None, head_m: None, swing: None }
    }

    pub fn width_m(&self) -> f64 {
        length_m(self.from_m, self.to_m)
    }

    /// Returns its corners: the rectangle that it takes of its wall.
    pub fn corners_m(&self) -> [[f64; 2]; 4] {
        strip(self.from_m, self.to_m, self.thickness_m)
    }
}

impl Furniture {
    /// Returns its corners, counter-clockwise from its own lower left one.
    pub fn corners_m(&self) -> [[f64; 2]; 4] {
        let (sin, cos) = self.yaw_rad.sin_cos();
        let [x, y] = self.size_m.map(|side| side / 2.0);
        [[-x, -y], [x, -y], [x, y], [-x, y]]
            .map(|[x, y]| [self.centre_m[0] + cos * x - sin * y, self.centre_m[1] + sin * x + cos * y])
    }
}

impl Plan {
    /// Returns the title: with the level unless it is `main`, and with the home's name if it has one.
    pub fn title(&self) -> String {
        let mut title = "Floor plan".to_owned();
        if !self.level.is_main() {
            title += &format!(", {}", self.level);
        }
        if let Some(name) = self.home_name.as_deref().map(str::trim).filter(|name| !name.is_empty()) {
            title += &format!(": {name}");
        }
        title
    }

    /// Returns the angle by which the LiDAR map's frame is turned in the upright one, in degrees, rounded to thousandths.
    pub(super) fn turn_deg(&self) -> f64 {
        // Adding zero makes -0 and 0 equal.
        (self.map_from_plan.yaw_rad.to_degrees() * -1e3).round() / 1e3 + 0.0
    }

    /// Returns whether a room is a part of one of which a part comes before it.
    pub(super) fn is_further_part(&self, at: usize) -> bool {
        let id = &self.rooms[at].id;
        id.is_some() && self.rooms[..at].iter().any(|before| before.id == *id)
    }

    /// Returns the box of all walls and rooms.
    pub fn bounds_m(&self) -> ([f64; 2], [f64; 2]) {
        let rings = self.masonry.iter().chain(self.rooms.iter().map(|room| &room.outline));
        let [x, y] = span(rings.flat_map(|outline| &outline.ring_m));
        if x[0] > x[1] { ([0.0; 2], [1.0; 2]) } else { ([x[0], y[0]], [x[1], y[1]]) }
    }
}

/// Returns the walls that clips filmed, and those of the LiDAR map only. If clips filmed none, as in a home without clips, all
/// walls are in the first group.
pub(super) fn by_filming(walls: &[Wall]) -> (Vec<&Wall>, Vec<&Wall>) {
    let is_any_filmed = walls.iter().any(Wall::is_filmed);
    walls.iter().partition(|wall| !is_any_filmed || wall.is_filmed())
}

/// Returns the distance between two places.
pub(super) fn length_m(from_m: [f64; 2], to_m: [f64; 2]) -> f64 {
    (to_m[0] - from_m[0]).hypot(to_m[1] - from_m[1])
}

/// Returns the unit vector from one place to another.
pub(super) fn direction(from_m: [f64; 2], to_m: [f64; 2]) -> [f64; 2] {
    let length_m = length_m(from_m, to_m).max(1e-9);
    [0, 1].map(|axis| (to_m[axis] - from_m[axis]) / length_m)
}

/// Returns the corners of a strip around a line, counter-clockwise.
pub(super) fn strip(from_m: [f64; 2], to_m: [f64; 2], thickness_m: f64) -> [[f64; 2]; 4] {
    let [x, y] = direction(from_m, to_m);
    let half = [-y * thickness_m / 2.0, x * thickness_m / 2.0];
    let shifted = |p: [f64; 2], by: f64| [p[0] + by * half[0], p[1] + by * half[1]];
    [shifted(from_m, -1.0), shifted(to_m, -1.0), shifted(to_m, 1.0), shifted(from_m, 1.0)]
}
