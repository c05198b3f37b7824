//! Rooms of a home: from the vacuum's software, or computed from the map.

pub(super) mod bands;
mod bridge;
mod edit;
pub(super) mod outline;
pub(super) mod partition;
pub(super) mod space;

pub use edit::{merged, split};

use super::level_ids::own_part;
use super::map_point::MapPoint;
use outline::{Outline, contains, distance_m, off_m};
use partition::MIN_AREA_M2;
use serde::{Deserialize, Serialize};
use space::Space;
use viola_formats::lidar::{LidarMap, MAX_ROOMS};
use viola_geometry::{DistanceField, Grid, GridFrame, Point2};

/// Gaps up to twice this are closed: the robot omits the cells around thin legs.
const CLOSE_M: f64 = 0.15;
/// Holes smaller than this are filled: they are furniture.
const FILL_M2: f64 = 2.0;
/// Tolerance of the polygon to the cells' border.
const TOLERANCE_M: f64 = 0.07;

/// Source of a room.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RoomSource {
    /// From the robot's software.
    LidarMap,
    /// Computed from the map.
    Computed,
}

/// A room, in the LiDAR map's frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Room {
    pub id: String,
    pub name: Option<String>,
    pub source: RoomSource,
    /// Area of the polygon without its holes, in square metres.
    pub area_m2: f64,
    /// Outer ring, counter-clockwise; the first corner is not repeated.
    pub polygon_m: Vec<[f64; 2]>,
    /// Inner rings, clockwise.
    pub holes_m: Vec<Vec<[f64; 2]>>,
    /// Label position: the inner point furthest from the border.
    pub label_at_m: [f64; 2],
}

#[cfg(test)]
impl Room {
    /// Returns a rectangular room along the axes.
    pub(crate) fn rectangle(id: &str, low: [f64; 2], high: [f64; 2]) -> Room {
        Room {
            id: id.to_owned(),
            name: None,
            source: RoomSource::Computed,
            area_m2: (high[0] - low[0]) * (high[1] - low[1]),
            polygon_m: vec![low, [high[0], low[1]], high, [low[0], high[1]]],
            holes_m: Vec::new(),
            label_at_m: [0, 1].map(|axis| (low[axis] + high[axis]) / 2.0),
        }
    }
}

impl Room {
    /// Returns the name to show: the given one, else `Room` and the id.
    pub fn title(&self) -> String {
        title(self.name.as_deref(), Some(&self.id))
    }

    pub fn contains(&self, point: &Point2) -> bool {
        contains(&self.polygon_m, point) && !self.holes_m.iter().any(|hole| contains(hole, point))
    }

    /// Returns the distance from a point to the outer ring; 0 inside.
    pub fn distance_m(&self, point: &Point2) -> f64 {
        if contains(&self.polygon_m, point) { 0.0 } else { distance_m(&self.polygon_m, point) }
    }

    /// Returns the distance from a point to the room; 0 inside, and not in its holes.
    pub fn off_m(&self, point: &Point2) -> f64 {
        off_m(&self.polygon_m, &self.holes_m, point)
    }
}

/// Returns the name to show for a room: the given one, else `Room` and the id without its level.
pub(super) fn title(name: Option<&str>, id: Option<&str>) -> String {
    let is_shown = |name: &&str| name.chars().any(|letter| !letter.is_control() && !letter.is_whitespace());
    match (name.filter(is_shown), id) {
        (Some(name), _) => name.to_owned(),
        (None, Some(id)) => format!("Room {}", own_part(id)),
        (None, None) => "Room".to_owned(),
    }
}

/// Returns the index of the room at a point, or of the nearest within `reach_m`: objects at walls are off the free floor.
pub fn room_at(rooms: &[Room], point: &Point2, reach_m: f64) -> Option<usize> {
    let inside = rooms.iter().position(|room| room.contains(point));
    inside.or_else(|| {
        let near = (0..rooms.len()).filter(|room| rooms[*room].distance_m(point) <= reach_m);
        // A room may lie in a hole of another one.
        let near = near.map(|room| (rooms[room].off_m(point), room));
        near.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, room)| room)
    })
}

