//! Transform between the frames of two LiDAR maps of one home.

use super::super::assemble::PlacedClip;
use viola_geometry::{LevelName, Pose2, angle_between};

/// Distance and angle at which two clips disagree for certain about the transform; further counts the same.
const APART_M: f64 = 1.0;
const APART_RAD: f64 = 0.3;
/// A few hundred clips decide as well as thousands.
const MAX_CLIPS: usize = 300;

/// Returns the transform from the frame of a level's earlier LiDAR map into that of the present one; `None` if
/// no clip is in both maps.
///
/// A clip's own frame does not depend on the LiDAR map, so each clip in both maps gives the transform. The
/// one that most others agree with is taken, because single clips may have changed their place.
pub fn map_from_earlier(level: LevelName, earlier: &[PlacedClip], now: &[PlacedClip]) -> Option<Pose2> {
    let is_on_level = |clip: &&PlacedClip| clip.level == level;
    let now: Vec<&PlacedClip> = now.iter().filter(is_on_level).collect();
    let both = earlier
        .iter()
        .filter(is_on_level)
        .filter_map(|then| Some((then, *now.iter().find(|clip| clip.clip == then.clip)?)));
    let pairs: Vec<(&PlacedClip, &PlacedClip)> = both.take(MAX_CLIPS).collect();
    let transform =
        |(then, now): &(&PlacedClip, &PlacedClip)| now.map_from_clip.compose(&then.map_from_clip.inverse());
    let transforms: Vec<Pose2> = pairs.iter().map(transform).collect();
    let disagreement = |one: &Pose2| -> f64 {
        let each = pairs.iter().map(|(then, now)| {
            let moved = one.compose(&then.map_from_clip);
            let turned_rad = angle_between(moved.yaw_rad, now.map_from_clip.yaw_rad).abs();
            (moved.distance_m(&now.map_from_clip) / APART_M).min(1.0) + (turned_rad / APART_RAD).min(1.0)
        });
        each.sum()
    };
    let best = transforms.iter().map(|one| (disagreement(one), one));
    best.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, one)| *one)
}
