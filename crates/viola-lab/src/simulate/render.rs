//! Rendering of depth pictures: the first surface of every pixel.
//!
//! Pixels of a tile see similar solids, so each solid's transform is computed once per tile row, for sixteen
//! adjacent pixels at a time. Solids are sorted by distance; a tile ends when the next solid is behind
//! everything seen.

use super::scene::{Primitive, Scene};
use super::solid::{CUSHION_RADIUS, Shape};
use nalgebra::Matrix3;
use rayon::prelude::*;
use viola_geometry::{Pinhole, Pose3, Vector3};

/// Side of a tile in pixels.
const TILE: usize = 16;
/// Near plane, in metres along z.
const NEAR_M: f64 = 0.02;
/// Value of [`View::solid`] for pixels without a surface.
pub const NOTHING: u32 = u32::MAX;

/// Noise-free view of a camera, row-major from the top.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    pub width: usize,
    pub height: usize,
    /// Along z, in metres; infinite without a surface.
    pub depth_m: Vec<f32>,
    /// Index of the solid in the scene, or [`NOTHING`].
    pub solid: Vec<u32>,
}

/// A solid in one camera's view.
struct Candidate {
    index: u32,
    shape: Shape,
    /// Camera position in the unit shape's frame.
    origin: [f32; 3],
    /// Direction of pixel (0, 0), and its change per column and per row.
    corner: [f32; 3],
    right: [f32; 3],
    down: [f32; 3],
    nearest_m: f32,
    /// Range of columns and rows that may see it.
    columns: [usize; 2],
    rows: [usize; 2],
}

/// Renders the view of `camera` from a pose. Glass is a surface like any other.
pub fn render(scene: &Scene, camera: &Pinhole, home_from_camera: &Pose3) -> View {
    render_where(scene, camera, home_from_camera, |_| true)
}

/// Renders the solids that count.
pub(super) fn render_where(
    scene: &Scene,
    camera: &Pinhole,
    home_from_camera: &Pose3,
    counts: impl Fn(&Primitive) -> bool,
) -> View {
    let (width, height) = (camera.width as usize, camera.height as usize);
    let mut candidates: Vec<Candidate> = scene
        .primitives
        .iter()
        .enumerate()
        .filter(|(_, primitive)| counts(primitive))
        .filter_map(|(index, primitive)| candidate(index as u32, primitive, camera, home_from_camera))
        .collect();
    candidates.sort_by(|a, b| a.nearest_m.total_cmp(&b.nearest_m).then(a.index.cmp(&b.index)));
    let mut view = View {
        width,
        height,
        depth_m: vec![f32::INFINITY; width * height],
        solid: vec![NOTHING; width * height],
    };
    let rows_of_tiles =
        view.depth_m.par_chunks_mut(TILE * width).zip(view.solid.par_chunks_mut(TILE * width));
    rows_of_tiles.enumerate().for_each(|(row, (depth, solid))| {
        let top = row * TILE;
        let bottom = (top + TILE).min(height);
        let here: Vec<&Candidate> =
            candidates.iter().filter(|c| c.rows[0] < bottom && c.rows[1] > top).collect();
        for left in (0..width).step_by(TILE) {
            let mut tile = Tile::new();
            tile.trace(&here, left, top, bottom);
            let used = TILE.min(width - left);
            for y in 0..bottom - top {
                let at = y * width + left;
                depth[at..at + used].copy_from_slice(&tile.depth[y][..used]);
                solid[at..at + used].copy_from_slice(&tile.solid[y][..used]);
            }
        }
    });
    view
}

