//! Measures the time of each stage. The caller provides the clock.

use crate::progress::{EarlyPose, Progress, Stage};
use std::collections::BTreeMap;
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// A [`Progress`] that forwards everything and records the duration of each stage.
pub struct Stopwatch<'a> {
    inner: &'a dyn Progress,
    laps: Mutex<Laps>,
    budget: Option<(Stage, Duration)>,
    clock: Clock,
}

/// A function that returns the time: `Instant::now`.
pub type Clock = fn() -> Instant;

struct Laps {
    seconds: BTreeMap<String, f64>,
    current: Option<(Stage, Instant)>,
}

impl<'a> Stopwatch<'a> {
    pub fn around(inner: &'a dyn Progress, clock: Clock) -> Stopwatch<'a> {
        let laps = Laps { seconds: BTreeMap::new(), current: None };
        Stopwatch { inner, laps: Mutex::new(laps), budget: None, clock }
    }

    /// Limits the time of a stage.
    pub fn with_budget(self, stage: Stage, time: Duration) -> Stopwatch<'a> {
        Stopwatch { budget: Some((stage, time)), ..self }
    }

    /// Ends the current stage and returns the seconds of each.
    pub fn stop(self) -> BTreeMap<String, f64> {
        let now = (self.clock)();
        let mut laps = self.laps.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner());
        laps.close(now);
        laps.seconds
    }
}

impl Laps {
    fn close(&mut self, now: Instant) {
        if let Some((stage, since)) = self.current.take() {
            *self.seconds.entry(stage.name().to_owned()).or_default() +=
                now.duration_since(since).as_secs_f64();
        }
    }
}

impl Progress for Stopwatch<'_> {
    fn enter(&self, stage: Stage) {
        let now = (self.clock)();
        let mut laps = self.laps.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        laps.close(now);
        laps.current = Some((stage, now));
        drop(laps);
        self.inner.enter(stage);
    }

    fn advance(&self, fraction: f64) {
        self.inner.advance(fraction);
    }

    fn cancelled(&self) -> bool {
        self.inner.cancelled()
    }

    fn out_of_time(&self) -> bool {
        let now = (self.clock)();
        let laps = self.laps.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        let over = match (self.budget, laps.current) {
            (Some((stage, time)), Some((current, since))) => {
                stage == current && now.duration_since(since) > time
            }
            _ => false,
        };
        drop(laps);
        over || self.inner.out_of_time()
    }

    fn wants_early_pose(&self) -> bool {
        self.inner.wants_early_pose()
    }

    fn early_pose(&self, pose: EarlyPose) {
        self.inner.early_pose(pose);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;
    use crate::{LevelName, Pose2};

    /// Keeps the names of the calls, and answers yes.
    #[derive(Default)]
    struct Yes(Mutex<Vec<&'static str>>);

    impl Yes {
        fn hear(&self, call: &'static str) -> bool {
            self.0.lock().unwrap().push(call);
            true
        }
    }

    impl Progress for Yes {
        fn enter(&self, _: Stage) {
            self.hear("enter");
        }
        fn advance(&self, _: f64) {
            self.hear("advance");
        }
        fn cancelled(&self) -> bool {
            self.hear("cancelled")
        }
        fn out_of_time(&self) -> bool {
            self.hear("out_of_time")
        }
        fn wants_early_pose(&self) -> bool {
            self.hear("wants_early_pose")
        }
        fn early_pose(&self, _: EarlyPose) {
            self.hear("early_pose");
        }
    }

    #[test]
    fn every_call_is_forwarded() {
        let yes = Yes::default();
        let watch = Stopwatch::around(&yes, Instant::now);
        watch.enter(Stage::Search);
        watch.advance(0.5);
        assert!(watch.cancelled() && watch.out_of_time() && watch.wants_early_pose());
        let (level, map_from_clip) = (LevelName::MAIN, Pose2::IDENTITY);
        watch.early_pose(EarlyPose { level, map_from_clip, probability: 0.5 });
        assert_eq!(
            *yes.0.lock().unwrap(),
            ["enter", "advance", "cancelled", "out_of_time", "wants_early_pose", "early_pose"]
        );
    }

    #[test]
    fn only_the_stage_with_a_budget_runs_out_of_time() {
        let watch = Stopwatch::around(&Silent, Instant::now).with_budget(Stage::Complete, Duration::ZERO);
        assert!(!watch.out_of_time(), "nothing has begun");
        watch.enter(Stage::Search);
        assert!(!watch.out_of_time());
        watch.enter(Stage::Complete);
        // A coarse clock may not have advanced yet.
        while !watch.out_of_time() {}
        let patient =
            Stopwatch::around(&watch, Instant::now).with_budget(Stage::Complete, Duration::from_secs(3600));
        patient.enter(Stage::Complete);
        while !patient.out_of_time() {}
        assert_eq!(patient.stop().keys().collect::<Vec<_>>(), ["complete"]);
    }
}
