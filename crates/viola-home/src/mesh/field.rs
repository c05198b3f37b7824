//! A sparse signed distance field of oriented points: moving least squares of their tangent planes (Kolluri,
//! "Provably good moving least squares", 2008).
//!
//! A corner of the grid sees only the points that face the same way as its nearest point. Both sides of a thin
//! wall would cancel otherwise.

use rayon::prelude::*;
use rustc_hash::FxHashMap;
use viola_reconstruct::CloudPoint;

/// Corners along a block's side.
pub const BLOCK: i32 = 8;
const CORNERS: usize = (BLOCK * BLOCK * BLOCK) as usize;
/// Radius of a point's influence, in grid steps. A cell on a surface has its far corners 1.73 steps away, which
/// must still see enough points.
const RADIUS: f32 = 2.5;

/// The field at one corner.
#[derive(Clone, Copy, Default)]
pub struct Sample {
    pub distance_m: f32,
    /// 0 without points.
    pub weight: f32,
    /// Mean of the points' normals.
    pub normal: [f32; 3],
}

/// The field at the corners of one block.
pub struct Block([Sample; CORNERS]);

/// Distances at the corners of a grid, near points only.
pub struct Field {
    pub step_m: f32,
    /// Sorted by key.
    pub blocks: Vec<([i32; 3], Block)>,
    index: FxHashMap<[i32; 3], u32>,
}

/// Returns the index of a corner in its block.
pub fn corner([x, y, z]: [i32; 3]) -> usize {
    let [x, y, z] = [x, y, z].map(|c| c.rem_euclid(BLOCK) as usize);
    x + BLOCK as usize * (y + BLOCK as usize * z)
}

pub fn block_of(corner: [i32; 3]) -> [i32; 3] {
    corner.map(|c| c.div_euclid(BLOCK))
}

impl Field {
    pub fn new(points: &[&CloudPoint], step_m: f32) -> Field {
        let mut touching: FxHashMap<[i32; 3], Vec<u32>> = FxHashMap::default();
        for (index, point) in points.iter().enumerate() {
            let [low, high] = corners_near(point, step_m).map(block_of);
            for z in low[2]..=high[2] {
                for y in low[1]..=high[1] {
                    for x in low[0]..=high[0] {
                        touching.entry([x, y, z]).or_default().push(index as u32);
                    }
                }
            }
        }
        let mut touching: Vec<_> = touching.into_iter().collect();
        touching.sort_unstable_by_key(|(key, _)| *key);
        let blocks: Vec<([i32; 3], Block)> = touching
            .par_iter()
            .map(|(key, touching)| (*key, Block::new(*key, touching, points, step_m)))
            .collect();
        let index = blocks.iter().enumerate().map(|(index, (key, _))| (*key, index as u32)).collect();
        Field { step_m, blocks, index }
    }

    pub fn block(&self, key: [i32; 3]) -> Option<u32> {
        self.index.get(&key).copied()
    }

    /// Returns the field at a corner; `None` far from all points.
    pub fn at(&self, place: [i32; 3]) -> Option<Sample> {
        let (_, block) = &self.blocks[self.block(block_of(place))? as usize];
        Some(block.0[corner(place)]).filter(|sample| sample.weight > 0.0)
    }
}

/// Returns the first and the last corner that a point reaches.
fn corners_near(point: &CloudPoint, step_m: f32) -> [[i32; 3]; 2] {
    let scaled = point.position_m.map(|c| c / step_m);
    [scaled.map(|c| (c - RADIUS).ceil() as i32), scaled.map(|c| (c + RADIUS).floor() as i32)]
}

impl Block {
    fn new(key: [i32; 3], touching: &[u32], points: &[&CloudPoint], step_m: f32) -> Block {
        let radius2_m2 = (RADIUS * step_m).powi(2);
        let mut nearest = [(f32::INFINITY, u32::MAX); CORNERS];
        for &index in touching {
            each_corner(key, points[index as usize], step_m, |at, offset_m| {
                let distance2 = dot(offset_m, offset_m);
                if distance2 < radius2_m2 && distance2 < nearest[at].0 {
                    nearest[at] = (distance2, index);
                }
            });
        }
        let mut samples = [Sample::default(); CORNERS];
        for &index in touching {
            let point = points[index as usize];
            each_corner(key, point, step_m, |at, offset_m| {
                let distance2 = dot(offset_m, offset_m);
                if distance2 >= radius2_m2 {
                    return;
                }
                let of_nearest = points[nearest[at].1 as usize];
                if dot(point.normal, of_nearest.normal) <= 0.0 {
                    return;
                }
                let weight = (1.0 - distance2 / radius2_m2).powi(2);
                let sample = &mut samples[at];
                sample.distance_m += weight * dot(point.normal, offset_m);
                sample.weight += weight;
                sample.normal.iter_mut().zip(point.normal).for_each(|(sum, c)| *sum += weight * c);
            });
        }
        for sample in samples.iter_mut().filter(|sample| sample.weight > 0.0) {
            sample.distance_m /= sample.weight;
            sample.normal = sample.normal.map(|c| c / sample.weight);
        }
        Block(samples)
    }
}

/// Calls back with each corner of the block near a point, and the corner's offset from the point.
fn each_corner(key: [i32; 3], point: &CloudPoint, step_m: f32, mut call: impl FnMut(usize, [f32; 3])) {
    let [low, high] = corners_near(point, step_m);
    let range = |axis: usize| {
        let first = key[axis] * BLOCK;
        low[axis].max(first)..=high[axis].min(first + BLOCK - 1)
    };
    for z in range(2) {
        for y in range(1) {
            for x in range(0) {
                let place = [x, y, z];
                let offset: [f32; 3] =
                    std::array::from_fn(|axis| place[axis] as f32 * step_m - point.position_m[axis]);
                call(corner(place), offset);
            }
        }
    }
}

pub fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
