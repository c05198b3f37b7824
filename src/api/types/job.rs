//! A job.

use super::answer;
use super::names::{HomeId, LevelName, Pose2};
use super::reason_code::ReasonCode;
use jiff::Timestamp;
use uuid::Uuid;

answer! {
    /// The stages of aligning one clip, in the order in which they run.
    enum Stage from viola_geometry::progress::Stage {
        /// Open the container and read the poses and the intrinsics.
        Decode,
        /// Follow the camera of a clip without poses, or refine poses that drift.
        Track,
        /// Decode the key frames and fuse them into a signed distance map.
        Fuse,
        /// Label the surface by pictures, shapes and networks.
        Label,
        /// Find the floor plane.
        Floor,
        /// Cast rays at the vacuum's height.
        Raycast,
        /// Search the whole map for candidate poses.
        Search,
        /// Refine all candidates at once.
        Refine,
        /// Compare the candidates and compute the probability of the best one.
        Decide,
        /// Fill in what the clip did not see; then search, refine and decide again.
        Complete,
        /// Write pictures and clouds.
        Report,
    }
}

answer! {
    /// A machine-readable reason for a verdict.
    struct Reason from viola_reconstruct::Reason {
        #[schema(value_type = ReasonCode)]
        code: String,
        /// For people.
        detail: String,
    }
}

answer! {
    /// State of a job:
    /// - `queued`: it waits for a worker, and starts by itself.
    /// - `running`: a worker aligns the clip.
    /// - `succeeded`: the method gave an answer, which may be that the clip cannot be aligned; see the state of the clip.
    /// - `failed`: there is no answer, and `error` says why. Correct the cause, then align the clip again.
    /// - `cancelled`: it was ended before it had an answer, which is no failure. The code of `error` is `cancelled` if a person
    ///   did so, and `superseded` if a newer job of the clip replaced it.
    enum JobState from viola_storage::JobState {
        Queued,
        Running,
        Succeeded,
        Failed,
        Cancelled,
    }
}

answer! {
    /// A pose by shape alone, known before the pictures are labelled. The alignment of the clip, which also uses
    /// the labels, may differ.
    struct EarlyPose from viola_geometry::progress::EarlyPose {
        /// The level in whose LiDAR map the pose is.
        level: LevelName,
        map_from_clip: Pose2,
        /// Probability that the pose is right to 10 degrees and 0.3 m, 0..1.
        #[schema(minimum = 0, maximum = 1, example = 0.97)]
        probability: f64,
    }
}

answer! {
    /// The alignment of one clip to the LiDAR maps of its home.
    struct Job from viola_storage::Job {
        #[schema(example = "01a1f766-7abd-71fb-b5b7-3d59df71839d")]
        id: Uuid,
        home: HomeId,
        clip: Uuid,
        /// The newest revision of the home's LiDAR maps when the job was queued.
        lidar_map_revision: i64,
        state: JobState,
        /// Current stage of the method, while the job runs.
        stage: Option<Stage>,
        /// Progress of the whole job, 0..1.
        #[schema(minimum = 0, maximum = 1, example = 0.43)]
        progress: f64,
        /// Provisional pose of the clip while the job runs; null before it is known, after the end of the job, and if
        /// shape alone leaves the pose in doubt. Only a service that labels pictures by a network has it: without
        /// one the alignment itself comes as early.
        early_pose: Option<EarlyPose>,
        /// Number of attempts, with the current one but without those that a fault of the service ended.
        #[schema(example = 1)]
        attempts: u32,
        #[schema(example = 3)]
        max_attempts: u32,
        /// Reason for the failure of the last attempt or of the job, or for its cancellation.
        error: Option<Reason>,
        /// Grows with every change.
        #[schema(example = 5)]
        version: i64,
        created_at: Timestamp,
        updated_at: Timestamp,
        started_at: Option<Timestamp>,
        finished_at: Option<Timestamp>,
    }
}
