//! What tests of the service share: a client, recordings to upload, and waiting with a deadline.

#![allow(dead_code, reason = "each test binary uses its own part")]

pub mod client;
pub mod disk;
pub mod postgres;
pub mod process;
pub mod room;
#[path = "../../src/storage/conformance/s3_server.rs"]
pub mod s3_server;
pub mod tablespace;
pub mod tus;
pub mod zips;

use std::future::Future;
use std::time::{Duration, Instant};
use viola::storage::S3Params;

/// Longer than anything takes on a busy machine with two cores.
pub const DEADLINE: Duration = Duration::from_secs(120);

/// Asks again and again until there is an answer.
pub async fn eventually<T, F: Future<Output = Option<T>>>(what: &str, mut ask: impl FnMut() -> F) -> T {
    let begun = Instant::now();
    loop {
        if let Some(answer) = ask().await {
            return answer;
        }
        assert!(begun.elapsed() < DEADLINE, "after {DEADLINE:?} still not so: {what}");
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
}
