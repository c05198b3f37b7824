//! Simulated homes: any number of clips with exact truth, rendered on demand.

use super::oracle::Oracle;
use super::{Case, RunError, Sample, Suite, Unit};
use crate::simulate::{ClipParams, Home, HomeParams, Sensor, Set, SimulatedClip, Survey, clip_in_memory};
use std::ops::Range;
use std::sync::{Arc, Mutex};
use viola_align as align;
use viola_align::{AlignParams, Target};
use viola_formats::clip::Clip;
use viola_formats::lidar::LidarMap;
use viola_geometry::LevelName;
use viola_geometry::progress::Progress;

/// Suffix of sets whose clips get the map of another home.
const FOREIGN: &str = "-foreign";

/// Selection of homes, and recording of their clips.
#[derive(Debug, Clone, PartialEq)]
pub struct HomesParams {
    pub sets: Vec<Set>,
    /// One home per set and seed.
    pub seeds: Range<u64>,
    pub clips_per_home: u64,
    /// Lengths of the clips in frames.
    pub frames: Vec<usize>,
    /// Labels pictures by the truth with this accuracy, instead of by shape alone.
    pub picture_labels: Option<f64>,
    /// Also pairs every clip with the map of the next seed's home, to which it does not belong.
    pub foreign: bool,
    /// Withholds the device's poses, so that the clips must be tracked. They last as long, with [`DENSER`]
    /// times as many frames.
    pub withhold_poses: bool,
    /// Error of the device's poses after one metre, in metres, as in [`ClipParams`].
    pub drift: f64,
    pub unit: Unit,
}

impl Default for HomesParams {
    fn default() -> Self {
        HomesParams {
            sets: vec![Set::Normal],
            seeds: 1000..1001,
            clips_per_home: 1,
            frames: vec![60],
            picture_labels: None,
            foreign: false,
            withhold_poses: false,
            drift: ClipParams::default().drift,
            unit: Unit::Metres,
        }
    }
}

impl HomesParams {
    /// Returns a recording as a clip, and the parameters to align it.
    pub(super) fn clip_of(
        &self,
        recorded: &Arc<SimulatedClip>,
        seed: u64,
        params: &AlignParams,
    ) -> (Clip, AlignParams) {
        let mut params = params.clone();
        let Some(accuracy) = self.picture_labels else { return (clip_in_memory(recorded.clone()), params) };
        let (clip, oracle) = Oracle::with_clip(recorded.clone(), accuracy, seed);
        params.label.segmenter = Some(oracle);
        (clip, params)
    }
}

/// Factor of the frame rate without device poses: 10 Hz instead of 2.5 Hz. At 2.5 Hz half of the picture is
/// new in every frame, and nobody records like that for tracking.
pub const DENSER: usize = 4;

/// Returns the name of a storey.
fn level(storey: u64) -> LevelName {
    if storey == 0 { LevelName::MAIN } else { format!("storey-{storey}").parse().unwrap_or_default() }
}

pub struct HomeClips {
    params: HomesParams,
    cases: Vec<Case>,
    clips: Vec<HomeClip>,
    /// Recently generated homes, shared by neighbouring cases.
    recent: Mutex<Vec<Arc<Mapped>>>,
}

/// The clip of a case.
#[derive(Clone, Copy)]
struct HomeClip {
    set: Set,
    seed: u64,
    storey: u64,
    /// Among the clips of the storey.
    number: u64,
    frames: usize,
    foreign: bool,
}

/// A home and its map.
struct Mapped {
    of: (Set, u64, u64),
    home: Home,
    survey: Survey,
    lidar: Arc<LidarMap>,
    target: Option<Arc<Target>>,
}

impl HomeClips {
    pub fn new(params: HomesParams) -> HomeClips {
        let mut clips = Vec::new();
        let maps: &[bool] = if params.foreign { &[false, true] } else { &[false] };
        for &set in &params.sets {
            for &foreign in maps {
                for &frames in &params.frames {
                    for seed in params.seeds.clone() {
                        let clip = |number| {
                            let (storey, number) = (number % set.storeys(), number / set.storeys());
                            HomeClip { set, seed, storey, number, frames, foreign }
                        };
                        clips.extend((0..params.clips_per_home).map(clip));
                    }
                }
            }
        }
        let case = |clip: &HomeClip| Case {
            name: format!("{:06}_{}", clip.seed, clip.number * clip.set.storeys() + clip.storey),
            set: format!("{}{}", clip.set.name(), if clip.foreign { FOREIGN } else { "" }),
            frames: clip.frames,
        };
        HomeClips { cases: clips.iter().map(case).collect(), clips, params, recent: Mutex::default() }
    }

