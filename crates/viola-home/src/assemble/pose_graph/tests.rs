use super::super::floor_correction::{pose_in_space, rounded, split_pose};
use super::*;
use viola_geometry::Vector3;

fn sure(b_from_a: Pose3, information: f64) -> Overlap {
    let row = |i: usize| std::array::from_fn(|j| if i == j { information } else { 0.0 });
    Overlap { b_from_a, information: std::array::from_fn(row), found: 500 }
}

fn prior(map_from_clip: Pose3, sigma: f64) -> Prior {
    Prior { map_from_clip, covariance: Some(Matrix3::identity() * sigma * sigma), is_fixed: false }
}

fn pose(x: f64, y: f64, yaw: f64) -> Pose3 {
    Pose3::new(Vector3::new(x, y, 0.0), Vector3::new(0.0, 0.0, yaw))
}

fn distance_m(a: &Pose3, b: &Pose3) -> f64 {
    (a.translation.vector - b.translation.vector).norm()
}

/// Two clips with equal priors meet half way.
#[test]
fn two_clips_meet_half_way() {
    let mut second = pose(1.04, 2.0, 0.5);
    second.translation.z = 0.02;
    let clips = [prior(pose(1.0, 2.0, 0.5), 0.05), prior(second, 0.05)];
    let overlap = sure(Pose3::identity(), 1e8);
    let edges = [Edge { a: 0, b: 1, overlap: &overlap }];
    let refined = refine_poses(&clips, &edges, &[1e9]);
    let half = Pose3::from_parts(Vector3::new(1.02, 2.0, 0.01).into(), clips[0].map_from_clip.rotation);
    assert!(refined.iter().all(|pose| distance_m(pose, &half) < 1e-4), "{refined:?}");
}

/// The Jacobians match the error's change under small motions.
#[test]
fn consistent_clips_stay() {
    let tilted = Pose3::new(Vector3::new(3.0, -1.0, 0.02), Vector3::new(0.01, -0.02, 3.0));
    let poses = [pose(1.0, 2.0, 0.5), pose(-0.5, 1.0, -2.0), tilted];
    let clips: Vec<Prior> = poses.iter().map(|pose| prior(*pose, 0.05)).collect();
    let between = |a: usize, b: usize| sure(poses[b].inverse() * poses[a], 1e5);
    let (ab, ac, bc) = (between(0, 1), between(0, 2), between(1, 2));
    let edges = [
        Edge { a: 0, b: 1, overlap: &ab },
        Edge { a: 0, b: 2, overlap: &ac },
        Edge { a: 1, b: 2, overlap: &bc },
    ];
    let refined = refine_poses(&clips, &edges, &KERNELS);
    assert!((0..3).all(|i| distance_m(&refined[i], &poses[i]) < 1e-9), "{refined:?}");
    // Displaced, strong edges to two fixed clips bring it back.
    let mut moved = clips.clone();
    moved[0].map_from_clip = poses[0] * Pose3::new(Vector3::new(0.05, -0.03, 0.0), Vector3::z() * 0.02);
    moved[1].covariance = None;
    moved[2].covariance = None;
    let refined = refine_poses(&moved, &edges, &[1e9]);
    assert!(distance_m(&refined[0], &poses[0]) < 3e-3, "{refined:?}");
}

#[test]
fn what_a_person_chose_stays_in_the_plane() {
    let clips =
        [Prior { covariance: None, ..prior(pose(1.0, 2.0, 0.5), 0.1) }, prior(pose(1.05, 2.0, 0.5), 0.1)];
    let overlap = sure(Pose3::identity(), 1e6);
    let edges = [Edge { a: 0, b: 1, overlap: &overlap }];
    let refined = refine_poses(&clips, &edges, &KERNELS);
    assert!(distance_m(&refined[0], &clips[0].map_from_clip) < 1e-6);
    assert!(distance_m(&refined[1], &clips[0].map_from_clip) < 2e-3, "{refined:?}");
}

/// Errors without a generator: fractions of multiples of an irrational number, -1..1.
fn noise(number: usize) -> f64 {
    2.0 * ((number as f64 + 1.0) * 0.754_877_666_246_693).fract() - 1.0
}

/// Clips along a corridor, each joined to the next: priors err by 3 cm (standard deviation), edges by 4 mm.
struct Chain {
    truth: Vec<Pose3>,
    priors: Vec<Prior>,
    overlaps: Vec<Overlap>,
}

impl Chain {
    fn new(count: usize) -> Chain {
        // The standard deviation of a uniform distribution is its half width over the square root of three.
        let shake = |pose: &Pose3, number: usize, m: f64, rad: f64| {
            let at = |axis: usize| 3f64.sqrt() * noise(7 * number + axis);
            let shift = Vector3::new(m * at(0), m * at(1), 0.0);
            let turn = Vector3::new(0.0, 0.0, rad * at(2));
            Pose3::from_parts(
                (pose.translation.vector + shift).into(),
                nalgebra::UnitQuaternion::from_scaled_axis(turn) * pose.rotation,
            )
        };
        let truth: Vec<Pose3> =
            (0..count).map(|i| pose(1.5 * i as f64, 0.3 * noise(i), noise(3 * i))).collect();
        let priors = (0..count).map(|i| prior(shake(&truth[i], i, 0.03, 0.01), 0.03)).collect();
        let overlaps = (1..count)
            .map(|i| {
                sure(shake(&(truth[i].inverse() * truth[i - 1]), 500 + i, 0.004, 0.001), 0.004f64.powi(-2))
            })
            .collect();
        Chain { truth, priors, overlaps }
    }

