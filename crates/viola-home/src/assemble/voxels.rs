//! Fusion of the points of several clips in voxels.

mod file;

use super::tile::TileKey;
use crate::{MAP_VOXEL_M, MapPoint};
use rustc_hash::FxHashMap;
use std::cmp::Reverse;
use viola_geometry::taxonomy::{CLASSES, Class};
use viola_geometry::{LevelName, Vector3};
use viola_reconstruct::cloud::BLACK;
use viola_reconstruct::label::likeliest_beside;
use viola_reconstruct::{CloudPoint, Label, NO_COLOR};

/// Minimum weight of a voxel: one reading from 4 m. Further away depth errors exceed a voxel.
const MIN_WEIGHT: i64 = 16;
/// Maximum weight of a point: eight readings from 1 m. Readings of one recording have correlated errors.
const MAX_WEIGHT: u16 = 2_048;

/// Maximum distance along each axis from a point without a colour to those that give it one. Beyond, nobody saw its colour.
const NEAR_COLOR_M: f64 = 0.12;

/// Views that a label counts as without any: shapes and surface networks know something, too.
const PSEUDO_VIEWS: u32 = 3;
/// Maximum number of views that count: more of them are nearly the same view.
const MAX_VIEWS: u16 = 20;
/// Maximum weight of the labels without a view, relative to those with one.
const BLIND_FRACTION: f32 = 0.25;

/// No clip.
const NOBODY: (u16, i64) = (u16::MAX, 0);

/// Sums of one voxel. Integers, so that they do not depend on the order.
#[derive(Debug, Clone, Default)]
struct Voxel {
    weight: i64,
    points: i64,
    /// In 0.01 mm from the voxel's corner.
    position: [i64; 3],
    /// In thousandths.
    normal: [i64; 3],
    /// Only of points with a colour.
    color: [i64; 3],
    color_weight: i64,
    /// Labels of points that a network's views saw, and of the others.
    seen: Classes,
    blind: Classes,
    views: i64,
    /// Clip with the largest weight so far, and the current clip: clips are added one after the other, in any
    /// order. Of clips with equal weights the first in the map's order counts.
    most: (u16, i64),
    now: (u16, i64),
}

/// Sums of distributions over classes, weighted by views (paper eq. 1).
#[derive(Debug, Clone, Default)]
struct Classes {
    /// In 255ths; only the classes that occur.
    sums: Vec<(Class, u32)>,
    /// The weight of the labels, in 255ths.
    total: u32,
}

impl Classes {
    fn add(&mut self, label: &Label) {
        let weight = PSEUDO_VIEWS + u32::from(label.views.min(MAX_VIEWS));
        self.total = self.total.saturating_add(255 * weight);
        label.fractions().for_each(|(class, fraction)| self.add_sum(class, weight * u32::from(fraction)));
    }

    fn add_sum(&mut self, class: Class, more: u32) {
        match self.sums.iter_mut().find(|(known, _)| *known == class) {
            Some((_, sum)) => *sum = sum.saturating_add(more),
            None => self.sums.push((class, more)),
        }
    }

    fn merge(&mut self, other: &Classes) {
        self.total = self.total.saturating_add(other.total);
        other.sums.iter().for_each(|(class, sum)| self.add_sum(*class, *sum));
    }
}

/// Voxels of one tile under construction. Clips are added one after the other.
#[derive(Debug, Clone)]
pub(crate) struct Voxels {
    side_m: f64,
    /// Places in `voxels`, which is large and would be slow to move when the table grows.
    index: FxHashMap<[i32; 3], u32>,
    voxels: Vec<([i32; 3], Voxel)>,
}

/// Returns the clip with the larger weight, of equal ones the first.
fn heavier(one: (u16, i64), other: (u16, i64)) -> (u16, i64) {
    let rank = |(clip, weight): (u16, i64)| (weight, Reverse(clip));
    if rank(other) > rank(one) { other } else { one }
}

/// Returns the voxel that contains a point in the map's frame.
fn voxel_of(position_m: &[f32; 3], side_m: f64) -> [i32; 3] {
    position_m.map(|c| (f64::from(c) / side_m).floor() as i32)
}

