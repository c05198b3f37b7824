//! A running merge: the order to stop, which its threads read, and its end.

use super::error::MergeError;
use std::pin::pin;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tokio::sync::Notify;
use viola_geometry::progress::Progress;

/// State of a running merge, shared with its threads.
#[derive(Debug, Default)]
pub(super) struct Running {
    is_cancelled: AtomicBool,
    /// Told once it is cancelled, to the one who waits for that.
    cancelled: Notify,
    /// Set once the merge writes its files, which no row names yet.
    is_writing: AtomicBool,
}

impl Running {
    pub fn begin_to_write(&self) {
        self.is_writing.store(true, Ordering::Relaxed);
    }

    /// Returns when the merge is asked to stop, once.
    pub async fn stopped(&self) {
        self.cancelled.notified().await;
    }

    /// Returns after `limit`; never if the merge writes its files by then, because little is left to do.
    pub async fn too_long(&self, limit: Duration) {
        tokio::time::sleep(limit).await;
        if self.is_writing.load(Ordering::Relaxed) {
            std::future::pending().await
        }
    }

    /// Returns the result of `merge`, or that of `early` if it comes first. The merge is then asked to stop and has the time
    /// `grace` for it; a thread in a longer step ends after the step. One that writes its files becomes complete, or removes the
    /// files that it wrote in vain.
    pub async fn end<T>(
        &self,
        merge: impl Future<Output = Result<T, MergeError>>,
        early: impl Future<Output = Result<T, MergeError>>,
        grace: Duration,
    ) -> Result<T, MergeError> {
        let mut merge = pin!(merge);
        let reason = tokio::select! {
            ended = merge.as_mut() => return ended,
            reason = early => reason,
        };
        self.is_cancelled.store(true, Ordering::Relaxed);
        self.cancelled.notify_one();
        match tokio::time::timeout(grace, merge).await {
            Ok(Err(MergeError::Cancelled)) | Err(_) => reason,
            Ok(ended) => ended,
        }
    }
}

impl Progress for Running {
    fn cancelled(&self) -> bool {
        self.is_cancelled.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tokio::sync::oneshot;
    use tokio::task::yield_now;

    /// Returns the end of a merge that is asked to stop during `rest`, its last part.
    async fn ended(
        running: &Running,
        rest: impl Future<Output = Result<&'static str, MergeError>>,
        grace: Duration,
    ) -> &'static str {
        let (stop, stopped) = oneshot::channel();
        let merge = async {
            stop.send(()).unwrap();
            rest.await
        };
        let early = async {
            stopped.await.unwrap();
            Ok("stopped")
        };
        running.end(merge, early, grace).await.unwrap()
    }

    #[tokio::test]
    async fn a_merge_ends_soon_after_a_stop() {
        let hour = Duration::from_hours(1);
        let running = Running::default();
        let works = async {
            while !running.cancelled() {
                yield_now().await;
            }
            Err(MergeError::Cancelled)
        };
        assert_eq!(ended(&running, works, hour).await, "stopped");
        let writes = async {
            for _ in 0..9 {
                yield_now().await;
            }
            Ok("merged")
        };
        assert_eq!(ended(&Running::default(), writes, hour).await, "merged");
        let waits = std::future::pending();
        assert_eq!(ended(&Running::default(), waits, Duration::ZERO).await, "stopped");
    }

    #[tokio::test]
    async fn the_limit_is_of_the_time_before_the_files() {
        let running = Running::default();
        running.too_long(Duration::ZERO).await;
        running.begin_to_write();
        let limit = running.too_long(Duration::ZERO);
        assert!(tokio::time::timeout(Duration::from_millis(10), limit).await.is_err());
    }
}
