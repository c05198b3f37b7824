//! The service over HTTP, in this process: what it promises, and what it refuses.

mod access;
mod attacks;
mod changes;
mod children;
mod choice;
mod clips;
mod document;
mod exports;
mod homes;
mod hostile;
mod jobs;
mod lidar_map;
mod map;
mod metrics;
mod problems;
mod server;
mod tus_client;
mod upload_cuts;
mod uploads;
mod webhooks;
mod workers;