fn candidate(
    index: u32,
    primitive: &Primitive,
    camera: &Pinhole,
    home_from_camera: &Pose3,
) -> Option<Candidate> {
    let turn: Matrix3<f64> = *home_from_camera.rotation.to_rotation_matrix().matrix();
    let eye = home_from_camera.translation.vector;
    let camera_from_unit = turn.transpose() * primitive.home_from_unit;
    let centre = turn.transpose() * (primitive.centre.coords - eye);
    let bounds = screen_bounds(&camera_from_unit, &centre, camera)?;
    let unit_from_camera = primitive.unit_from_home * turn;
    let origin = primitive.unit_from_home * (eye - primitive.centre.coords);
    let right = unit_from_camera.column(0) / camera.fx;
    let down = unit_from_camera.column(1) / camera.fy;
    let corner = unit_from_camera.column(2) - right * camera.cx - down * camera.cy;
    let narrow = |v: Vector3| [v.x as f32, v.y as f32, v.z as f32];
    let pixels = |low: f64, high: f64, count: u32| {
        [
            low.floor().clamp(0.0, f64::from(count)) as usize,
            (high.ceil() + 1.0).clamp(0.0, f64::from(count)) as usize,
        ]
    };
    let columns = pixels(bounds.left, bounds.right, camera.width);
    let rows = pixels(bounds.top, bounds.bottom, camera.height);
    if columns[0] >= columns[1] || rows[0] >= rows[1] {
        return None;
    }
    Some(Candidate {
        index,
        shape: primitive.shape,
        origin: narrow(origin),
        corner: narrow(corner),
        right: narrow(right),
        down: narrow(down),
        nearest_m: bounds.nearest_m as f32,
        columns,
        rows,
    })
}

struct Bounds {
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
    nearest_m: f64,
}

/// Returns the image rectangle of a box, clipped at the near plane; none if it is entirely behind.
fn screen_bounds(camera_from_unit: &Matrix3<f64>, centre: &Vector3, camera: &Pinhole) -> Option<Bounds> {
    let corner = |k: usize| {
        let sign = |bit: usize| if k >> bit & 1 == 1 { 1.0 } else { -1.0 };
        centre + camera_from_unit * Vector3::new(sign(0), sign(1), sign(2))
    };
    let corners: [Vector3; 8] = std::array::from_fn(corner);
    let mut bounds =
        Bounds { left: f64::MAX, right: f64::MIN, top: f64::MAX, bottom: f64::MIN, nearest_m: f64::MAX };
    let mut include = |p: &Vector3| {
        let (u, v) = (camera.fx * p.x / p.z + camera.cx, camera.fy * p.y / p.z + camera.cy);
        bounds.left = bounds.left.min(u);
        bounds.right = bounds.right.max(u);
        bounds.top = bounds.top.min(v);
        bounds.bottom = bounds.bottom.max(v);
        bounds.nearest_m = bounds.nearest_m.min(p.z);
    };
    let mut seen = false;
    for (k, p) in corners.iter().enumerate() {
        if p.z >= NEAR_M {
            include(p);
            seen = true;
            continue;
        }
        for bit in 0..3 {
            let q = &corners[k ^ (1 << bit)];
            if q.z > NEAR_M {
                let fraction = (NEAR_M - p.z) / (q.z - p.z);
                let mut cut = p + (q - p) * fraction;
                cut.z = NEAR_M;
                include(&cut);
                seen = true;
            }
        }
    }
    seen.then_some(bounds)
}

type Lanes = [f32; TILE];

struct Tile {
    depth: [Lanes; TILE],
    solid: [[u32; TILE]; TILE],
}

impl Tile {
    fn new() -> Tile {
        Tile { depth: [[f32::INFINITY; TILE]; TILE], solid: [[NOTHING; TILE]; TILE] }
    }

    fn trace(&mut self, candidates: &[&Candidate], left: usize, top: usize, bottom: usize) {
        let mut farthest = f32::INFINITY;
        for candidate in candidates {
            if candidate.nearest_m >= farthest {
                break;
            }
            if candidate.columns[0] >= left + TILE || candidate.columns[1] <= left {
                continue;
            }
            let (from, to) = (candidate.rows[0].max(top), candidate.rows[1].min(bottom));
            for y in from..to {
                let row = y - top;
                candidate.trace_row(left, y, &mut self.depth[row], &mut self.solid[row]);
            }
            farthest = 0.0;
            for row in &self.depth[..bottom - top] {
                for &depth in row {
                    farthest = if depth > farthest { depth } else { farthest };
                }
            }
        }
    }
}

fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Returns the interval of a ray inside the unit block.
#[inline(always)]
fn slabs(&[ox, oy, oz]: &[f32; 3], [dx, dy, dz]: [f32; 3]) -> (f32, f32) {
    let (ix, iy, iz) = (1.0 / dx, 1.0 / dy, 1.0 / dz);
    let (x0, x1) = ((-1.0 - ox) * ix, (1.0 - ox) * ix);
    let (y0, y1) = ((-1.0 - oy) * iy, (1.0 - oy) * iy);
    let (z0, z1) = ((-1.0 - oz) * iz, (1.0 - oz) * iz);
    let enter = max(max(min(x0, x1), min(y0, y1)), min(z0, z1));
    (enter, min(min(max(x0, x1), max(y0, y1)), max(z0, z1)))
}

