//! A clip.

use super::alignment::Alignment;
use super::answer;
use super::job::{Job, Reason};
use super::names::{HomeId, LevelName, Pose2};
use jiff::Timestamp;
use uuid::Uuid;

answer! {
    /// Summary of a clip's file.
    struct ClipInfo from viola_formats::clip::ClipInfo {
        /// Layout by name, for example `stray_scanner`, `record3d`, `polycam`, `scannet`, `tum_rgbd`.
        layout: String,
        /// Direction and camera axes of the poses as the files have them, for example
        /// `camera-to-world, OpenCV (x right, y down, z forward)`.
        pose_convention: String,
        /// Unit of the depth pictures, for example `millimetres (16-bit PNG)`.
        depth_unit: String,
        /// Up direction and its source, for example `world z is up (rule of the layout)` or `unknown`.
        gravity: String,
        /// Source of the intrinsics.
        intrinsics: String,
        /// Frames with both pictures.
        frames: usize,
        /// Frames with a finite pose.
        frames_with_pose: usize,
        /// Frames that cannot be used because their pose is missing or not a finite rigid motion.
        skipped_without_pose: usize,
        /// Frames left out because one of their pictures is missing.
        skipped_incomplete: usize,
        color_width: u32,
        color_height: u32,
        depth_width: u32,
        depth_height: u32,
        /// Seconds from the first to the last frame, when the layout has times.
        duration_s: Option<f64>,
        /// False if poses and depth have a common but unknown unit: the alignment finds its scale.
        #[schema(required = false)]
        metric: bool,
        /// Time of the first frame in milliseconds since 1970 UTC, if the layout has times of day.
        recorded_at_ms: Option<i64>,
        /// Notes of the reader: assumptions made, files ignored.
        notes: Vec<String>,
    }
}

answer! {
    /// Source of a clip's pose:
    /// - `alignment`: the clip's own alignment to the LiDAR map.
    /// - `neighbours`: the clips around it, which decided between its alternatives.
    /// - `person`: a person's choice.
    enum PlacedBy from viola_home::PlacedBy {
        Alignment,
        Neighbours,
        Person,
    }
}

answer! {
    /// Hits at the vacuum's height and cameras of a clip, for drawing it at any pose.
    struct ClipScan from viola_home::ClipScan {
        /// Hits at the vacuum's height, in the clip's frame: z up, its origin on the floor below the first used camera.
        hits_m: Vec<[f32; 2]>,
        /// The key frames in the order of recording.
        cameras: Vec<ScanCamera>,
    }
}

answer! {
    /// A key frame's camera in the clip's frame.
    struct ScanCamera from viola_home::ScanCamera {
        position_m: [f32; 3],
        /// Viewing direction of the camera, of unit length.
        forward: [f32; 3],
    }
}

answer! {
    /// Estimate of the work to align a clip.
    struct Estimate from viola_reconstruct::Estimate {
        /// Frames that will be decoded and fused; all frames if the clip has no poses.
        #[schema(example = 118)]
        key_frames: usize,
        /// Seconds on two cores without a network and without completion; waiting for other jobs is not counted.
        #[schema(example = 3.2)]
        seconds: f64,
    }
}

answer! {
    /// The pose of a clip that a person chose.
    struct Choice from viola_storage::Choice {
        /// The level in whose LiDAR map the pose is.
        level: LevelName,
        /// In the frame of the LiDAR map of `lidar_map_revision`.
        map_from_clip: Pose2,
        /// Index among the alternatives that the clip had then; null when the person gave a pose.
        #[schema(minimum = 0, example = 1)]
        alternative: Option<u32>,
        /// The LiDAR map that the person looked at, or a later one that the choice was carried over to.
        #[schema(minimum = 1, example = 1)]
        lidar_map_revision: i64,
        /// The LiDAR map that the person looked at, if the choice was carried over to a later one; null otherwise.
        #[schema(minimum = 1, required = false)]
        carried_from: Option<i64>,
        chosen_at: Timestamp,
    }
}

