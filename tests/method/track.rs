//! Clips without poses: tracked frames, lost frames with their reasons, and no bent segments.

use image::{Rgb, RgbImage};
use std::sync::atomic::{AtomicUsize, Ordering};
use viola_align as align;
use viola_align::{AlignParams, Observation};
use viola_formats::clip::{Clip, DepthImage, Frame, FrameHeader, Shutter, Up};
use viola_geometry::progress::{Progress, Silent};
use viola_geometry::{Pinhole, Point3, Pose3, Vector3};
use viola_lab::evaluate::track::{TrajectoryErrors, measure};
use viola_lab::simulate::{ClipParams, Home, HomeParams, Set};
use viola_reconstruct::track::{Lost, Track, Tracker};
use viola_reconstruct::{KeyFrame, TrackParams};

/// Returns a simulated walk with a phone, with noise, and the true poses.
fn walk(seed: u64, frames: usize) -> (Vec<Frame>, Vec<Pose3>) {
    let home = Home::generate(&HomeParams::new(Set::Normal, seed));
    let survey = home.survey();
    let params = ClipParams { frames, rate_hz: 10.0, color_width: 256, ..ClipParams::default() };
    let clip = home.clip(&survey, 0, &params);
    ((0..frames).map(|index| clip.frame(index)).collect(), clip.truth.home_from_camera.clone())
}

fn follow(frames: &[Frame]) -> Track {
    let mut tracker = Tracker::new(&TrackParams::default());
    frames.iter().for_each(|frame| tracker.add(frame));
    tracker.finish(&Silent).unwrap()
}

/// Returns the errors of one segment.
fn errors(track: &Track, segment: usize, truth: &[Pose3]) -> TrajectoryErrors {
    let truth: Vec<_> = truth.iter().copied().map(Some).collect();
    measure(&track.poses_of(segment), &truth).expect("a segment with poses")
}

/// Checks that no segment is bent: every pose is right within its segment.
fn check_no_segment_is_bent(track: &Track, truth: &[Pose3]) {
    for segment in 0..track.segments.len() {
        let errors = errors(track, segment, truth);
        assert!(
            errors.ate_m < 0.03 && errors.rotation_deg < 1.5,
            "{segment}: {errors:?} {:?}",
            track.segments
        );
    }
}

#[test]
fn a_walk_is_followed_alike_by_any_number_of_threads() {
    let (frames, truth) = walk(1002, 60);
    let track = follow(&frames);
    assert_eq!(track.segments.len(), 1);
    assert_eq!(track.segments[0].frames, 60);
    // The threshold for simulated clips is one hundredth of the path.
    let errors = errors(&track, 0, &truth);
    assert!(errors.fraction_of_path < 0.01, "{errors:?}");
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert_eq!(pool.install(|| follow(&frames)).poses, track.poses, "{threads} threads");
    }
}

/// The world of tracking is arbitrary; the accelerometer gives its up direction.
#[test]
fn what_the_accelerometer_felt_tells_up() {
    let (frames, truth) = walk(1002, 60);
    let track = follow(&frames);
    let poses: Vec<Pose3> = track.poses_of(0).into_iter().map(Option::unwrap).collect();
    let up = Up::felt(frames.iter().map(|frame| &frame.header).zip(&poses)).unwrap();
    let world_from_home = poses[0] * truth[0].inverse();
    let off_rad = up.direction.angle(&(world_from_home.rotation * Vector3::z()));
    assert!(off_rad < 3f64.to_radians() && off_rad < 2.0 * up.deviation_rad, "{off_rad} {up:?}");
}

/// Checks that frames spoiled in the middle of a walk have no pose, and that later ones are right again.
fn check_spoiled(spoil: impl Fn(&mut Frame), why: &Lost) {
    let (mut frames, truth) = walk(1002, 70);
    frames[30..38].iter_mut().for_each(spoil);
    let track = follow(&frames);
    assert!(track.poses[30..38].iter().all(Option::is_none), "{why:?}");
    assert!(track.poses[..30].iter().all(Option::is_some));
    let after = track.poses[40..].iter().flatten().count();
    assert!(after >= 25, "{after} of the 30 frames behind have a pose");
    check_no_segment_is_bent(&track, &truth);
    // Either the place was recognised, or the first segment has the reason of its end.
    let is_one = track.segments.len() == 1;
    assert!(is_one || track.segments[0].ended.as_ref() == Some(why), "{:?}", track.segments);
}

