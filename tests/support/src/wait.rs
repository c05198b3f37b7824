//! Waiting with a deadline.

use std::future::Future;
use std::time::{Duration, Instant};

/// Longer than any wait takes on a busy machine with two cores.
pub const DEADLINE: Duration = Duration::from_secs(300);

/// Asks repeatedly until there is an answer.
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
