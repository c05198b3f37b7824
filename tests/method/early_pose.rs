//! The pose before the labels of the pictures: told to those who want it, and without effect on the answer.

use std::sync::{Arc, Mutex};
use viola_align as align;
use viola_align::{AlignParams, AlignmentState};
use viola_formats::clip::Clip;
use viola_formats::lidar::LidarMap;
use viola_geometry::angle_between;
use viola_geometry::progress::{EarlyPose, Progress, Silent, Stage};
use viola_lab::evaluate::Oracle;
use viola_lab::simulate::{ClipParams, Home, HomeParams, Sensor, Set};
use viola_reconstruct::LabelParams;

/// A [`Progress`] that keeps the stages and the poses in the order in which it hears them.
#[derive(Default)]
struct Heard(Mutex<Vec<Told>>);

#[derive(Debug, Clone, Copy, PartialEq)]
enum Told {
    Begun(Stage),
    Pose(EarlyPose),
}

impl Progress for Heard {
    fn enter(&self, stage: Stage) {
        self.0.lock().unwrap().push(Told::Begun(stage));
    }

    fn cancelled(&self) -> bool {
        false
    }

    fn wants_early_pose(&self) -> bool {
        true
    }

    fn early_pose(&self, pose: EarlyPose) {
        self.0.lock().unwrap().push(Told::Pose(pose));
    }
}

fn recorded() -> (Clip, LabelParams, LidarMap) {
    let home = Home::generate(&HomeParams::new(Set::Normal, 2));
    let survey = home.survey();
    // Small pictures: the oracle labels each pixel.
    let color_width = Sensor::PhoneLidar.depth_camera().width;
    let params = ClipParams { frames: 24, color_width, ..ClipParams::default() };
    let clip = home.clip(&survey, 0, &params);
    let lidar = survey.lidar_map().unwrap();
    let (clip, oracle) = Oracle::with_clip(Arc::new(clip), 1.0, 0);
    (clip, LabelParams { segmenter: Some(oracle), ..LabelParams::default() }, lidar)
}

#[test]
fn it_comes_before_the_labels_and_changes_nothing() {
    let (clip, label, lidar) = recorded();
    let params = AlignParams { label, ..AlignParams::default() };
    let align = |params: &AlignParams, progress: &dyn Progress| {
        align::align(&clip, None, &lidar, params, progress).unwrap().alignment
    };
    let heard = Heard::default();
    let answer = align(&params, &heard);
    assert_eq!(answer, align(&params, &Silent));
    assert_eq!(answer.state, AlignmentState::Aligned);

    let told = heard.0.into_inner().unwrap();
    let poses: Vec<usize> = (0..told.len()).filter(|at| matches!(told[*at], Told::Pose(_))).collect();
    let ([at], Some(answered)) = (&poses[..], answer.map_from_clip) else { panic!("{told:?}") };
    let Told::Pose(early) = told[*at] else { panic!("{told:?}") };
    assert!(early.probability >= 0.9 && early.map_from_clip.distance_m(&answered) < 0.1, "{early:?}");
    assert!(angle_between(early.map_from_clip.yaw_rad, answered.yaw_rad).abs() < 0.05, "{early:?}");
    // The search for the answer is still to come.
    assert!(!told[..*at].contains(&Told::Begun(Stage::Search)), "{told:?}");
    assert!(told[*at..].contains(&Told::Begun(Stage::Search)), "{told:?}");

    // Without pictures the answer itself comes as early.
    let heard = Heard::default();
    align(&AlignParams::default(), &heard);
    let told = heard.0.into_inner().unwrap();
    assert!(told.iter().all(|told| matches!(told, Told::Begun(_))), "{told:?}");
}