fn darken(frame: &mut Frame) {
    let picture = frame.color.as_mut().unwrap();
    picture.pixels_mut().for_each(|pixel| *pixel = Rgb([1, 1, 1]));
}

#[test]
fn darkness_is_waited_for() {
    check_spoiled(darken, &Lost::Dark);
}

#[test]
fn missing_depth_is_waited_for() {
    check_spoiled(|frame| frame.depth.depth_m.fill(0.0), &Lost::NoDepth);
}

/// A frozen recording repeats one frame; all copies have its pose.
#[test]
fn frozen_frames_stay_where_they_are() {
    let (mut frames, mut truth) = walk(1002, 60);
    for index in 31..36 {
        frames[index] = frames[30].clone();
        truth[index] = truth[30];
    }
    let track = follow(&frames);
    check_no_segment_is_bent(&track, &truth);
    let tracked = track.poses.iter().flatten().count();
    assert!(tracked >= 55, "{tracked}");
}

/// Two recordings in one: each half is right, and the halves are not connected.
#[test]
fn a_jump_cut_ends_a_segment() {
    let ((mut frames, mut truth), (others, other_truth)) = (walk(1002, 40), walk(1001, 40));
    frames.extend(others);
    truth.extend(other_truth);
    let track = follow(&frames);
    assert_eq!(track.segments.len(), 2, "{:?}", track.segments);
    assert_eq!(track.segments[0].ended, Some(Lost::Jump));
    assert_eq!(track.segments[1].first, 40);
    check_no_segment_is_bent(&track, &truth);
}

/// The recording returns to the first room, and ends in the dark.
#[test]
fn a_segment_that_goes_on_later_has_its_own_end() {
    let ((mut frames, _), (others, _)) = (walk(1002, 40), walk(1001, 40));
    let again = frames[..20].to_vec();
    let mut dark = again[19].clone();
    darken(&mut dark);
    frames.extend(others.into_iter().chain(again).chain([dark]));
    let track = follow(&frames);
    let ended: Vec<_> = track.segments.iter().map(|segment| segment.ended.clone()).collect();
    assert_eq!(ended, [Some(Lost::Dark), Some(Lost::Jump)], "{:?}", track.segments);
}

/// A person walks through from left to right, a quarter of the picture wide, with a texture that moves along.
#[test]
fn a_person_walking_through_is_not_followed() {
    let (mut frames, truth) = walk(1002, 60);
    for (step, frame) in frames[20..40].iter_mut().enumerate() {
        let (width, height) = (frame.depth.width as usize, frame.depth.height as usize);
        let left = step * width / 20;
        for y in height / 6..height {
            for x in left..(left + width / 4).min(width) {
                frame.depth.depth_m[y * width + x] = 1.1 + 0.001 * ((x - left) % 7) as f32;
                let shade = if (x - left + y) / 5 % 2 == 0 { 40 } else { 170 };
                let picture = frame.color.as_mut().unwrap();
                picture.put_pixel(x as u32, y as u32, Rgb([shade, shade / 2, 60]));
            }
        }
    }
    let track = follow(&frames);
    assert!(track.segments[0].frames >= 55, "{:?}", track.segments);
    // The person walks 1.4 m: a camera tracked on them would be off by much of it. The bounds are chosen, not
    // taken from a source.
    let errors = errors(&track, 0, &truth);
    assert!(errors.ate_m < 0.07 && errors.rotation_deg < 2.0, "{errors:?}");
}

const CAMERA: Pinhole = Pinhole { width: 256, height: 192, fx: 200.0, fy: 200.0, cx: 127.5, cy: 95.5 };

/// Renders the inside of a box of 5 x 3 x 6 m around the world's origin; its faces are plain or chequered.
fn in_a_box(world_from_camera: &Pose3, is_plain: bool) -> Frame {
    in_a_box_by_rows(|_| *world_from_camera, is_plain)
}

