//! Progress of the running method, shared with the worker.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use tokio::sync::Notify;
use tracing::{Span, info_span};
use viola_geometry::progress::{EarlyPose, Progress, Stage};
use viola_storage::JobProgress;

/// A [`Progress`] that stores the progress for the worker and forwards its order to stop. Each stage has its own span.
#[derive(Default)]
pub(super) struct SharedProgress {
    current: Mutex<JobProgress>,
    cancelled: AtomicBool,
    stop: Notify,
    job: Option<Span>,
    stage: Mutex<Option<Span>>,
}

impl SharedProgress {
    /// Returns the progress of the current span's job.
    pub fn here() -> SharedProgress {
        SharedProgress { job: Some(Span::current()), ..SharedProgress::default() }
    }

    pub fn current(&self) -> JobProgress {
        *self.lock()
    }

    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
        self.stop.notify_one();
    }

    /// Returns when [`SharedProgress::cancel`] is called, or was. For one listener.
    pub async fn stop_asked(&self) {
        self.stop.notified().await;
    }

    fn lock(&self) -> MutexGuard<'_, JobProgress> {
        self.current.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Progress for SharedProgress {
    fn enter(&self, stage: Stage) {
        self.lock().record(stage, 0.0);
        let parent = self.job.as_ref().and_then(Span::id);
        let span = info_span!(parent: parent, "stage", otel.name = stage.name());
        *self.stage.lock().unwrap_or_else(PoisonError::into_inner) = Some(span);
    }

    fn advance(&self, fraction: f64) {
        let mut current = self.lock();
        if let Some(stage) = current.stage {
            current.record(stage, fraction);
        }
    }

    fn cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    fn wants_early_pose(&self) -> bool {
        true
    }

    fn early_pose(&self, pose: EarlyPose) {
        self.lock().early_pose = Some(pose);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stage_that_comes_again_takes_no_progress_back() {
        let shared = SharedProgress::default();
        let mut recorded = Vec::new();
        for (stage, fraction) in
            [(Stage::Track, 0.9), (Stage::Fuse, 1.0), (Stage::Track, 0.5), (Stage::Label, 0.5)]
        {
            shared.enter(stage);
            shared.advance(fraction);
            assert_eq!(shared.current().stage, Some(stage));
            recorded.push(shared.current().progress);
        }
        let is_same = recorded[1] == recorded[2];
        assert!(recorded.is_sorted() && is_same && recorded[3] > recorded[2], "{recorded:?}");
    }
}
