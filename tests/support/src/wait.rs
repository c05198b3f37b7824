//! Waiting with a deadline.

use std::future::Future;
use std::time::{Duration, Instant};

/// Longer than any wait takes on a busy machine with two cores.
const DEADLINE: Duration = Duration::from_secs(300);

/// Pauses between two questions: a twentieth of the wait so far, because the questions of several tests would slow down what
/// they wait for.
const PAUSES: [Duration; 2] = [Duration::from_millis(5), Duration::from_millis(50)];

/// Asks repeatedly until something is so.
pub async fn until(what: &str, mut is_so: impl AsyncFnMut() -> bool) {
    let begun = Instant::now();
    while !is_so().await {
        pause(what, begun).await;
    }
}

/// Asks repeatedly until there is an answer.
pub async fn eventually<T, F: Future<Output = Option<T>>>(what: &str, mut ask: impl FnMut() -> F) -> T {
    let begun = Instant::now();
    loop {
        if let Some(answer) = ask().await {
            return answer;
        }
        pause(what, begun).await;
    }
}

/// Pauses before the next question; fails after the deadline.
async fn pause(what: &str, begun: Instant) {
    let waited = begun.elapsed();
    assert!(waited < DEADLINE, "after {DEADLINE:?} still not so: {what}");
    tokio::time::sleep((waited / 20).clamp(PAUSES[0], PAUSES[1])).await;
}