/// Renders the box with a camera that moves while its rows are read.
fn in_a_box_by_rows(world_from_camera: impl Fn(u32) -> Pose3, is_plain: bool) -> Frame {
    let half = [2.5, 1.5, 3.0];
    let mut depth_m = vec![0.0; (CAMERA.width * CAMERA.height) as usize];
    let mut color = RgbImage::new(CAMERA.width, CAMERA.height);
    for y in 0..CAMERA.height {
        let world_from_camera = world_from_camera(y);
        let eye = Point3::from(world_from_camera.translation.vector);
        for x in 0..CAMERA.width {
            let ray = world_from_camera.rotation * CAMERA.ray(f64::from(x), f64::from(y));
            let along = |axis: usize| (half[axis] * ray[axis].signum() - eye[axis]) / ray[axis];
            let depth = (0..3).map(along).filter(|depth| *depth > 0.0).fold(f64::INFINITY, f64::min);
            let hit = eye + ray * depth;
            let cell = |axis: usize| ((hit[axis] + 10.0) / 0.23).floor() as u64;
            let mixed = (cell(0) * 73_856_093) ^ (cell(1) * 19_349_663) ^ (cell(2) * 83_492_791);
            let grey =
                if is_plain { 200 } else { 40 + (mixed.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 57) as u8 };
            color.put_pixel(x, y, Rgb([grey, grey, grey]));
            depth_m[(y * CAMERA.width + x) as usize] = ((depth * 1000.0).round() / 1000.0) as f32;
        }
    }
    Frame {
        header: FrameHeader { number: 0, time_s: None, world_from_camera: None, force_in_camera: None },
        color_camera: CAMERA,
        color: Some(color),
        depth_camera: CAMERA,
        depth: DepthImage { width: CAMERA.width, height: CAMERA.height, depth_m },
    }
}

#[test]
fn a_camera_that_only_turns_stays_in_its_place() {
    let turn = |step: i32| Pose3::new(Vector3::zeros(), Vector3::new(0.0, 0.07 * f64::from(step), 0.0));
    // A full turn and a little more: the end sees the beginning again.
    let truth: Vec<Pose3> = (0..95).map(turn).collect();
    let frames: Vec<Frame> = truth.iter().map(|pose| in_a_box(pose, false)).collect();
    let track = follow(&frames);
    assert_eq!(track.segments[0].frames, 95, "{:?}", track.segments);
    assert!(track.loops > 0);
    let farthest = track.poses.iter().flatten().map(|(_, pose)| pose.translation.vector.norm());
    assert!(farthest.fold(0.0, f64::max) < 0.02);
    assert!(errors(&track, 0, &truth).rotation_deg < 0.5);
}

/// A white wall does not show the camera's motion: tracking reports a loss, and no standstill.
#[test]
fn a_white_wall_is_admitted() {
    let slide = |step: i32| Pose3::translation(0.03 * f64::from(step) - 1.0, 0.0, 2.0);
    let truth: Vec<Pose3> = (0..40).map(slide).collect();
    let frames: Vec<Frame> = truth.iter().map(|pose| in_a_box(pose, true)).collect();
    let track = follow(&frames);
    let ended: Vec<_> = track.segments.iter().filter_map(|segment| segment.ended.clone()).collect();
    let all_short = track.segments.iter().all(|segment| segment.frames <= 16);
    assert!(all_short && ended.iter().all(|why| *why == Lost::Unconstrained), "{:?}", track.segments);
}

/// A rolling shutter skews a room while the camera turns, and the other way when it turns back. Tracking with
/// a known shutter is better.
#[test]
fn a_rolling_shutter_is_allowed_for() {
    const READOUT_S: f64 = 0.03;
    let at = |time_s: f64| {
        let phase = std::f64::consts::TAU * time_s;
        let turn = Vector3::new(0.06 * (2.0 * phase).sin(), 0.3 * phase.sin(), 0.0);
        Pose3::new(Vector3::new(0.1 * phase.cos(), 0.0, 0.05 * phase.sin()), turn)
    };
    let time_s = |frame: i32| f64::from(frame) / 30.0;
    let truth: Vec<Pose3> = (0..60).map(|frame| at(time_s(frame))).collect();
    let frames: Vec<Frame> = (0..60)
        .map(|frame| {
            let row =
                |y: u32| at(time_s(frame) + READOUT_S * (f64::from(y) / f64::from(CAMERA.height) - 0.5));
            let mut seen = in_a_box_by_rows(row, false);
            seen.header.time_s = Some(time_s(frame));
            seen
        })
        .collect();
    let errors_with = |shutter: Option<Shutter>| {
        let mut tracker = Tracker::new(&TrackParams { shutter, ..TrackParams::default() });
        frames.iter().for_each(|frame| tracker.add(frame));
        errors(&tracker.finish(&Silent).unwrap(), 0, &truth)
    };
    let (unaware, aware) =
        (errors_with(None), errors_with(Some(Shutter { color_s: READOUT_S, depth_s: READOUT_S })));
    assert!(aware.rotation_deg < 0.5 * unaware.rotation_deg, "{aware:?} {unaware:?}");
    assert!(aware.ate_m < 0.5 * unaware.ate_m, "{aware:?} {unaware:?}");
}

