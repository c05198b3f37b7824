//! Fuses the aligned excerpts of a scene into one map.

use super::member::{ClipFiles, FilesOfClips, member};
use crate::evaluate::{SUCCESS_DEG, SUCCESS_M, Scene};
use serde::Serialize;
use std::collections::BTreeMap;
use std::ops::Range;
use viola_align as align;
use viola_align::{AlignError, AlignParams, AlignmentState};
use viola_geometry::progress::{Progress, Silent};
use viola_geometry::{Pose2, Pose3, angle_between};
use viola_home::{
    ClipContribution, ClipNumbers, Manifest, MapPoint, Pair, PlacedBy, PlacedClip, Tile, Verdict, assemble,
    disagreement,
};
use viola_reconstruct::PointCloud;

/// An excerpt and its result.
#[derive(Debug, Clone, Serialize)]
pub struct Excerpt {
    /// Range of indices in the recording's frames.
    pub frames: Range<usize>,
    pub state: AlignmentState,
    pub map_from_clip: Option<Pose2>,
    /// Error against the truth, if it has a pose.
    pub error_m: Option<f64>,
    pub error_deg: Option<f64>,
    /// Source of its pose in the map; none if it is not there.
    pub placed_by: Option<PlacedBy>,
    /// Error after joint refinement.
    pub together_m: Option<f64>,
    pub together_deg: Option<f64>,
}

impl Excerpt {
    /// Returns whether it is in the map at a pose that is not the paper's success.
    pub fn is_wrong(&self) -> bool {
        self.together_m.is_some_and(|m| m >= SUCCESS_M)
            || self.together_deg.is_some_and(|deg| deg >= SUCCESS_DEG)
    }
}

/// Disagreement of overlapping clips, before and after joint refinement.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Agreement {
    pub pairs: usize,
    /// RMS distance of points to the other clip's surface along its normal, over all pairs, of points within
    /// 10 cm.
    pub alone_m: f64,
    pub together_m: f64,
}

/// The fused map of a scene.
pub struct Fused {
    pub points: Vec<MapPoint>,
    pub tiles: Vec<Tile>,
    pub excerpts: Vec<Excerpt>,
    pub agreement: Agreement,
    /// Clouds of the clips in the map, and their poses there.
    pub clips: Vec<(PointCloud, Pose3)>,
}

/// Returns consecutive runs of `length` frames that cover `total`; the last may overlap to keep its length.
pub fn consecutive(total: usize, length: usize) -> Vec<Range<usize>> {
    if length == 0 || total == 0 {
        return Vec::new();
    }
    let firsts = (0..total).step_by(length);
    firsts.map(|first| first.min(total.saturating_sub(length))..(first + length).min(total)).collect()
}

/// Aligns the excerpts one by one and fuses them into one map, as the service does; ambiguous ones as well if
/// the others decide their place. `progress` is called with the name of each excerpt.
pub fn fuse(
    scene: &Scene,
    ranges: &[Range<usize>],
    params: &AlignParams,
    progress: &dyn Fn(String) -> Box<dyn Progress>,
) -> Result<Fused, AlignError> {
    let headers = scene.clip.frames();
    let (mut members, mut files, mut excerpts) = (Vec::new(), Vec::new(), Vec::new());
    let mut truths = Vec::new();
    for (number, range) in ranges.iter().enumerate() {
        let numbers = headers[range.start].number..headers[range.end - 1].number + 1;
        let progress = progress(format!("excerpt {} of {}", number + 1, ranges.len()));
        let aligned = align::align(&scene.clip, Some(numbers), &scene.lidar, params, progress.as_ref())?;
        let answer = &aligned.alignment;
        let first = answer.reference_camera.as_ref().map(|camera| camera.frame);
        let first = range.clone().find(|i| Some(headers[*i].number) == first);
        let truth = first.and_then(|first| scene.map_from_clip(first));
        let error = answer.map_from_clip.zip(truth).map(|(pose, truth)| errors(&pose, &truth));
        truths.push(truth);
        excerpts.push(Excerpt {
            frames: range.clone(),
            state: answer.state,
            map_from_clip: answer.map_from_clip,
            error_m: error.map(|(m, _)| m),
            error_deg: error.map(|(_, deg)| deg),
            placed_by: None,
            together_m: None,
            together_deg: None,
        });
        members.extend(Verdict::of(answer).map(|verdict| member(number, verdict)));
        let contribution = ClipContribution::new(aligned.cloud_in_clip, aligned.views);
        files.push(ClipFiles { contribution, features: aligned.features });
    }
    let mut load = FilesOfClips(files.iter().collect());
    let assembly = assemble(&Manifest::default(), members, &mut load, &Silent)?;
    let contribution_of = |name: &str| load.of(name).map(|files| &files.contribution);
    let map = assembly.label(BTreeMap::new(), params.label.surface.as_deref(), &Silent)?;
    let placed = &map.manifest.clips;
    for clip in placed {
        let number = clip.clip.as_u128() as usize;
        excerpts[number].placed_by = Some(clip.by);
        if let Some(truth) = truths[number] {
            let (m, deg) = errors(&clip.map_from_clip, &truth);
            (excerpts[number].together_m, excerpts[number].together_deg) = (Some(m), Some(deg));
        }
    }
    let numbers = ClipNumbers::new(placed.iter().map(|clip| &clip.clip));
    let tiles: Vec<Tile> = map.tiles.values().cloned().collect();
    let points = tiles.iter().flat_map(|tile| numbers.in_map(tile)).collect();
    let agreement = agreement(placed, &map.manifest.pairs, |name| contribution_of(name));
    let cloud = |clip: &PlacedClip| {
        let contribution = contribution_of(&clip.contribution)?;
        Some((contribution.cloud_in_clip.clone(), clip.pose_in_space()))
    };
    let clips = placed.iter().filter_map(cloud).collect();
    Ok(Fused { points, tiles, excerpts, agreement, clips })
}

fn errors(pose: &Pose2, truth: &Pose2) -> (f64, f64) {
    (pose.distance_m(truth), angle_between(pose.yaw_rad, truth.yaw_rad).to_degrees())
}

fn agreement<'a>(
    placed: &[PlacedClip],
    pairs: &[Pair],
    contribution_of: impl Fn(&str) -> Option<&'a ClipContribution>,
) -> Agreement {
    const NEAR_M: f64 = 0.1;
    let (mut squares, mut counts, mut count) = ([0.0; 2], [0usize; 2], 0);
    for pair in pairs.iter().filter(|pair| pair.overlap.is_some()) {
        let find = |name: &str| placed.iter().find(|clip| clip.contribution == name);
        let (Some(a), Some(b)) = (find(&pair.a), find(&pair.b)) else { continue };
        let (Some(of_a), Some(of_b)) = (contribution_of(&pair.a), contribution_of(&pair.b)) else {
            continue;
        };
        count += 1;
        let alone = b.alone_in_space().inverse() * a.alone_in_space();
        let together = b.pose_in_space().inverse() * a.pose_in_space();
        for (which, b_from_a) in [alone, together].iter().enumerate() {
            let (rms_m, found) = disagreement(&of_a.cloud_in_clip, &of_b.cloud_in_clip, b_from_a, NEAR_M);
            squares[which] += rms_m * rms_m * found as f64;
            counts[which] += found;
        }
    }
    let rms = |which: usize| (squares[which] / counts[which].max(1) as f64).sqrt();
    Agreement { pairs: count, alone_m: rms(0), together_m: rms(1) }
}