impl Voxels {
    pub fn new(side_m: f64) -> Voxels {
        Voxels { side_m, index: FxHashMap::default(), voxels: Vec::new() }
    }

    pub fn add(&mut self, point: &CloudPoint, clip: u16) {
        let key = voxel_of(&point.position_m, self.side_m);
        let side_m = self.side_m;
        let voxel = self.at(key);
        let weight = i64::from(point.weight.clamp(1, MAX_WEIGHT));
        voxel.weight += weight;
        voxel.points += 1;
        voxel.views += i64::from(point.label.views);
        for (axis, corner) in key.iter().enumerate() {
            let within_m = f64::from(point.position_m[axis]) - f64::from(*corner) * side_m;
            voxel.position[axis] += weight * (within_m * 1e5).round() as i64;
            voxel.normal[axis] += weight * (f64::from(point.normal[axis]) * 1e3).round() as i64;
            voxel.color[axis] += weight * i64::from(point.color[axis]);
        }
        voxel.color_weight += if point.color == NO_COLOR { 0 } else { weight };
        let classes = if point.label.views > 0 { &mut voxel.seen } else { &mut voxel.blind };
        classes.add(&point.label);
        if voxel.now.0 != clip {
            voxel.now = (clip, 0);
        }
        voxel.now.1 += weight;
        voxel.most = heavier(voxel.most, voxel.now);
    }

    fn at(&mut self, key: [i32; 3]) -> &mut Voxel {
        let place = *self.index.entry(key).or_insert_with(|| {
            self.voxels.push((key, Voxel::default()));
            self.voxels.len() as u32 - 1
        });
        &mut self.voxels[place as usize].1
    }

    /// Returns the keys and places of voxels, by their keys.
    fn ordered(&self, is_wanted: impl Fn(&Voxel) -> bool) -> Vec<([i32; 3], u32)> {
        let wanted = (0u32..).zip(&self.voxels).filter(|(_, (_, voxel))| is_wanted(voxel));
        let mut order: Vec<([i32; 3], u32)> = wanted.map(|(place, (key, _))| (*key, place)).collect();
        order.sort_unstable();
        order
    }

    /// Adds the points of other clips.
    pub fn merge(&mut self, others: &Voxels) {
        let measured = others.voxels.iter().filter(|(_, voxel)| voxel.points > 0);
        measured.for_each(|(key, voxel)| self.at(*key).merge(voxel));
    }

    /// Removes the points of the voxels that `is_gone`.
    pub fn clear(&mut self, is_gone: impl Fn(&[i32; 3]) -> bool) {
        let gone = self.voxels.iter_mut().filter(|(key, _)| is_gone(key));
        gone.for_each(|(_, voxel)| *voxel = Voxel::default());
    }

    /// Returns one point per voxel, in voxel order, without voxels below `MIN_WEIGHT`.
    pub fn into_points(self) -> Vec<MapPoint> {
        let order = self.ordered(|voxel| voxel.weight >= MIN_WEIGHT);
        let voxel = |place: &u32| &self.voxels[*place as usize].1;
        let has_colors = order.iter().any(|(_, place)| voxel(place).color_weight > 0);
        let point = |(key, place): &([i32; 3], u32)| {
            let mut point = voxel(place).point(key, self.side_m);
            if has_colors && point.color == NO_COLOR {
                point.color = self.color_beside(key);
            }
            MapPoint { point, clip: voxel(place).most.0 }
        };
        order.iter().map(point).collect()
    }

    /// Returns the mean colour of the nearest voxels that have one: pictures show less than depth at edges.
    fn color_beside(&self, key: &[i32; 3]) -> [u8; 3] {
        for reach in 1..=(NEAR_COLOR_M / self.side_m + 1e-6) as i32 {
            let mut sum = Voxel::default();
            let steps = || -reach..=reach;
            for step in steps().flat_map(|x| steps().flat_map(move |y| steps().map(move |z| [x, y, z]))) {
                let beside = [0, 1, 2].map(|axis| key[axis] + step[axis]);
                if let Some(place) = self.index.get(&beside) {
                    sum.merge(&self.voxels[*place as usize].1);
                }
            }
            if sum.color_weight > 0 {
                return sum.color();
            }
        }
        NO_COLOR
    }
}

