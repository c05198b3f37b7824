//! One map of a home out of the clouds of its clips: a function of the set of clips, not of their order.

use crate::align::label::Label;
use crate::align::{CloudPoint, PointCloud};
use crate::geometry::Vector3;
use crate::taxonomy::{CLASSES, Class};
use rayon::slice::ParallelSliceMut;
use rustc_hash::FxHashMap;
use serde::{Deserialize, Serialize};

/// Side of the map's voxels: that of the clips.
pub const MAP_VOXEL_M: f64 = 0.03;

/// What is known of one voxel. Whole numbers, so that sums do not depend on their order and a clip's share can be taken
/// out exactly as it was put in.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
struct Voxel {
    points: i64,
    /// In hundredths of a millimetre from the voxel's corner.
    position: [i64; 3],
    /// In thousandths.
    normal: [i64; 3],
    color: [i64; 3],
    /// Sums of probabilities, in 255ths, by class; few are not 0.
    classes: Vec<(Class, i64)>,
    views: i64,
}

/// A home's map in the making, in the LiDAR map's frame.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct MapMerge {
    voxels: FxHashMap<[i32; 3], Voxel>,
}

/// What is in a home's map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct HomeMapInfo {
    pub points: usize,
    pub voxel_m: f64,
    /// Corners of what it spans, in the LiDAR map's frame; null when it is empty.
    pub min_m: Option<[f32; 3]>,
    pub max_m: Option<[f32; 3]>,
    /// Points by class, the largest first.
    pub classes: Vec<ClassCount>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct ClassCount {
    #[schema(value_type = String, example = "floor")]
    pub class: String,
    pub points: usize,
}

impl MapMerge {
    /// Adds the cloud of a clip, which is in the map's frame.
    pub fn add(&mut self, cloud_in_map: &PointCloud) {
        self.count(cloud_in_map, 1);
    }

    /// Takes the cloud of a clip out again.
    pub fn remove(&mut self, cloud_in_map: &PointCloud) {
        self.count(cloud_in_map, -1);
        self.voxels.retain(|_, voxel| voxel.points > 0);
    }

    fn count(&mut self, cloud: &PointCloud, sign: i64) {
        for point in &cloud.points {
            let key = point.position_m.map(|c| (f64::from(c) / MAP_VOXEL_M).floor() as i32);
            let voxel = self.voxels.entry(key).or_default();
            voxel.points += sign;
            voxel.views += sign * i64::from(point.label.views);
            for (axis, corner) in key.iter().enumerate() {
                let within_m = f64::from(point.position_m[axis]) - f64::from(*corner) * MAP_VOXEL_M;
                voxel.position[axis] += sign * (within_m * 1e5).round() as i64;
                voxel.normal[axis] += sign * (f64::from(point.normal[axis]) * 1e3).round() as i64;
                voxel.color[axis] += sign * i64::from(point.color[axis]);
            }
            let share = sign * (point.label.probability() * 255.0).round() as i64;
            match voxel.classes.iter_mut().find(|(class, _)| *class == point.label.class) {
                Some((_, sum)) => *sum += share,
                None => voxel.classes.push((point.label.class, share)),
            }
        }
    }

    /// The map: one point a voxel, in the order of their voxels.
    pub fn cloud_in_map(&self) -> PointCloud {
        let mut voxels: Vec<(&[i32; 3], &Voxel)> = self.voxels.iter().collect();
        voxels.par_sort_unstable_by_key(|(key, _)| **key);
        let points = voxels.into_iter().map(|(key, voxel)| voxel.point(key)).collect();
        PointCloud { points, voxel_m: MAP_VOXEL_M }
    }
}

impl Voxel {
    fn point(&self, key: &[i32; 3]) -> CloudPoint {
        let mean = |sum: i64| sum as f64 / self.points as f64;
        let position_m = [0, 1, 2]
            .map(|axis| (f64::from(key[axis]) * MAP_VOXEL_M + mean(self.position[axis]) * 1e-5) as f32);
        let normal = Vector3::from(self.normal.map(|sum| sum as f64)).try_normalize(1e-9);
        let normal = normal.unwrap_or(Vector3::z());
        // Of equal sums the class with the lower id: the list is in the order of arrival.
        let total: i64 = self.classes.iter().map(|(_, sum)| sum).sum();
        let best = self.classes.iter().max_by_key(|(class, sum)| (*sum, std::cmp::Reverse(class.id())));
        let label = match best {
            Some((class, sum)) if total > 0 => {
                // How sure the points were on the whole, and how much of that is for this class.
                let probability = *sum as f64 / (255.0 * self.points as f64);
                let views = mean(self.views).round().min(f64::from(u16::MAX)) as u16;
                Label::new(*class, probability as f32, views)
            }
            _ => Label::NONE,
        };
        CloudPoint {
            position_m,
            normal: [normal.x as f32, normal.y as f32, normal.z as f32],
            color: self.color.map(|sum| mean(sum).round() as u8),
            label,
        }
    }
}

