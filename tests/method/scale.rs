//! A clip whose unit is unknown gets its scale and its pose in metres.

use viola_align::{AlignParams, Alignment, AlignmentState};
use viola_formats::clip::Clip;
use viola_formats::lidar::LidarMap;
use viola_geometry::progress::Silent;
use viola_lab::simulate::{ClipParams, Home, HomeParams, Sensor, Set};

fn align(clip: &Clip, lidar: &LidarMap) -> Alignment {
    viola_align::align(clip, None, lidar, &AlignParams::default(), &Silent).unwrap().alignment
}

#[test]
fn a_simulated_clip_is_found_in_any_unit() {
    let home = Home::generate(&HomeParams::new(Set::Normal, 1000));
    let survey = home.survey();
    let color_width = Sensor::PhoneLidar.depth_camera().width;
    let recorded = home.clip(&survey, 0, &ClipParams { frames: 40, color_width, ..ClipParams::default() });
    let truth = recorded.truth.map_from_clip;
    let clip = recorded.into_clip();
    let lidar = survey.lidar_map().unwrap();
    let metric = align(&clip, &lidar);
    assert_eq!((metric.state, metric.scale, metric.scale_std), (AlignmentState::Aligned, None, None));
    for unit_m in [0.22, 4.6] {
        let found = align(&clip.scaled(1.0 / unit_m).with_unknown_scale(), &lidar);
        assert_eq!(found.state, AlignmentState::Aligned, "{unit_m} {:?}", found.reasons);
        let (scale, std) = (found.scale.unwrap(), found.scale_std.unwrap());
        assert!((scale / unit_m - 1.0).abs() < 0.02, "{scale} instead of {unit_m}");
        assert!((0.001..0.02).contains(&(std / unit_m)), "{std} of {unit_m}");
        let pose = found.map_from_clip.unwrap();
        assert!(pose.distance_m(&truth) < 0.15, "{pose:?} instead of {truth:?}");
    }
}
