//! Simplification by edge collapses in the order of quadric errors (Garland and Heckbert, "Surface simplification
//! using quadric error metrics", 1997). Borders of holes, colours and classes hold edges back.

use super::Mesh;
use nalgebra::Vector3;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// A step in colour from black to white, or into another class, counts as a step of this length.
const COLOUR_M: f64 = 0.02;
/// A border may move this many times less than a surface.
const BORDER: f64 = 20.0;
/// A collapse may turn a triangle by at most 60 degrees.
const MIN_COS: f64 = 0.5;

type V = Vector3<f64>;

/// A sum of squared distances to planes: x'Ax + 2b'x + c, with the six different members of A.
#[derive(Clone, Copy, Default)]
struct Quadric {
    a: [f64; 6],
    b: V,
    c: f64,
}

impl Quadric {
    fn of_plane(normal: &V, point: &V, weight: f64) -> Quadric {
        let d = -normal.dot(point);
        let [x, y, z] = [normal.x, normal.y, normal.z];
        Quadric {
            a: [x * x, x * y, x * z, y * y, y * z, z * z].map(|product| weight * product),
            b: normal * (weight * d),
            c: weight * d * d,
        }
    }

    fn add(&mut self, other: &Quadric) {
        self.a.iter_mut().zip(&other.a).for_each(|(a, b)| *a += b);
        self.b += other.b;
        self.c += other.c;
    }

    fn at(&self, p: &V) -> f64 {
        let [xx, xy, xz, yy, yz, zz] = self.a;
        let square = xx * p.x * p.x
            + yy * p.y * p.y
            + zz * p.z * p.z
            + 2.0 * (xy * p.x * p.y + xz * p.x * p.z + yz * p.y * p.z);
        (square + 2.0 * self.b.dot(p) + self.c).max(0.0)
    }
}

/// A possible collapse; the cheapest is the greatest. Its cost as bits, whose order is that of the costs, as none is
/// negative; its edge; and the versions of the two vertices when the cost was computed.
type Collapse = Reverse<(u64, [u32; 2], [u32; 2])>;

struct Simplifier<'a> {
    mesh: &'a mut Mesh,
    places: Vec<V>,
    quadrics: Vec<Quadric>,
    versions: Vec<u32>,
    /// Triangles at each vertex.
    at_vertex: Vec<Vec<u32>>,
    is_removed: Vec<bool>,
    left: usize,
    heap: BinaryHeap<Collapse>,
}

/// Reduces a mesh to at most `triangles`, as far as its topology allows.
pub fn simplify(mesh: &mut Mesh, triangles: usize) {
    if mesh.triangles.len() <= triangles {
        return;
    }
    let mut simplifier = Simplifier::new(mesh);
    simplifier.run(triangles);
    let is_removed = simplifier.is_removed;
    let mut kept = is_removed.iter().map(|removed| !removed);
    mesh.triangles.retain(|_| kept.next().unwrap_or(false));
    mesh.drop_unused_vertices();
}

