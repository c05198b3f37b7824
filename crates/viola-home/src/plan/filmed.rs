//! Fraction of a wall that clips filmed: walls that are in the LiDAR map only are drawn lighter.

use super::evidence::Evidence;
use super::model::{Opening, Wall};
use super::raster::directions_of;
use viola_geometry::{Point2, Vector2};

/// Step along a wall.
const STEP_M: f64 = 0.05;
/// Maximum distance of surface from a face of its wall, as for the coverage of the LiDAR map.
const REACH_M: f64 = 0.1;
/// Ends of other walls this near a face of a wall are at it.
const AT_WALL_M: f64 = 0.1;
/// Cosine of the smallest angle between walls that meet.
const SAME_WAY: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// Minimum length of a part of a wall.
const MIN_PART_M: f64 = 0.5;

/// Returns the fraction of a wall's length where clips saw upright surface at one of its faces: 0 to 1, rounded to thousandths.
/// Doors and passages (`ways`) count only if the wall has no other length.
pub(super) fn fraction(wall: &Wall, ways: &[Opening], evidence: &Evidence) -> f64 {
    fraction_between([wall.from_m, wall.to_m], wall.thickness_m, ways, evidence)
}

/// Returns the same of a piece of wall, by the ends of its centre line.
pub(super) fn fraction_between(
    ends_m: [[f64; 2]; 2],
    thickness_m: f64,
    ways: &[Opening],
    evidence: &Evidence,
) -> f64 {
    let [from, to] = ends_m.map(Point2::from);
    let length_m = (to - from).norm();
    let along = (to - from) / length_m.max(1e-9);
    let across = Vector2::new(-along.y, along.x);
    let span = |way: &Opening| {
        let offsets = [way.from_m, way.to_m].map(|end| Point2::from(end) - from);
        let [a, b] = offsets.map(|offset| offset.dot(&along));
        let half_m = thickness_m.max(way.thickness_m) / 2.0;
        let is_in_wall = offsets.iter().all(|offset| offset.dot(&across).abs() <= half_m);
        is_in_wall.then(|| [a.min(b), a.max(b)])
    };
    let spans: Vec<[f64; 2]> = ways.iter().filter_map(span).collect();
    let count = ((length_m / STEP_M).round() as usize).max(1);
    let step_m = length_m / count as f64;
    let is_in_way = |step: usize| {
        let middle_m = (step as f64 + 0.5) * step_m;
        spans.iter().any(|[low_m, high_m]| (*low_m..*high_m).contains(&middle_m))
    };
    let mut steps: Vec<usize> = (0..count).filter(|step| !is_in_way(*step)).collect();
    if steps.is_empty() {
        steps = (0..count).collect();
    }

    // The raster is in the map's frame.
    let origin = evidence.map_from_plan.apply(&from);
    let [along, across] = [along, across].map(|direction| evidence.map_from_plan.rotate(&direction));
    let directions = directions_of(&across);
    let rows_m = rows_m(thickness_m, evidence.cell_m());
    let samples = (step_m / evidence.cell_m()).round().max(1.0) as usize;
    let is_filmed = |step: usize| {
        (0..samples).any(|sample| {
            let along_m = (step as f64 + (sample as f64 + 0.5) / samples as f64) * step_m;
            let centre = origin + along * along_m;
            rows_m.iter().any(|row_m| evidence.has_upright(&(centre + across * *row_m), directions))
        })
    };
    let filmed = steps.iter().filter(|step| is_filmed(**step)).count();
    (filmed as f64 / steps.len() as f64 * 1e3).round() / 1e3
}

/// Returns the walls in their parts between other walls, each with its own fraction: clips of one room film its part of a facade.
pub(super) fn parts(walls: &[Wall], ways: &[Opening], evidence: &Evidence) -> Vec<Wall> {
    let mut parts = Vec::new();
    for wall in walls {
        let ends_m = ends_of_parts(wall, walls);
        if ends_m.len() == 2 {
            parts.push(wall.clone());
            continue;
        }
        for ends in ends_m.windows(2) {
            let mut part = Wall { from_m: wall.at(ends[0]), to_m: wall.at(ends[1]), ..wall.clone() };
            part.filmed_fraction = fraction(&part, ways, evidence);
            parts.push(part);
        }
    }
    parts
}

/// Returns the coordinates along a wall of its ends and of the walls that meet it between them.
fn ends_of_parts(wall: &Wall, walls: &[Wall]) -> Vec<f64> {
    let (from, length_m) = (Point2::from(wall.from_m), wall.length_m());
    let direction =
        |wall: &Wall| (Point2::from(wall.to_m) - Point2::from(wall.from_m)) / wall.length_m().max(1e-9);
    let along = direction(wall);
    let reach_m = wall.thickness_m / 2.0 + AT_WALL_M;
    let ends = walls.iter().flat_map(|other| [(other, other.from_m), (other, other.to_m)]);
    let at_wall = ends.filter_map(|(other, end)| {
        let end = Point2::from(end) - from;
        (end.perp(&along).abs() <= reach_m).then(|| (other, end.dot(&along)))
    });
    let within = at_wall.filter(|(_, at_m)| (MIN_PART_M..=length_m - MIN_PART_M).contains(at_m));
    // Last, because a large map has very many walls, and few of them are near.
    let across = within.filter(|(other, _)| direction(other).dot(&along).abs() <= SAME_WAY);
    let mut places: Vec<f64> = across.map(|(_, at_m)| at_m).collect();
    places.sort_by(f64::total_cmp);
    let mut ends_m = vec![0.0];
    for at_m in places {
        if at_m - ends_m[ends_m.len() - 1] >= MIN_PART_M {
            ends_m.push(at_m);
        }
    }
    ends_m.push(length_m);
    ends_m
}

/// Returns the coordinates across a wall of the cells at its two faces.
fn rows_m(thickness_m: f64, cell_m: f64) -> Vec<f64> {
    let cells = (REACH_M / cell_m).ceil().max(1.0) as i32;
    let mut rows_m = Vec::new();
    for face_m in [-thickness_m / 2.0, thickness_m / 2.0] {
        rows_m.extend((-cells..=cells).map(|cell| face_m + f64::from(cell) / f64::from(cells) * REACH_M));
    }
    rows_m
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wall_has_its_parts_between_other_walls() {
        let wall =
            |from_m: [f64; 2], to_m: [f64; 2], thickness_m: f64| Wall::new([from_m, to_m], thickness_m);
        // A facade below three rooms, its corners, two partitions, and walls that do not meet it.
        let walls = [
            wall([0.0, -0.1], [9.0, -0.1], 0.2),
            wall([-0.1, 0.0], [-0.1, 3.0], 0.2),
            wall([9.1, 3.0], [9.1, 0.0], 0.2),
            wall([4.0, 0.0], [4.0, 3.0], 0.1),
            wall([7.0, 3.0], [7.0, 0.05], 0.1),
            // The side of a pillar beside a partition.
            wall([4.3, 0.0], [4.3, 0.3], 0.1),
            wall([2.0, 1.0], [2.0, 3.0], 0.1),
            wall([0.0, 0.05], [3.0, 0.05], 0.1),
        ];
        let near = |found: Vec<f64>, want: &[f64]| {
            assert!(found.len() == want.len(), "{found:?}");
            assert!(found.iter().zip(want).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}");
        };
        near(ends_of_parts(&walls[0], &walls), &[0.0, 4.0, 7.0, 9.0]);
        near(ends_of_parts(&walls[3], &walls), &[0.0, 3.0]);
    }
}
