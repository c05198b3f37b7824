//! The bars that no change may fall below, on fixed clips. CONTRIBUTING.md lists them with the claims of BENCHMARKS.md
//! that they hold. They are loose enough for another machine and tight enough for a real loss.

use crate::evaluate::run;
use crate::runtimes::{apartment, built_in_labels};
use std::path::Path;
use viola_align::{AlignParams, AlignmentState};
use viola_formats::clip::Clip;
use viola_geometry::progress::Silent;
use viola_lab::evaluate::home::{SampleParams, consecutive, fuse, simulated};
use viola_lab::evaluate::labels::{self, Truth};
use viola_lab::evaluate::{
    ClipResult, HomeClips, HomesParams, Method, Scene, SceneClips, Suite, Unit, excerpts,
};
use viola_lab::simulate::Set;

fn scene(folder: &Path) -> Scene {
    let lidar = folder.join("lidar");
    Scene::open(folder, &lidar.join("points.csv"), &lidar.join("ground_truth.json")).unwrap()
}

fn results(suite: &dyn Suite, methods: &[&str]) -> Vec<ClipResult> {
    let methods: Vec<Method> = methods.iter().map(|name| Method::named(name, 0, None).unwrap()).collect();
    run(suite, &methods, 1)
}

/// Returns the numbers of right clips, of aligned ones, and of those that are wrong.
fn count(results: &[ClipResult]) -> (usize, usize, usize) {
    let is_aligned = |result: &&ClipResult| result.state == AlignmentState::Aligned;
    let aligned: Vec<&ClipResult> = results.iter().filter(is_aligned).collect();
    let right = results.iter().filter(|result| result.is_success()).count();
    (right, aligned.len(), aligned.iter().filter(|result| !result.is_success()).count())
}

fn homes(sets: &[Set], seeds: std::ops::Range<u64>, frames: usize) -> HomesParams {
    HomesParams { sets: sets.to_vec(), seeds, frames: vec![frames], ..HomesParams::default() }
}

#[test]
fn short_real_clips_are_found_and_called_aligned() {
    let Some(folder) = apartment() else { return };
    let scene = scene(&folder);
    let clips: Vec<_> = excerpts(scene.clip.frames().len(), 10).into_iter().step_by(4).collect();
    let results = results(&SceneClips::new(scene, clips, Unit::Metres), &["viola"]);
    let (right, aligned, wrong) = count(&results);
    eprintln!("{right} right, {aligned} aligned, {wrong} wrong of {}", results.len());
    assert_eq!((results.len(), wrong), (15, 0));
    assert!(right >= 14 && aligned >= 13, "{right} right, {aligned} aligned");
}

#[test]
fn registration_is_many_times_faster_than_the_paper_s() {
    let Some(folder) = apartment() else { return };
    let scene = scene(&folder);
    let one = excerpts(scene.clip.frames().len(), 10)[24..25].to_vec();
    let results = results(&SceneClips::new(scene, one, Unit::Metres), &["paper", "viola"]);
    let [paper, viola] = [&results[0], &results[1]].map(|result| result.register_seconds);
    eprintln!("{paper} and {viola} s");
    assert!(paper > 30.0 * viola, "{paper} and {viola} s");
}

#[test]
fn simulated_clips_are_found_and_called_aligned() {
    let sets = [Set::Normal, Set::Upper, Set::Repeated, Set::Changed];
    let results = results(&HomeClips::new(homes(&sets, 2000..2003, 20)), &["viola"]);
    let (right, aligned, wrong) = count(&results);
    eprintln!("{right} right, {aligned} aligned, {wrong} wrong of {}", results.len());
    assert_eq!((results.len(), wrong), (12, 0));
    assert!(right >= 8 && aligned >= 6, "{right} right, {aligned} aligned");
}

#[test]
fn a_clip_in_a_wrong_unit_is_not_called_aligned_where_it_is_wrong() {
    for factor in [0.93, 1.1] {
        let homes = HomesParams { unit: Unit::Wrong(factor), ..homes(&[Set::Normal], 2000..2010, 20) };
        let results = results(&HomeClips::new(homes), &["viola"]);
        let told = results.iter().filter(|one| one.reasons.iter().any(|code| code == "scale_disagrees"));
        let (told, (_, aligned, wrong)) = (told.count(), count(&results));
        eprintln!("{factor}: {aligned} aligned, {wrong} wrong, {told} told of {}", results.len());
        assert!(wrong <= 1 && told >= 2, "{factor}: {wrong} wrong, {told} told");
    }
}

#[test]
fn floors_of_real_clips_are_right() {
    let Some(folder) = apartment() else { return };
    let (clip, truth) = (Clip::open(&folder).unwrap(), Truth::open(&folder).unwrap());
    let row =
        labels::floors("shape alone", &clip, &truth, 20, &AlignParams::default(), &|_| Box::new(Silent));
    let row = row.unwrap();
    eprintln!("{row:?}");
    assert!(row.see_floor >= 29 && row.within >= 28, "{row:?}");
    assert!(row.median_deg < 0.5 && row.median_m < 0.01, "{row:?}");
}

#[test]
fn the_built_in_network_labels_simulated_homes() {
    let params = AlignParams { label: built_in_labels(), ..AlignParams::default() };
    let rows = labels::simulated(&homes(&[Set::Normal], 2000..2002, 12), &params, &|_| {}).unwrap();
    let [(shapes, _), (volume, _)] = rows.as_slice() else { panic!("{rows:?}") };
    eprintln!("{rows:?}");
    assert!(shapes.structure_accuracy >= 0.7, "{shapes:?}");
    assert!(volume.voxel_accuracy >= 0.75 && volume.structure_accuracy >= 0.85, "{volume:?}");
    assert!(volume.mean_iou >= shapes.mean_iou + 0.15, "{shapes:?} {volume:?}");
}

#[test]
fn objects_and_plan_of_a_simulated_home_are_right() {
    let params = SampleParams { rays: 6_000, ..SampleParams::default() };
    let score = simulated(Set::Normal, 2001..2002, &params, &|_| {}).unwrap();
    let (objects, plan) = (&score.objects.total, &score.plan);
    eprintln!("{objects:?} {} of {} rooms; {plan:?}", score.matched_rooms, score.rooms);
    assert!(objects.recall() >= 0.6 && objects.precision() >= 0.7, "{objects:?}");
    assert!(plan.recall() >= 0.85 && plan.precision() >= 0.85, "{plan:?}");
    assert!(
        plan.found_doors * 10 >= plan.doors * 7 && plan.found_windows * 10 >= plan.windows * 5,
        "{plan:?}"
    );
    assert_eq!((plan.broken_rooms, plan.overlaps), (0, 0), "{plan:?}");
}

/// Four clips as one map: the pose graph moves overlapping clips together.
#[test]
fn overlapping_clips_agree_better_together() {
    let Some(folder) = apartment() else { return };
    let scene = scene(&folder);
    let ranges = &consecutive(scene.clip.frames().len(), 30)[..4];
    let fused = fuse(&scene, ranges, &AlignParams::default(), &|_| Box::new(Silent)).unwrap();
    eprintln!("{:?} {:?}", fused.agreement, fused.excerpts);
    assert!(fused.excerpts.iter().all(|excerpt| excerpt.placed_by.is_some() && !excerpt.is_wrong()));
    let agreement = fused.agreement;
    assert!(agreement.pairs >= 2 && agreement.together_m < 0.85 * agreement.alone_m, "{agreement:?}");
}