answer! {
    /// State of a clip:
    /// - `uploaded`: stored without a job under way. With the reason `no_lidar_map`, send the home's LiDAR map; with
    ///   `cancelled`, align the clip again.
    /// - `queued`: its job waits for a worker, and starts by itself. A reason tells a fault of the service that delays it.
    /// - `aligning`: its job runs.
    /// - `aligned`: its pose is known. One pose stands out, the clips around it decided, or a person chose one.
    /// - `ambiguous`: no pose is certain enough. Choose one of the alignment's alternatives, or film more of the room; the
    ///   reasons say more.
    /// - `failed`: it has no pose. The reasons say why; correct their cause, then align the clip again or film again.
    enum ClipState from viola_storage::ClipState {
        Uploaded,
        Queued,
        Aligning,
        Aligned,
        Ambiguous,
        Failed,
    }
}

answer! {
    /// An uploaded clip.
    struct Clip from viola_storage::Clip {
        #[schema(example = "01a1f766-7a97-7747-9dbb-391e0eeccb64")]
        id: Uuid,
        home: HomeId,
        state: ClipState,
        /// Reasons for the state.
        reasons: Vec<Reason>,
        #[schema(example = 15147863)]
        size_bytes: u64,
        /// SHA-256 of the file, in lower-case hexadecimal.
        #[schema(example = "7a0339dd7ccb957e90eb77c14f3ee67f0aa0f22b2746d18fb8ef262c6f069c9e")]
        sha256: String,
        /// Name of the file, if its sender gave one.
        #[schema(example = "kitchen.zip")]
        file_name: Option<String>,
        /// Name that a person gave the clip.
        #[schema(example = "Kitchen, evening")]
        title: Option<String>,
        /// The oldest clip of the home with the same recording: with the same file, or with another archive of the same files. Null if
        /// this is it. The home's map takes one of them.
        duplicate_of: Option<Uuid>,
        /// Summary of the file.
        info: ClipInfo,
        /// Time of recording, from the sender or else from the file; null if neither gives it.
        #[schema(example = "2026-03-14T15:09:26Z")]
        recorded_at: Option<Timestamp>,
        /// The method's own answer; null before a job has given one, and while a newer job is under way. Its pose, level
        /// and probability are those of `placement` if the clips around it decided (`by: neighbours`).
        alignment: Option<Alignment>,
        /// The answer of an earlier job, while the newest job has none; null otherwise. Until then, `overlay.png`,
        /// `thumbnail.jpg`, `scan` and the other files are those of this answer.
        #[schema(required = false)]
        last_answer: Option<LastAnswer>,
        /// The pose that a person chose; it overrides the method's own until it is withdrawn.
        choice: Option<Choice>,
        /// Pose of the clip in the newest revision of the home's map; null if the clip is not in it.
        placement: Option<Placement>,
        /// The newest job of the clip, null before the first one.
        job: Option<Job>,
        created_at: Timestamp,
        updated_at: Timestamp,
    }
}

answer! {
    /// The answer of an earlier job.
    struct LastAnswer from viola_storage::LastAnswer {
        /// Its poses are in the frames of the LiDAR maps of `lidar_map_revision`.
        alignment: Alignment,
        /// The newest revision of the home's LiDAR maps when that job was queued. If the home's is another one, the answer is of
        /// an older map.
        #[schema(minimum = 1, example = 1)]
        lidar_map_revision: i64,
    }
}

answer! {
    /// Pose of a clip in a revision of the home's map, and its source.
    struct Placement from viola_storage::Placement {
        /// The level in whose LiDAR map the pose is.
        level: LevelName,
        map_from_clip: Pose2,
        /// Height of the clip frame's origin above the floor there, in metres, as `rise_m` of an alternative: not 0 if an
        /// alternative above another floor than that of the answer was chosen.
        #[schema(required = false)]
        rise_m: f64,
        by: PlacedBy,
        /// Probability that the pose is right to 10 degrees and 0.3 m, 0..1; null if a person chose it.
        #[schema(minimum = 0, maximum = 1, example = 0.97)]
        probability: Option<f64>,
        /// Revision of the home's map.
        #[schema(minimum = 1, example = 4)]
        map_revision: i64,
    }
}
