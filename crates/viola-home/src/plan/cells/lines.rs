//! The lines between the cells.

use crate::plan::axes::place;
use crate::plan::evidence::Evidence;
use crate::plan::faces::Face;
use crate::plan::oblique::Oblique;
use crate::rooms::Room;
use viola_geometry::Point2;

/// Maximum lines of each axis before rooms are divided at narrow passages, and after it. 520 lines of both axes are 270 000
/// cells. A cell has about four pairs of arcs in the graph of the cut, of 40 bytes each, and 100 bytes of lists: 0.3 kB,
/// and at most 1 kB where every side has faces. So the cells take about 80 MB, and at most 270 MB.
const MAX_LINES: usize = 480;
pub(super) const MAX_REFINED: usize = 520;
/// Lines of faces nearer than this are one.
pub(super) const SAME_LINE_M: f64 = 0.02;
/// Minimum evidence of a wall in a column.
pub(super) const WALL: f32 = 0.25;
/// Lines at ends of faces and between rooms are left out this near another line.
const NEAR_LINE_M: f64 = 0.08;
/// Lines at the stairs of oblique faces are left out this near another line. With wider cells thin walls have holes.
const STAIR_LINE_M: f64 = 0.03;
/// Shortest stretch without wall that gets lines of its own.
const GAP_M: f64 = 0.4;
/// The outside reaches this far.
const MARGIN_M: f64 = 0.5;

/// Returns the lines across an axis, in order.
pub(super) fn lines(
    axis: usize,
    evidence: &Evidence,
    faces: &[Face],
    oblique: &[Oblique],
    rooms: &[Room],
) -> Vec<f64> {
    let mut on_faces: Vec<&Face> = faces.iter().filter(|face| face.facing.axis == axis).collect();
    on_faces.sort_by(|a, b| b.weight.total_cmp(&a.weight).then(a.line_m.total_cmp(&b.line_m)));
    let across = faces.iter().filter(|face| face.facing.axis != axis);
    let places = Places {
        bounds: [evidence.low_m[axis] - MARGIN_M, evidence.high_m[axis] + MARGIN_M],
        faces: on_faces.iter().map(|face| face.line_m).collect(),
        stairs: oblique.iter().flat_map(Oblique::stairs).map(|corner| corner[axis]).collect(),
        ends: across.flat_map(ends).collect(),
        borders: borders(axis, evidence, rooms),
    };
    places.lines()
}

/// Coordinates of which lines are made.
struct Places {
    bounds: [f64; 2],
    /// Faces along the axes, the heaviest first.
    faces: Vec<f64>,
    stairs: Vec<f64>,
    /// Ends of walls and edges of doorways.
    ends: Vec<f64>,
    /// Borders between rooms that no wall divides.
    borders: Vec<f64>,
}

impl Places {
    fn lines(&self) -> Vec<f64> {
        let mut lines = self.bounds.to_vec();
        let most = MAX_LINES + 1;
        add(&mut lines, &self.faces, SAME_LINE_M, most);
        add(&mut lines, &self.stairs, STAIR_LINE_M, most);
        add(&mut lines, &self.ends, NEAR_LINE_M, most);
        add(&mut lines, &self.borders, NEAR_LINE_M, most);
        if lines.len() > MAX_LINES {
            lines = self.most_needed();
        }
        lines.sort_by(f64::total_cmp);
        lines
    }

    /// Returns as many lines as may be. Without the edges of doorways and the borders, rooms would be lost; without the last
    /// stairs and the lightest faces, some walls are less exact.
    fn most_needed(&self) -> Vec<f64> {
        let mut lines = self.bounds.to_vec();
        add(&mut lines, &self.faces, SAME_LINE_M, MAX_LINES / 2);
        add(&mut lines, &self.borders, NEAR_LINE_M, MAX_LINES * 3 / 4);
        add(&mut lines, &self.ends, NEAR_LINE_M, MAX_LINES * 3 / 4);
        add(&mut lines, &self.stairs, STAIR_LINE_M, MAX_LINES);
        add(&mut lines, &self.faces, SAME_LINE_M, MAX_LINES);
        add(&mut lines, &self.ends, NEAR_LINE_M, MAX_LINES);
        lines
    }
}

