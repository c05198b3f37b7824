//! Names of the files in a clip's result.

pub const OVERLAY: &str = "overlay.png";
/// In the clip's frame.
pub const CLOUD: &str = "cloud.ply";
pub const VIEWS: &str = "views.bin";
/// Results of earlier versions have none.
pub const FEATURES: &str = "features.bin";
pub const SCAN: &str = "scan.json";
pub const COMPLETION: &str = "completion.png";
/// Results of earlier versions and of clips without colour have none.
pub const THUMBNAIL: &str = "thumbnail.jpg";
/// Only of clips that are not aligned.
pub const FRAMES: &str = "frames.jpg";

/// Names of the files for people that every answer has.
pub const OF_EVERY_ANSWER: [&str; 3] = [OVERLAY, CLOUD, SCAN];

/// All names; not every result has all of the files.
pub const ALL: [&str; 8] = [OVERLAY, CLOUD, VIEWS, FEATURES, SCAN, COMPLETION, THUMBNAIL, FRAMES];
