//! Fusion of the points of several clips in voxels.

use super::tile::TileKey;
use crate::{MAP_VOXEL_M, MapPoint};
use rustc_hash::FxHashMap;
use viola_geometry::Vector3;
use viola_geometry::taxonomy::Class;
use viola_reconstruct::{CloudPoint, Label};

/// Minimum weight of a voxel: one reading from 4 m. Further away depth errors exceed a voxel.
const LEAST_WEIGHT: i64 = 16;
/// Maximum weight of a point: eight readings from 1 m. Readings of one recording have correlated errors.
const MOST_WEIGHT: u16 = 2_048;

/// Sums of one voxel. Integers, so that they do not depend on the order.
#[derive(Debug, Clone, Default)]
struct Voxel {
    weight: i64,
    points: i64,
    /// In 0.01 mm from the voxel's corner.
    position: [i64; 3],
    /// In thousandths.
    normal: [i64; 3],
    color: [i64; 3],
    /// Sums of probabilities, in 255ths, of the classes seen.
    classes: Vec<(Class, i64)>,
    views: i64,
    /// Clip with the largest weight so far, and the current clip: clips are added one after the other.
    most: (u16, i64),
    now: (u16, i64),
}

/// Voxels of one tile under construction. Clips are added one after the other, in the map's order.
#[derive(Debug, Clone)]
pub(crate) struct Voxels {
    side_m: f64,
    voxels: FxHashMap<[i32; 3], Voxel>,
}

/// Returns the voxel that contains a point in the map's frame.
fn voxel_of(position_m: &[f32; 3], side_m: f64) -> [i32; 3] {
    position_m.map(|c| (f64::from(c) / side_m).floor() as i32)
}

impl Voxels {
    pub fn new(side_m: f64) -> Voxels {
        Voxels { side_m, voxels: FxHashMap::default() }
    }

    pub fn add(&mut self, point: &CloudPoint, clip: u16) {
        let key = voxel_of(&point.position_m, self.side_m);
        let voxel = self.voxels.entry(key).or_default();
        let weight = i64::from(point.weight.clamp(1, MOST_WEIGHT));
        voxel.weight += weight;
        voxel.points += 1;
        voxel.views += i64::from(point.label.views);
        for (axis, corner) in key.iter().enumerate() {
            let within_m = f64::from(point.position_m[axis]) - f64::from(*corner) * self.side_m;
            voxel.position[axis] += weight * (within_m * 1e5).round() as i64;
            voxel.normal[axis] += weight * (f64::from(point.normal[axis]) * 1e3).round() as i64;
            voxel.color[axis] += weight * i64::from(point.color[axis]);
        }
        let share = (point.label.probability() * 255.0).round() as i64;
        match voxel.classes.iter_mut().find(|(class, _)| *class == point.label.class) {
            Some((_, sum)) => *sum += share,
            None => voxel.classes.push((point.label.class, share)),
        }
        if voxel.now.0 != clip {
            voxel.now = (clip, 0);
        }
        voxel.now.1 += weight;
        if voxel.now.1 > voxel.most.1 {
            voxel.most = voxel.now;
        }
    }

    /// Returns one point per voxel, in voxel order, without voxels below `LEAST_WEIGHT`.
    pub fn into_points(self) -> Vec<MapPoint> {
        let well = self.voxels.into_iter().filter(|(_, voxel)| voxel.weight >= LEAST_WEIGHT);
        let mut voxels: Vec<([i32; 3], Voxel)> = well.collect();
        voxels.sort_unstable_by_key(|(key, _)| *key);
        let point = |(key, voxel): &([i32; 3], Voxel)| MapPoint {
            point: voxel.point(key, self.side_m),
            clip: voxel.most.0,
        };
        voxels.iter().map(point).collect()
    }
}

impl Voxel {
    fn point(&self, key: &[i32; 3], side_m: f64) -> CloudPoint {
        let mean = |sum: i64| sum as f64 / self.weight as f64;
        let position_m =
            [0, 1, 2].map(|axis| (f64::from(key[axis]) * side_m + mean(self.position[axis]) * 1e-5) as f32);
        let normal = Vector3::from(self.normal.map(|sum| sum as f64)).try_normalize(1e-9);
        let normal = normal.unwrap_or(Vector3::z());
        // Ties go to the lower class id: the list is in order of arrival.
        let best = self.classes.iter().max_by_key(|(class, sum)| (*sum, std::cmp::Reverse(class.id())));
        let label = match best {
            Some((class, sum)) if *sum > 0 => {
                // Mean probability of this class over all points.
                let probability = *sum as f64 / (255.0 * self.points as f64);
                let views = (self.views as f64 / self.points as f64).round().min(f64::from(u16::MAX)) as u16;
                Label::new(*class, probability as f32, views)
            }
            _ => Label::NONE,
        };
        CloudPoint {
            position_m,
            normal: [normal.x as f32, normal.y as f32, normal.z as f32],
            color: self.color.map(|sum| mean(sum).round() as u8),
            label,
            weight: self.weight.min(i64::from(u16::MAX)) as u16,
        }
    }
}

/// Returns the tile that contains a point in the map's frame.
pub(super) fn tile_of(position_m: &[f32; 3]) -> TileKey {
    TileKey::of_voxel(&voxel_of(position_m, MAP_VOXEL_M))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(x: f32, class: Class, probability: f32, weight: u16, red: u8) -> CloudPoint {
        CloudPoint {
            position_m: [x, 0.01, 0.01],
            normal: [0.0, 0.0, 1.0],
            color: [red, 0, 0],
            label: Label::new(class, probability, 1),
            weight,
        }
    }

    #[test]
    fn points_of_one_voxel_agree_by_weight() {
        let mut voxels = Voxels::new(MAP_VOXEL_M);
        voxels.add(&point(0.010, Class::Chair, 0.6, 50, 10), 0);
        voxels.add(&point(0.020, Class::Table, 0.5, 100, 20), 3);
        voxels.add(&point(0.012, Class::Table, 0.4, 50, 30), 5);
        let points = voxels.into_points();
        assert_eq!(points.len(), 1);
        let seen = &points[0];
        // By hand: (10 + 2 * 20 + 12) / 4 = 15.5 mm, (10 + 2 * 20 + 30) / 4 = 20, (0.5 + 0.4) / 3 = 0.3.
        assert!((seen.point.position_m[0] - 0.0155).abs() < 1e-5);
        assert_eq!((seen.point.color, seen.point.label.class, seen.clip), ([20, 0, 0], Class::Table, 3));
        assert!((seen.point.label.probability() - 0.3).abs() < 0.005);
    }

    #[test]
    fn what_was_hardly_measured_is_left_out() {
        for (weights, there) in [([15, 0], false), ([8, 8], true), ([16, 0], true)] {
            let mut voxels = Voxels::new(MAP_VOXEL_M);
            for weight in weights.into_iter().filter(|weight| *weight > 0) {
                voxels.add(&point(0.01, Class::Wall, 0.9, weight, 10), 0);
            }
            assert_eq!(!voxels.into_points().is_empty(), there, "{weights:?}");
        }
    }

    #[test]
    fn what_nobody_can_name_has_no_class() {
        let mut voxels = Voxels::new(MAP_VOXEL_M);
        voxels.add(&point(0.01, Class::Other, 0.0, 40, 10), 1);
        assert_eq!(voxels.into_points()[0].point.label, Label::NONE);
    }
}
