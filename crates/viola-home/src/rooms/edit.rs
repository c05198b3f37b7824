//! Rooms as people correct them: two rooms become one, or a line divides a room.

use super::outline::{bounds_m, edges, pieces};
use super::{Room, Shape, keep_largest, outlined};
use viola_geometry::{DistanceField, Grid, GridFrame, Point2};

/// Side of the cells on which rooms are cut and joined: that of most LiDAR maps.
const CELL_M: f64 = 0.05;
/// Cells of such a grid; larger rooms have larger cells.
const MAX_CELLS: f64 = 4e6;
/// Widest gap between two rooms that are joined: the wall between them with its unseen edges.
const MAX_GAP_M: f64 = 0.6;
/// Minimum area of a part of a room.
const MIN_PART_M2: f64 = 0.5;

/// Returns two rooms as one with the id of the first, or none if they do not meet at a wall.
pub fn merged(a: &Room, b: &Room) -> Option<Room> {
    let frame = around(&[a, b]);
    let (of_a, of_b) = (mask(a, frame), mask(b, frame));
    let (to_a, to_b) = (DistanceField::new(&of_a), DistanceField::new(&of_b));
    let between = |index: usize| {
        let at = frame.centre(index % frame.width, index / frame.width);
        let ((a_m, from_a), (b_m, from_b)) = (to_a.value_and_gradient(&at), to_b.value_and_gradient(&at));
        // Beside both of them, as behind the wall at their common corner, is not between them.
        a_m + b_m <= MAX_GAP_M && from_a.dot(&from_b) < 0.0
    };
    let cells = (0..frame.len()).map(|index| of_a.cells[index] || of_b.cells[index] || between(index));
    let mut both = Grid { frame, cells: cells.collect() };
    keep_largest(&mut both);
    let has = |room: &Room| both.at(&Point2::from(room.label_at_m)).unwrap_or(false);
    if !(has(a) && has(b)) {
        return None;
    }
    let name = a.name.clone().or_else(|| b.name.clone());
    Some(outlined(&both)?.into_room(a.id.clone(), name, a.source))
}

/// Returns the two parts of a room beside the line through two points: the part with `anchor` with the
/// room's id and name, the other with `other_id`. None if one of the parts would be no room.
pub fn split(room: &Room, from: &Point2, to: &Point2, anchor: &Point2, other_id: &str) -> Option<[Room; 2]> {
    let side = |at: &Point2| (to.x - from.x) * (at.y - from.y) - (to.y - from.y) * (at.x - from.x) >= 0.0;
    let frame = around(&[room]);
    let whole = mask(room, frame);
    let is_of_anchor =
        |index: usize| side(&frame.centre(index % frame.width, index / frame.width)) == side(anchor);
    let part = |of_anchor: bool| -> Option<Shape> {
        let cells = (0..frame.len()).map(|index| whole.cells[index] && is_of_anchor(index) == of_anchor);
        let mut part = Grid { frame, cells: cells.collect() };
        // A line across both arms of a U cuts off two pieces: the room is the one with its label.
        if !(of_anchor && keep_around(&mut part, anchor)) {
            keep_largest(&mut part);
        }
        let area_m2 = part.cells.iter().filter(|set| **set).count() as f64 * frame.cell_m * frame.cell_m;
        if area_m2 < MIN_PART_M2 { None } else { outlined(&part) }
    };
    let (own, other) = (part(true)?, part(false)?);
    let own = own.into_room(room.id.clone(), room.name.clone(), room.source);
    Some([own, other.into_room(other_id.to_owned(), None, room.source)])
}

/// Keeps the piece of a mask at a point; returns false, and keeps all, if there is none.
fn keep_around(mask: &mut Grid<bool>, at: &Point2) -> bool {
    let frame = mask.frame;
    let (piece, _) = pieces(mask);
    // The line may pass through the cell of the point.
    let beside = [[0.0, 0.0], [-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.0, 1.0]];
    let own = beside.iter().find_map(|[x, y]| {
        let (x, y) = frame.cell(&Point2::new(at.x + x * frame.cell_m, at.y + y * frame.cell_m))?;
        Some(piece[y * frame.width + x]).filter(|piece| *piece != 0)
    });
    let Some(own) = own else { return false };
    mask.cells.iter_mut().zip(piece).for_each(|(cell, piece)| *cell = piece == own);
    true
}

/// Returns a grid that covers the rooms.
fn around(rooms: &[&Room]) -> GridFrame {
    let [min_m, max_m] = bounds_m(rooms.iter().flat_map(|room| &room.polygon_m));
    let area_m2 = (max_m[0] - min_m[0]) * (max_m[1] - min_m[1]);
    let cell_m = CELL_M.max((area_m2 / MAX_CELLS).sqrt());
    GridFrame::covering(min_m, max_m, 2.0 * cell_m, cell_m)
}

