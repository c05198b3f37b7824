//! Coverage of the LiDAR map by the fused map.

use super::map_point::MapPoint;
use super::rooms::Room;
use super::rooms::bands::Bands;
use super::rooms::outline::bounds_m;
use super::rooms::space::Space;
use serde::{Deserialize, Serialize};
use viola_formats::lidar::LidarMap;
use viola_geometry::taxonomy::Class;
use viola_geometry::{DistanceField, Grid, Point2};

/// Maximum distance, seen from above, of a surface that explains a point of the LiDAR map.
const NEAR_M: f64 = 0.1;
/// Heights of such a surface above the floor: a wall behind a chair is seen above the LiDAR's height.
const HEIGHTS_M: [f64; 2] = [0.05, 2.0];
/// Maximum distance, seen from above, of a fused point that covers a free cell.
const FLOOR_NEAR_M: f64 = 0.1;
/// Maximum height of such a point: the floor, or an object on it.
const FLOOR_BELOW_M: f64 = 1.5;
/// Occupied cells this far from a room belong to its walls.
const ROOM_REACH_M: f64 = 0.4;
/// Rooms whose bounds are this far away are further away than that.
const BOUNDS_M: f64 = ROOM_REACH_M + 0.01;

/// Coverage of the LiDAR map by the fused map.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Coverage {
    /// Fraction of the LiDAR map's occupied points that the fused map explains with a surface other than
    /// floor and ceiling within 10 cm, 0.05 to 2 m high. 0 for a map without such points.
    pub seen: f64,
    /// Fraction of the LiDAR map's free area where the fused map has the floor or an object on it. 0 for a
    /// map without free area.
    pub floor_seen: f64,
    pub by_room: Vec<RoomCoverage>,
}

/// Coverage of one room.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RoomCoverage {
    /// Id of the room.
    pub room: String,
    /// Fraction of the occupied points in the room and at its walls.
    pub seen: f64,
    pub floor_seen: f64,
}

#[derive(Default, Clone, Copy)]
struct Fraction {
    seen: u64,
    of: u64,
}

impl Fraction {
    fn count(&mut self, seen: bool) {
        self.seen += u64::from(seen);
        self.of += 1;
    }

    /// Returns the fraction in 0..1, rounded to thousandths.
    fn value(self) -> f64 {
        (self.seen as f64 / self.of.max(1) as f64 * 1e3).round() / 1e3
    }
}

/// Returns the fused map's coverage of the LiDAR map, overall and per room.
pub fn coverage(lidar: &LidarMap, points: &[MapPoint], rooms: &[Room]) -> Coverage {
    let space = Space::new(lidar, &[]);
    let near = |counts: &dyn Fn(&MapPoint, f64) -> bool| {
        let mut mask = Grid::filled(space.frame, false);
        for point in points {
            let [x, y, z] = point.point.position_m.map(f64::from);
            if counts(point, z)
                && let Some(at) = space.index(&Point2::new(x, y))
            {
                mask.cells[at] = true;
            }
        }
        mask.cells.contains(&true).then(|| DistanceField::new(&mask))
    };
    let structure = near(&|point, z| {
        (HEIGHTS_M[0]..HEIGHTS_M[1]).contains(&z)
            && !point.point.label.class.is_ground()
            && point.point.label.class != Class::Ceiling
    });
    let ground = near(&|_, z| z < FLOOR_BELOW_M);
    // Distance fields are between cell centres: half a cell of tolerance.
    let slack_m = space.frame.cell_m / 2.0;
    let is_near = |field: &Option<DistanceField>, at: usize, reach_m: f64| {
        field.as_ref().is_some_and(|field| f64::from(field.grid().cells[at]) <= reach_m + slack_m)
    };
    let places = Places::new(rooms);
    let (mut all, mut floor) = (Fraction::default(), Fraction::default());
    let mut by_room = vec![(Fraction::default(), Fraction::default()); rooms.len()];
    for at in 0..space.frame.len() {
        if space.occupied[at] {
            let seen = is_near(&structure, at, NEAR_M);
            all.count(seen);
            if let Some(room) = places.room_at(&space.centre(at), ROOM_REACH_M) {
                by_room[room].0.count(seen);
            }
        } else if space.free[at] {
            let seen = is_near(&ground, at, FLOOR_NEAR_M);
            floor.count(seen);
            if let Some(room) = places.room_at(&space.centre(at), 0.0) {
                by_room[room].1.count(seen);
            }
        }
    }
    let room = |(room, (seen, floor)): (&Room, (Fraction, Fraction))| RoomCoverage {
        room: room.id.clone(),
        seen: seen.value(),
        floor_seen: floor.value(),
    };
    Coverage {
        seen: all.value(),
        floor_seen: floor.value(),
        by_room: rooms.iter().zip(by_room).map(room).collect(),
    }
}