/// Drifting poses of a device: pictures reduce the drift; without useful pictures its poses are used.
#[test]
fn the_poses_of_a_device_are_refined() {
    let home = Home::generate(&HomeParams::new(Set::Normal, 1002));
    let survey = home.survey();
    let params = ClipParams { frames: 60, color_width: 256, drift: 0.02, ..ClipParams::default() };
    let clip = home.clip(&survey, 0, &params);
    let mut frames: Vec<Frame> = (0..60).map(|index| clip.frame(index)).collect();
    frames[30..33].iter_mut().for_each(darken);
    let given: Vec<_> = frames.iter().map(|frame| frame.header.world_from_camera).collect();
    let truth: Vec<_> = clip.truth.home_from_camera.iter().copied().map(Some).collect();
    let mut tracker = Tracker::refining(&TrackParams::default());
    frames.iter().for_each(|frame| tracker.add(frame));
    let track = tracker.finish(&Silent).unwrap();
    assert_eq!(track.segments.len(), 1, "{:?}", track.segments);
    assert_eq!(track.segments[0].frames, 60);
    let (before, after) = (measure(&given, &truth).unwrap(), errors(&track, 0, &clip.truth.home_from_camera));
    assert!(after.ate_m < 0.7 * before.ate_m, "{after:?} {before:?}");
    // The poses are in the device's world.
    let first = track.poses[0].expect("the first frame has a pose").1;
    assert!((first.inverse() * given[0].unwrap()).translation.vector.norm() < 1e-9);
}

/// The next pictures are compared with the last right one, so they correct the device's poses.
#[test]
fn a_picture_that_contradicts_the_device_is_no_key_frame() {
    let turned = Pose3::new(Vector3::zeros(), Vector3::new(0.0, 11f64.to_radians(), 0.0));
    let mut tracker = Tracker::refining(&TrackParams::default());
    for index in 0..10 {
        // By all other pictures the camera rests; the device is wrong from the contradiction on.
        let mut frame = in_a_box(&if index == 4 { turned } else { Pose3::identity() }, false);
        let off_m = if index > 4 { 0.015 } else { 0.0 };
        frame.header.world_from_camera = Some(Pose3::translation(off_m, 0.0, 0.0));
        tracker.add(&frame);
    }
    let track = tracker.finish(&Silent).unwrap();
    for (index, pose) in track.poses.iter().enumerate() {
        let (_, pose) = pose.expect("the device has all poses");
        assert!(pose.translation.vector.norm() < 0.005 && pose.rotation.angle() < 0.005, "{index}: {pose:?}");
    }
}

