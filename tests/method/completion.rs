//! Completion of clips with too few points at the vacuum's height: the completed points, their report, and
//! their separation from the seen points.

use image::{GrayImage, Rgb, RgbImage};
use rayon::prelude::*;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, LazyLock};
use viola_align as align;
use viola_align::complete::inpaint::{InpaintError, Inpainter, open_inpainter};
use viola_align::complete::monocular::{DepthError, DepthEstimator, open_estimator};
use viola_align::complete::{Imagination, Take, ViewStrategy};
use viola_align::{Activation, AlignError, AlignParams, Aligned, CompleteParams};
use viola_formats::clip::{Clip, Frame};
use viola_formats::lidar::LidarMap;
use viola_geometry::progress::{Progress, Silent, Stage};
use viola_home as home;
use viola_lab::simulate::{ClipParams, Home, HomeParams, Sensor, Set, SimulatedClip};
use viola_network as network;
use viola_network::RuntimeParams;
use viola_network::manifest::Manifest;

/// A clip that saw mostly the upper part of a room, its map, and the truth.
struct Recorded {
    clip: Clip,
    lidar: LidarMap,
    truth: viola_geometry::Pose2,
}

/// The recording of several tests.
static SHARED: LazyLock<Recorded> = LazyLock::new(|| recorded(102, 0));

/// Returns a recording with colour pictures of the depth sensor's width, which are rendered fastest.
fn recorded(seed: u64, number: u64) -> Recorded {
    recorded_with(seed, number, Sensor::PhoneLidar.depth_camera().width)
}

fn recorded_with(seed: u64, number: u64, color_width: u32) -> Recorded {
    let home = Home::generate(&HomeParams::new(Set::Upper, seed));
    let survey = home.survey();
    let lidar = survey.lidar_map().unwrap();
    let params = ClipParams { frames: 60, color_width, ..ClipParams::default() };
    let recorded = home.clip(&survey, number, &params);
    let truth = recorded.truth.map_from_clip;
    Recorded { clip: rendered(recorded), lidar, truth }
}

/// Returns a recording as a clip whose frames are rendered once, since tests align it several times.
fn rendered(recorded: SimulatedClip) -> Clip {
    let indices = 0..recorded.headers().len();
    let frames: Vec<Frame> = indices.into_par_iter().map(|index| recorded.frame(index)).collect();
    let clip = recorded.into_clip();
    let (info, headers, up) = (clip.info().clone(), clip.frames().to_vec(), clip.up_in_world());
    Clip::from_frames(info, headers, up.map(|up| up.direction), move |index| frames[index].clone())
}

/// Paints holes white and counts how often it is asked.
#[derive(Default)]
struct White {
    asked: AtomicUsize,
    breaks: bool,
}

impl Inpainter for White {
    fn inpaint(
        &self,
        picture: &RgbImage,
        hole: &GrayImage,
        _seed: u64,
        keep_going: &dyn Fn() -> bool,
    ) -> Result<RgbImage, InpaintError> {
        self.asked.fetch_add(1, Ordering::Relaxed);
        if self.breaks {
            return Err(InpaintError::NotFinite);
        }
        if !keep_going() {
            return Err(InpaintError::Cancelled);
        }
        let mut filled = picture.clone();
        for (pixel, hole) in filled.pixels_mut().zip(hole.pixels()) {
            if hole.0[0] > 0 {
                *pixel = Rgb([255; 3]);
            }
        }
        Ok(filled)
    }

    fn name(&self) -> String {
        "white".into()
    }
}

/// Estimates two metres everywhere.
struct Flat;

impl DepthEstimator for Flat {
    fn depth(&self, picture: &RgbImage) -> Result<Vec<f32>, DepthError> {
        Ok(vec![2.0; (picture.width() * picture.height()) as usize])
    }

    fn name(&self) -> String {
        "flat".into()
    }
}

fn imagination(inpainter: Arc<dyn Inpainter>, estimator: Option<Arc<dyn DepthEstimator>>) -> Imagination {
    Imagination { inpainter, estimator, views: ViewStrategy::Frontier, max_views: 4 }
}

fn params(imagination: Option<Imagination>) -> AlignParams {
    let complete = CompleteParams {
        when: Activation::Always,
        take: Take::After,
        imagination,
        ..CompleteParams::default()
    };
    AlignParams { complete, ..AlignParams::default() }
}

fn align(recorded: &Recorded, params: &AlignParams) -> Aligned {
    align::align(&recorded.clip, None, &recorded.lidar, params, &Silent).unwrap()
}

