//! The end of a merge, which writes files that no row names yet.

use std::future::Future;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Set once a merge writes its files.
#[derive(Debug, Default)]
pub(super) struct Finishing(AtomicBool);

impl Finishing {
    pub fn begin(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Returns the result of `merge`, or that of `early` if it comes first. A merge that writes its files then has the time
    /// `grace` to end: it removes the files that it wrote in vain.
    pub async fn end<T>(
        &self,
        merge: impl Future<Output = T>,
        early: impl Future<Output = T>,
        grace: Duration,
    ) -> T {
        let early = async {
            let ended = early.await;
            if self.0.load(Ordering::Relaxed) {
                tokio::time::sleep(grace).await;
            }
            ended
        };
        tokio::select! {
            ended = merge => ended,
            ended = early => ended,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tokio::sync::oneshot;

    #[tokio::test]
    async fn a_merge_that_writes_its_files_ends_before_its_worker() {
        let hour = Duration::from_hours(1);
        for writes in [false, true] {
            let finishing = Finishing::default();
            let (stop, stopped) = oneshot::channel();
            let merge = async {
                if writes {
                    finishing.begin();
                }
                stop.send(()).unwrap();
                for _ in 0..9 {
                    tokio::task::yield_now().await;
                }
                if !writes {
                    std::future::pending().await
                }
                "merged"
            };
            let early = async {
                stopped.await.unwrap();
                "stopped"
            };
            let expected = if writes { "merged" } else { "stopped" };
            assert_eq!(finishing.end(merge, early, hour).await, expected);
        }
    }
}