impl<'a> Simplifier<'a> {
    fn new(mesh: &'a mut Mesh) -> Simplifier<'a> {
        let places: Vec<V> =
            mesh.vertices.iter().map(|vertex| V::from(vertex.position_m.map(f64::from))).collect();
        let mut at_vertex = vec![Vec::new(); places.len()];
        for (index, triangle) in mesh.triangles.iter().enumerate() {
            for vertex in triangle {
                at_vertex[*vertex as usize].push(index as u32);
            }
        }
        let mut simplifier = Simplifier {
            quadrics: vec![Quadric::default(); places.len()],
            versions: vec![0; places.len()],
            is_removed: vec![false; mesh.triangles.len()],
            left: mesh.triangles.len(),
            heap: BinaryHeap::new(),
            mesh,
            places,
            at_vertex,
        };
        simplifier.fill();
        simplifier
    }

    fn fill(&mut self) {
        for triangle in &self.mesh.triangles {
            let [a, b, c] = triangle.map(|vertex| self.places[vertex as usize]);
            let cross = (b - a).cross(&(c - a));
            let Some(normal) = cross.try_normalize(1e-12) else { continue };
            let quadric = Quadric::of_plane(&normal, &a, cross.norm() / 2.0);
            triangle.iter().for_each(|vertex| self.quadrics[*vertex as usize].add(&quadric));
        }
        for index in 0..self.mesh.triangles.len() {
            let triangle = self.mesh.triangles[index];
            for side in 0..3 {
                let [from, to] = [triangle[side], triangle[(side + 1) % 3]];
                let is_border = self.shared(from, to).count() == 1;
                if is_border {
                    self.hold_border(triangle, from, to);
                }
                if from < to || is_border {
                    self.propose(from, to);
                }
            }
        }
    }

    /// Adds the plane through a border edge, at a right angle to its triangle.
    fn hold_border(&mut self, triangle: [u32; 3], from: u32, to: u32) {
        let [a, b, c] = triangle.map(|vertex| self.places[vertex as usize]);
        let [p, q] = [from, to].map(|vertex| self.places[vertex as usize]);
        let Some(normal) = (b - a).cross(&(c - a)).cross(&(q - p)).try_normalize(1e-15) else { return };
        let quadric = Quadric::of_plane(&normal, &p, BORDER * (q - p).norm_squared());
        [from, to].iter().for_each(|vertex| self.quadrics[*vertex as usize].add(&quadric));
    }

    /// Returns the triangles that have a vertex.
    fn at(&self, vertex: u32) -> impl Iterator<Item = u32> {
        self.at_vertex[vertex as usize].iter().copied().filter(|index| !self.is_removed[*index as usize])
    }

    /// Returns the triangles that have both vertices.
    fn shared(&self, a: u32, b: u32) -> impl Iterator<Item = u32> {
        self.at(a).filter(move |index| self.mesh.triangles[*index as usize].contains(&b))
    }

    /// Returns the best of both ends and the middle, with its cost.
    fn best(&self, a: u32, b: u32) -> (f64, V, f64) {
        let [p, q] = [a, b].map(|vertex| self.places[vertex as usize]);
        let mut quadric = self.quadrics[a as usize];
        quadric.add(&self.quadrics[b as usize]);
        let step = self.mesh.vertices[a as usize].difference(&self.mesh.vertices[b as usize]);
        let look = (p - q).norm_squared() * (COLOUR_M * step).powi(2);
        let candidates = [(p, 0.0), (q, 1.0), ((p + q) / 2.0, 0.5)];
        let costs = candidates.map(|(place, fraction)| (quadric.at(&place) + look, place, fraction));
        costs.into_iter().min_by(|x, y| x.0.total_cmp(&y.0)).unwrap_or((f64::INFINITY, p, 0.0))
    }

    fn propose(&mut self, a: u32, b: u32) {
        let edge = [a.min(b), a.max(b)];
        let (cost, ..) = self.best(edge[0], edge[1]);
        let versions = edge.map(|vertex| self.versions[vertex as usize]);
        self.heap.push(Reverse((cost.to_bits(), edge, versions)));
    }

    fn run(&mut self, triangles: usize) {
        while self.left > triangles {
            let Some(Reverse((_, edge, versions))) = self.heap.pop() else { return };
            if versions != edge.map(|vertex| self.versions[vertex as usize]) {
                continue;
            }
            let [a, b] = edge;
            let (_, place, fraction) = self.best(a, b);
            if self.is_allowed(a, b, &place) {
                self.collapse(a, b, place, fraction);
            }
        }
    }

    fn neighbours(&self, vertex: u32) -> Vec<u32> {
        let triangles = self.at(vertex);
        let mut all: Vec<u32> = triangles.flat_map(|index| self.mesh.triangles[index as usize]).collect();
        all.sort_unstable();
        all.dedup();
        all.retain(|other| *other != vertex);
        all
    }

    /// Checks the link condition, and that no triangle turns over.
    fn is_allowed(&self, a: u32, b: u32, place: &V) -> bool {
        let (of_a, of_b) = (self.neighbours(a), self.neighbours(b));
        let common = of_a.iter().filter(|vertex| of_b.binary_search(vertex).is_ok()).count();
        if common != self.shared(a, b).count() {
            return false;
        }
        [(a, b), (b, a)].into_iter().all(|(moved, other)| {
            let is_staying = |index: &u32| !self.mesh.triangles[*index as usize].contains(&other);
            self.at(moved).filter(is_staying).all(|index| self.keeps_its_side(index, moved, place))
        })
    }

    fn keeps_its_side(&self, triangle: u32, moved: u32, place: &V) -> bool {
        let corners = self.mesh.triangles[triangle as usize];
        let normal = |at: &dyn Fn(u32) -> V| {
            let [a, b, c] = corners.map(at);
            (b - a).cross(&(c - a))
        };
        let before = normal(&|vertex| self.places[vertex as usize]);
        let after = normal(&|vertex| if vertex == moved { *place } else { self.places[vertex as usize] });
        before.dot(&after) > MIN_COS * before.norm() * after.norm()
    }

    /// Moves `a` to its new place and puts it wherever `b` was.
    fn collapse(&mut self, a: u32, b: u32, place: V, fraction: f64) {
        let gone: Vec<u32> = self.shared(a, b).collect();
        for index in &gone {
            self.is_removed[*index as usize] = true;
        }
        self.left -= gone.len();
        let of_b = std::mem::take(&mut self.at_vertex[b as usize]);
        for index in of_b.into_iter().filter(|index| !self.is_removed[*index as usize]) {
            let triangle = &mut self.mesh.triangles[index as usize];
            triangle.iter_mut().filter(|vertex| **vertex == b).for_each(|vertex| *vertex = a);
            self.at_vertex[a as usize].push(index);
        }
        let is_removed = &self.is_removed;
        self.at_vertex[a as usize].retain(|index| !is_removed[*index as usize]);
        let of_b = self.quadrics[b as usize];
        self.quadrics[a as usize].add(&of_b);
        self.places[a as usize] = place;
        let vertex = self.mesh.vertices[a as usize].towards(&self.mesh.vertices[b as usize], fraction as f32);
        self.mesh.vertices[a as usize] =
            super::Vertex { position_m: [place.x as f32, place.y as f32, place.z as f32], ..vertex };
        self.versions[a as usize] += 1;
        self.versions[b as usize] += 1;
        for other in self.neighbours(a) {
            self.propose(a, other);
        }
    }
}