/// A clip without a floor has a scan for each height of the camera: poses above another one stay rivals.
#[test]
fn other_floors_are_completed_and_stay_rivals() {
    let Recorded { clip, lidar, .. } = &*SHARED;
    let params = params(None);
    let mut observation = align::observe(clip, None, &params, &Silent).unwrap();
    let mut floor = observation.floor.clone().unwrap();
    floor.camera_height_m += 0.1;
    let scan = observation.scan.clone();
    observation.other_floors.push(align::FloorHypothesis { scan, floor: floor.clone() });
    let target = align::Target::new(lidar).unwrap();
    let completed_hits = |scan: &align::VirtualScan| scan.hits.iter().filter(|hit| hit.completed).count();
    let asked = std::sync::Mutex::new(Vec::new());
    let register =
        |observation: &align::Observation, _: Option<&align::Completion>, progress: &dyn Progress| {
            let scans = std::iter::once(&observation.scan)
                .chain(observation.other_floors.iter().map(|other| &other.scan));
            asked.lock().unwrap().push(scans.map(completed_hits).collect::<Vec<_>>());
            align::register(observation, &[&target], &params, progress)
        };
    let (answer, completion) = align::completing(&observation, &params, &Silent, &register).unwrap();
    let asked = asked.into_inner().unwrap();
    assert_eq!((asked.len(), &asked[0]), (2, &vec![0, 0]));
    // This clip needs completed hits above one of the two only.
    assert!(asked[1].len() == 2 && asked[1][1] > 0, "{asked:?}");
    // The completion is that of the floor that was chosen.
    assert_eq!(completed_hits(&completion.unwrap().scan), answer.completion.unwrap().hits);
}

#[test]
fn what_is_filled_in_is_told_and_stays_apart() {
    let recorded = &*SHARED;
    let never = AlignParams {
        complete: CompleteParams { when: Activation::Never, ..CompleteParams::default() },
        ..AlignParams::default()
    };
    let seen = align(recorded, &never);
    assert!(seen.completion.is_none() && seen.alignment.completion.is_none());
    assert!(home::completion_png(&seen).is_none() && home::completion_pngs(&seen).is_empty());

    let white = Arc::new(White::default());
    for (imagination, names) in [
        (None, vec![]),
        (Some(imagination(white.clone(), None)), vec!["white"]),
        (Some(imagination(white.clone(), Some(Arc::new(Flat)))), vec!["white", "flat"]),
    ] {
        let completed = align(recorded, &params(imagination));
        // The points for the home's map contain no completed ones.
        assert_eq!(completed.cloud_in_clip, seen.cloud_in_clip, "{names:?}");
        assert_eq!(completed.scan, seen.scan);
        let report = completed.alignment.completion.as_ref().unwrap();
        let completion = completed.completion.as_ref().unwrap();
        assert_eq!(report.imagined_by, names);
        assert!(report.structure_points > 0 && report.taken && !report.cut_short);
        assert_eq!(report.structure_points + report.imagined_points, completion.cloud_in_clip.points.len());
        assert_eq!(report.hits, completion.scan.hits.iter().filter(|hit| hit.completed).count());
        assert_eq!(report.views.len(), completion.views.len());
        assert_eq!(report.views.is_empty(), names.is_empty());
        assert_eq!(report.before.map_from_clip, seen.alignment.map_from_clip);
        assert_eq!(report.after.map_from_clip, completed.alignment.map_from_clip);
        // The pictures: one sheet, two plans, and four for each view.
        let pictures = home::completion_pngs(&completed);
        assert_eq!(pictures.len(), 3 + 4 * report.views.len());
        for (name, bytes) in &pictures {
            assert!(image::load_from_memory(bytes).is_ok(), "{name}");
        }
        assert_eq!(home::completion_png(&completed).unwrap(), pictures[0].1);
    }
    assert!(white.asked.load(Ordering::Relaxed) > 0);
}

#[test]
fn any_number_of_threads_completes_alike() {
    let recorded = recorded(104, 0);
    let params = params(Some(imagination(Arc::new(White::default()), Some(Arc::new(Flat)))));
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let aligned = align(&recorded, &params);
            (aligned.alignment, aligned.completion.map(|completion| completion.cloud_in_clip))
        })
    };
    let one = on(1);
    assert_eq!(one, on(2));
    assert_eq!(one, on(3));
}

/// Cancels, or runs out of time, once completion begins.
struct Impatient {
    cancels: bool,
    completing: std::sync::atomic::AtomicBool,
}

impl Impatient {
    fn that(cancels: bool) -> Impatient {
        Impatient { cancels, completing: Default::default() }
    }
}

impl Progress for Impatient {
    fn enter(&self, stage: Stage) {
        self.completing.store(stage == Stage::Complete, Ordering::Relaxed);
    }

    fn cancelled(&self) -> bool {
        self.cancels && self.completing.load(Ordering::Relaxed)
    }

    fn out_of_time(&self) -> bool {
        self.completing.load(Ordering::Relaxed)
    }
}

#[test]
fn completion_ends_when_it_is_told_to() {
    let recorded = &*SHARED;
    let white = Arc::new(White::default());
    let params = params(Some(imagination(white.clone(), None)));
    let run =
        |progress: &dyn Progress| align::align(&recorded.clip, None, &recorded.lidar, &params, progress);
    assert!(matches!(run(&Impatient::that(true)), Err(AlignError::Cancelled)));
    // Without time for a view the walls are still extended, and the answer reports that it was cut short.
    let report = run(&Impatient::that(false)).unwrap().alignment.completion.unwrap();
    assert!(report.cut_short && report.views.is_empty() && report.structure_points > 0);
    assert_eq!(white.asked.load(Ordering::Relaxed), 0);
}