/// Returns the rooms: in the LiDAR map's order, or computed ones by descending area. `points` is the home's
/// fused map, in the LiDAR map's frame; it may be empty.
pub fn rooms(lidar: &LidarMap, points: &[MapPoint]) -> Vec<Room> {
    let space = Space::new(lidar, points);
    // 0 is no room; room numbers start at 1.
    let mut owner: Grid<u32> = Grid::filled(space.frame, 0);
    let known = &lidar.rooms[..lidar.rooms.len().min(MAX_ROOMS)];
    for (number, room) in (1..).zip(known) {
        for cell in &room.cells_m {
            if let Some((x, y)) = space.frame.cell(cell) {
                owner.set(x, y, number);
            }
        }
    }
    if !known.is_empty() {
        let shapes = shapes(&owner, known.len(), &space);
        let named = shapes.into_iter().zip(known).filter_map(|(shape, room)| {
            Some(shape?.into_room(room.id.clone(), room.name.clone(), RoomSource::LidarMap))
        });
        return named.collect();
    }
    let count = partition::partition(&space, &mut owner, MAX_ROOMS);
    let mut shapes: Vec<Shape> = shapes(&owner, count, &space).into_iter().flatten().collect();
    shapes.retain(|shape| shape.outline.area_m2() >= MIN_AREA_M2);
    shapes.sort_by(|a, b| {
        let order = b.outline.area_m2().total_cmp(&a.outline.area_m2());
        let [axis_0, axis_1] = [0, 1].map(|axis| a.label_at_m[axis].total_cmp(&b.label_at_m[axis]));
        order.then(axis_0).then(axis_1)
    });
    (1..).zip(shapes).map(|(n, shape)| shape.into_room(n.to_string(), None, RoomSource::Computed)).collect()
}

/// Maximum cells of all rooms' boxes together; further rooms are dropped.
const MAX_BOXES: usize = 16 << 20;

struct Shape {
    outline: Outline,
    label_at_m: [f64; 2],
}

impl Shape {
    fn into_room(self, id: String, name: Option<String>, source: RoomSource) -> Room {
        Room {
            id,
            name,
            source,
            area_m2: (self.outline.area_m2() * 100.0).round() / 100.0,
            polygon_m: self.outline.ring_m,
            holes_m: self.outline.holes_m,
            label_at_m: self.label_at_m,
        }
    }
}

/// Returns the polygons of rooms 1 to `count`; none for a room without cells.
fn shapes(owner: &Grid<u32>, count: usize, space: &Space) -> Vec<Option<Shape>> {
    let frame = owner.frame;
    let mut boxes = vec![([usize::MAX; 2], [0; 2]); count + 1];
    for (index, number) in owner.cells.iter().enumerate() {
        let at = [index % frame.width, index / frame.width];
        if let Some((low, high)) = boxes.get_mut(*number as usize) {
            *low = [low[0].min(at[0]), low[1].min(at[1])];
            *high = [high[0].max(at[0]), high[1].max(at[1])];
        }
    }
    let mut spent = 0;
    (1..=count)
        .map(|number| {
            let (low, high) = boxes[number];
            let window = (low[0] != usize::MAX).then(|| Window::around(low, high, &frame, CLOSE_M))?;
            spent += window.frame.len();
            if spent > MAX_BOXES { None } else { shape(owner, number as u32, &window, space) }
        })
        .collect()
}

/// Returns one room's polygon: its largest piece, with near pieces joined to it, gaps closed and small holes filled.
fn shape(owner: &Grid<u32>, number: u32, window: &Window, space: &Space) -> Option<Shape> {
    let frame = window.frame;
    let whose =
        |index: usize| owner.get(index % frame.width + window.left, index / frame.width + window.bottom);
    let mut mask = Grid { frame, cells: (0..frame.len()).map(|i| whose(i) == number).collect() };
    let is_open = |index: usize| {
        let (x, y) = (index % frame.width + window.left, index / frame.width + window.bottom);
        whose(index) == number || whose(index) == 0 && !space.is_wall(x, y)
    };
    close(&mut mask, CLOSE_M);
    // Closing must not reach through a wall.
    mask.cells.iter_mut().enumerate().for_each(|(index, cell)| *cell &= is_open(index));
    bridge::bridge(&mut mask, is_open);
    keep_largest(&mut mask);
    // A room within a room is not filled.
    let most = (FILL_M2 / (frame.cell_m * frame.cell_m)) as usize;
    fill_holes(&mut mask, most, |index| whose(index) != 0 && whose(index) != number);
    outlined(&mask)
}

/// Returns the polygon of a mask in one piece; none if it is degenerate.
fn outlined(mask: &Grid<bool>) -> Option<Shape> {
    let frame = mask.frame;
    let depth = DistanceField::new(&outside(mask));
    let deepest = (0..frame.len())
        .max_by(|a, b| depth.grid().cells[*a].total_cmp(&depth.grid().cells[*b]).then(b.cmp(a)))?;
    let at = frame.centre(deepest % frame.width, deepest / frame.width);
    let outline = outline::trace(mask).into_iter().next()?.simplified(TOLERANCE_M)?;
    Some(Shape { outline, label_at_m: [at.x, at.y] })
}

