//! Names of the files in a clip's result.

pub const OVERLAY: &str = "overlay.png";
/// In the clip's frame.
pub const CLOUD: &str = "cloud.ply";
pub const VIEWS: &str = "views.bin";
pub const SCAN: &str = "scan.json";
pub const COMPLETION: &str = "completion.png";

/// All names; not every result has all of the files.
pub const ALL: [&str; 5] = [OVERLAY, CLOUD, VIEWS, SCAN, COMPLETION];