/// Drift of poses is detected in the clip itself, and reported.
#[test]
fn poses_are_refined_where_they_drift_and_left_where_they_do_not() {
    let home = Home::generate(&HomeParams::new(Set::Normal, 1000));
    let survey = home.survey();
    for (drift, is_refined) in [(0.06, true), (ClipParams::default().drift, false)] {
        let params = ClipParams { frames: 40, color_width: 256, drift, ..ClipParams::default() };
        let simulated = home.clip(&survey, 0, &params);
        let truth = simulated.truth.home_from_camera.clone();
        let clip = simulated.into_clip();
        let observe = |refine: bool| {
            let track = TrackParams { refine, ..TrackParams::default() };
            align::observe(&clip, None, &AlignParams { track, ..AlignParams::default() }, &Silent).unwrap()
        };
        let (seen, as_it_was) = (observe(true), observe(false));
        let is_told = seen.reasons.iter().any(|reason| reason.code == "poses_refined");
        assert_eq!(is_told, is_refined, "{drift}: {:?}", seen.reasons);
        let ate_m = |seen: &Observation| {
            let of = |key: &KeyFrame| (Some(key.world_from_camera), Some(truth[key.index]));
            let (found, truth): (Vec<_>, Vec<_>) = seen.keys.iter().map(of).unzip();
            measure(&found, &truth).unwrap().ate_m
        };
        if is_refined {
            assert!(ate_m(&seen) < 0.5 * ate_m(&as_it_was), "{} {}", ate_m(&seen), ate_m(&as_it_was));
        } else {
            assert_eq!(seen.scan, as_it_was.scan);
        }
    }
}

/// Nearly all of them are outliers, and the rest alone would not tell why.
#[test]
fn poses_in_millimetres_are_told_though_they_are_dropped() {
    let home = Home::generate(&HomeParams::new(Set::Normal, 1002));
    let params = ClipParams { frames: 20, color_width: 256, ..ClipParams::default() };
    let recorded = home.clip(&home.survey(), 0, &params).into_clip();
    let mut headers = recorded.frames().to_vec();
    let poses = headers.iter_mut().filter_map(|header| header.world_from_camera.as_mut());
    poses.for_each(|pose| pose.translation.vector *= 1000.0);
    let frames = recorded.clone();
    let load = move |index: usize| frames.load(index).unwrap();
    let clip = Clip::from_frames(recorded.info().clone(), headers, Some(Vector3::z()), load);
    let seen = align::observe(&clip, None, &AlignParams::default(), &Silent).unwrap();
    let is_told =
        |code: &str, text: &str| seen.reasons.iter().any(|one| one.code == code && one.detail.contains(text));
    assert!(is_told("poses_dropped", ""), "{:?}", seen.reasons);
    assert!(is_told("poses_disagree", "in millimetres"), "{:?}", seen.reasons);
}

/// Requests a stop after a number of polls, and counts them.
struct Stop(usize, AtomicUsize);

impl Progress for Stop {
    fn cancelled(&self) -> bool {
        self.1.fetch_add(1, Ordering::Relaxed) >= self.0
    }
}

#[test]
fn a_stop_ends_the_search_for_loops() {
    let (frames, _) = walk(1002, 20);
    let finish = |after: usize| {
        let stop = Stop(after, AtomicUsize::new(0));
        let mut tracker = Tracker::new(&TrackParams::default());
        frames.iter().for_each(|frame| tracker.add(frame));
        (tracker.finish(&stop), stop.1.into_inner())
    };
    let (track, polls) = finish(usize::MAX);
    // The key frames are compared by their looks and by their poses.
    assert!(polls > 2 * track.unwrap().key_frames, "{polls}");
    for after in [0, polls / 2, polls - 1] {
        assert!(finish(after).0.is_err(), "{after} of {polls}");
    }
}

/// Handheld recordings, by the thresholds for them.
#[test]
fn real_recordings_are_followed_as_well_as_asked_for() {
    for (name, ate_m, rotation_deg) in
        [("seven_scenes/redkitchen", 0.02, None), ("tum/freiburg1_rpy_excerpt", 0.03, Some(1.0))]
    {
        let Some(folder) = viola_testing::data::folder(name) else { return };
        let clip = Clip::open(&folder).unwrap();
        let params = TrackParams { shutter: clip.shutter(), ..TrackParams::default() };
        let mut tracker = Tracker::new(&params);
        (0..clip.frames().len()).for_each(|index| tracker.add(&clip.load(index).unwrap()));
        let track = tracker.finish(&Silent).unwrap();
        let truth: Vec<_> = clip.frames().iter().map(|frame| frame.world_from_camera).collect();
        assert_eq!(track.segments.len(), 1, "{name}");
        let errors = measure(&track.poses_of(0), &truth).unwrap();
        assert!(errors.ate_m <= ate_m, "{name}: {errors:?}");
        assert!(rotation_deg.is_none_or(|limit| errors.rotation_deg <= limit), "{name}: {errors:?}");
    }
}