/// Returns the cells whose centres are in a room. Each row is filled between the borders that it crosses.
fn mask(room: &Room, frame: GridFrame) -> Grid<bool> {
    let mut mask = Grid::filled(frame, false);
    for y in 0..frame.height {
        let at_y = frame.centre(0, y).y;
        let rings = std::iter::once(&room.polygon_m).chain(&room.holes_m);
        let mut crossings: Vec<f64> = rings.flat_map(|ring| crossings(ring, at_y)).collect();
        crossings.sort_by(f64::total_cmp);
        for pair in crossings.chunks_exact(2) {
            let cell = |x_m: f64| (x_m - frame.origin_m[0]) / frame.cell_m - 0.5;
            let first = cell(pair[0]).ceil().max(0.0) as usize;
            let end = (cell(pair[1]).floor() + 1.0).max(0.0) as usize;
            (first..end.min(frame.width)).for_each(|x| mask.set(x, y, true));
        }
    }
    mask
}

/// Returns the x at which a ring crosses a horizontal line.
fn crossings(ring: &[[f64; 2]], y: f64) -> Vec<f64> {
    let crossed = edges(ring).filter(|(a, b)| (a[1] > y) != (b[1] > y));
    crossed.map(|(a, b)| a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rooms_on_both_sides_of_a_wall_become_one() {
        let a = Room::rectangle("a", [0.0, 0.0], [4.0, 3.0]);
        for (low_x, is_one) in [(4.0, true), (4.15, true), (4.5, true), (4.8, false), (9.0, false)] {
            let b =
                Room { name: Some("b".to_owned()), ..Room::rectangle("b", [low_x, 0.0], [low_x + 3.0, 2.0]) };
            let Some(both) = merged(&a, &b) else {
                assert!(!is_one, "{low_x}");
                continue;
            };
            assert!(is_one, "{low_x}");
            let expected_m2 = 12.0 + 6.0 + (low_x - 4.0) * 2.0;
            assert!((both.area_m2 - expected_m2).abs() < 0.5, "{low_x}: {} {expected_m2}", both.area_m2);
            assert_eq!((both.id.as_str(), both.name.as_deref()), ("a", Some("b")));
            for label in [a.label_at_m, b.label_at_m, both.label_at_m] {
                assert!(both.contains(&Point2::from(label)));
            }
        }
    }

    #[test]
    fn a_line_divides_a_room() {
        let whole = Room { name: Some("Lounge".to_owned()), ..Room::rectangle("7", [0.0, 0.0], [6.0, 3.0]) };
        let cut = |x: f64, anchor: [f64; 2]| {
            split(&whole, &Point2::new(x, 0.0), &Point2::new(x, 1.0), &Point2::from(anchor), "7-b")
        };
        let [own, other] = cut(2.0, [5.0, 1.0]).unwrap();
        assert!((own.area_m2 - 12.0).abs() < 0.4 && (other.area_m2 - 6.0).abs() < 0.4, "{own:?} {other:?}");
        assert_eq!((own.id.as_str(), own.name.as_deref()), ("7", Some("Lounge")));
        assert_eq!((other.id.as_str(), &other.name), ("7-b", &None));
        assert!(own.contains(&Point2::new(5.0, 1.0)) && !own.contains(&Point2::new(1.0, 1.0)));
        assert!(other.contains(&Point2::from(other.label_at_m)));
        let [own, _] = cut(2.0, [1.0, 1.0]).unwrap();
        assert!((own.area_m2 - 6.0).abs() < 0.4);
        for x in [-1.0, 0.05, 6.0, 70.0] {
            assert_eq!(cut(x, [3.0, 1.0]), None, "{x}");
        }
    }

    /// The line cuts off both arms of a U. The smaller one has the label.
    #[test]
    fn the_part_with_the_label_keeps_the_id_even_if_it_is_not_the_largest() {
        let polygon_m =
            [[0.0, 0.0], [8.0, 0.0], [8.0, 4.0], [5.2, 4.0], [5.2, 1.3], [1.6, 1.3], [1.6, 7.0], [0.0, 7.0]];
        let whole = Room { polygon_m: polygon_m.to_vec(), ..Room::rectangle("7", [0.0, 0.0], [8.0, 7.0]) };
        let cut = |anchor: [f64; 2]| {
            let [from, to] = [Point2::new(0.0, 1.36), Point2::new(8.0, 1.36)];
            split(&whole, &from, &to, &Point2::from(anchor), "7-b").unwrap()
        };
        for (anchor, own_m2, other_m2) in
            [([6.6, 1.4], 7.4, 10.6), ([0.8, 5.0], 9.0, 10.6), ([4.0, 0.6], 10.6, 9.0)]
        {
            let [own, other] = cut(anchor);
            assert!(own.contains(&Point2::from(anchor)), "{own:?}");
            for (part, area_m2) in [(own, own_m2), (other, other_m2)] {
                assert!((part.area_m2 - area_m2).abs() < 0.5, "{area_m2}: {part:?}");
            }
        }
    }

    #[test]
    fn a_hole_stays_one() {
        let mut whole = Room::rectangle("1", [0.0, 0.0], [4.0, 4.0]);
        whole.holes_m = vec![vec![[1.0, 1.0], [1.0, 2.0], [2.0, 2.0], [2.0, 1.0]]];
        let [own, _] =
            split(&whole, &Point2::new(3.0, 0.0), &Point2::new(3.0, 1.0), &Point2::new(0.5, 0.5), "2")
                .unwrap();
        assert_eq!(own.holes_m.len(), 1);
        assert!((own.area_m2 - 11.0).abs() < 0.4, "{own:?}");
    }
}
