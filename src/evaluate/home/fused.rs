//! One map out of the excerpts of a scene that align.

use crate::align::{self, AlignError, AlignParams, AlignmentState, PointCloud};
use crate::evaluate::Scene;
use crate::geometry::{Pose2, Pose3};
use crate::home::{MAP_VOXEL_M, MapMerge, MapPoint};
use crate::progress::Progress;
use nalgebra::{Translation3, UnitQuaternion};
use rustc_hash::FxHashMap;
use serde::Serialize;
use std::ops::Range;

/// An excerpt and what became of it.
#[derive(Debug, Clone, Serialize)]
pub struct Excerpt {
    /// Places in the recording's frames, the last one not included.
    pub frames: Range<usize>,
    pub state: AlignmentState,
    pub map_from_clip: Option<Pose2>,
    /// Against the truth, where it has a pose.
    pub error_m: Option<f64>,
    pub error_deg: Option<f64>,
}

/// Consecutive runs of `length` frames that cover all `total`; the last one reaches back where it would be shorter.
pub fn consecutive(total: usize, length: usize) -> Vec<Range<usize>> {
    if length == 0 || total == 0 {
        return Vec::new();
    }
    let firsts = (0..total).step_by(length);
    firsts.map(|first| first.min(total.saturating_sub(length))..(first + length).min(total)).collect()
}

/// Aligns the excerpts one by one and merges those that are called aligned.
pub fn fuse(
    scene: &Scene,
    ranges: &[Range<usize>],
    params: &AlignParams,
    progress: &dyn Progress,
) -> Result<(Vec<MapPoint>, Vec<Excerpt>), AlignError> {
    let headers = scene.clip.frames();
    let (mut clouds, mut excerpts) = (Vec::new(), Vec::new());
    for range in ranges {
        let numbers = headers[range.start].number..headers[range.end - 1].number + 1;
        let aligned = align::align(&scene.clip, Some(numbers), &scene.lidar, params, progress)?;
        let pose = aligned.alignment.map_from_clip;
        let begin = range.clone().find(|i| headers[*i].world_from_camera.is_some());
        let truth = begin.and_then(|begin| scene.map_from_clip(begin));
        let both = pose.zip(truth);
        excerpts.push(Excerpt {
            frames: range.clone(),
            state: aligned.alignment.state,
            map_from_clip: pose,
            error_m: both.map(|(pose, truth)| pose.distance_m(&truth)),
            error_deg: both.map(|(p, t)| crate::geometry::angle_between(p.yaw_rad, t.yaw_rad).to_degrees()),
        });
        if let (AlignmentState::Aligned, Some(pose)) = (aligned.alignment.state, pose) {
            clouds.push(aligned.cloud_in_clip.transformed(&upright(&pose)));
        } else {
            clouds.push(PointCloud::default());
        }
    }
    Ok((merged(&clouds), excerpts))
}

fn upright(pose: &Pose2) -> Pose3 {
    Pose3::from_parts(
        Translation3::new(pose.x_m, pose.y_m, 0.0),
        UnitQuaternion::from_axis_angle(&nalgebra::Vector3::z_axis(), pose.yaw_rad),
    )
}

/// The merged map, and for each of its points the clip with most points in its voxel.
pub fn merged(clouds: &[PointCloud]) -> Vec<MapPoint> {
    let voxel = |position_m: &[f32; 3]| position_m.map(|c| (f64::from(c) / MAP_VOXEL_M).floor() as i32);
    let mut merge = MapMerge::default();
    let mut most: FxHashMap<[i32; 3], (u16, u32)> = FxHashMap::default();
    for (clip, cloud) in (0u16..).zip(clouds) {
        merge.add(cloud);
        let mut counts: FxHashMap<[i32; 3], u32> = FxHashMap::default();
        cloud.points.iter().for_each(|p| *counts.entry(voxel(&p.position_m)).or_default() += 1);
        for (voxel, count) in counts {
            let best = most.entry(voxel).or_insert((clip, count));
            if count > best.1 {
                *best = (clip, count);
            }
        }
    }
    let clip = |position_m: &[f32; 3]| most.get(&voxel(position_m)).map_or(0, |(clip, _)| *clip);
    let points = merge.cloud_in_map().points.into_iter();
    points.map(|point| MapPoint { clip: clip(&point.position_m), point }).collect()
}
