//! The files that a job makes of its clip, by name.

pub const OVERLAY: &str = "overlay.png";
/// In the clip's frame.
pub const CLOUD: &str = "cloud.ply";
pub const VIEWS: &str = "views.bin";
pub const SCAN: &str = "scan.json";
pub const COMPLETION: &str = "completion.png";

/// Every name that a result may have; not every answer has all of them.
pub const ALL: [&str; 5] = [OVERLAY, CLOUD, VIEWS, SCAN, COMPLETION];
