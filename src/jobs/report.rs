//! Progress of the running method, shared with the worker.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use tokio::sync::Notify;
use tracing::{Span, info_span};
use viola_geometry::progress::{EarlyPose, Progress, Stage};

/// A [`Progress`] that stores the last report and forwards the order to stop. Each stage has its own span.
#[derive(Default)]
pub(super) struct Report {
    heard: Mutex<Heard>,
    cancelled: AtomicBool,
    stop: Notify,
    job: Option<Span>,
    stage: Mutex<Option<Span>>,
}

/// Last report of the method.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Heard {
    pub stage: Option<Stage>,
    /// Progress of the whole job, 0..1. It never decreases, though stages may repeat.
    pub progress: f64,
    pub early_pose: Option<EarlyPose>,
}

impl Heard {
    fn hear(&mut self, stage: Stage, fraction: f64) {
        let progress = self.progress.max(stage.overall(fraction));
        *self = Heard { stage: Some(stage), progress, ..*self };
    }
}

impl Report {
    /// Returns a report for the job of the current span.
    pub fn here() -> Report {
        Report { job: Some(Span::current()), ..Report::default() }
    }

    pub fn heard(&self) -> Heard {
        *self.lock()
    }

    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
        self.stop.notify_one();
    }

    /// Returns when [`Report::cancel`] is called, or was. For one listener.
    pub async fn stop_asked(&self) {
        self.stop.notified().await;
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Heard> {
        self.heard.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }
}

impl Progress for Report {
    fn enter(&self, stage: Stage) {
        self.lock().hear(stage, 0.0);
        let parent = self.job.as_ref().and_then(Span::id);
        let span = info_span!(parent: parent, "stage", otel.name = stage.name());
        *self.stage.lock().unwrap_or_else(|poisoned| poisoned.into_inner()) = Some(span);
    }

    fn advance(&self, fraction: f64) {
        let mut heard = self.lock();
        if let Some(stage) = heard.stage {
            heard.hear(stage, fraction);
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
        let report = Report::default();
        let mut told = Vec::new();
        for (stage, fraction) in
            [(Stage::Track, 0.9), (Stage::Fuse, 1.0), (Stage::Track, 0.5), (Stage::Label, 0.5)]
        {
            report.enter(stage);
            report.advance(fraction);
            assert_eq!(report.heard().stage, Some(stage));
            told.push(report.heard().progress);
        }
        assert!(told.is_sorted() && told[1] == told[2] && told[3] > told[2], "{told:?}");
    }
}
