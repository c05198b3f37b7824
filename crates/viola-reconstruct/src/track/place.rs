//! Recognises the place of two key frames by RANSAC: their corners are matched, three pairs at a time propose
//! a motion, and the motion with the most inliers is kept (Fischler and Bolles, 1981).

use super::corners::{Corner, distance};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use viola_geometry::{Point3, Pose3, Vector3};

/// Maximum Hamming distance of a pair's descriptors, of 256 bits.
const MAX_BITS: u32 = 60;
/// Minimum ratio of the second best match's distance to the best one's.
const NEXT_BEST: f64 = 1.2;
const TRIES: usize = 300;
/// Maximum distance of an inlier: this, plus this fraction of its depth.
const NEAR_M: f64 = 0.02;
const NEAR_FRACTION: f64 = 0.02;
/// Minimum number and fraction of inliers.
const MIN_INLIERS: usize = 14;
const MIN_INLIER_FRACTION: f64 = 0.3;

/// A motion with its inliers among the pairs of corners.
#[derive(Debug, Clone)]
pub(super) struct Place {
    pub b_from_a: Pose3,
    pub pairs: usize,
}

/// Returns the motion between two frames by their corners; `None` if they do not show the same place.
pub(super) fn recognise(a: &[Corner], b: &[Corner], seed: u64) -> Option<Place> {
    let pairs = matches(a, b);
    if pairs.len() < MIN_INLIERS {
        return None;
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut best: Option<(usize, Pose3)> = None;
    for _ in 0..TRIES {
        let three: [usize; 3] = std::array::from_fn(|_| rng.random_range(0..pairs.len()));
        if three[0] == three[1] || three[1] == three[2] || three[0] == three[2] {
            continue;
        }
        let chosen = three.map(|i| pairs[i]);
        if !is_spread(&chosen) {
            continue;
        }
        let Some(motion) = motion(&chosen) else { continue };
        let count = agreeing(&pairs, &motion).count();
        if best.as_ref().is_none_or(|(most, _)| count > *most) {
            best = Some((count, motion));
        }
    }
    let (_, mut b_from_a) = best?;
    for _ in 0..3 {
        let near: Vec<(Point3, Point3)> = agreeing(&pairs, &b_from_a).copied().collect();
        b_from_a = motion(&near)?;
    }
    let count = agreeing(&pairs, &b_from_a).count();
    let is_enough = count >= MIN_INLIERS && count as f64 >= MIN_INLIER_FRACTION * pairs.len() as f64;
    is_enough.then_some(Place { b_from_a, pairs: count })
}

fn agreeing<'a>(
    pairs: &'a [(Point3, Point3)],
    b_from_a: &Pose3,
) -> impl Iterator<Item = &'a (Point3, Point3)> {
    let b_from_a = *b_from_a;
    let (near_m, near_fraction) = (NEAR_M, NEAR_FRACTION);
    pairs.iter().filter(move |(a, b)| (b_from_a * a - b).norm() < near_m + near_fraction * b.z)
}

/// Returns the pairs of corners that are each other's best match.
fn matches(a: &[Corner], b: &[Corner]) -> Vec<(Point3, Point3)> {
    let nearest = |corner: &Corner, among: &[Corner]| {
        let (mut best, mut second) = ((u32::MAX, 0), u32::MAX);
        for (i, other) in among.iter().enumerate() {
            let bits = distance(&corner.bits, &other.bits);
            if bits < best.0 {
                second = best.0;
                best = (bits, i);
            } else if bits < second {
                second = bits;
            }
        }
        let is_alone = f64::from(second) >= NEXT_BEST * f64::from(best.0);
        (best.0 <= MAX_BITS && is_alone).then_some(best.1)
    };
    let pair = |(i, corner): (usize, &Corner)| {
        let other = &b[nearest(corner, b)?];
        (nearest(other, a) == Some(i)).then_some((corner.point_m, other.point_m))
    };
    a.iter().enumerate().filter_map(pair).collect()
}

/// Returns whether three points determine a rotation.
fn is_spread(three: &[(Point3, Point3); 3]) -> bool {
    let [a, b, c] = three.map(|(a, _)| a);
    (b - a).cross(&(c - a)).norm() > 0.02
}

/// Returns the rigid motion with the least squared distances (Arun, Huang and Blostein, 1987).
fn motion(pairs: &[(Point3, Point3)]) -> Option<Pose3> {
    if pairs.len() < 3 {
        return None;
    }
    let mean = |pick: fn(&(Point3, Point3)) -> Point3| {
        pairs.iter().fold(Vector3::zeros(), |sum, pair| sum + pick(pair).coords) / pairs.len() as f64
    };
    let (from, to) = (mean(|pair| pair.0), mean(|pair| pair.1));
    let mut spread = Matrix3::zeros();
    for (a, b) in pairs {
        spread += (b.coords - to) * (a.coords - from).transpose();
    }
    let svd = spread.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    let mut mirror = Matrix3::identity();
    mirror[(2, 2)] = (u * v_t).determinant().signum();
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(u * mirror * v_t));
    Some(Pose3::from_parts((to - turn * from).into(), turn))
}
