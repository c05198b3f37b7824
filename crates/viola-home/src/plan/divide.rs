//! Rooms that people divided: the plan is made with each of them in one, and is then cut along their lines, which need not
//! be parallel to any wall.

use super::axes::{self, span};
use super::masonry::{pieces, polygon};
use super::model::{Plan, PlanRoom, Wall};
use crate::corrections::RoomDivision;
use crate::rooms::Room;
use crate::rooms::outline::Outline;
use geo::{Area, BooleanOps, Coord, LineString, MultiPolygon, Polygon};
use viola_geometry::{Point2, Pose2, Vector2, groups};

/// Parts of rooms with less floor do not count.
const MIN_FLOOR_M2: f64 = 0.25;
/// Maximum floor of a room on the other side of its line, as a fraction of that on its own side. Small rooms of cells have
/// much of their border.
const MAX_BEYOND: f64 = 0.25;
/// Each side of a line has this much of a piece, or the line does not divide it: the larger part of the smallest floor, less
/// what rounding may take.
const LEAST_SIDE_M2: f64 = 0.99 * MIN_FLOOR_M2 / (1.0 + MAX_BEYOND);
/// Parts of less area are no rooms: rounding leaves slivers along a line.
const SLIVER_M2: f64 = 1e-3;
/// Places along a wall at which its rooms are sought, and their distance from its face.
const PLACES: usize = 9;
const BESIDE_M: f64 = 0.05;

/// Returns the room that stands for each room while the plan is made, by their numbers from 1: the first of those that lines
/// divide from each other.
pub(super) fn roots(rooms: &[Room], divisions: &[RoomDivision]) -> Vec<u32> {
    let count = rooms.len() as u32;
    let mut parent: Vec<u32> = (0..=count).collect();
    let number = |id: &str| (1u32..).zip(rooms).find(|(_, room)| room.id == id).map(|(number, _)| number);
    for RoomDivision { rooms: [a, b], .. } in divisions {
        if let (Some(a), Some(b)) = (number(a), number(b)) {
            groups::join(&mut parent, a, b);
        }
    }
    (0..=count).map(|number| groups::root(&mut parent, number)).collect()
}

/// Cuts the rooms of a plan along the lines of people. A line that crosses a room on one of its sides cuts nothing.
pub(super) fn divide(plan: &mut Plan, rooms: &[Room], roots: &[u32], divisions: &[RoomDivision]) {
    let plan_from_map = plan.map_from_plan.inverse();
    let line = |division: &RoomDivision| {
        [division.from_m, division.to_m].map(|end| plan_from_map.apply(&Point2::from(end)))
    };
    let lines: Vec<[Point2; 2]> = divisions.iter().map(line).collect();
    let mut all: Vec<PlanRoom> = Vec::new();
    let mut parts_of: Vec<Vec<usize>> = Vec::new();
    for drawn in std::mem::take(&mut plan.rooms) {
        let first = all.len();
        let root = rooms.iter().position(|room| Some(&room.id) == drawn.id.as_ref()).map(|at| roots[at + 1]);
        let numbered = (1u32..).zip(rooms);
        let of_root = numbered.filter(|(number, _)| Some(roots[*number as usize]) == root);
        let members: Vec<(u32, Polygon)> =
            of_root.map(|(number, room)| (number, polygon(&in_plan(room, &plan_from_map)))).collect();
        if members.len() < 2 {
            all.push(drawn);
        } else {
            let parts = cut(polygon(&drawn.outline), &members, &lines);
            all.extend(pieces(&MultiPolygon(parts)).into_iter().map(|part| {
                let owner = owner(&polygon(&part), &members);
                super::room(part, owner, rooms)
            }));
        }
        parts_of.push((first..all.len()).collect());
    }
    plan.rooms = all;
    for wall in &mut plan.walls {
        let mut beside = Vec::new();
        for parts in wall.rooms.iter().filter_map(|room| parts_of.get(*room)) {
            let is_its = |part: &&usize| parts.len() == 1 || is_beside(wall, &plan.rooms[**part]);
            beside.extend(parts.iter().filter(is_its).copied());
        }
        wall.rooms = beside;
    }
}

/// Returns the own outline of a room, in the plan's frame.
pub(super) fn in_plan(room: &Room, plan_from_map: &Pose2) -> Outline {
    let corner = |corner: &[f64; 2]| {
        let at = plan_from_map.apply(&Point2::from(*corner));
        [at.x, at.y]
    };
    Outline {
        ring_m: room.polygon_m.iter().map(corner).collect(),
        holes_m: room.holes_m.iter().map(|hole| hole.iter().map(corner).collect()).collect(),
    }
}