    fn edges(&self) -> Vec<Edge<'_>> {
        self.overlaps.iter().enumerate().map(|(i, overlap)| Edge { a: i, b: i + 1, overlap }).collect()
    }

    /// Returns the largest disagreement of the poses with an edge.
    fn worst_edge_m(&self, poses: &[Pose3]) -> f64 {
        let left =
            |edge: &Edge| distance_m(&(poses[edge.b].inverse() * poses[edge.a]), &edge.overlap.b_from_a);
        self.edges().iter().map(left).fold(0.0, f64::max)
    }
}

/// Poses are rounded as in the map.
#[test]
fn a_chain_of_clips_agrees_with_its_edges() {
    let chain = Chain::new(20);
    let before = chain.priors.iter().map(|prior| prior.map_from_clip).collect::<Vec<_>>();
    let refined = refine_poses(&chain.priors, &chain.edges(), &KERNELS);
    let in_map = |pose: &Pose3| {
        let (pose, correction) = split_pose(pose);
        let (pose, correction) = rounded(&pose, &correction);
        pose_in_space(&pose, &correction)
    };
    let refined: Vec<Pose3> = refined.iter().map(in_map).collect();
    assert!(chain.worst_edge_m(&before) > 0.05);
    assert!(chain.worst_edge_m(&refined) < 2e-3, "{}", chain.worst_edge_m(&refined));
    let error_m = |poses: &[Pose3]| -> f64 {
        let squares = poses.iter().zip(&chain.truth).map(|(p, truth)| distance_m(p, truth).powi(2));
        (squares.sum::<f64>() / poses.len() as f64).sqrt()
    };
    assert!(error_m(&refined) < 0.6 * error_m(&before), "{} {}", error_m(&refined), error_m(&before));
}

/// The kernel ends narrow: an edge that contradicts the others by 25 cm is given up. It moves them by less than a
/// tenth of that.
#[test]
fn a_wrong_edge_is_outvoted() {
    let mut chain = Chain::new(6);
    chain
        .overlaps
        .push(sure(Pose3::translation(0.0, 0.25, 0.0) * chain.truth[3].inverse() * chain.truth[0], 6e4));
    let mut edges = chain.edges();
    edges[5] = Edge { a: 0, b: 3, overlap: &chain.overlaps[5] };
    let (with, without) =
        (refine_poses(&chain.priors, &edges, &KERNELS), refine_poses(&chain.priors, &edges[..5], &KERNELS));
    let moved_m = with.iter().zip(&without).map(|(a, b)| distance_m(a, b)).fold(0.0, f64::max);
    assert!(moved_m < 0.02, "{moved_m}");
}

#[test]
fn components_do_not_affect_each_other() {
    let (one, two) = (Chain::new(5), Chain::new(9));
    let alone = refine_poses(&one.priors, &one.edges(), &KERNELS);
    let priors: Vec<Prior> = one.priors.iter().chain(&two.priors).cloned().collect();
    let further = two.edges().into_iter().map(|edge| Edge { a: edge.a + 5, b: edge.b + 5, ..edge });
    let edges: Vec<Edge> = one.edges().into_iter().chain(further).collect();
    assert_eq!(refine_poses(&priors, &edges, &KERNELS)[..5], alone[..]);
}

/// A fixed clip stays where it is in space; the clips joined to it follow, and do not see behind it.
#[test]
fn fixed_clips_stay_and_separate_the_others() {
    let chain = Chain::new(9);
    let with_fixed = |count: usize| -> Vec<Prior> {
        let each = chain.priors.iter().enumerate();
        each.map(|(i, prior)| Prior { is_fixed: i < count, ..prior.clone() }).collect()
    };
    let priors = with_fixed(4);
    let poses = refine_poses(&priors, &chain.edges(), &KERNELS);
    assert!((0..4).all(|i| poses[i] == priors[i].map_from_clip));
    assert!((4..9).all(|i| poses[i] != priors[i].map_from_clip));
    let edges = chain.edges().split_off(3);
    assert_eq!(refine_poses(&priors, &edges, &KERNELS)[4..], poses[4..]);
    // A fixed clip between two parts: each is solved as if the other were not there.
    let middle: Vec<Prior> =
        with_fixed(0).into_iter().enumerate().map(|(i, p)| Prior { is_fixed: i == 4, ..p }).collect();
    let both = refine_poses(&middle, &chain.edges(), &KERNELS);
    assert_eq!(refine_poses(&middle, &chain.edges()[..4], &KERNELS)[..4], both[..4]);
}
