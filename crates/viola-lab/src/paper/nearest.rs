//! Exact nearest-neighbour search among the map's points.

use viola_geometry::Point2;

/// A quadtree whose leaves hold every point that is nearest to some position in the leaf.
///
/// A square drops a point if another one is nearer everywhere in it: if the point's smallest distance to the
/// square exceeds the other's largest. Small squares keep few points, so a query is one descent and a few
/// distances.
pub struct Nearest {
    points_m: Vec<Point2>,
    nodes: Vec<Node>,
    /// The leaves' points, one leaf after the other.
    leaves: Vec<u32>,
    centre_m: Point2,
    half_m: f64,
}

#[derive(Clone, Copy)]
enum Node {
    /// Index of the first of four children, in the order (low, low), (high, low), (low, high), (high, high).
    Inner(u32),
    Leaf {
        first: u32,
        count: u32,
    },
}

/// Squares with at most this many points are not split ...
const FEW: usize = 4;
/// ... nor are squares of this half side.
const SMALL_M: f64 = 0.01;
/// Margin around the points as a fraction of their extent: clips extend beyond the map.
const ROOM: f64 = 0.5;

impl Nearest {
    /// # Panics
    /// If `points_m` is empty.
    pub fn new(points_m: &[Point2]) -> Nearest {
        let (mut min, mut max) = (points_m[0], points_m[0]);
        for p in points_m {
            min = Point2::new(min.x.min(p.x), min.y.min(p.y));
            max = Point2::new(max.x.max(p.x), max.y.max(p.y));
        }
        let centre_m = nalgebra::center(&min, &max);
        let half_m = (0.5 + ROOM) * (max - min).max() + 1.0;
        let mut tree =
            Nearest { points_m: points_m.to_vec(), nodes: Vec::new(), leaves: Vec::new(), centre_m, half_m };
        tree.nodes.push(Node::Inner(0));
        tree.fill(0, centre_m, half_m, &(0..points_m.len() as u32).collect::<Vec<_>>());
        tree
    }

    fn fill(&mut self, node: usize, centre: Point2, half_m: f64, from: &[u32]) {
        let away = |i: &u32| (self.points_m[*i as usize] - centre).abs();
        let largest = |i: &u32| away(i).add_scalar(half_m).norm_squared();
        let smallest = |i: &u32| away(i).map(|d| f64::max(d - half_m, 0.0)).norm_squared();
        let bound = from.iter().map(largest).fold(f64::INFINITY, f64::min);
        let kept: Vec<u32> = from.iter().copied().filter(|i| smallest(i) <= bound).collect();
        if kept.len() <= FEW || half_m <= SMALL_M {
            self.nodes[node] = Node::Leaf { first: self.leaves.len() as u32, count: kept.len() as u32 };
            self.leaves.extend(kept);
            return;
        }
        let child = self.nodes.len();
        self.nodes[node] = Node::Inner(child as u32);
        self.nodes.extend([Node::Inner(0); 4]);
        let half_m = 0.5 * half_m;
        for quarter in 0..4 {
            let side = |high: bool| if high { half_m } else { -half_m };
            let centre = Point2::new(centre.x + side(quarter & 1 == 1), centre.y + side(quarter & 2 == 2));
            self.fill(child + quarter, centre, half_m, &kept);
        }
    }

    /// Returns the nearest point; the first of several at the same distance.
    pub fn nearest(&self, to: &Point2) -> Point2 {
        let away = (to - self.centre_m).abs();
        if !(away.x < self.half_m && away.y < self.half_m) {
            return closest(to, self.points_m.iter());
        }
        let (mut centre, mut half_m) = (self.centre_m, self.half_m);
        let mut node = self.nodes[0];
        loop {
            match node {
                Node::Leaf { first, count } => {
                    let leaf = &self.leaves[first as usize..(first + count) as usize];
                    return closest(to, leaf.iter().map(|i| &self.points_m[*i as usize]));
                }
                Node::Inner(child) => {
                    half_m *= 0.5;
                    let (right, upper) = (to.x >= centre.x, to.y >= centre.y);
                    centre.x += if right { half_m } else { -half_m };
                    centre.y += if upper { half_m } else { -half_m };
                    node = self.nodes[child as usize + usize::from(right) + 2 * usize::from(upper)];
                }
            }
        }
    }

    pub fn distance_m(&self, to: &Point2) -> f64 {
        (self.nearest(to) - to).norm()
    }
}

fn closest<'a>(to: &Point2, among: impl Iterator<Item = &'a Point2>) -> Point2 {
    let mut best = (f64::INFINITY, *to);
    for point in among {
        let distance_m2 = (point - to).norm_squared();
        if distance_m2 < best.0 {
            best = (distance_m2, *point);
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn equals_looking_at_every_point(
            points in prop::collection::vec((-3.0..3.0f64, -2.0..5.0f64), 1..80),
            queries in prop::collection::vec((-20.0..20.0f64, -20.0..20.0f64), 40),
        ) {
            let points: Vec<Point2> = points.into_iter().map(|(x, y)| Point2::new(x, y)).collect();
            let tree = Nearest::new(&points);
            for (x, y) in queries {
                // Far queries, and near ones in small leaves.
                for scale in [1.0, 0.1] {
                    let query = Point2::new(x * scale, y * scale);
                    let want = points.iter().map(|p| (p - query).norm()).fold(f64::INFINITY, f64::min);
                    prop_assert!((tree.distance_m(&query) - want).abs() < 1e-12);
                }
            }
        }
    }
}