/// Rooms with what is needed to find that of very many places.
struct Places<'a> {
    rooms: &'a [Room],
    /// Corners of the box around each room.
    bounds: Vec<[[f64; 2]; 2]>,
    bands: Vec<Bands>,
}

impl<'a> Places<'a> {
    fn new(rooms: &'a [Room]) -> Places<'a> {
        let bands = rooms.iter().map(|room| Bands::new(&room.polygon_m, &room.holes_m));
        Places {
            rooms,
            bounds: rooms.iter().map(|room| bounds_m(&room.polygon_m)).collect(),
            bands: bands.collect(),
        }
    }

    /// Returns what [`room_at`](super::rooms::room_at) returns, for a reach of at most [`ROOM_REACH_M`]. Only rooms whose bounds
    /// are near are compared: a large home has hundreds of others.
    fn room_at(&self, point: &Point2, reach_m: f64) -> Option<usize> {
        let is_near = |[low, high]: &[[f64; 2]; 2]| {
            (0..2).all(|axis| (low[axis] - BOUNDS_M..=high[axis] + BOUNDS_M).contains(&point[axis]))
        };
        let near: Vec<usize> = (0..self.rooms.len()).filter(|room| is_near(&self.bounds[*room])).collect();
        if let Some(inside) = near.iter().find(|room| self.bands[**room].contains(point)) {
            return Some(*inside);
        }
        let is_beside = |room: &usize| {
            self.bands[*room].surrounds(point) || self.bands[*room].is_outer_near(point, reach_m)
        };
        let off_m = |room: &usize| {
            let near_m = self.bands[*room].off_m(point, reach_m);
            // Else it is deep in a hole.
            if near_m <= reach_m { near_m } else { self.rooms[*room].off_m(point) }
        };
        near.into_iter().filter(is_beside).min_by(|a, b| off_m(a).total_cmp(&off_m(b)))
    }
}

#[cfg(test)]
mod tests {
    use super::super::rooms::room_at;
    use super::*;
    use viola_reconstruct::Label;

    fn point(x: f64, y: f64, z: f64, class: Class) -> MapPoint {
        MapPoint::new([x, y, z], [0.0, 0.0, 1.0], Label::new(class, 0.9, 3))
    }

