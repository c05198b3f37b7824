//! The exact Euclidean distance to the occupied cells of a grid, with bilinear value and gradient.

use super::{Grid, GridFrame, Point2, Vector2};
use rayon::prelude::*;

/// Distance in metres from every cell's centre to the centre of the nearest occupied cell.
///
/// Between centres the value is bilinear, so the distance to a wall of adjacent cells is zero all along the
/// wall and grows linearly away from it. Outside the grid the value is that of the grid's nearest point plus
/// the distance to it.
#[derive(Debug, Clone)]
pub struct DistanceField {
    grid: Grid<f32>,
    cells_per_m: f64,
}

impl DistanceField {
    /// Computes separable lower envelopes of parabolas (Felzenszwalb and Huttenlocher, 2012): exact, linear
    /// in the number of cells. Without any occupied cell the distance is the grid's diagonal everywhere.
    pub fn new(occupied: &Grid<bool>) -> DistanceField {
        let GridFrame { width, height, cell_m, .. } = occupied.frame;
        let far = ((width * width + height * height) as f32).max(1.0);
        // Columns first: the squared distance, in cells, to the nearest occupied cell of the same column.
        let mut columns = vec![0f32; width * height];
        columns.par_chunks_mut(height.max(1)).enumerate().for_each(|(x, column)| {
            let mut nearest: Option<usize> = None;
            for (y, value) in column.iter_mut().enumerate() {
                if occupied.cells[y * width + x] {
                    nearest = Some(y);
                }
                *value = nearest.map_or(far, |n| ((y - n) * (y - n)) as f32);
            }
            nearest = None;
            for y in (0..height).rev() {
                if occupied.cells[y * width + x] {
                    nearest = Some(y);
                }
                if let Some(n) = nearest {
                    column[y] = column[y].min(((n - y) * (n - y)) as f32);
                }
            }
        });
        let mut grid = Grid::filled(occupied.frame, 0f32);
        let scale = cell_m as f32;
        grid.cells.par_chunks_mut(width.max(1)).enumerate().for_each_init(
            || Envelope::with_capacity(width),
            |envelope, (y, row)| {
                envelope.build((0..width).map(|x| columns[x * height + y]));
                envelope.evaluate(row);
                for value in row {
                    *value = value.min(far).sqrt() * scale;
                }
            },
        );
        DistanceField { grid, cells_per_m: 1.0 / occupied.frame.cell_m }
    }

    pub fn frame(&self) -> &GridFrame {
        &self.grid.frame
    }

    /// Returns the distances at the cells' centres, in metres.
    pub fn grid(&self) -> &Grid<f32> {
        &self.grid
    }

    /// Returns the distance at a point, in metres.
    pub fn value(&self, point: &Point2) -> f64 {
        let at = self.locate(point);
        at.value() + at.outside_m
    }

    /// Returns the distance at a point in metres, and its gradient in metres per metre.
    #[inline]
    pub fn value_and_gradient(&self, point: &Point2) -> (f64, Vector2) {
        let GridFrame { origin_m, width, height, .. } = self.grid.frame;
        let u = (point.x - origin_m[0]) * self.cells_per_m - 0.5;
        let v = (point.y - origin_m[1]) * self.cells_per_m - 0.5;
        // Hot path of the refinement: nearly all points are inside. NaN fails the comparisons.
        if u >= 0.0 && v >= 0.0 && u < (width - 1) as f64 && v < (height - 1) as f64 {
            let (x0, y0) = (u as i32, v as i32);
            let from = y0 as usize * width + x0 as usize;
            if let Some(cells) = self.grid.cells.get(from..from + width + 2) {
                let (fx, fy) = (u - f64::from(x0), v - f64::from(y0));
                let [v00, v10] = [cells[0], cells[1]].map(f64::from);
                let [v01, v11] = [cells[width], cells[width + 1]].map(f64::from);
                let (low, high) = (v10 - v00, v11 - v01);
                let (left, right) = (v00 + fy * (v01 - v00), v10 + fy * (v11 - v10));
                let gx = (low + fy * (high - low)) * self.cells_per_m;
                return (
                    left + fx * (right - left),
                    Vector2::new(gx, (v01 - v00 + fx * (high - low)) * self.cells_per_m),
                );
            }
        }
        self.value_and_gradient_outside(point)
    }

