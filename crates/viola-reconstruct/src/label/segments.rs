//! Graph-based segmentation of the surface: internal variation below the boundary's (Felzenszwalb and
//! Huttenlocher, 2004). The weight of an edge is the bend between two sites.

use super::sites::Sites;
use rayon::prelude::*;
use viola_geometry::groups;

/// Scale of the threshold; a larger value gives larger segments.
const SCALE: f64 = 0.05;
/// Minimum size; smaller segments join the neighbour with the least bend.
const MIN_SITES: u32 = 40;

/// Returns the segment of each site, numbered from 0 in the order of their first sites.
pub(super) fn segments(sites: &Sites) -> Vec<u32> {
    let mut edges: Vec<Edge> = sites.neighbours.par_iter().map(|pair| Edge::new(*pair, sites)).collect();
    edges.par_sort_unstable();
    let mut forest = Forest::new(sites.len());
    for edge in &edges {
        let ([a, b], weight) = (edge.sites().map(|site| forest.root(site)), edge.weight());
        if a != b && f64::from(weight) <= forest.bound(a).min(forest.bound(b)) {
            forest.join(a, b, weight);
        }
    }
    for edge in &edges {
        let [a, b] = edge.sites().map(|site| forest.root(site));
        if a != b && forest.size[a as usize].min(forest.size[b as usize]) < MIN_SITES {
            forest.join(a, b, edge.weight());
        }
    }
    let mut number = vec![u32::MAX; sites.len()];
    let mut next = 0;
    (0..sites.len() as u32)
        .map(|site| {
            let own = &mut number[forest.root(site) as usize];
            if *own == u32::MAX {
                *own = next;
                next += 1;
            }
            *own
        })
        .collect()
}

/// A pair of neighbours and the bend between them. One number, which is sorted fast: the bits of the bend, then those of the
/// sites. Floats that are not negative have the order of their bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Edge(u128);

impl Edge {
    fn new([a, b]: [u32; 2], sites: &Sites) -> Edge {
        let dot = sites.smooth_normals[a as usize].dot(&sites.smooth_normals[b as usize]);
        let bend = (1.0 - dot).max(0.0) as f32;
        Edge(u128::from(bend.to_bits()) << 64 | u128::from(a) << 32 | u128::from(b))
    }

    fn weight(self) -> f32 {
        f32::from_bits((self.0 >> 64) as u32)
    }

    fn sites(self) -> [u32; 2] {
        [(self.0 >> 32) as u32, self.0 as u32]
    }
}

struct Forest {
    parent: Vec<u32>,
    size: Vec<u32>,
    /// Internal variation: the largest bend that was joined.
    inner: Vec<f32>,
}

impl Forest {
    fn new(count: usize) -> Forest {
        Forest { parent: (0..count as u32).collect(), size: vec![1; count], inner: vec![0.0; count] }
    }

    fn root(&mut self, at: u32) -> u32 {
        groups::root(&mut self.parent, at)
    }

    fn bound(&self, root: u32) -> f64 {
        f64::from(self.inner[root as usize]) + SCALE / f64::from(self.size[root as usize])
    }

    fn join(&mut self, a: u32, b: u32, weight: f32) {
        let (large, small) = if self.size[a as usize] >= self.size[b as usize] { (a, b) } else { (b, a) };
        self.parent[small as usize] = large;
        self.size[large as usize] += self.size[small as usize];
        self.inner[large as usize] = weight;
    }
}