#[test]
fn a_network_that_fails_is_told_and_structure_stays() {
    let recorded = &*SHARED;
    let broken = White { breaks: true, ..White::default() };
    let aligned = align(recorded, &params(Some(imagination(Arc::new(broken), None))));
    let report = aligned.alignment.completion.unwrap();
    assert!(report.views.is_empty() && report.imagined_by.is_empty() && report.structure_points > 0);
    let codes: Vec<&str> = aligned.alignment.reasons.iter().map(|reason| reason.code.as_str()).collect();
    assert!(codes.contains(&"imagination_failed"), "{codes:?}");
}

/// Networks would complete black pictures.
#[test]
fn a_clip_without_colour_is_completed_by_structure_alone() {
    let Recorded { clip, lidar, .. } = &*SHARED;
    let (mut info, headers, up) = (clip.info().clone(), clip.frames().to_vec(), clip.up_in_world());
    (info.color_width, info.color_height) = (0, 0);
    let load = |index: usize| {
        let frame = SHARED.clip.stream(vec![index]).next_batch(1).remove(0).unwrap();
        Frame { color: None, ..frame }
    };
    let clip = Clip::from_frames(info, headers, up.map(|up| up.direction), load);
    let white = Arc::new(White::default());
    let params = params(Some(imagination(white.clone(), None)));
    let aligned = align::align(&clip, None, lidar, &params, &Silent).unwrap();
    assert_eq!(white.asked.load(Ordering::Relaxed), 0);
    let report = aligned.alignment.completion.unwrap();
    assert!(report.views.is_empty() && report.imagined_by.is_empty() && report.structure_points > 0);
    let codes: Vec<&str> = aligned.alignment.reasons.iter().map(|reason| reason.code.as_str()).collect();
    assert!(codes.contains(&"no_colour"), "{codes:?}");
}

/// With structure, clips are found that the points at the vacuum's height alone do not find; none is lost.
#[test]
fn walls_that_go_on_help_clips_of_the_upper_part() {
    let (mut base_right, mut structure_right) = (0, 0);
    for (seed, number) in [(107, 0), (107, 1), (108, 0), (110, 0), (110, 1), (111, 0)] {
        let recorded = recorded(seed, number);
        let mut base = AlignParams::default();
        base.hit_weights.upper_weight = 0.0;
        base.complete.when = Activation::Never;
        let right = |params: &AlignParams| {
            let pose = align(&recorded, params).alignment.map_from_clip;
            usize::from(pose.is_some_and(|pose| pose.distance_m(&recorded.truth) < 0.3))
        };
        let (base, structure) = (right(&base), right(&AlignParams::default()));
        assert!(structure >= base, "{seed} {number}: right without structure, wrong with it");
        base_right += base;
        structure_right += structure;
    }
    assert!(structure_right > base_right, "{base_right} {structure_right}");
}

/// The networks of the package registries, if `VIOLA_FETCHED_MODELS` names their folder.
#[test]
fn fetched_networks_complete_a_clip() {
    let Some(models) = std::env::var_os("VIOLA_FETCHED_MODELS").map(PathBuf::from) else {
        viola_testing::skipped(
            "migan and fastdepth",
            "set VIOLA_FETCHED_MODELS to a models folder with them",
        );
        return;
    };
    let manifest = Manifest::with_folder(&models).unwrap();
    let runtime = RuntimeParams::default();
    let inpainter = open_inpainter(manifest.find("migan").unwrap(), &models, &runtime).unwrap();
    let entry = manifest.find("fastdepth").unwrap();
    let estimator = open_estimator(entry, network::open(&entry.path(&models), &runtime).unwrap()).unwrap();
    let imagination = imagination(Arc::from(inpainter), Some(Arc::from(estimator)));
    // The networks see the pictures of a phone.
    let aligned = align(&recorded_with(103, 0, 640), &params(Some(imagination)));
    let report = aligned.alignment.completion.as_ref().unwrap();
    assert!(!report.views.is_empty() && report.imagined_points > 100, "{report:?}");
    assert!(report.imagined_by[0].starts_with("migan") && report.imagined_by[1].starts_with("fastdepth"));
    for view in &aligned.completion.as_ref().unwrap().views {
        for ((before, after), hole) in
            view.rendered.pixels().zip(view.inpainted.pixels()).zip(view.mask.pixels())
        {
            assert!(hole.0[0] > 0 || before == after, "what the cloud shows stays");
        }
    }
    // Pictures for people, if a folder is named.
    if let Some(folder) = std::env::var_os("VIOLA_TEST_PICTURES").map(PathBuf::from) {
        std::fs::create_dir_all(&folder).unwrap();
        for (name, bytes) in home::completion_pngs(&aligned) {
            std::fs::write(folder.join(name), bytes).unwrap();
        }
    }
}
