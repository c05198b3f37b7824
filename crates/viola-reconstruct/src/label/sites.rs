//! The places of a clip that get a class: one for each voxel of its fused surface.

use crate::cloud::PointCloud;
use rayon::prelude::*;
use rustc_hash::FxHashMap;
use viola_geometry::{Point3, Pose3, Vector3};

/// Sites, one for each voxel, with the means of its points.
#[derive(Debug, Clone, Default)]
pub(super) struct Sites {
    pub(super) positions_m: Vec<Point3>,
    /// Mean of the points' normals, unit length.
    pub(super) normals: Vec<Vector3>,
    /// Mean of the normals of the sites around, unit length ...
    pub(super) smooth_normals: Vec<Vector3>,
    /// ... and the length of that mean: 1 on a plane, less on bent or rough surface.
    pub(super) flatness: Vec<f64>,
    /// Pairs of sites in touching voxels, the lower index first.
    pub(super) neighbours: Vec<[u32; 2]>,
    /// The site of each point of the cloud.
    pub(super) of_point: Vec<u32>,
    pub(super) voxel_m: f64,
}

impl Sites {
    /// Returns the sites in the frame of the cloud, in the order of its points.
    pub(super) fn new(cloud: &PointCloud) -> Sites {
        let voxel_m = cloud.voxel_m.max(1e-3);
        let mut index: FxHashMap<[i32; 3], u32> = FxHashMap::default();
        let mut keys: Vec<[i32; 3]> = Vec::new();
        let mut sums: Vec<(Vector3, Vector3, f64)> = Vec::new();
        let of_point = cloud.points.iter().map(|point| {
            let at = point.position();
            let key = [at.x, at.y, at.z].map(|c| (c / voxel_m).floor() as i32);
            let site = *index.entry(key).or_insert_with(|| {
                keys.push(key);
                sums.push((Vector3::zeros(), Vector3::zeros(), 0.0));
                sums.len() as u32 - 1
            });
            let (position, normal, count) = &mut sums[site as usize];
            *position += at.coords;
            *normal += point.normal();
            *count += 1.0;
            site
        });
        let of_point = of_point.collect();
        let positions_m = sums.iter().map(|(sum, _, count)| Point3::from(sum / *count)).collect();
        let normals: Vec<Vector3> =
            sums.iter().map(|(_, sum, _)| sum.try_normalize(1e-9).unwrap_or(Vector3::z())).collect();
        drop(index);
        let neighbours = touching(&keys);
        let (smooth_normals, flatness) = smooth(&normals, &neighbours);
        Sites { positions_m, normals, smooth_normals, flatness, neighbours, of_point, voxel_m }
    }

    pub(super) fn len(&self) -> usize {
        self.positions_m.len()
    }

    /// Transforms the sites to another frame.
    pub(super) fn transform(&mut self, to_from_this: &Pose3) {
        self.positions_m.iter_mut().for_each(|p| *p = to_from_this * *p);
        for normals in [&mut self.normals, &mut self.smooth_normals] {
            normals.iter_mut().for_each(|n| *n = to_from_this * *n);
        }
    }

    /// Returns the area of a number of sites. A slanted surface crosses more voxels than a level one; the
    /// factor lies halfway and is within a quarter of either.
    pub(super) fn area_m2(&self, sites: usize) -> f64 {
        0.8 * sites as f64 * self.voxel_m * self.voxel_m
    }
}

/// Half of the 26 voxels around, the other half finds this one: the next of its row, and of four rows those beside it.
const HALF: usize = 13;
/// Steps along y and z to the four rows.
const ROWS: [[i32; 2]; 4] = [[1, 0], [-1, 1], [0, 1], [1, 1]];

/// Returns all pairs of touching voxels, each once, by sites and then by z, y and x of the steps.
fn touching(keys: &[[i32; 3]]) -> Vec<[u32; 2]> {
    let mut sorted: Vec<([i32; 3], u32)> =
        keys.iter().zip(0..).map(|([x, y, z], site)| ([*z, *y, *x], site)).collect();
    sorted.par_sort_unstable();
    let mut found = vec![[u32::MAX; HALF]; keys.len()];
    for (at, (place, site)) in sorted.iter().enumerate() {
        let next = [place[0], place[1], place[2] + 1];
        if let Some((_, other)) = sorted.get(at + 1).filter(|(place, _)| *place == next) {
            found[*site as usize][0] = *other;
        }
    }
    for (row, [dy, dz]) in ROWS.into_iter().enumerate() {
        // Both sides are in the same order, so the start moves forward only.
        let mut from = 0;
        for ([z, y, x], site) in &sorted {
            let first = [z + dz, y + dy, x - 1];
            from += sorted[from..].iter().take_while(|(place, _)| *place < first).count();
            for ([other_z, other_y, other_x], other) in sorted[from..].iter().take(3) {
                if [*other_z, *other_y] == first[..2] && *other_x <= x + 1 {
                    found[*site as usize][1 + 3 * row + (other_x - first[2]) as usize] = *other;
                }
            }
        }
    }
    let mut pairs = Vec::with_capacity(keys.len() * 5);
    for (site, others) in (0..).zip(found) {
        let others = others.into_iter().filter(|other| *other != u32::MAX);
        pairs.extend(others.map(|other: u32| [other.min(site), other.max(site)]));
    }
    pairs
}

/// Averages the normals over touching sites twice, which is about two voxels around.
fn smooth(normals: &[Vector3], neighbours: &[[u32; 2]]) -> (Vec<Vector3>, Vec<f64>) {
    let mut means = normals.to_vec();
    for _ in 0..2 {
        let mut sums = means.clone();
        let mut counts = vec![1.0f64; means.len()];
        for &[a, b] in neighbours {
            let (a, b) = (a as usize, b as usize);
            sums[a] += means[b];
            sums[b] += means[a];
            counts[a] += 1.0;
            counts[b] += 1.0;
        }
        for ((mean, sum), count) in means.iter_mut().zip(sums).zip(counts) {
            *mean = sum / count;
        }
    }
    let flatness = means.iter().map(|mean| mean.norm()).collect();
    for (mean, normal) in means.iter_mut().zip(normals) {
        *mean = mean.try_normalize(1e-6).unwrap_or(*normal);
    }
    (means, flatness)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn all_touching_voxels_are_pairs(keys in prop::collection::hash_set(prop::array::uniform3(-3..3i32), 0..80)) {
            let keys: Vec<[i32; 3]> = keys.into_iter().collect();
            let mut want = Vec::new();
            for (site, [x, y, z]) in (0..).zip(&keys) {
                for step in 14..27 {
                    let place = [x + step % 3 - 1, y + step / 3 % 3 - 1, z + step / 9 - 1];
                    let other = keys.iter().position(|key| *key == place);
                    want.extend(other.map(|other| [site.min(other as u32), site.max(other as u32)]));
                }
            }
            prop_assert_eq!(touching(&keys), want);
        }
    }
}