    #[cold]
    fn value_and_gradient_outside(&self, point: &Point2) -> (f64, Vector2) {
        let at = self.locate(point);
        let cell_m = self.grid.frame.cell_m;
        let gx = ((1.0 - at.fy) * (at.v10 - at.v00) + at.fy * (at.v11 - at.v01)) / cell_m;
        let gy = ((1.0 - at.fx) * (at.v01 - at.v00) + at.fx * (at.v11 - at.v10)) / cell_m;
        // Along a clamped axis the bilinear value is constant: only the distance to the grid has a slope.
        let inner = |slope: f64, outwards: f64| if outwards == 0.0 { slope } else { outwards };
        let gradient = Vector2::new(inner(gx, at.outwards.x), inner(gy, at.outwards.y));
        (at.value() + at.outside_m, gradient)
    }

    fn locate(&self, point: &Point2) -> Located {
        let frame = &self.grid.frame;
        let clamp = |value: f64, cells: usize| value.clamp(0.0, (cells - 1) as f64);
        let u = (point.x - frame.origin_m[0]) / frame.cell_m - 0.5;
        let v = (point.y - frame.origin_m[1]) / frame.cell_m - 0.5;
        let (cu, cv) = (clamp(u, frame.width), clamp(v, frame.height));
        let x0 = (cu as usize).min(frame.width.saturating_sub(2));
        let y0 = (cv as usize).min(frame.height.saturating_sub(2));
        let (x1, y1) = ((x0 + 1).min(frame.width - 1), (y0 + 1).min(frame.height - 1));
        let beyond = Vector2::new(u - cu, v - cv) * frame.cell_m;
        let outside_m = beyond.norm();
        Located {
            v00: f64::from(self.grid.get(x0, y0)),
            v10: f64::from(self.grid.get(x1, y0)),
            v01: f64::from(self.grid.get(x0, y1)),
            v11: f64::from(self.grid.get(x1, y1)),
            fx: cu - x0 as f64,
            fy: cv - y0 as f64,
            outside_m,
            outwards: if outside_m > 0.0 { beyond / outside_m } else { Vector2::zeros() },
        }
    }
}

/// The values of the four cells around a point, and its position between them.
struct Located {
    v00: f64,
    v10: f64,
    v01: f64,
    v11: f64,
    fx: f64,
    fy: f64,
    outside_m: f64,
    outwards: Vector2,
}

impl Located {
    fn value(&self) -> f64 {
        (1.0 - self.fy) * ((1.0 - self.fx) * self.v00 + self.fx * self.v10)
            + self.fy * ((1.0 - self.fx) * self.v01 + self.fx * self.v11)
    }
}

/// The lower envelope of the parabolas `(x - i)^2 + f(i)`.
struct Envelope {
    heights: Vec<f32>,
    vertices: Vec<usize>,
    /// `bounds[k]` is the left bound of parabola `k` of the envelope.
    bounds: Vec<f32>,
}

impl Envelope {
    fn with_capacity(n: usize) -> Envelope {
        Envelope {
            heights: Vec::with_capacity(n),
            vertices: Vec::with_capacity(n),
            bounds: Vec::with_capacity(n),
        }
    }

