//! Matches the features of two clips.

use viola_geometry::{Point3, wrap_angle};
use viola_reconstruct::Feature;

/// Maximum difference of the heights of one place: both clips have their floor at z = 0.
const MAX_RISE_M: f64 = 0.2;
/// Minimum similarity of a match.
const MIN_SIMILARITY: f32 = 0.75;
/// Maximum ratio of a match's distance to that of the next best place.
const RATIO: f32 = 0.92;
/// Features nearer than this are the same place.
const SAME_PLACE_M: f64 = 0.15;
/// Maximum matches of two clips, the most distinctive first.
const MAX_MATCHES: usize = 100;

/// A place of clip `a` that may be one of clip `b`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Match {
    pub a: Point3,
    pub b: Point3,
    /// Rotation from `a` to `b` by the directions that the patches face.
    pub yaw_rad: f64,
    /// Ratio of its distance to that of the next best place.
    pub ratio: f32,
}

/// Returns the matches of two clips, the most distinctive first: features that are each other's most similar.
pub(super) fn matches(a: &[Feature], b: &[Feature]) -> Vec<Match> {
    let similarity: Vec<f32> =
        a.iter().flat_map(|one| b.iter().map(move |other| alike(one, other))).collect();
    let of_a = |i: usize| &similarity[i * b.len()..(i + 1) * b.len()];
    let to_b: Vec<Option<(usize, f32)>> = (0..a.len()).map(|i| best(b, of_a(i).iter().copied())).collect();
    let to_a: Vec<Option<(usize, f32)>> =
        (0..b.len()).map(|j| best(a, (0..a.len()).map(|i| similarity[i * b.len() + j]))).collect();
    let mut found: Vec<Match> = Vec::new();
    for (i, forth) in to_b.iter().enumerate() {
        let Some((j, ratio)) = *forth else { continue };
        let Some((back, back_ratio)) = to_a[j] else { continue };
        let ratio = ratio.max(back_ratio);
        if back == i && ratio < RATIO {
            let yaw_rad = wrap_angle(f64::from(b[j].heading_rad - a[i].heading_rad));
            found.push(Match { a: a[i].position(), b: b[j].position(), yaw_rad, ratio });
        }
    }
    // Stable: equal ones stay in the order of the features.
    found.sort_by(|x, y| x.ratio.total_cmp(&y.ratio));
    found.truncate(MAX_MATCHES);
    found
}

/// Returns the similarity of two features; 0 if their heights differ.
fn alike(a: &Feature, b: &Feature) -> f32 {
    if f64::from((a.position_m[2] - b.position_m[2]).abs()) > MAX_RISE_M {
        return 0.0;
    }
    a.descriptor.similarity(&b.descriptor)
}

/// Returns the most similar of some features, and the ratio of its distance to that of the next best place.
fn best(among: &[Feature], similarities: impl Iterator<Item = f32> + Clone) -> Option<(usize, f32)> {
    let first =
        |best: (usize, f32), (at, value): (usize, f32)| if value > best.1 { (at, value) } else { best };
    let (at, most) = similarities.clone().enumerate().fold((0, 0.0), first);
    if most < MIN_SIMILARITY {
        return None;
    }
    let place = among[at].position();
    let elsewhere = |(other, _): &(usize, f32)| (among[*other].position() - place).norm() > SAME_PLACE_M;
    let next = similarities.enumerate().filter(elsewhere).map(|(_, value)| value).fold(0.0, f32::max);
    let distance = |similarity: f32| (2.0 - 2.0 * similarity).max(0.0).sqrt();
    Some((at, distance(most) / distance(next).max(1e-3)))
}
