//! Progress display: a bar on a terminal, else one plain line per stage.
//!
//! One clip of several has a bar of its own, named by its number; its plain lines have no percentages.

use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use viola_geometry::progress::{Progress, Stage};

pub struct TerminalProgress {
    bar: Option<ProgressBar>,
    /// Name of this part of the work, such as `clip 2 of 6`; `None` if it is the whole work.
    part: Option<String>,
    stage: Mutex<Option<Stage>>,
    /// Highest progress so far, in thousandths: stages may repeat, and the bar must not move back.
    furthest: AtomicU64,
}

impl TerminalProgress {
    pub fn new() -> TerminalProgress {
        TerminalProgress::with(None)
    }

    /// Returns the progress of one part of the work.
    pub fn of_part(part: String) -> TerminalProgress {
        TerminalProgress::with(Some(part))
    }

    fn with(part: Option<String>) -> TerminalProgress {
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::new(1000);
            if let Ok(style) = ProgressStyle::with_template("{msg:>8} {wide_bar} {percent:>3} % {elapsed:>4}")
            {
                bar.set_style(style);
            }
            bar
        });
        TerminalProgress { bar, part, stage: Mutex::new(None), furthest: AtomicU64::new(0) }
    }

    pub fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }

    /// Shows the progress and returns the highest so far, in thousandths.
    fn show(&self, stage: Stage, fraction: f64) -> u64 {
        let thousandths = (stage.overall(fraction) * 1000.0) as u64;
        let furthest = self.furthest.fetch_max(thousandths, Ordering::Relaxed).max(thousandths);
        if let Some(bar) = &self.bar {
            bar.set_position(furthest);
        }
        furthest
    }
}

impl Progress for TerminalProgress {
    fn enter(&self, stage: Stage) {
        *self.stage.lock().unwrap_or_else(|poisoned| poisoned.into_inner()) = Some(stage);
        let furthest = self.show(stage, 0.0);
        let name = stage.name();
        match (&self.bar, &self.part) {
            (Some(bar), Some(part)) => bar.set_message(format!("{part}: {name}")),
            (Some(bar), None) => bar.set_message(name),
            (None, Some(part)) => eprintln!("{part}: {name}"),
            (None, None) => eprintln!("{:3} % {name}", furthest / 10),
        }
    }

    fn advance(&self, fraction: f64) {
        let stage = *self.stage.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        if let Some(stage) = stage {
            self.show(stage, fraction);
        }
    }

    fn cancelled(&self) -> bool {
        false
    }
}
