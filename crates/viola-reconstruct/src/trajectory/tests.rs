use super::*;
use proptest::prelude::*;
use viola_formats::clip::ClipInfo;
use viola_geometry::Vector3;

/// Returns the poses of a person who walks along x at 1 m/s and looks around.
fn walk(frames: usize, rate_hz: f64) -> Vec<Pose3> {
    (0..frames)
        .map(|i| {
            let t = i as f64 / rate_hz;
            Pose3::new(Vector3::new(t, 0.1 * t.sin(), 1.4), Vector3::new(0.0, 0.0, (0.8 * t).sin()))
        })
        .collect()
}

fn clip(poses: &[Option<Pose3>], rate_hz: Option<f64>) -> Clip {
    let frames = poses.iter().enumerate().map(|(i, pose)| FrameHeader {
        number: i as u32,
        time_s: rate_hz.map(|rate_hz| 1e9 + i as f64 / rate_hz),
        world_from_camera: *pose,
        force_in_camera: None,
    });
    let info = ClipInfo::in_memory(poses.len(), [4, 3], [4, 3]);
    Clip::from_frames(info, frames.collect(), None, |_| unreachable!())
}

/// Returns the indices of the dropped poses.
fn dropped(poses: &[Pose3], rate_hz: Option<f64>) -> Vec<usize> {
    let poses: Vec<Option<Pose3>> = poses.iter().copied().map(Some).collect();
    let Some(trajectory) = without_outliers(&clip(&poses, rate_hz), None) else { return Vec::new() };
    (0..poses.len()).filter(|place| trajectory.world_from_camera[*place].is_none()).collect()
}

fn moved(poses: &mut [Pose3], places: impl IntoIterator<Item = usize>, by: [f64; 3]) {
    for place in places {
        poses[place].translation.vector += Vector3::from(by);
    }
}

#[test]
fn wild_poses_are_dropped_wherever_they_are() {
    for rate_hz in [None, Some(2.5), Some(30.0)] {
        for wild in
            [vec![0], vec![19], vec![7], vec![3, 4, 5], vec![0, 1, 2], vec![17, 18, 19], vec![2, 9, 10, 15]]
        {
            for far_m in [40.0, 300.0, 10_000.0] {
                let mut poses = walk(20, rate_hz.unwrap_or(2.5));
                moved(&mut poses, wild.clone(), [far_m, -far_m, 0.0]);
                assert_eq!(dropped(&poses, rate_hz), wild, "{rate_hz:?} {far_m}");
            }
        }
    }
}

#[test]
fn each_wild_pose_may_be_elsewhere() {
    let mut poses = walk(40, 2.5);
    let wild = [1, 4, 5, 6, 20, 21, 33];
    for (i, place) in wild.into_iter().enumerate() {
        moved(&mut poses, [place], [100.0 * (i as f64 + 1.0), 70.0 * i as f64, 5.0]);
    }
    assert_eq!(dropped(&poses, None), wild);
    assert_eq!(dropped(&poses, Some(2.5)), wild);
}

#[test]
fn a_turn_that_is_too_fast_is_dropped_where_times_are_known() {
    let mut poses = walk(30, 30.0);
    poses[11].rotation = Pose3::rotation(Vector3::new(2.0, 0.0, 0.0)).rotation * poses[11].rotation;
    assert_eq!(dropped(&poses, Some(30.0)), [11]);
    assert_eq!(dropped(&poses, None), Vec::<usize>::new());
}

/// A lost tracker continues in another coordinate frame; the longer segment is kept.
#[test]
fn of_two_segments_the_longer_is_kept() {
    for rate_hz in [None, Some(30.0)] {
        let mut poses = walk(50, rate_hz.unwrap_or(2.5));
        moved(&mut poses, 0..20, [40.0, 0.0, 0.0]);
        assert_eq!(dropped(&poses, rate_hz), (0..20).collect::<Vec<_>>(), "{rate_hz:?}");
        let mut poses = walk(50, rate_hz.unwrap_or(2.5));
        moved(&mut poses, 30..50, [40.0, 0.0, 0.0]);
        assert_eq!(dropped(&poses, rate_hz), (30..50).collect::<Vec<_>>(), "{rate_hz:?}");
    }
}

#[test]
fn poses_without_any_order_leave_one() {
    let poses: Vec<Pose3> = (0..200).map(|i| Pose3::translation(40.0 * f64::from(i), 0.0, 1.4)).collect();
    assert_eq!(dropped(&poses, None).len(), 199);
    assert_eq!(dropped(&poses, Some(2.5)).len(), 199);
}

#[test]
fn corrections_pauses_and_frames_without_a_pose_are_no_outliers() {
    // A correction of 0.8 m, as devices make when they recognise a place.
    let mut poses = walk(60, 30.0);
    moved(&mut poses, 31..60, [0.0, 0.8, 0.0]);
    assert_eq!(dropped(&poses, Some(30.0)), Vec::<usize>::new());
    // Tracking was lost for a while, and the person walked on.
    let mut poses: Vec<Option<Pose3>> = walk(60, 1.0).into_iter().map(Some).collect();
    poses[10..40].fill(None);
    assert!(without_outliers(&clip(&poses, None), None).is_none());
    assert!(without_outliers(&clip(&poses, Some(1.0)), None).is_none());
    assert!(without_outliers(&clip(&[], None), None).is_none());
    // Times of a stopped clock are ignored.
    assert!(without_outliers(&clip(&poses, Some(f64::INFINITY)), None).is_none());
}

#[test]
fn frames_that_are_not_wanted_are_not_looked_at() {
    let mut poses = walk(20, 2.5);
    moved(&mut poses, [3, 12], [300.0, 0.0, 0.0]);
    let poses: Vec<Option<Pose3>> = poses.into_iter().map(Some).collect();
    assert!(without_outliers(&clip(&poses, None), Some(&(4..12))).is_none());
    let trajectory = without_outliers(&clip(&poses, None), Some(&(5..15))).unwrap();
    assert_eq!(trajectory.world_from_camera.iter().flatten().count(), 9);
    assert_eq!(trajectory.reason.code, "poses_dropped");
    assert!(trajectory.reason.detail.starts_with("1 of 10 camera poses"), "{}", trajectory.reason.detail);
    assert!(trajectory.reason.detail.contains("frame 12"), "{}", trajectory.reason.detail);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn wild_poses_are_dropped_and_no_others(
        wild in prop::collection::btree_set(0usize..60, 0..12), far in prop::collection::vec(100.0..9e4f64, 12),
        angles in prop::collection::vec(0.0..std::f64::consts::TAU, 12), timed in any::<bool>(),
    ) {
        let mut poses = walk(60, 10.0);
        for (i, &place) in wild.iter().enumerate() {
            moved(&mut poses, [place], [far[i] * angles[i].cos(), far[i] * angles[i].sin(), 0.0]);
        }
        prop_assert_eq!(dropped(&poses, timed.then_some(10.0)), wild.into_iter().collect::<Vec<_>>());
    }
}