    #[test]
    fn half_of_a_room_is_half() {
        let side = (0..=80).map(|i| f64::from(i) * 0.05);
        let csv: String = side
            .flat_map(|t| [[t, 0.0], [t, 4.0], [0.0, t], [4.0, t]])
            .map(|[x, y]| format!("{x},{y}\n"))
            .collect();
        let lidar = LidarMap::read(csv.as_bytes()).unwrap();
        let rooms = crate::rooms(&lidar, &[]);
        let none = coverage(&lidar, &[], &rooms);
        assert_eq!((none.seen, none.floor_seen, none.by_room.len()), (0.0, 0.0, 1));
        // The lower half: its walls above the LiDAR's height, and its floor.
        let mut points = Vec::new();
        for i in 0..=80 {
            let t = f64::from(i) * 0.05;
            points.push(point(t, 0.0, 1.5, Class::Wall));
            if t < 1.95 {
                points.push(point(0.0, t, 1.5, Class::Wall));
                points.push(point(4.0, t, 1.5, Class::Wall));
                points.extend((0..=80).map(|j| point(f64::from(j) * 0.05, t, 0.01, Class::Floor)));
            }
        }
        let half = coverage(&lidar, &points, &rooms);
        assert!((half.seen - 0.5).abs() < 0.05, "{half:?}");
        assert!((half.floor_seen - 0.5).abs() < 0.06, "{half:?}");
        assert!((half.by_room[0].floor_seen - half.floor_seen).abs() < 0.05, "{half:?}");
        // Neither ceiling nor floor explains a wall.
        let other: Vec<MapPoint> = points
            .iter()
            .map(|p| {
                let [x, y, _] = p.point.position_m.map(f64::from);
                point(x, y, 1.8, Class::Ceiling)
            })
            .collect();
        assert_eq!(coverage(&lidar, &other, &rooms).seen, 0.0);
    }

    #[test]
    fn a_place_has_the_room_that_all_sides_tell() {
        let hole = |low: [f64; 2], high: [f64; 2]| vec![low, [low[0], high[1]], high, [high[0], low[1]]];
        let small = vec![hole([0.5, 0.5], [2.5, 2.5]), hole([2.8, 0.5], [3.3, 1.0])];
        let large = vec![hole([0.2, 0.2], [3.0, 2.8])];
        let rooms = [
            Room { holes_m: small, ..Room::rectangle("1", [0.0, 0.0], [4.0, 3.0]) },
            Room::rectangle("2", [0.9, 0.9], [1.6, 2.1]),
            Room::rectangle("3", [4.3, 0.0], [8.0, 2.0]),
            Room { holes_m: large, ..Room::rectangle("4", [0.1, 0.1], [8.0, 6.0]) },
        ];
        let places = Places::new(&rooms);
        let mut counts = [0; 4];
        // In rooms, between them, in holes, on sides and corners, and at equal distances.
        for at in 0..180 * 150 {
            let point = Point2::new((at % 180) as f64 * 0.05 - 0.5, (at / 180) as f64 * 0.05 - 0.5);
            for reach_m in [0.0, ROOM_REACH_M] {
                let found = places.room_at(&point, reach_m);
                assert_eq!(found, room_at(&rooms, &point, reach_m), "{point:?} {reach_m}");
                found.into_iter().for_each(|room| counts[room] += 1);
            }
        }
        assert!(counts.iter().all(|count| *count > 0), "{counts:?}");
    }

    #[test]
    fn the_walls_of_a_room_within_a_room_are_its_own() {
        let square = |low: f64, high: f64| {
            let side = (0..=60).map(move |i| low + (high - low) * f64::from(i) / 60.0);
            side.flat_map(move |t| [[t, low], [t, high], [low, t], [high, t]])
        };
        let csv: String =
            square(0.0, 6.0).chain(square(2.0, 4.0)).map(|[x, y]| format!("{x},{y}\n")).collect();
        let lidar = LidarMap::read(csv.as_bytes()).unwrap();
        let hole = vec![[1.8, 1.8], [1.8, 4.2], [4.2, 4.2], [4.2, 1.8]];
        let around = Room { holes_m: vec![hole], ..Room::rectangle("1", [0.0, 0.0], [6.0, 6.0]) };
        let rooms = [around, Room::rectangle("2", [2.1, 2.1], [3.9, 3.9])];
        let points: Vec<MapPoint> = square(2.0, 4.0).map(|[x, y]| point(x, y, 1.5, Class::Wall)).collect();
        let by_room = coverage(&lidar, &points, &rooms).by_room;
        // Of 240 cells of wall, one at a corner may be as near to the room around.
        assert!(by_room[0].seen < 0.01 && by_room[1].seen == 1.0, "{by_room:?}");
    }
}
