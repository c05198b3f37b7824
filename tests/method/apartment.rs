//! The whole method on a real apartment (ScanNet scene0000_00), with the thresholds of the paper's protocol.

use crate::evaluate::run;
use crate::runtimes::apartment;
use std::path::Path;
use viola_align as align;
use viola_align::{AlignParams, Alignment, AlignmentState};
use viola_formats::clip::Clip;
use viola_formats::lidar::LidarMap;
use viola_geometry::progress::{Progress, Silent, Stage};
use viola_lab::evaluate::{self, Method, Scene, SceneClips, Unit};

/// Checks three of the nine 60-frame excerpts against one form of the map: success in each, medians under
/// half a degree and 5 cm. `viola evaluate` runs all nine.
fn check(scene: &Path, lidar: &str, truth: &str) {
    let lidar_folder = scene.join("lidar");
    let scene = Scene::open(scene, &lidar_folder.join(lidar), &lidar_folder.join(truth)).unwrap();
    let all = evaluate::excerpts(scene.clip.frames().len(), 60);
    let three = [all[0].clone(), all[4].clone(), all[8].clone()];
    let suite = SceneClips::new(scene, three.to_vec(), Unit::Metres);
    let results = run(&suite, &[Method::viola(AlignParams::default())], 1);
    assert_eq!(results.len(), 3);
    for result in &results {
        assert!(result.is_success(), "{lidar}: {result:?}");
        assert_eq!(result.state, AlignmentState::Aligned, "{lidar}: {result:?}");
    }
    let row = &evaluate::tabulate(&results)[0];
    assert!(row.r_median_deg < 0.5 && row.t_median_m < 0.05, "{lidar}: {row:?}");
}

#[test]
fn excerpts_against_valetudo() {
    let Some(scene) = apartment() else { return };
    check(&scene, "valetudo.json", "ground_truth_valetudo.json");
}

#[test]
fn excerpts_against_ros() {
    let Some(scene) = apartment() else { return };
    check(&scene, "map.yaml", "ground_truth.json");
}

#[test]
fn excerpts_against_points() {
    let Some(scene) = apartment() else { return };
    check(&scene, "points.csv", "ground_truth.json");
}

fn align_short(scene: &Path, threads: usize) -> Alignment {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| {
        let clip = Clip::open(scene).unwrap();
        let lidar = LidarMap::open(&scene.join("lidar/valetudo.json")).unwrap();
        align::align(&clip, Some(120..150), &lidar, &AlignParams::default(), &Silent).unwrap().alignment
    })
}

#[test]
fn threads_do_not_change_a_bit() {
    let Some(scene) = apartment() else { return };
    let [one, two, three] =
        [1, 2, 3].map(|threads| serde_json::to_string(&align_short(&scene, threads)).unwrap());
    assert_eq!(one, two);
    assert_eq!(one, three);
}

/// Stops in one stage and remembers the stages that began.
struct StopIn {
    stage: Stage,
    seen: std::sync::Mutex<Vec<Stage>>,
}

impl Progress for StopIn {
    fn enter(&self, stage: Stage) {
        self.seen.lock().unwrap().push(stage);
    }
    fn cancelled(&self) -> bool {
        self.seen.lock().unwrap().last() == Some(&self.stage)
    }
}

#[test]
fn every_stage_hears_that_it_should_stop() {
    let Some(scene) = apartment() else { return };
    let clip = Clip::open(&scene).unwrap();
    let lidar = LidarMap::open(&scene.join("lidar/points.csv")).unwrap();
    for stage in [Stage::Fuse, Stage::Floor, Stage::Raycast, Stage::Search, Stage::Refine, Stage::Decide] {
        let progress = StopIn { stage, seen: Default::default() };
        let answer = align::align(&clip, Some(120..125), &lidar, &AlignParams::default(), &progress);
        assert!(matches!(answer, Err(align::AlignError::Cancelled)), "{stage:?}");
        assert_eq!(progress.seen.lock().unwrap().last(), Some(&stage), "nothing runs after {stage:?}");
    }
}

#[test]
fn a_kitchen_without_gravity_has_a_floor_or_a_reason() {
    let Some(kitchen) = viola_testing::data::folder("seven_scenes/redkitchen") else { return };
    check_floor_or_reason(&kitchen, Some(0..150));
}

#[test]
fn a_desk_has_a_floor_or_a_reason() {
    let Some(desk) = viola_testing::data::folder("tum/freiburg1_rpy_excerpt") else { return };
    check_floor_or_reason(&desk, None);
}

fn check_floor_or_reason(folder: &Path, frames: Option<std::ops::Range<u32>>) {
    let clip = Clip::open(folder).unwrap();
    let observation = align::observe(&clip, frames, &AlignParams::default(), &Silent).unwrap();
    match &observation.floor {
        Some(floor) => {
            assert!((0.3..2.5).contains(&floor.camera_height_m), "{floor:?}");
            assert!(observation.cloud_in_clip.points.len() > 10_000);
        }
        None => {
            let reason = observation.reasons.last().expect("a reason");
            assert!(
                ["no_floor", "up_unknown", "nothing_fused"].contains(&reason.code.as_str()),
                "{reason:?}"
            );
        }
    }
    eprintln!("{}: floor {:?}, reasons {:?}", folder.display(), observation.floor, observation.reasons);
}

/// Without a network; the truth is ScanNet's labels of the vertices.
#[test]
fn geometry_alone_tells_floor_and_walls() {
    let Some(scene) = apartment() else { return };
    let clip = Clip::open(&scene).unwrap();
    let truth = evaluate::labels::Truth::open(&scene).unwrap();
    let params = AlignParams::default();
    let rows = evaluate::labels::evaluate(&clip, &truth, None, &params, &|_| Box::new(Silent)).unwrap();
    let [row] = rows.as_slice() else { panic!("{rows:?}") };
    assert_eq!(row.variant, "geometry");
    assert!(row.iou["floor"] >= 0.82 && row.wall_or_opening_iou >= 0.65, "{row:?}");
    assert!(row.structure_accuracy >= 0.82, "{row:?}");
}
