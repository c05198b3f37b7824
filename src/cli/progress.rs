//! Progress display: a bar on a terminal, else one plain line per stage if there are several clips or with `--verbose`.
//!
//! One clip of several has a bar of its own, named by its number.

use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU8, AtomicU64, Ordering};
use viola_geometry::progress::{Progress, Stage};

/// Amount of output about the work beside its result.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub enum Verbosity {
    Quiet,
    Normal,
    Verbose,
}

/// The process's [`Verbosity`], as a number.
static VERBOSITY: AtomicU8 = AtomicU8::new(Verbosity::Normal as u8);

/// Sets the verbosity of the process.
pub fn set_verbosity(verbosity: Verbosity) {
    VERBOSITY.store(verbosity as u8, Ordering::Relaxed);
}

fn is_at_least(verbosity: Verbosity) -> bool {
    VERBOSITY.load(Ordering::Relaxed) >= verbosity as u8
}

/// Prints a line about the work, unless `--quiet` is given.
pub fn tell(line: &str) {
    if is_at_least(Verbosity::Normal) {
        eprintln!("{line}");
    }
}

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
        let has_bar = std::io::stderr().is_terminal() && is_at_least(Verbosity::Normal);
        let bar = has_bar.then(|| {
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

    /// Shows the highest progress so far.
    fn show(&self, stage: Stage, fraction: f64) {
        let thousandths = (stage.overall(fraction) * 1000.0) as u64;
        let furthest = self.furthest.fetch_max(thousandths, Ordering::Relaxed).max(thousandths);
        if let Some(bar) = &self.bar {
            bar.set_position(furthest);
        }
    }
}

impl Progress for TerminalProgress {
    fn enter(&self, stage: Stage) {
        *self.stage.lock().unwrap_or_else(|poisoned| poisoned.into_inner()) = Some(stage);
        self.show(stage, 0.0);
        let name = stage.name();
        match (&self.bar, &self.part) {
            (Some(bar), Some(part)) => bar.set_message(format!("{part}: {name}")),
            (Some(bar), None) => bar.set_message(name),
            (None, Some(part)) if is_at_least(Verbosity::Normal) => eprintln!("{part}: {name}"),
            (None, None) if is_at_least(Verbosity::Verbose) => eprintln!("{name}"),
            (None, _) => {}
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