    fn build(&mut self, heights: impl Iterator<Item = f32>) {
        self.heights.clear();
        self.heights.extend(heights);
        self.vertices.clear();
        self.bounds.clear();
        for q in 0..self.heights.len() {
            let mut from = f32::NEG_INFINITY;
            while let (Some(&p), Some(&bound)) = (self.vertices.last(), self.bounds.last()) {
                from = self.crossing(p, q);
                if from > bound {
                    break;
                }
                self.vertices.pop();
                self.bounds.pop();
                from = f32::NEG_INFINITY;
            }
            self.vertices.push(q);
            self.bounds.push(from);
        }
    }

    /// Returns the x from which parabola `q` is below parabola `p < q`.
    fn crossing(&self, p: usize, q: usize) -> f32 {
        let (pf, qf) = (p as f64, q as f64);
        let (hp, hq) = (f64::from(self.heights[p]), f64::from(self.heights[q]));
        (((hq + qf * qf) - (hp + pf * pf)) / (2.0 * (qf - pf))) as f32
    }

    fn evaluate(&self, out: &mut [f32]) {
        let mut k = 0;
        for (x, value) in out.iter_mut().enumerate() {
            while k + 1 < self.bounds.len() && self.bounds[k + 1] < x as f32 {
                k += 1;
            }
            let i = self.vertices[k];
            let d = x as f32 - i as f32;
            *value = d * d + self.heights[i];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn brute_force(occupied: &Grid<bool>, x: usize, y: usize) -> f64 {
        let frame = occupied.frame;
        let here = frame.centre(x, y);
        let mut best = f64::INFINITY;
        for oy in 0..frame.height {
            for ox in 0..frame.width {
                if occupied.get(ox, oy) {
                    best = best.min((frame.centre(ox, oy) - here).norm());
                }
            }
        }
        best
    }

    proptest! {
        #[test]
        fn equals_brute_force(width in 1usize..24, height in 1usize..24, seeds in prop::collection::vec((0usize..24, 0usize..24), 1..12)) {
            let frame = GridFrame { origin_m: [-1.0, 2.0], cell_m: 0.05, width, height };
            let mut occupied = Grid::filled(frame, false);
            for (x, y) in seeds {
                occupied.set(x % width, y % height, true);
            }
            let field = DistanceField::new(&occupied);
            for y in 0..height {
                for x in 0..width {
                    let want = brute_force(&occupied, x, y);
                    prop_assert!((field.value(&frame.centre(x, y)) - want).abs() < 1e-5);
                }
            }
        }

        #[test]
        fn gradient_is_the_slope(px in 0.03..0.9f64, py in 0.03..0.9f64) {
            let frame = GridFrame { origin_m: [0.0, 0.0], cell_m: 0.05, width: 20, height: 20 };
            let mut occupied = Grid::filled(frame, false);
            for i in 0..20 {
                occupied.set(i, 3, true);
                occupied.set(5, i, true);
            }
            let field = DistanceField::new(&occupied);
            // Stay inside one bilinear patch: there the difference quotient is exact along an axis.
            let snap = |v: f64| ((v / 0.05 - 0.5).floor() + 0.5 + 0.4) * 0.05;
            let p = Point2::new(snap(px), snap(py));
            let (value, gradient) = field.value_and_gradient(&p);
            let h = 0.005;
            let dx = (field.value(&Point2::new(p.x + h, p.y)) - value) / h;
            let dy = (field.value(&Point2::new(p.x, p.y + h)) - value) / h;
            prop_assert!((gradient.x - dx).abs() < 1e-4 && (gradient.y - dy).abs() < 1e-4);
        }
    }

    #[test]
    fn outside_the_grid_the_way_there_counts() {
        let frame = GridFrame { origin_m: [0.0, 0.0], cell_m: 0.1, width: 5, height: 5 };
        let mut occupied = Grid::filled(frame, false);
        for y in 0..5 {
            occupied.set(4, y, true);
        }
        let field = DistanceField::new(&occupied);
        let (value, gradient) = field.value_and_gradient(&Point2::new(1.45, 0.25));
        assert!((value - 1.0).abs() < 1e-6, "{value}");
        assert!(gradient.x > 0.9);
    }
}