    /// Returns a storey of a home with its map.
    fn mapped(&self, of: (Set, u64, u64)) -> Result<Arc<Mapped>, RunError> {
        const KEPT: usize = 4;
        let (set, seed, storey) = of;
        let recent = || self.recent.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        if let Some(mapped) = recent().iter().find(|mapped| mapped.of == of) {
            return Ok(mapped.clone());
        }
        let home = Home::generate(&HomeParams { storey, ..HomeParams::new(set, seed) });
        let survey = home.survey();
        let lidar = survey.lidar_map().map_err(|source| RunError::Map { home: seed, source })?;
        let target = Target::of_level(level(storey), &lidar).map(Arc::new);
        let mapped = Arc::new(Mapped { of, home, survey, lidar: Arc::new(lidar), target });
        let mut recent = recent();
        recent.push(mapped.clone());
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
        // The cases contain the other parameters.
        let HomesParams { picture_labels, withhold_poses, drift, unit, .. } = &self.params;
        let poses = if *withhold_poses {
            format!(" without poses, with an accelerometer, {DENSER} times as densely")
        } else {
            String::new()
        };
        let unit = unit.fingerprint();
        format!("simulated {picture_labels:?}{poses} {drift}{unit}")
    }

    fn sample(
        &self,
        index: usize,
        params: &AlignParams,
        progress: &dyn Progress,
    ) -> Result<Option<Sample>, RunError> {
        let HomeClip { set, seed, storey, number, frames, foreign } = self.clips[index];
        let mapped = self.mapped((set, seed, storey))?;
        let of_map = if foreign { seed + 1 } else { seed };
        let map = self.mapped((set, of_map, storey))?;
        let others = (0..set.storeys()).filter(|other| *other != storey);
        let others = others.map(|other| Ok(self.mapped((set, of_map, other))?.target.clone()));
        let others: Vec<Option<Arc<Target>>> = others.collect::<Result<_, RunError>>()?;
        // Colour is not used: small pictures suffice.
        let color_width = Sensor::PhoneLidar.depth_camera().width;
        let denser = if self.params.withhold_poses { DENSER } else { 1 };
        let frames = frames * denser;
        let recording = ClipParams {
            frames,
            rate_hz: ClipParams::default().rate_hz * denser as f64,
            color_width,
            drift: self.params.drift,
            ..ClipParams::default()
        };
        let recorded = mapped.home.clip(&mapped.survey, number, &recording);
        let floor_in_sight = recorded.shows_floor();
        // Look-alikes are searched for in homes of similar rooms only.
        let unknowable = (set == Set::Repeated && !foreign).then_some(recorded.truth.unknowable);
        let recorded = if self.params.withhold_poses { recorded.without_poses() } else { recorded };
        let recorded = Arc::new(recorded);
        let (clip, params) = self.params.clip_of(&recorded, seed, params);
        let targets: Vec<&Target> =
            map.target.iter().chain(others.iter().flatten()).map(Arc::as_ref).collect();
        let (clip, scale) = self.params.unit.applied(clip, seed * 1000 + number);
        let observation = align::observe_any_scale(&targets, &clip, None, &params, progress)
            .map_err(|error| RunError::of_clip(&self.cases[index].name, error))?;
        let first = observation.first_camera.as_ref().map_or(0, |camera| camera.index);
        let map_from_clip = (!foreign).then(|| recorded.map_from_frame(&mapped.survey, first));
        Ok(Some(Sample {
            observation,
            lidar: map.lidar.clone(),
            target: map.target.clone(),
            level: level(storey),
            other_levels: others.into_iter().flatten().collect(),
            map_from_clip,
            unknowable,
            floor_in_sight: Some(floor_in_sight),
            scale,
            first_frame: 0,
            last_frame: frames.saturating_sub(1) as u32,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::record::coverage;
    use viola_geometry::Pose2;
    use viola_geometry::progress::Silent;

    #[test]
    fn the_map_of_another_home_has_no_true_pose() {
        for (set, is_examined) in [(Set::Normal, false), (Set::Repeated, true)] {
            let suite = HomeClips::new(HomesParams {
                sets: vec![set],
                seeds: 6..7,
                frames: vec![4],
                foreign: true,
                drift: 0.0,
                ..HomesParams::default()
            });
            let sample = |index| suite.sample(index, &AlignParams::default(), &Silent).unwrap().unwrap();
            let (own, foreign) = (sample(0), sample(1));
            let truth = own.map_from_clip.unwrap();
            assert!(own.is_right(own.level, &truth) && coverage(&own).is_some());
            assert_eq!(own.unknowable.is_some(), is_examined);
            assert_eq!((foreign.map_from_clip, foreign.unknowable), (None, None));
            assert_eq!((foreign.errors(&Pose2::IDENTITY), coverage(&foreign)), (None, None));
            assert!(!foreign.is_right(foreign.level, &truth));
            assert_eq!(own.floor_in_sight, foreign.floor_in_sight);
        }
    }
}
