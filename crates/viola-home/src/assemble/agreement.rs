//! Agreement and contradiction of two clips' surfaces, each clip at one of its possible poses.

use super::sight::Sights;
use super::surface::{Surface, SurfacePoint, cell};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use viola_geometry::{Point3, Pose3};
use viola_reconstruct::{NO_COLOR, View};

/// Sampled points of each clip.
const SAMPLES: usize = 1_500;
/// Side of the patches of surface that count as one observation each.
const PATCH_M: f64 = 0.5;
/// Minimum observed points of a patch.
const MIN_POINTS: u32 = 3;
/// Fraction of a patch's points needed to call it agreeing or differing.
const MAJORITY: f64 = 0.6;
/// RMS colour difference, of 255, above which surfaces differ in colour: exposures differ by less.
const COLOR: f64 = 60.0;

/// Distributions of the patches that agree, have another colour, and differ (Dirichlet-multinomial): if both
/// clips are at their true poses, and if one of them is at a wrong alternative. Maximum likelihood on eight
/// simulated homes (`viola evaluate --joint`, sets `repeated` and `normal`, seeds 2000..2004).
const RIGHT: [f64; 3] = [3.96, 0.356, 0.063];
const WRONG: [f64; 3] = [0.755, 0.3, 0.815];
/// A clip at one of its possible poses.
pub(super) struct Side<'a> {
    pub map_from_clip: Pose3,
    surface: &'a Surface,
    sights: Sights<'a>,
}

impl<'a> Side<'a> {
    pub fn new(surface: &'a Surface, views: &'a [View], map_from_clip: Pose3) -> Side<'a> {
        Side { map_from_clip, surface, sights: Sights::new(views, &map_from_clip) }
    }
}

/// Numbers of surface patches by what two clips observed of each other's surfaces.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Agreement {
    /// Same surface, and no other colour.
    pub agree: u16,
    /// Same surface in another colour.
    pub recolored: u16,
    /// One clip looked through the surface of the other.
    pub differ: u16,
}

impl Agreement {
    /// Compares two clips; symmetric.
    pub(super) fn of(a: &Side, b: &Side) -> Agreement {
        let mut patches: BTreeMap<[i32; 3], Votes> = BTreeMap::new();
        for (asking, asked) in [(a, b), (b, a)] {
            let asked_from_asking = asked.map_from_clip.inverse() * asking.map_from_clip;
            for sample in asking.surface.some(SAMPLES).filter(|sample| sample.is_upright()) {
                let at = asking.map_from_clip * sample.position;
                let votes = patches.entry(cell(&at, PATCH_M)).or_default();
                match observed(sample, &at, &asked_from_asking, asked) {
                    Observed::Same => votes.same += 1,
                    Observed::Recolored => votes.recolored += 1,
                    Observed::Through => votes.through += 1,
                    Observed::Nothing => {}
                }
            }
        }
        let mut sum = Agreement::default();
        for votes in patches.values() {
            let all = votes.same + votes.recolored + votes.through;
            let most = |votes: u32| u16::from(f64::from(votes) >= MAJORITY * f64::from(all));
            if all >= MIN_POINTS {
                sum.agree += most(votes.same);
                sum.recolored += most(votes.recolored);
                sum.differ += most(votes.through);
            }
        }
        sum
    }

    /// Returns the number of patches that both clips saw.
    pub(super) fn patches(&self) -> u32 {
        u32::from(self.agree) + u32::from(self.recolored) + u32::from(self.differ)
    }

    /// Returns the log-likelihood ratio: both poses right, against at least one wrong.
    pub(super) fn log_likelihood_ratio(&self) -> f64 {
        let counts = [self.agree, self.recolored, self.differ];
        log_likelihood(counts, &RIGHT) - log_likelihood(counts, &WRONG)
    }
}

/// Returns the log-likelihood of counts by a Dirichlet-multinomial distribution, without the factor that
/// depends on the counts alone.
fn log_likelihood(counts: [u16; 3], concentration: &[f64; 3]) -> f64 {
    // Logarithm of the rising factorial.
    let rising = |from: f64, count: u32| (0..count).map(|k| (from + f64::from(k)).ln()).sum::<f64>();
    let each = counts.iter().zip(concentration).map(|(count, from)| rising(*from, u32::from(*count)));
    each.sum::<f64>() - rising(concentration.iter().sum(), counts.iter().map(|c| u32::from(*c)).sum())
}

/// Observations of a patch's points.
#[derive(Default)]
struct Votes {
    same: u32,
    recolored: u32,
    through: u32,
}

/// One clip's observation of a point of the other.
enum Observed {
    Same,
    Recolored,
    /// It looked through the place.
    Through,
    Nothing,
}

fn observed(sample: &SurfacePoint, at: &Point3, asked_from_asking: &Pose3, asked: &Side) -> Observed {
    let (position, normal) = (asked_from_asking * sample.position, asked_from_asking * sample.normal);
    if let Some(near) = asked.surface.nearest(&position, &normal) {
        // A clip without colour pictures says nothing about the colour.
        if near.color == NO_COLOR || sample.color == NO_COLOR {
            return Observed::Same;
        }
        let difference = |i: usize| f64::from(near.color[i]) - f64::from(sample.color[i]);
        let squared: f64 = (0..3).map(|i| difference(i).powi(2)).sum();
        return if squared < 3.0 * COLOR * COLOR { Observed::Same } else { Observed::Recolored };
    }
    let (surface, through) = asked.sights.of(at);
    if through > 2 * surface { Observed::Through } else { Observed::Nothing }
}

#[cfg(test)]
mod tests {
    use super::*;
    use viola_reconstruct::cloud::BLACK;
    use viola_reconstruct::{CloudPoint, Label, PointCloud};

    /// Returns an upright wall of 3 x 2 m.
    fn wall(color: [u8; 3]) -> Surface {
        let point = |i: u16| CloudPoint {
            position_m: [f32::from(i % 50) * 0.06, 0.0, f32::from(i / 50) * 0.06],
            normal: [0.0, -1.0, 0.0],
            color,
            label: Label::NONE,
            weight: 100,
        };
        Surface::new(&PointCloud { points: (0..1_650).map(point).collect(), voxel_m: 0.03 })
    }

    #[test]
    fn surface_without_a_colour_has_no_other_colour() {
        let of = |a: [u8; 3], b: [u8; 3]| {
            let (a, b) = (wall(a), wall(b));
            let side = |surface| Side::new(surface, &[], Pose3::identity());
            Agreement::of(&side(&a), &side(&b))
        };
        let same = of([200; 3], [190; 3]);
        assert!(same.agree > 10 && same.recolored == 0 && same.differ == 0, "{same:?}");
        for (a, b) in [([200; 3], NO_COLOR), (NO_COLOR, [200; 3]), (NO_COLOR, NO_COLOR)] {
            assert_eq!(of(a, b), same);
        }
        let other = of([200; 3], BLACK);
        assert_eq!((other.agree, other.recolored), (0, same.agree));
    }
}
