//! Horizontal section of a mesh, and rays in its plane.

use super::Mesh;
use viola_geometry::{GridFrame, Point2, Vector2};

/// Segments in which a plane cuts a mesh, in a cell grid.
///
/// Horizontal rays hit the mesh at these segments, so no search in 3D is needed.
pub struct Section {
    segments: Vec<[Point2; 2]>,
    frame: GridFrame,
    /// The segments of each cell are `members[starts[cell]..starts[cell + 1]]`.
    starts: Vec<u32>,
    members: Vec<u32>,
}

const CELL_M: f64 = 0.10;
/// Bounds the memory: a mesh of kilometres gets coarser cells.
const MAX_CELLS: f64 = 4e6;

impl Section {
    /// Returns the section; none if the plane at `height_m` misses the mesh.
    pub fn new(mesh: &Mesh, height_m: f64) -> Option<Section> {
        let segments: Vec<[Point2; 2]> =
            mesh.corners().filter_map(|corners| cut(&corners, height_m)).collect();
        let inf = f64::INFINITY;
        let (min, max) = segments.iter().flatten().fold(([inf; 2], [-inf; 2]), |(min, max), p| {
            ([min[0].min(p.x), min[1].min(p.y)], [max[0].max(p.x), max[1].max(p.y)])
        });
        if segments.is_empty() {
            return None;
        }
        let mut cell_m = CELL_M;
        while (max[0] - min[0]) * (max[1] - min[1]) / (cell_m * cell_m) > MAX_CELLS {
            cell_m *= 2.0;
        }
        let frame = GridFrame::covering(min, max, cell_m, cell_m);
        let mut pairs: Vec<(u32, u32)> = Vec::new();
        for (index, [a, b]) in segments.iter().enumerate() {
            let cell = |p: &Point2| frame.cell(p).unwrap_or_default();
            let ((ax, ay), (bx, by)) = (cell(a), cell(b));
            for y in ay.min(by)..=ay.max(by) {
                for x in ax.min(bx)..=ax.max(bx) {
                    pairs.push(((y * frame.width + x) as u32, index as u32));
                }
            }
        }
        pairs.sort_unstable();
        let mut starts = vec![0u32; frame.len() + 1];
        pairs.iter().for_each(|(cell, _)| starts[*cell as usize + 1] += 1);
        for cell in 0..frame.len() {
            starts[cell + 1] += starts[cell];
        }
        let members = pairs.into_iter().map(|(_, segment)| segment).collect();
        Some(Section { segments, frame, starts, members })
    }

    pub fn segments(&self) -> &[[Point2; 2]] {
        &self.segments
    }

    /// Returns the distance to the first segment on a ray from inside the box; `toward` is a unit vector.
    pub fn range_m(&self, from: &Point2, toward: &Vector2, max_m: f64) -> Option<f64> {
        let (x, y) = self.frame.cell(from)?;
        let (mut x, mut y) = (x as i64, y as i64);
        let cell_m = self.frame.cell_m;
        // Steps to the next cell border in x or y (Amanatides and Woo, 1987).
        let axis = |origin_m: f64, at_m: f64, cell: i64, speed: f64| -> (i64, f64, f64) {
            if speed == 0.0 {
                return (0, f64::INFINITY, f64::INFINITY);
            }
            let wall = cell + i64::from(speed > 0.0);
            let first = (origin_m + wall as f64 * cell_m - at_m) / speed;
            (speed.signum() as i64, first, cell_m / speed.abs())
        };
        let (step_x, mut next_x, each_x) = axis(self.frame.origin_m[0], from.x, x, toward.x);
        let (step_y, mut next_y, each_y) = axis(self.frame.origin_m[1], from.y, y, toward.y);
        let mut nearest = max_m;
        loop {
            let inside =
                (0..self.frame.width as i64).contains(&x) && (0..self.frame.height as i64).contains(&y);
            if !inside {
                break;
            }
            let cell = y as usize * self.frame.width + x as usize;
            for &index in &self.members[self.starts[cell] as usize..self.starts[cell + 1] as usize] {
                if let Some(range_m) = meet(from, toward, &self.segments[index as usize]) {
                    nearest = nearest.min(range_m);
                }
            }
            // A hit beyond this cell may not be the nearest.
            if nearest <= next_x.min(next_y) {
                break;
            }
            if next_x < next_y {
                x += step_x;
                next_x += each_x;
            } else {
                y += step_y;
                next_y += each_y;
            }
        }
        (nearest < max_m).then_some(nearest)
    }
}

/// Returns the segment in which a plane cuts a triangle. Corners on the plane count as above.
fn cut(corners: &[viola_geometry::Point3; 3], height_m: f64) -> Option<[Point2; 2]> {
    let mut ends = Vec::with_capacity(2);
    for i in 0..3 {
        let (a, b) = (corners[i], corners[(i + 1) % 3]);
        if (a.z >= height_m) != (b.z >= height_m) {
            ends.push((a + (b - a) * ((height_m - a.z) / (b.z - a.z))).xy());
        }
    }
    <[Point2; 2]>::try_from(ends).ok()
}

/// Returns the distance along the ray to a segment.
fn meet(from: &Point2, toward: &Vector2, [a, b]: &[Point2; 2]) -> Option<f64> {
    let along = b - a;
    let turn = toward.perp(&along);
    if turn == 0.0 {
        return None;
    }
    let offset = a - from;
    let range_m = offset.perp(&along) / turn;
    let fraction = offset.perp(toward) / turn;
    // Tolerance at the ends: rays must not pass between adjacent segments.
    (range_m >= 0.0 && (-1e-9..=1.0 + 1e-9).contains(&fraction)).then_some(range_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use viola_geometry::Point3;

    proptest! {
        #[test]
        fn the_first_line_of_all(
            corners in prop::collection::vec((-3.0..3.0f64, -3.0..3.0f64, -1.0..1.0f64), 9..60),
            angle in 0.0..std::f64::consts::TAU,
        ) {
            let vertices_m: Vec<Point3> = corners.iter().map(|(x, y, z)| Point3::new(*x, *y, *z)).collect();
            let triangles = (0..vertices_m.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
            let mesh = Mesh { vertices_m, triangles, labels: Vec::new() };
            if let Some(section) = Section::new(&mesh, 0.1) {
                let from = nalgebra::center(&section.segments[0][0], &section.segments.last().unwrap()[1]);
                let toward = Vector2::new(angle.cos(), angle.sin());
                let want = section.segments.iter().filter_map(|s| meet(&from, &toward, s)).fold(f64::INFINITY, f64::min);
                let got = section.range_m(&from, &toward, 100.0).unwrap_or(f64::INFINITY);
                prop_assert!(got == want || (got - want).abs() < 1e-9, "{} {}", got, want);
            }
        }
    }
}