/// Returns the cells that are not set.
fn outside(mask: &Grid<bool>) -> Grid<bool> {
    Grid { frame: mask.frame, cells: mask.cells.iter().map(|set| !set).collect() }
}

fn keep_largest(mask: &mut Grid<bool>) {
    let (piece, count) = outline::pieces(mask);
    let mut sizes = vec![0usize; count + 1];
    piece.iter().for_each(|piece| sizes[*piece as usize] += 1);
    let largest = (1..=count).max_by_key(|piece| (sizes[*piece], std::cmp::Reverse(*piece))).unwrap_or(0);
    for (cell, piece) in mask.cells.iter_mut().zip(piece) {
        *cell = *cell && piece as usize == largest;
    }
}

/// Fills holes of at most `most` cells, none of which is `taken`.
pub(super) fn fill_holes(mask: &mut Grid<bool>, most: usize, taken: impl Fn(usize) -> bool) {
    let (width, height) = (mask.frame.width, mask.frame.height);
    let (piece, count) = outline::pieces(&outside(mask));
    let (mut sizes, mut open) = (vec![0usize; count + 1], vec![false; count + 1]);
    for (index, piece) in piece.iter().enumerate() {
        let (x, y) = (index % width, index / width);
        sizes[*piece as usize] += 1;
        let at_edge = x == 0 || y == 0 || x + 1 == width || y + 1 == height;
        open[*piece as usize] |= at_edge || taken(index);
    }
    for (cell, piece) in mask.cells.iter_mut().zip(piece) {
        *cell |= !open[piece as usize] && sizes[piece as usize] <= most;
    }
}

/// Part of a grid around a room.
struct Window {
    left: usize,
    bottom: usize,
    frame: GridFrame,
}

impl Window {
    fn around(low: [usize; 2], high: [usize; 2], frame: &GridFrame, margin_m: f64) -> Window {
        let margin = (margin_m / frame.cell_m).ceil() as usize + 1;
        let [left, bottom] = low.map(|v| v.saturating_sub(margin));
        let width = (high[0] + margin).min(frame.width - 1) + 1 - left;
        let height = (high[1] + margin).min(frame.height - 1) + 1 - bottom;
        let origin_m = [
            frame.origin_m[0] + left as f64 * frame.cell_m,
            frame.origin_m[1] + bottom as f64 * frame.cell_m,
        ];
        Window { left, bottom, frame: GridFrame { origin_m, cell_m: frame.cell_m, width, height } }
    }
}

