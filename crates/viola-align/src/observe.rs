//! Stages 2 to 6: from an opened clip to its virtual scan.

mod remarks;

use super::answer::ReferenceCamera;
use super::scan::{self, RaycastParams, VirtualScan};
use super::{AlignError, AlignParams, Alignment};
use std::ops::{Range, RangeInclusive};
use viola_formats::clip::{Clip, Up};
use viola_geometry::Pose3;
use viola_geometry::progress::{self, Progress, Stage};
use viola_reconstruct::features::features;
use viola_reconstruct::floor::{self, Floor, NoFloor};
use viola_reconstruct::label::{LabelReport, Labeller, Wall};
use viola_reconstruct::track::{self, TrackedClip};
use viola_reconstruct::trajectory::{Trajectory, posed};
use viola_reconstruct::{Feature, FloorReport, Fused, KeyFrame, PointCloud, Reason, fuse, trajectory};

/// A clip of unknown unit has a floor at any nominal height.
const ANY_HEIGHT: RangeInclusive<f64> = 0.0..=f64::MAX;

/// The data of a clip, without any map.
#[derive(Debug, Clone, Default)]
pub struct Observation {
    pub cloud_in_clip: PointCloud,
    pub scan: VirtualScan,
    pub key_frames: usize,
    /// The key frames themselves, if the clip is a recording.
    pub keys: Vec<KeyFrame>,
    /// In the clip frame.
    pub features: Vec<Feature>,
    /// In the clip frame.
    pub walls: Vec<Wall>,
    pub labels: Option<LabelReport>,
    /// Indices in the clip of the frames that a network segmented.
    pub pictures: Vec<usize>,
    /// `None` without a floor, seen or assumed.
    pub clip_from_world: Option<Pose3>,
    /// `None` without a floor.
    pub first_camera: Option<FirstCamera>,
    pub floor: Option<FloorReport>,
    /// Scans above other possible floors, if it is in doubt which one is the floor.
    pub other_floors: Vec<FloorHypothesis>,
    /// True if the camera was tracked from frames that are far apart.
    pub sparse_track: bool,
    /// Scale of a clip whose unit was unknown; everything above is in metres.
    pub scale: Option<Scale>,
    /// Remarks, and last the reason for an empty `scan`, if there is one.
    pub reasons: Vec<Reason>,
}

/// The first used camera.
#[derive(Debug, Clone, PartialEq)]
pub struct FirstCamera {
    /// Index of its frame in the clip.
    pub index: usize,
    pub number: u32,
    pub clip_from_camera: Pose3,
}

impl FirstCamera {
    /// Returns the camera above another floor of the clip.
    fn above(&self, floor: &FloorReport) -> ReferenceCamera {
        let mut pose = self.clip_from_camera;
        pose.translation.z = floor.camera_height_m;
        let matrix = pose.to_homogeneous();
        let clip_from_camera = std::array::from_fn(|row| std::array::from_fn(|column| matrix[(row, column)]));
        ReferenceCamera { frame: self.number, clip_from_camera }
    }
}

/// The scale of a clip.
#[derive(Debug, Clone, PartialEq)]
pub struct Scale {
    pub metres_per_unit: f64,
    pub std: f64,
    /// Loss of explanations at other scales minus that of the best one at this scale.
    pub rival_gaps_m: Vec<f64>,
    /// True if the search proved the optimum of each scale of the grid.
    pub complete: bool,
}

/// The virtual scan for another floor.
#[derive(Debug, Clone)]
pub struct FloorHypothesis {
    pub scan: VirtualScan,
    pub floor: FloorReport,
}

/// One scan of an observation, above one floor.
pub struct ScanView<'a> {
    pub scan: &'a VirtualScan,
    pub floor: &'a FloorReport,
    pub sparse_track: bool,
    /// True if the search for the scale ended at its budget.
    pub scale_cut_short: bool,
}

/// A fused clip, before labels and floor.
pub(super) struct Fusion {
    fused: Fused,
    /// Upward direction in the world of the used poses.
    up: Option<Up>,
    sparse_track: bool,
    pub(super) reasons: Vec<Reason>,
}