/// Cuts a room along all lines that divide its members.
fn cut(whole: Polygon, members: &[(u32, Polygon)], lines: &[[Point2; 2]]) -> Vec<Polygon> {
    let mut open = vec![whole];
    let mut parts = Vec::new();
    while let Some(piece) = open.pop() {
        match lines.iter().find_map(|line| halves(&piece, members, line)) {
            Some(halves) => open.extend(halves.into_iter().filter(|half| half.unsigned_area() >= SLIVER_M2)),
            None => parts.push(piece),
        }
    }
    parts.sort_by(|a, b| b.unsigned_area().total_cmp(&a.unsigned_area()));
    parts
}

/// Returns the parts of a piece on both sides of a line; none if the line does not divide its members.
fn halves(piece: &Polygon, members: &[(u32, Polygon)], line: &[Point2; 2]) -> Option<Vec<Polygon>> {
    if !crosses(piece, line) {
        return None;
    }
    let sides =
        [half_plane(piece, line, 1.0)?, half_plane(piece, line, -1.0)?].map(|half| piece.intersection(&half));
    // Each side holds the larger part of a member.
    if sides.iter().any(|side| side.unsigned_area() < LEAST_SIDE_M2) {
        return None;
    }
    let mut are_held = [false; 2];
    for (_, member) in members.iter().filter(|(_, member)| !are_apart(piece, member)) {
        let floor_m2 = [0, 1].map(|side: usize| sides[side].intersection(member).unsigned_area());
        if floor_m2[0] + floor_m2[1] < MIN_FLOOR_M2 {
            continue;
        }
        let side = usize::from(floor_m2[1] > floor_m2[0]);
        if floor_m2[1 - side] > MAX_BEYOND * floor_m2[side] {
            return None;
        }
        are_held[side] = true;
    }
    if are_held != [true; 2] {
        return None;
    }
    // A line may cut off a corner of which no member has floor: it stays with the other side.
    let [left, right] = sides;
    let cut_off = if left.0.len() > right.0.len() { left } else { right };
    let is_held = |part: &Polygon| {
        let mut floors_m2 = members.iter().map(|(_, member)| common_m2(part, member));
        floors_m2.any(|floor_m2| floor_m2 >= MIN_FLOOR_M2)
    };
    let cut_off: Vec<Polygon> = cut_off.0.into_iter().filter(is_held).collect();
    if cut_off.is_empty() {
        return None;
    }
    let rest = piece.difference(&MultiPolygon(cut_off.clone()));
    Some(cut_off.into_iter().chain(rest.0).collect())
}

/// Returns whether a piece has corners on both sides of a line.
fn crosses(piece: &Polygon, [from, to]: &[Point2; 2]) -> bool {
    let off = |corner: &Coord| (to - from).perp(&(Point2::new(corner.x, corner.y) - from));
    let corners = &piece.exterior().0;
    corners.iter().any(|corner| off(corner) > 0.0) && corners.iter().any(|corner| off(corner) < 0.0)
}

/// Returns the common area of a piece and a member.
fn common_m2(piece: &Polygon, member: &Polygon) -> f64 {
    if are_apart(piece, member) { 0.0 } else { piece.intersection(member).unsigned_area() }
}

/// Returns whether the boxes around two polygons are apart.
fn are_apart(a: &Polygon, b: &Polygon) -> bool {
    axes::are_apart(
        &[a, b].map(|polygon| span(polygon.exterior().0.iter().map(|corner| [corner.x, corner.y]))),
    )
}

/// Returns the half of the plane on the left (1) or the right (-1) of a line, as far as a piece reaches; none if the line has
/// no direction.
fn half_plane(piece: &Polygon, [from, to]: &[Point2; 2], side: f64) -> Option<Polygon> {
    let direction = (to - from).try_normalize(1e-9)?;
    let corners = &piece.exterior().0;
    let off_m = |corner: &Coord| (corner.x - from.x).hypot(corner.y - from.y);
    let reach_m = 1.0 + corners.iter().map(off_m).fold(0.0, f64::max);
    let along = direction * reach_m;
    let across = Vector2::new(-along.y, along.x) * side;
    let corners = [from - along, from + along, from + along + across, from - along + across];
    Some(Polygon::new(LineString(corners.iter().map(|p| Coord { x: p.x, y: p.y }).collect()), Vec::new()))
}

/// Returns the number of the member with the most floor in a part.
fn owner(part: &Polygon, members: &[(u32, Polygon)]) -> u32 {
    let floors = members.iter().map(|(number, member)| (*number, common_m2(part, member)));
    let most = floors.max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
    most.map_or(0, |(number, _)| number)
}