/// Steps of a metre and of a normal's part. Files of the points compress to half of their size with them, and sensors
/// have more noise.
const PLACES: f64 = 1024.0;
const NORMAL_PLACES: f64 = 256.0;

fn rounded(value: f64, places: f64) -> f32 {
    ((value * places).round() / places) as f32
}

impl Voxel {
    fn merge(&mut self, other: &Voxel) {
        self.weight += other.weight;
        self.points += other.points;
        self.color_weight += other.color_weight;
        self.views += other.views;
        for axis in 0..3 {
            self.position[axis] += other.position[axis];
            self.normal[axis] += other.normal[axis];
            self.color[axis] += other.color[axis];
        }
        self.seen.merge(&other.seen);
        self.blind.merge(&other.blind);
        self.most = heavier(self.most, other.most);
        self.now = NOBODY;
    }

    fn point(&self, key: &[i32; 3], side_m: f64) -> CloudPoint {
        let mean = |sum: i64| sum as f64 / self.weight as f64;
        let position_m =
            [0, 1, 2].map(|axis| f64::from(key[axis]) * side_m + mean(self.position[axis]) * 1e-5);
        let normal = Vector3::from(self.normal.map(|sum| sum as f64)).try_normalize(1e-9);
        let normal = normal.unwrap_or(Vector3::z());
        CloudPoint {
            position_m: position_m.map(|metres| rounded(metres, PLACES)),
            normal: [normal.x, normal.y, normal.z].map(|part| rounded(part, NORMAL_PLACES)),
            color: self.color(),
            label: self.label(),
            weight: self.weight.min(i64::from(u16::MAX)) as u16,
        }
    }

    /// Returns the mean colour of the points that have one.
    fn color(&self) -> [u8; 3] {
        let mean = |sum: i64| (sum as f64 / self.color_weight as f64).round() as u8;
        match self.color.map(mean) {
            _ if self.color_weight == 0 => NO_COLOR,
            NO_COLOR => BLACK,
            color => color,
        }
    }

    /// Returns the likeliest class. Labels without a view never outvote those with one, however many they are.
    fn label(&self) -> Label {
        let (seen, blind) = (self.seen.total as f32, self.blind.total as f32);
        let bound = if self.seen.total == 0 { f32::INFINITY } else { BLIND_FRACTION * seen };
        let blind_factor = if blind > bound { bound / blind } else { 1.0 };
        let mut sums = [0f32; CLASSES];
        for (classes, factor) in [(&self.seen, 1.0), (&self.blind, blind_factor)] {
            classes.sums.iter().for_each(|(class, sum)| sums[*class as usize] += factor * *sum as f32);
        }
        let named: f32 = sums.iter().sum();
        if named <= 0.0 {
            return Label::NONE;
        }
        let rest = (seen + blind_factor * blind - named).max(0.0);
        let views = (self.views as f64 / self.points as f64).round().min(f64::from(u16::MAX)) as u16;
        likeliest_beside(&sums, rest, views)
    }
}

