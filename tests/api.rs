//! The service over HTTP, in this process: what it promises, and what it refuses.

mod common;

#[path = "api/access.rs"]
mod access;
#[path = "api/attacks.rs"]
mod attacks;
#[path = "api/changes.rs"]
mod changes;
#[path = "api/children.rs"]
mod children;
#[path = "api/choice.rs"]
mod choice;
#[path = "api/clips.rs"]
mod clips;
#[path = "api/document.rs"]
mod document;
#[path = "api/exports.rs"]
mod exports;
#[path = "api/homes.rs"]
mod homes;
#[path = "api/hostile.rs"]
mod hostile;
#[path = "api/jobs.rs"]
mod jobs;
#[path = "api/lidar_map.rs"]
mod lidar_map;
#[path = "api/map.rs"]
mod map;
#[path = "api/metrics.rs"]
mod metrics;
#[path = "api/problems.rs"]
mod problems;
#[path = "api/server.rs"]
mod server;
#[path = "api/tus_client.rs"]
mod tus_client;
#[path = "api/upload_cuts.rs"]
mod upload_cuts;
#[path = "api/uploads.rs"]
mod uploads;
#[path = "api/webhooks.rs"]
mod webhooks;
#[path = "api/workers.rs"]
mod workers;
