//! The service over HTTP, in this process: its promises and its refusals.

mod access;
mod attacks;
mod changes;
mod children;
mod choice;
mod clips;
mod corrections;
mod document;
mod exports;
mod foreign;
mod homes;
mod hostile;
mod jobs;
mod layers;
mod levels;
mod lidar_map;
mod map;
mod metrics;
mod problems;
mod robot;
mod server;
mod tus_client;
mod upload_cuts;
mod uploads;
mod webhooks;
mod workers;