/// Adds places that are further than `near_m` from every line, up to `most` lines. The first two lines are the bounds.
fn add(lines: &mut Vec<f64>, places: &[f64], near_m: f64, most: usize) {
    let [low, high] = [lines[0], lines[1]];
    for metres in places.iter().filter(|metres| **metres > low && **metres < high) {
        if lines.len() >= most {
            return;
        }
        if lines.iter().all(|line| (line - metres).abs() > near_m) {
            lines.push(*metres);
        }
    }
}

/// Returns where a face ends, and where its gaps begin and end.
fn ends(face: &Face) -> Vec<f64> {
    let mut ends = vec![face.from_m, face.to_m];
    let mut gap = 0usize;
    for (place, seen) in face.cover.iter().enumerate() {
        if *seen < WALL {
            gap += 1;
            continue;
        }
        if gap as f64 * face.along_m >= GAP_M {
            ends.extend([place - gap, place].map(|place| face.from_m + place as f64 * face.along_m));
        }
        gap = 0;
    }
    ends
}

/// Returns the straight borders across an axis between given rooms that no wall divides.
fn borders(axis: usize, evidence: &Evidence, rooms: &[Room]) -> Vec<f64> {
    const STEP_M: f64 = 0.05;
    /// Rooms this near each other have a common border.
    const REACH: i64 = 4;
    /// Minimum length of a border, in steps.
    const MIN_STEPS: usize = 10;
    let mut places: std::collections::BTreeMap<(u32, u32), Vec<f64>> = std::collections::BTreeMap::new();
    if rooms.len() < 2 {
        return Vec::new();
    }
    let count =
        |axis: usize| ((evidence.high_m[axis] - evidence.low_m[axis]) / STEP_M).min(2000.0) as i64 + 1;
    for row in 0..count(1 - axis) {
        let (mut last, mut last_at) = (0, i64::MIN);
        for at in 0..count(axis) {
            let on_axis_m = evidence.low_m[axis] + at as f64 * STEP_M;
            let other_m = evidence.low_m[1 - axis] + row as f64 * STEP_M;
            let point = Point2::from(place(axis, on_axis_m, other_m));
            let room = evidence.room(&point);
            if room == 0 {
                continue;
            }
            if last != 0 && room != last && at - last_at <= REACH && evidence.is_open(&point) {
                let middle_m = evidence.low_m[axis] + (at + last_at) as f64 / 2.0 * STEP_M;
                places.entry((last.min(room), last.max(room))).or_default().push(middle_m);
            }
            (last, last_at) = (room, at);
        }
    }
    let median = |mut places: Vec<f64>| {
        places.sort_by(f64::total_cmp);
        places[places.len() / 2]
    };
    places.into_values().filter(|places| places.len() >= MIN_STEPS).map(median).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spread(count: usize, step_m: f64) -> Vec<f64> {
        (0..count).map(|i| i as f64 * step_m).collect()
    }

    #[test]
    fn doorways_and_borders_have_lines_in_a_crowded_plan() {
        let places = Places {
            bounds: [-1.0, 101.0],
            faces: spread(900, 0.05),
            stairs: (0..900).map(|i| 46.0 + f64::from(i) * 0.035).collect(),
            ends: vec![90.0, 90.8, 92.0],
            borders: vec![95.0],
        };
        let lines = places.lines();
        assert_eq!(lines.len(), MAX_LINES);
        assert!(lines.is_sorted() && lines.first() == Some(&-1.0) && lines.last() == Some(&101.0));
        for metres in places.ends.iter().chain(&places.borders) {
            assert!(lines.contains(metres), "{metres}");
        }
        // Faces, the heaviest first, and stairs share the others.
        assert!(places.faces[..150].iter().all(|metres| lines.contains(metres)));
        let beyond = lines.iter().filter(|line| (46.0..80.0).contains(*line)).count();
        assert!(beyond > 100, "{beyond}");
    }

    #[test]
    fn a_plan_with_few_lines_has_all_of_them() {
        let places = Places {
            bounds: [0.0, 20.0],
            faces: vec![4.0, 4.01, 8.0],
            stairs: vec![8.02, 8.04],
            ends: vec![8.1, 9.0, 21.0],
            borders: vec![9.05, 12.0],
        };
        assert_eq!(places.lines(), [0.0, 4.0, 8.0, 8.04, 9.0, 12.0, 20.0]);
    }
}