/// Returns the interval of a ray inside a ball about the origin; one that ends before it begins is empty.
#[inline(always)]
fn ball(&[ox, oy, oz]: &[f32; 3], [dx, dy, dz]: [f32; 3], radius: f32) -> (f32, f32) {
    let c = ox * ox + oy * oy + oz * oz - radius * radius;
    let a = dx * dx + dy * dy + dz * dz;
    let b = ox * dx + oy * dy + oz * dz;
    let square = b * b - a * c;
    let root = max(square, 0.0).sqrt();
    let ia = 1.0 / a;
    ((-b - root) * ia, if square < 0.0 { -1.0 } else { (-b + root) * ia })
}

impl Candidate {
    fn trace_row(&self, left: usize, y: usize, depth: &mut Lanes, solid: &mut [u32; TILE]) {
        let start: [f32; 3] =
            std::array::from_fn(|k| self.corner[k] + self.right[k] * left as f32 + self.down[k] * y as f32);
        let mut dx = [0f32; TILE];
        let mut dy = [0f32; TILE];
        let mut dz = [0f32; TILE];
        for lane in 0..TILE {
            let step = lane as f32;
            dx[lane] = start[0] + self.right[0] * step;
            dy[lane] = start[1] + self.right[1] * step;
            dz[lane] = start[2] + self.right[2] * step;
        }
        let mut enter = [0f32; TILE];
        let mut leave = [0f32; TILE];
        let [ox, oy, oz] = self.origin;
        match self.shape {
            Shape::Block => {
                for lane in 0..TILE {
                    (enter[lane], leave[lane]) = slabs(&self.origin, [dx[lane], dy[lane], dz[lane]]);
                }
            }
            Shape::Cylinder => {
                let c = ox * ox + oy * oy - 1.0;
                for lane in 0..TILE {
                    let a = dx[lane] * dx[lane] + dy[lane] * dy[lane];
                    let b = ox * dx[lane] + oy * dy[lane];
                    let square = b * b - a * c;
                    let root = max(square, 0.0).sqrt();
                    let (ia, iz) = (1.0 / a, 1.0 / dz[lane]);
                    let (z0, z1) = ((-1.0 - oz) * iz, (1.0 - oz) * iz);
                    enter[lane] = max((-b - root) * ia, min(z0, z1));
                    let out = min((-b + root) * ia, max(z0, z1));
                    leave[lane] = if square < 0.0 { -1.0 } else { out };
                }
            }
            Shape::Mesh(model) => {
                for lane in 0..TILE {
                    let toward = [dx[lane], dy[lane], dz[lane]];
                    let (from, to) = slabs(&self.origin, toward);
                    enter[lane] = f32::INFINITY;
                    if from <= to && to > NEAR_M as f32 && from < depth[lane] {
                        let wide = |v: [f32; 3]| Vector3::from(v.map(f64::from));
                        let hit = model.cast(&wide(self.origin), &wide(toward), f64::from(depth[lane]));
                        enter[lane] = hit.map_or(f32::INFINITY, |t| t as f32);
                    }
                    leave[lane] = enter[lane];
                }
            }
            Shape::Ball => {
                for lane in 0..TILE {
                    (enter[lane], leave[lane]) = ball(&self.origin, [dx[lane], dy[lane], dz[lane]], 1.0);
                }
            }
            Shape::Cushion => {
                let radius = CUSHION_RADIUS as f32;
                for lane in 0..TILE {
                    let toward = [dx[lane], dy[lane], dz[lane]];
                    let ((b0, b1), (r0, r1)) =
                        (slabs(&self.origin, toward), ball(&self.origin, toward, radius));
                    enter[lane] = max(b0, r0);
                    leave[lane] = min(b1, r1);
                }
            }
        }
        for lane in 0..TILE {
            let t = enter[lane];
            let hit = (t <= leave[lane]) & (t > NEAR_M as f32) & (t < depth[lane]);
            depth[lane] = if hit { t } else { depth[lane] };
            solid[lane] = if hit { self.index } else { solid[lane] };
        }
    }
}