/// Morphological closing: closes gaps narrower than twice `by_m`.
pub(super) fn close(mask: &mut Grid<bool>, by_m: f64) {
    let grown = DistanceField::new(mask).grid().cells.iter().map(|d| f64::from(*d) <= by_m).collect();
    let outside = outside(&Grid { frame: mask.frame, cells: grown });
    if !outside.cells.contains(&true) {
        return;
    }
    let left = DistanceField::new(&outside);
    for (cell, distance_m) in mask.cells.iter_mut().zip(&left.grid().cells) {
        *cell |= f64::from(*distance_m) > by_m;
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use viola_formats::lidar;

    /// Two rooms of 4 m x 3 m and 3 m x 3 m with a wall of 0.1 m between them and a door of 0.8 m, as points 2.5 cm
    /// apart, turned by `yaw_rad`.
    pub fn flat(yaw_rad: f64) -> LidarMap {
        let map_from_flat = viola_geometry::Pose2::new(0.0, 0.0, yaw_rad);
        let mut csv = String::new();
        let mut wall = |from: [f64; 2], to: [f64; 2]| {
            let length = (to[0] - from[0]).hypot(to[1] - from[1]);
            for i in 0..=(length / 0.025) as usize {
                let t = i as f64 * 0.025 / length;
                let at = [0, 1].map(|axis| from[axis] + t * (to[axis] - from[axis]));
                let at = map_from_flat.apply(&Point2::from(at));
                csv += &format!("{},{}\n", at.x, at.y);
            }
        };
        wall([0.0, 0.0], [7.1, 0.0]);
        wall([0.0, 3.0], [7.1, 3.0]);
        wall([0.0, 0.0], [0.0, 3.0]);
        wall([7.1, 0.0], [7.1, 3.0]);
        for x in [4.0, 4.1] {
            wall([x, 0.0], [x, 1.0]);
            wall([x, 1.8], [x, 3.0]);
        }
        LidarMap::read(csv.as_bytes()).unwrap()
    }

    #[test]
    fn a_door_divides_rooms() {
        let rooms = rooms(&flat(0.0), &[]);
        assert_eq!(rooms.len(), 2, "{rooms:?}");
        for (room, area, inside) in [(&rooms[0], 12.0, [2.0, 1.5]), (&rooms[1], 9.0, [5.5, 1.5])] {
            assert!((room.area_m2 - area).abs() < 1.2, "{room:?}");
            assert!(room.contains(&Point2::from(inside)) && room.contains(&Point2::from(room.label_at_m)));
            assert!(outline::signed_area_m2(&room.polygon_m) > 0.0);
            assert_eq!((room.source, &room.name), (RoomSource::Computed, &None));
        }
        // Beyond a wall: the nearer room.
        assert_eq!(rooms[room_at(&rooms, &Point2::new(-0.3, 1.0), 1.0).unwrap()].id, "1");
        assert_eq!(room_at(&rooms, &Point2::new(-1.3, 1.0), 1.0), None);
    }

    #[test]
    fn the_robots_rooms_keep_their_names() {
        let mut map = flat(0.0);
        let cells = |x: f64| {
            (0..50).flat_map(move |i| {
                (0..50).map(move |j| Point2::new(x + f64::from(i) * 0.05, 0.3 + f64::from(j) * 0.05))
            })
        };
        let room = |id: &str, name: Option<&str>, x: f64| lidar::Room {
            id: id.into(),
            name: name.map(str::to_owned),
            cells_m: cells(x).collect(),
            material: None,
        };
        map.rooms = vec![room("17", Some("Kitchen"), 0.4), room("3", None, 4.4)];
        map.rooms.push(lidar::Room { id: "empty".into(), name: None, cells_m: vec![], material: None });
        let rooms = rooms(&map, &[]);
        let named: Vec<(&str, Option<&str>)> =
            rooms.iter().map(|room| (room.id.as_str(), room.name.as_deref())).collect();
        assert_eq!(named, [("17", Some("Kitchen")), ("3", None)]);
        assert!(rooms.iter().all(|room| (room.area_m2 - 6.25).abs() < 0.6), "{rooms:?}");
        assert_eq!(rooms[0].source, RoomSource::LidarMap);
    }

    #[test]
    fn a_robots_room_in_two_pieces_is_one() {
        let mut map = flat(0.0);
        // Furniture takes 0.6 m between the pieces.
        let columns = (0..20).chain(32..50);
        let cell = |i: u32, j: u32| Point2::new(0.4 + f64::from(i) * 0.05, 0.3 + f64::from(j) * 0.05);
        let cells_m = columns.flat_map(|i| (0..50).map(move |j| cell(i, j))).collect();
        map.rooms = vec![lidar::Room { id: "17".into(), name: None, cells_m, material: None }];
        let rooms = rooms(&map, &[]);
        for at in [[0.8, 1.5], [2.4, 1.5]] {
            assert!(rooms[0].contains(&Point2::from(at)), "{rooms:?}");
        }
        assert!((4.3..5.6).contains(&rooms[0].area_m2), "{rooms:?}");
    }

    #[test]
    fn many_specks_of_floor_leave_no_room_out() {
        let mut map = flat(0.0);
        map.info.min_m = [0.0, -5.0];
        let frame = GridFrame { origin_m: [-0.2, -5.2], cell_m: 0.05, width: 150, height: 170 };
        let is_free = |x: usize, y: usize| {
            let at = frame.centre(x, y);
            let is_in_door = (3.9..4.3).contains(&at.x) && (1.05..1.75).contains(&at.y);
            let is_in_room = (0.05..3.98).contains(&at.x) || (4.16..7.05).contains(&at.x);
            let is_speck = at.y < -0.5 && x.is_multiple_of(4) && y.is_multiple_of(4);
            is_in_door || is_in_room && (0.05..2.95).contains(&at.y) || is_speck
        };
        let cell = |at: usize| {
            if is_free(at % frame.width, at / frame.width) { lidar::Cell::Free } else { lidar::Cell::Unknown }
        };
        map.cells = Some(Grid { frame, cells: (0..frame.len()).map(cell).collect() });
        let areas_m2: Vec<f64> = rooms(&map, &[]).iter().map(|room| room.area_m2).collect();
        assert!(areas_m2.len() == 2, "{areas_m2:?}");
        assert!((areas_m2[0] - 12.0).abs() < 1.2 && (areas_m2[1] - 9.0).abs() < 1.2, "{areas_m2:?}");
    }

    #[test]
    fn a_map_without_an_inside_has_no_rooms() {
        for csv in ["1,2\n", "0,0\n5,0\n"] {
            let map = LidarMap::read(csv.as_bytes()).unwrap();
            assert!(rooms(&map, &[]).is_empty(), "{csv}");
        }
    }
}