/// Returns the tile that contains a point in the map's frame.
pub(super) fn tile_of(level: LevelName, position_m: &[f32; 3]) -> TileKey {
    TileKey::of_voxel(level, &voxel_of(position_m, MAP_VOXEL_M))
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
        // By hand: (10 + 2 * 20 + 12) / 4 = 15.5 mm, (10 + 2 * 20 + 30) / 4 = 20, (0.5 + 0.4) / 3 = 0.3; every label has one view.
        assert!((f64::from(seen.point.position_m[0]) - 0.0155).abs() <= 0.5 / PLACES);
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

    fn fused(labels: &[Label]) -> Label {
        let mut voxels = Voxels::new(MAP_VOXEL_M);
        for (clip, label) in (0..).zip(labels) {
            voxels.add(&CloudPoint { label: *label, ..point(0.01, Class::Other, 0.0, 40, 10) }, clip);
        }
        voxels.into_points()[0].point.label
    }

    #[test]
    fn distributions_add_up_by_views() {
        use Class::{Bed, Cabinet, Other, Sofa, Wall};
        let label = Label::new;
        // (labels, class, probability)
        let cases: [(&[Label], Class, f32); 6] = [
            (&[label(Sofa, 0.6, 2), label(Sofa, 0.4, 2)], Sofa, 0.5),
            // Second places count: bed has 0.4 + 0.3 + 0.4.
            (
                &[
                    label(Sofa, 0.5, 4).with_others([(Bed, 0.4)]),
                    label(Wall, 0.5, 4).with_others([(Bed, 0.3)]),
                    label(Bed, 0.4, 4).with_others([(Cabinet, 0.3)]),
                ],
                Bed,
                1.1 / 3.0,
            ),
            // Weights of 3 + 7 and 3 + 2 views.
            (&[label(Sofa, 0.6, 7), label(Bed, 0.9, 2)], Sofa, 0.4),
            // More than twenty views are no more evidence.
            (&[label(Sofa, 0.6, 20), label(Bed, 0.7, 900)], Bed, 0.35),
            // Shapes do not outvote a network, however many clips say so.
            (
                &[label(Sofa, 0.4, 1), label(Other, 0.8, 0), label(Other, 0.8, 0), label(Other, 0.8, 0)],
                Sofa,
                0.4 / 1.25,
            ),
            (&[label(Other, 0.8, 0), label(Other, 0.6, 0)], Other, 0.7),
        ];
        for (labels, class, probability) in cases {
            let fused = fused(labels);
            assert_eq!(fused.class, class, "{labels:?}");
            assert!((fused.probability() - probability).abs() < 0.005, "{labels:?} {fused:?}");
        }
    }

    #[test]
    fn points_without_a_colour_do_not_darken_the_others() {
        let cases: [(&[[u8; 3]], [u8; 3]); 4] = [
            (&[[0, 0, 0], [90, 60, 30]], [90, 60, 30]),
            (&[[80, 60, 30], [0, 0, 0], [100, 60, 30]], [90, 60, 30]),
            (&[[0, 0, 0], [0, 0, 0]], [0, 0, 0]),
            (&[[1, 0, 0], [0, 1, 0], [0, 0, 1]], BLACK),
        ];
        for (colors, want) in cases {
            let mut voxels = Voxels::new(MAP_VOXEL_M);
            for color in colors {
                voxels.add(&CloudPoint { color: *color, ..point(0.01, Class::Wall, 0.9, 40, 10) }, 0);
            }
            assert_eq!(voxels.into_points()[0].point.color, want, "{colors:?}");
        }
    }

    #[test]
    fn a_point_without_a_colour_has_that_of_the_nearest_voxels() {
        let check = |beside: &[(i32, u8)], want: [u8; 3]| {
            let mut voxels = Voxels::new(MAP_VOXEL_M);
            voxels.add(&CloudPoint { color: NO_COLOR, ..point(0.01, Class::Wall, 0.9, 40, 0) }, 0);
            for (step, red) in beside {
                voxels.add(&point(0.01 + *step as f32 * MAP_VOXEL_M as f32, Class::Wall, 0.9, 40, *red), 0);
            }
            let points = voxels.into_points();
            let found = points.iter().find(|p| (0.0..0.03).contains(&p.point.position_m[0])).unwrap();
            assert_eq!(found.point.color, want, "{beside:?}");
        };
        check(&[(1, 80), (-1, 90), (2, 7)], [85, 0, 0]);
        check(&[(2, 70)], [70, 0, 0]);
        check(&[(4, 70)], [70, 0, 0]);
        check(&[(5, 70)], NO_COLOR);
        check(&[], NO_COLOR);
    }

    #[test]
    fn what_nobody_can_name_has_no_class() {
        let mut voxels = Voxels::new(MAP_VOXEL_M);
        voxels.add(&point(0.01, Class::Other, 0.0, 40, 10), 1);
        assert_eq!(voxels.into_points()[0].point.label, Label::NONE);
    }
}
