//! Simulated homes: any number of clips with exact truth, rendered when they are wanted.

use super::{Case, RunError, Sample, Suite};
use crate::align::{self, AlignError, AlignParams, Target};
use crate::clip::{Clip, ClipInfo};
use crate::geometry::Vector3;
use crate::lidar::LidarMap;
use crate::progress::Progress;
use crate::simulate::{ClipParams, Home, HomeParams, Sensor, Set, SimulatedClip, Survey, valetudo_json};
use std::ops::Range;
use std::sync::{Arc, Mutex};

/// Which homes, and how they are filmed.
#[derive(Debug, Clone, PartialEq)]
pub struct HomesParams {
    pub set: Set,
    /// One home a seed.
    pub seeds: Range<u64>,
    pub clips_per_home: u64,
    /// Lengths of the clips in frames.
    pub frames: Vec<usize>,
    pub sensor: Sensor,
}

/// Clips of simulated homes.
pub struct HomeClips {
    params: HomesParams,
    cases: Vec<Case>,
    /// Seed, number and length of each case's clip.
    clips: Vec<(u64, u64, usize)>,
    /// The homes made last: neighbouring cases share theirs.
    recent: Mutex<Vec<(u64, Arc<Mapped>)>>,
}

/// A home and its map.
struct Mapped {
    home: Home,
    survey: Survey,
    lidar: Arc<LidarMap>,
    target: Option<Arc<Target>>,
}

impl HomeClips {
    pub fn new(params: HomesParams) -> HomeClips {
        let clips: Vec<(u64, u64, usize)> = params
            .frames
            .iter()
            .flat_map(|&frames| {
                let of_home = move |seed| (0..params.clips_per_home).map(move |clip| (seed, clip, frames));
                params.seeds.clone().flat_map(of_home)
            })
            .collect();
        let case = |&(seed, clip, frames): &(u64, u64, usize)| Case {
            name: format!("{seed:06}_{clip}"),
            set: params.set.name().to_owned(),
            frames,
        };
        HomeClips { cases: clips.iter().map(case).collect(), clips, params, recent: Mutex::default() }
    }

    fn mapped(&self, seed: u64) -> Result<Arc<Mapped>, RunError> {
        const KEPT: usize = 4;
        let recent = || self.recent.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        if let Some((_, mapped)) = recent().iter().find(|(known, _)| *known == seed) {
            return Ok(mapped.clone());
        }
        let home = Home::generate(&HomeParams::new(self.params.set, seed));
        let survey = home.survey();
        let lidar = LidarMap::read(valetudo_json(&survey).to_string().as_bytes())
            .map_err(|source| RunError::Map { home: seed, source })?;
        let target = Target::new(&lidar).map(Arc::new);
        let mapped = Arc::new(Mapped { home, survey, lidar: Arc::new(lidar), target });
        let mut recent = recent();
        recent.push((seed, mapped.clone()));
        if recent.len() > KEPT {
            recent.remove(0);
        }
        Ok(mapped)
    }
}

impl Suite for HomeClips {
    fn cases(&self) -> &[Case] {
        &self.cases
    }

    fn fingerprint(&self) -> String {
        let HomesParams { set, clips_per_home: _, seeds: _, frames: _, sensor } = &self.params;
        format!("{} {sensor:?}", set.name())
    }

    fn sample(
        &self,
        index: usize,
        params: &AlignParams,
        progress: &dyn Progress,
    ) -> Result<Option<Sample>, RunError> {
        let (seed, number, frames) = self.clips[index];
        let mapped = self.mapped(seed)?;
        // Colour does not matter here: the cheapest pictures will do.
        let color_width = self.params.sensor.depth_camera().width;
        let recording =
            ClipParams { frames, sensor: self.params.sensor, color_width, ..ClipParams::default() };
        let recorded = mapped.home.clip(&mapped.survey, number, &recording);
        let truth = recorded.truth.clone();
        let clip = in_memory(recorded);
        let observation = align::observe(&clip, None, params, progress).map_err(|error| match error {
            AlignError::Cancelled => RunError::Cancelled,
            source => RunError::Align { clip: self.cases[index].name.clone(), source },
        })?;
        Ok(Some(Sample {
            observation,
            lidar: mapped.lidar.clone(),
            target: mapped.target.clone(),
            map_from_clip: truth.map_from_clip,
            equivalent_poses: truth.equivalent_poses,
            first_frame: 0,
            last_frame: frames.saturating_sub(1) as u32,
        }))
    }
}

fn in_memory(recorded: SimulatedClip) -> Clip {
    let (color, depth) = (recorded.color_camera, recorded.depth_camera);
    let frames = recorded.headers().to_vec();
    let info = ClipInfo {
        layout: "simulated".into(),
        pose_convention: "camera-to-world, OpenCV (x right, y down, z forward)".into(),
        depth_unit: "metres".into(),
        gravity: "world z is up".into(),
        intrinsics: "exact".into(),
        frames: frames.len(),
        frames_with_pose: frames.len(),
        skipped_without_pose: 0,
        skipped_incomplete: 0,
        color_width: color.width,
        color_height: color.height,
        depth_width: depth.width,
        depth_height: depth.height,
        duration_s: frames.last().and_then(|last| last.time_s),
        notes: Vec::new(),
    };
    Clip::from_frames(info, frames, Some(Vector3::z()), move |index| recorded.frame(index))
}