impl HomeMapInfo {
    pub fn of(cloud_in_map: &PointCloud) -> HomeMapInfo {
        let points = &cloud_in_map.points;
        let corner = |pick: fn(f32, f32) -> f32| {
            let positions = points.iter().map(|p| p.position_m);
            positions.reduce(|a, b| [0, 1, 2].map(|axis| pick(a[axis], b[axis])))
        };
        let mut counts = [0usize; CLASSES];
        points.iter().for_each(|point| counts[point.label.class as usize] += 1);
        let mut classes: Vec<ClassCount> = Class::ALL
            .iter()
            .map(|class| ClassCount { class: class.name().to_owned(), points: counts[*class as usize] })
            .filter(|count| count.points > 0)
            .collect();
        classes.sort_by_key(|count| std::cmp::Reverse(count.points));
        HomeMapInfo {
            points: points.len(),
            voxel_m: cloud_in_map.voxel_m,
            min_m: corner(f32::min),
            max_m: corner(f32::max),
            classes,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn cloud() -> impl Strategy<Value = PointCloud> {
        let point = (
            prop::array::uniform3(-0.2f32..0.2),
            prop::array::uniform3(-1.0f32..1.0),
            any::<[u8; 3]>(),
            0usize..CLASSES,
            0.0f32..=1.0,
            0u16..50,
        )
            .prop_map(|(position_m, normal, color, class, probability, views)| CloudPoint {
                position_m,
                normal,
                color,
                label: Label::new(Class::ALL[class], probability, views),
            });
        prop::collection::vec(point, 0..60).prop_map(|points| PointCloud { points, voxel_m: MAP_VOXEL_M })
    }

    fn merged<'a>(clouds: impl IntoIterator<Item = &'a PointCloud>) -> PointCloud {
        let mut merge = MapMerge::default();
        clouds.into_iter().for_each(|cloud| merge.add(cloud));
        merge.cloud_in_map()
    }

    proptest! {
        #[test]
        fn any_order_gives_the_same_map(clouds in prop::collection::vec(cloud(), 1..5)) {
            prop_assert_eq!(merged(&clouds), merged(clouds.iter().rev()));
        }

        #[test]
        fn what_is_taken_out_was_never_in(clouds in prop::collection::vec(cloud(), 1..4), other in cloud()) {
            let mut merge = MapMerge::default();
            clouds.iter().for_each(|cloud| merge.add(cloud));
            merge.add(&other);
            merge.remove(&other);
            prop_assert_eq!(merge.cloud_in_map(), merged(&clouds));
        }

        #[test]
        fn points_stay_in_their_voxels(cloud in cloud()) {
            let map = merged([&cloud]);
            prop_assert!(map.points.len() <= cloud.points.len());
            for point in &map.points {
                let near = |p: &CloudPoint| (p.position() - point.position()).amax() <= MAP_VOXEL_M + 1e-4;
                prop_assert!(cloud.points.iter().any(near));
            }
        }
    }

    #[test]
    fn points_of_one_voxel_agree_by_weight() {
        let point = |x: f32, class: Class, probability: f32, red: u8| CloudPoint {
            position_m: [x, 0.01, 0.01],
            normal: [0.0, 0.0, 1.0],
            color: [red, 0, 0],
            label: Label::new(class, probability, 2),
        };
        let one = PointCloud {
            points: vec![point(0.010, Class::Chair, 0.6, 10), point(0.020, Class::Table, 0.5, 20)],
            voxel_m: MAP_VOXEL_M,
        };
        let other = PointCloud { points: vec![point(0.012, Class::Table, 0.4, 30)], voxel_m: MAP_VOXEL_M };
        let map = merged([&one, &other]);
        assert_eq!(map.points.len(), 1);
        let seen = &map.points[0];
        assert!((seen.position_m[0] - 0.014).abs() < 1e-5);
        assert_eq!((seen.color, seen.label.class, seen.label.views), ([20, 0, 0], Class::Table, 2));
        assert!((seen.label.probability() - 0.3).abs() < 0.01);
        let info = HomeMapInfo::of(&map);
        assert_eq!((info.points, info.classes.len()), (1, 1));
        assert_eq!(HomeMapInfo::of(&PointCloud::default()).min_m, None);
    }
}