/// Fuses the clip, finds the floor and casts the rays.
pub fn observe(
    clip: &Clip,
    frames: Option<Range<u32>>,
    params: &AlignParams,
    progress: &dyn Progress,
) -> Result<Observation, AlignError> {
    match fuse(clip, frames, params, progress)? {
        Ok(fusion) => fusion.observe(clip, params, progress),
        Err(reasons) => Ok(Observation { reasons, ..Observation::default() }),
    }
}

/// Fuses the clip; returns the reasons if that is not possible.
pub(super) fn fuse(
    clip: &Clip,
    frames: Option<Range<u32>>,
    params: &AlignParams,
    progress: &dyn Progress,
) -> Result<Result<Fusion, Vec<Reason>>, AlignError> {
    let mut tracked = track_where_needed(clip, frames.as_ref(), params, progress)?;
    let by_device =
        if tracked.is_none() { trajectory::without_outliers(clip, frames.as_ref()) } else { None };
    let fuse = |tracked: Option<&TrackedClip>| {
        progress::begin(progress, Stage::Fuse)?;
        let tracked = tracked.map(|tracked| (&tracked.world_from_camera, tracked.is_refined));
        let poses = tracked.or(by_device.as_ref().map(|trajectory| (&trajectory.world_from_camera, false)));
        let poses = poses
            .map(|(world_from_camera, is_of_key_frames)| fuse::Poses { world_from_camera, is_of_key_frames });
        fuse::fuse(clip, frames.clone(), poses, progress)
    };
    let mut fused = fuse(tracked.as_ref())?;
    if let (None, Ok(first)) = (&tracked, &fused)
        && let Some(refined) = track::refine(clip, &first.key_frames, &params.track, progress)?
    {
        fused = fuse(Some(&refined))?;
        tracked = Some(refined);
    }
    let mut reasons: Vec<Reason> = remarks::of(clip);
    reasons.extend(by_device.iter().map(|trajectory| trajectory.reason.clone()));
    reasons.extend(tracked.iter().flat_map(|tracked| tracked.reasons.clone()));
    let fused = match fused {
        Ok(fused) => fused,
        Err(why) => {
            reasons.push(why.reason(clip));
            return Ok(Err(reasons));
        }
    };
    reasons.extend(fused.remarks());
    if tracked.is_none() {
        let dropped =
            by_device.as_ref().map(|kept| track::convention_of_dropped(clip, frames.as_ref(), kept));
        reasons.extend(dropped.transpose()?.flatten().or_else(|| track::other_convention(&fused.key_frames)));
    }
    let up = up_in_world(clip, tracked.as_ref(), by_device.as_ref());
    let sparse_track = tracked.as_ref().is_some_and(|tracked| tracked.is_sparse);
    Ok(Ok(Fusion { fused, up, sparse_track, reasons }))
}

impl Fusion {
    /// Labels the clip, finds the floor and casts the rays.
    pub(super) fn observe(
        mut self,
        clip: &Clip,
        params: &AlignParams,
        progress: &dyn Progress,
    ) -> Result<Observation, AlignError> {
        let mut observation = self.blank();
        progress::begin(progress, Stage::Label)?;
        let keys = &self.fused.key_frames;
        let up = self.up.as_ref().map(|up| &up.direction);
        let labeller = Labeller::segment_pictures(
            clip,
            &mut self.fused.cloud_in_world,
            keys,
            up,
            &params.label,
            progress,
        )?;
        observation.labels = Some(labeller.report.clone());
        observation.pictures = labeller.pictures.clone();
        observation.reasons.extend(labeller.remarks.clone());

        progress::begin(progress, Stage::Floor)?;
        let floors = self.floors(params.seed, &mut observation.reasons);
        if let Some(first) = floors.first() {
            let cloud = &mut self.fused.cloud_in_world;
            let labelled = labeller.add_shapes(cloud, &first.clip_from_world, &params.label);
            observation.walls = labelled.walls;
            observation.labels = Some(labelled.report);
            observation.reasons.extend(labelled.remark);

            progress::begin(progress, Stage::Raycast)?;
            observation.cast(self.fused.cloud_in_world, keys, &floors, &params.raycast, progress)?;
            observation.features = features(&self.fused.pictures, &first.clip_from_world);
        }
        observation.keys = self.fused.key_frames;
        Ok(observation)
    }