/// Returns whether a room is beside a wall.
fn is_beside(wall: &Wall, room: &PlanRoom) -> bool {
    let [from, to] = [wall.from_m, wall.to_m].map(Point2::from);
    let along = to - from;
    let Some(direction) = along.try_normalize(1e-9) else { return false };
    let off_m = wall.thickness_m / 2.0 + BESIDE_M;
    let across = Vector2::new(-direction.y, direction.x) * off_m;
    (0..PLACES).any(|place| {
        let on_wall = from + along * ((place as f64 + 0.5) / PLACES as f64);
        [on_wall + across, on_wall - across].iter().any(|p| room.contains([p.x, p.y]))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ring(corners: &[[f64; 2]]) -> Polygon {
        polygon(&Outline { ring_m: corners.to_vec(), holes_m: Vec::new() })
    }

    fn areas_m2(parts: &[Polygon]) -> Vec<f64> {
        parts.iter().map(|part| (part.unsigned_area() * 100.0).round() / 100.0).collect()
    }

    #[test]
    fn a_line_cuts_a_room_where_it_divides_its_members() {
        let whole = ring(&[[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]]);
        let line = [Point2::new(1.0, 0.0), Point2::new(3.0, 3.0)];
        // Members as the cells of the LiDAR map have them: their border has stairs.
        let left = (1, ring(&[[0.1, 0.1], [1.5, 0.1], [1.5, 1.5], [2.5, 1.5], [2.5, 2.9], [0.1, 2.9]]));
        let right = (2, ring(&[[1.6, 0.1], [3.9, 0.1], [3.9, 2.9], [2.6, 2.9], [2.6, 1.6], [1.6, 1.6]]));
        let members = [left, right];
        let parts = cut(whole.clone(), &members, &[line]);
        assert_eq!(areas_m2(&parts), [6.0, 6.0]);
        let mut owners: Vec<u32> = parts.iter().map(|part| owner(part, &members)).collect();
        owners.sort_unstable();
        assert_eq!(owners, [1, 2]);
        // A line through both of them is of no division, and one without a direction is none.
        for line in [[Point2::new(0.0, 1.5), Point2::new(4.0, 1.5)], [Point2::new(2.0, 1.0); 2]] {
            assert_eq!(areas_m2(&cut(whole.clone(), &members, &[line])), [12.0]);
        }
    }

    /// A hall in 60 strips. Lines that do not cross a piece, and members that are apart from it, are not cut.
    #[test]
    fn a_hall_with_very_many_parts_is_cut_soon() {
        const STRIPS: u32 = 60;
        let strip = |at: u32| {
            let [low, high] = [at, at + 1].map(f64::from);
            ring(&[[low, 0.0], [high, 0.0], [high, 3.0], [low, 3.0]])
        };
        let members: Vec<(u32, Polygon)> = (0..STRIPS).map(|at| (at + 1, strip(at))).collect();
        let lines: Vec<[Point2; 2]> =
            (1..STRIPS).map(f64::from).map(|x| [Point2::new(x, 0.0), Point2::new(x, 3.0)]).collect();
        let end_m = f64::from(STRIPS);
        let parts = cut(ring(&[[0.0, 0.0], [end_m, 0.0], [end_m, 3.0], [0.0, 3.0]]), &members, &lines);
        assert_eq!(areas_m2(&parts), vec![3.0; STRIPS as usize]);
        for (_, own) in &members {
            assert!(!lines.iter().any(|line| crosses(own, line)));
            assert_eq!(members.iter().filter(|(_, member)| !are_apart(own, member)).count(), 1);
        }
        let mut owners: Vec<u32> = parts.iter().map(|part| owner(part, &members)).collect();
        owners.sort_unstable();
        assert_eq!(owners, (1..=STRIPS).collect::<Vec<u32>>());
    }

    /// The line y = 1 divides a room like a U; the map's cells have one of its arms only.
    #[test]
    fn an_arm_without_floor_stays_with_the_other_side() {
        let whole = ring(&[
            [0.0, 0.0],
            [5.0, 0.0],
            [5.0, 3.0],
            [4.0, 3.0],
            [4.0, 1.0],
            [1.0, 1.0],
            [1.0, 3.0],
            [0.0, 3.0],
        ]);
        let base = (1, ring(&[[0.0, 0.0], [5.0, 0.0], [5.0, 1.0], [0.0, 1.0]]));
        let arm = (2, ring(&[[0.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]]));
        let line = [Point2::new(0.0, 1.0), Point2::new(1.0, 1.0)];
        assert_eq!(areas_m2(&cut(whole, &[base, arm], &[line])), [7.0, 2.0]);
    }
}
