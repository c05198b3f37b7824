//! The method's answer for one clip.

use super::answer;
use super::job::Reason;
use super::names::{LevelName, Pose2};
use std::collections::BTreeMap;

answer! {
    /// The verdict on a clip:
    /// - `aligned`: one pose stands out, and can be used.
    /// - `ambiguous`: the best pose is not certain enough, because poses elsewhere explain the clip about as well, or because
    ///   the clip shows too little. Choose one of the alternatives, or film more of the room.
    /// - `failed`: no pose can be given. The reasons say why; correct their cause, or film again.
    enum AlignmentState from viola_align::AlignmentState {
        Aligned,
        Ambiguous,
        Failed,
    }
}

answer! {
    /// One explanation of the clip, the best first.
    struct Alternative from viola_align::Alternative {
        /// The level in whose LiDAR map the pose is.
        #[schema(required = false)]
        level: LevelName,
        map_from_clip: Pose2,
        /// Height of the clip frame's origin above the floor of this explanation, in metres: it is added to heights in the
        /// clip frame. Not 0 if several floors were tried, and this explanation is above another one than the answer; positive
        /// if that one lies lower.
        #[schema(required = false)]
        rise_m: f64,
        /// Loss by which alternatives are ranked, in metres: the mean robust distance of the hits to the map,
        /// plus the penalties from free space and the rooms' names.
        loss_m: f64,
        /// Fraction of the hits within 0.1 m of the map, 0..1.
        inliers: f64,
        /// Contradictions between the pose and free space; null if the method does not look at free space.
        free_space: Option<FreeSpace>,
        /// Fraction of the labelled points above the floor in a room whose name excludes their class, such as a
        /// bed in a kitchen, 0..1. It is computed from the classes of a network and the names of the rooms;
        /// null if no room's name tells its use.
        #[schema(required = false)]
        misplaced: Option<f64>,
        /// Probability that this pose is right, 0..1; null if the method does not give one.
        probability: Option<f64>,
    }
}

answer! {
    /// Contradictions: places that the clip or the robot saw free, and where the other has an obstacle.
    struct FreeSpace from viola_align::FreeSpace {
        /// Fraction of the clip's rays that run through walls of the map, 0..1.
        blocked_rays: f64,
        /// Fraction of the hits that stand where the robot saw free floor, 0..1.
        hits_on_floor: f64,
        /// Fraction of the hits that fit a wall on the side from which the robot never saw it, 0..1.
        unseen_sides: f64,
        /// Map walls on floor that the clip saw free, as a share of these walls and the clip's hits, 0..1.
        walls_on_floor: f64,
    }
}

answer! {
    /// The answer for one clip: `result.json` of `viola align`, and `alignment` of a clip over HTTP.
    struct Alignment from viola_align::Alignment {
        state: AlignmentState,
        /// Probability that the pose is right to 10 degrees and 0.3 m, 0..1; null if there is no pose.
        probability: Option<f64>,
        /// The level of the first alternative; `main` without one.
        #[schema(required = false)]
        level: LevelName,
        /// Null when the state is `failed`.
        map_from_clip: Option<Pose2>,
        /// Covariance of (x_m, y_m, yaw_rad), row by row: square metres, metre radians, square radians.
        covariance: Option<[[f64; 3]; 3]>,
        /// Metres per unit of the clip's depth, if the unit was unknown; null if it is metres. Poses have the same unit;
        /// those of a Nerfstudio file have it after division by its `applied_scale`. Everything else in the answer is in
        /// metres.
        scale: Option<f64>,
        /// Standard deviation of `scale`.
        scale_std: Option<f64>,
        /// Loss of the best alternative.
        loss_m: Option<f64>,
        inliers: Option<f64>,
        /// Fraction of the LiDAR map's points that the clip's hits explain, 0..1 (the paper's coverage).
        coverage: Option<f64>,
        /// The ranked explanations, the chosen one first.
        alternatives: Vec<Alternative>,
        reasons: Vec<Reason>,
        hits: usize,
        key_frames: usize,
        /// Source of the points' classes; null if nothing was fused.
        labels: Option<LabelReport>,
        floor: Option<FloorReport>,
        /// The camera that defines the clip frame; null without a floor, and in answers of earlier versions.
        #[schema(required = false)]
        reference_camera: Option<ReferenceCamera>,
        /// Completion, made because the first answer was uncertain; null if there was none.
        completion: Option<CompletionReport>,
        /// Time of each stage. The only part that differs from run to run.
        seconds: BTreeMap<String, f64>,
    }
}

answer! {
    /// The first used camera of a clip: the clip frame has its origin on the floor below it and faces along its heading.
    /// With it a device's session is placed in the map: `map_from_clip * clip_from_camera * world_from_camera^-1`, by the
    /// device's own pose of that frame.
    struct ReferenceCamera from viola_align::ReferenceCamera {
        /// Number of the frame in the clip.
        #[schema(example = 0)]
        frame: u32,
        /// Pose of the camera (x right, y down, z forward) in the clip frame, row by row; translation in metres.
        #[schema(example = json!([[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 1.45], [0.0, 0.0, 0.0, 1.0]]))]
        clip_from_camera: [[f64; 4]; 4],
    }
}

answer! {
    /// The completion of an answer, as the answer reports it.
    struct CompletionReport from viola_align::CompletionReport {
        /// Points that continue walls.
        structure_points: usize,
        /// Points that networks generated.
        imagined_points: usize,
        /// Hits at the vacuum's height that were filled in.
        hits: usize,
        /// Networks that generated something.
        imagined_by: Vec<String>,
        /// Views whose pictures were filled in, in order.
        views: Vec<ViewReport>,
        /// True if the time limit was reached before the last view.
        cut_short: bool,
        /// True if the answer is the one after the completion.
        taken: bool,
        before: Judged,
        after: Judged,
    }
}

answer! {
    /// A view in short.
    struct ViewReport from viola_align::ViewReport {
        /// In the clip frame.
        view: View,
        /// Fraction of the picture that was filled in, 0..1.
        imagined_share: f64,
        /// Points that the view added.
        points: usize,
    }
}

answer! {
    /// An answer in short.
    struct Judged from viola_align::AnswerSummary {
        state: AlignmentState,
        probability: Option<f64>,
        map_from_clip: Option<Pose2>,
    }
}

answer! {
    /// A camera that is held level, in the clip frame.
    struct View from viola_align::complete::View {
        /// Its place.
        eye_m: [f64; 3],
        /// Its heading: 0 looks along x, a quarter turn along y.
        yaw_rad: f64,
        /// Its tilt; positive is downwards.
        pitch_rad: f64,
    }
}

answer! {
    /// The floor as it was found.
    struct FloorReport from viola_reconstruct::FloorReport {
        /// True if the floor was not seen; its height is then the guess that fits the map best.
        assumed: bool,
        /// Height of the first camera above it, in metres.
        camera_height_m: f64,
        /// Fused points within 2 cm of the plane.
        support_points: usize,
        /// Angle to the capture's gravity in degrees, when the capture knows gravity.
        gravity_angle_deg: Option<f64>,
    }
}

answer! {
    /// Source of the labels of an answer's points.
    struct LabelReport from viola_reconstruct::label::LabelReport {
        /// `geometry` if no network was used. Else the networks with their runtimes, separated by `; `: first the
        /// one for pictures, then the one for surfaces.
        #[schema(example = "columns, rten 0.27")]
        by: String,
        /// Pictures that a network looked at; 0 if no network for pictures was used.
        key_frames: usize,
    }
}