    /// Finds the floor and casts the rays without labels. The key frames are left out.
    pub(super) fn observe_shape(
        &self,
        params: &AlignParams,
        progress: &dyn Progress,
    ) -> Result<Observation, AlignError> {
        let mut observation = self.blank();
        let floors = self.floors(params.seed, &mut observation.reasons);
        let (cloud, keys) = (self.fused.cloud_in_world.clone(), &self.fused.key_frames);
        observation.cast(cloud, keys, &floors, &params.raycast, progress)?;
        Ok(observation)
    }

    /// Finds the floor of a clip in nominal metres, at any height, and casts the rays.
    pub(super) fn observe_nominal(
        &self,
        params: &AlignParams,
        progress: &dyn Progress,
    ) -> Result<Result<Observation, NoFloor>, AlignError> {
        let (cloud, keys) = (&self.fused.cloud_in_world, &self.fused.key_frames);
        let floor = match floor::find_floor(cloud, keys, self.up.as_ref(), &ANY_HEIGHT, params.seed) {
            Ok(floor) => floor,
            Err(why) => return Ok(Err(why)),
        };
        let mut observation = self.blank();
        observation.cast(cloud.clone(), keys, &[floor], &params.raycast, progress)?;
        Ok(Ok(observation))
    }

    pub(super) fn into_key_frames(self) -> Vec<KeyFrame> {
        self.fused.key_frames
    }

    fn blank(&self) -> Observation {
        Observation {
            key_frames: self.fused.key_frames.len(),
            sparse_track: self.sparse_track,
            reasons: self.reasons.clone(),
            ..Observation::default()
        }
    }

    /// Returns the possible floors, the likeliest first.
    fn floors(&self, seed: u64, reasons: &mut Vec<Reason>) -> Vec<Floor> {
        let (cloud, keys) = (&self.fused.cloud_in_world, &self.fused.key_frames);
        let (floors, none_seen) = floor::floors(cloud, keys, self.up.as_ref(), seed);
        reasons.extend(none_seen.map(|why| why.reason()));
        floors
    }
}

/// Returns the upward direction in the world of the used poses.
fn up_in_world(clip: &Clip, tracked: Option<&TrackedClip>, by_device: Option<&Trajectory>) -> Option<Up> {
    match (tracked, by_device) {
        // Tracking has a world of its own, in which only the measured forces give the upward direction.
        (Some(tracked), _) if !tracked.is_refined => Up::felt(posed(clip, &tracked.world_from_camera)),
        (_, Some(trajectory)) => clip.up_by(posed(clip, &trajectory.world_from_camera)),
        _ => clip.up_in_world(),
    }
}

/// Tracks the wanted frames of a clip if none of them has a pose.
fn track_where_needed(
    clip: &Clip,
    frames: Option<&Range<u32>>,
    params: &AlignParams,
    progress: &dyn Progress,
) -> Result<Option<TrackedClip>, AlignError> {
    let wanted = |number: u32| frames.is_none_or(|frames| frames.contains(&number));
    let mut headers = clip.frames().iter().enumerate().filter(|(_, header)| wanted(header.number));
    let indices: Vec<usize> = headers.clone().map(|(index, _)| index).collect();
    let has_pose = headers.any(|(_, header)| header.world_from_camera.is_some());
    if indices.is_empty() || has_pose || !clip.has_color() {
        return Ok(None);
    }
    progress::begin(progress, Stage::Track)?;
    Ok(Some(track::track(clip, &indices, &params.track, progress)?))
}

impl Observation {
    /// Moves the cloud into the clip frame and casts the rays above all floors.
    fn cast(
        &mut self,
        cloud_in_world: PointCloud,
        keys: &[KeyFrame],
        floors: &[Floor],
        params: &RaycastParams,
        progress: &dyn Progress,
    ) -> Result<(), AlignError> {
        let Some(first) = floors.first() else { return Ok(()) };
        self.cloud_in_clip = cloud_in_world.transformed(&first.clip_from_world);
        self.floor = Some(first.report());
        self.clip_from_world = Some(first.clip_from_world);
        self.first_camera = keys.first().map(|key| FirstCamera {
            index: key.index,
            number: key.number,
            clip_from_camera: first.clip_from_world * key.world_from_camera,
        });
        self.scan = self.scan_above(first, first, keys, params);
        for floor in &floors[1..] {
            progress::check(progress)?;
            let scan = self.scan_above(floor, first, keys, params);
            self.other_floors.push(FloorHypothesis { scan, floor: floor.report() });
        }
        Ok(())
    }

    /// Returns the scan above `floor`; the cloud stays in the frame of `first`.
    fn scan_above(
        &self,
        floor: &Floor,
        first: &Floor,
        keys: &[KeyFrame],
        params: &RaycastParams,
    ) -> VirtualScan {
        let rise_m = first.first_camera_height_m - floor.first_camera_height_m;
        let params = RaycastParams { vacuum_height_m: params.vacuum_height_m + rise_m, floor_m: rise_m };
        scan::raycast(&self.cloud_in_clip, keys, &first.clip_from_world, &params)
    }

    /// Returns all scans with their floors, the likeliest first; none without a floor, seen or assumed.
    pub(super) fn views(&self) -> impl Iterator<Item = ScanView<'_>> {
        let first = self.floor.iter().map(|floor| (&self.scan, floor));
        let others = self.other_floors.iter().map(|other| (&other.scan, &other.floor));
        let scale_cut_short = self.scale.as_ref().is_some_and(|scale| !scale.complete);
        let sparse_track = self.sparse_track;
        first.chain(others).map(move |(scan, floor)| ScanView { scan, floor, sparse_track, scale_cut_short })
    }

    /// Returns this observation with the chosen floor at z = 0; `None` without a floor.
    pub(super) fn on_floor(&self, alignment: &Alignment) -> Option<Observation> {
        let floor = alignment.floor.as_ref().or(self.floor.as_ref())?;
        let (scan, floor_offset_m) = self.view_of(alignment);
        Some(self.with_floor(floor, scan, floor_offset_m))
    }

    /// Returns this observation with each other floor than that of `chosen` at z = 0.
    pub(super) fn on_other_floors(&self, chosen: &Observation) -> impl Iterator<Item = Observation> {
        let first_m = self.floor.as_ref().map_or(0.0, |floor| floor.camera_height_m);
        let others = self.views().filter(move |view| Some(view.floor) != chosen.floor.as_ref());
        others.map(move |view| {
            self.with_floor(view.floor, view.scan.clone(), view.floor.camera_height_m - first_m)
        })
    }

    /// Returns this observation with the floor `floor_offset_m` below that of the cloud at z = 0, without other floors.
    fn with_floor(&self, floor: &FloorReport, scan: VirtualScan, floor_offset_m: f64) -> Observation {
        let lower = Pose3::translation(0.0, 0.0, floor_offset_m);
        let raise = |range: (f64, f64)| (range.0 + floor_offset_m, range.1 + floor_offset_m);
        let mut moved =
            Observation { scan, floor: Some(floor.clone()), other_floors: Vec::new(), ..self.clone() };
        moved.cloud_in_clip = moved.cloud_in_clip.transformed(&lower);
        moved.clip_from_world = moved.clip_from_world.map(|clip_from_world| lower * clip_from_world);
        moved.walls.iter_mut().flat_map(|wall| &mut wall.seen_m).for_each(|seen| *seen = seen.map(raise));
        moved
    }

    /// Returns the camera that defines the clip frame above a floor of the clip.
    pub(super) fn reference_camera(&self, floor: &FloorReport) -> Option<ReferenceCamera> {
        self.first_camera.as_ref().map(|camera| camera.above(floor))
    }

    /// Returns the scan that an answer chose, and the depth of its floor below that of the cloud.
    pub(super) fn view_of(&self, alignment: &Alignment) -> (VirtualScan, f64) {
        let first_m = self.floor.as_ref().map_or(0.0, |floor| floor.camera_height_m);
        self.views().find(|view| Some(view.floor) == alignment.floor.as_ref()).map_or_else(
            || (self.scan.clone(), 0.0),
            |view| (view.scan.clone(), view.floor.camera_height_m - first_m),
        )
    }
}
