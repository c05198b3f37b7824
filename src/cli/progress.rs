//! Progress display: a bar on a terminal, else one plain line per stage if there are several clips or with `--verbose`.
//!
//! One clip of several has a bar of its own, named by its number.

use indicatif::{ProgressBar, ProgressStyle};
use std::io::{IsTerminal, Write};
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

/// Returns whether progress is shown as bars: on a terminal and without `--quiet`.
pub fn has_bars() -> bool {
    shows_bars(std::io::stderr().is_terminal(), VERBOSITY.load(Ordering::Relaxed))
}

fn shows_bars(is_terminal: bool, verbosity: u8) -> bool {
    is_terminal && verbosity >= Verbosity::Normal as u8
}

/// Returns a bar, which is hidden without a terminal and with `--quiet`.
pub fn bar(length: u64, template: &str) -> ProgressBar {
    let bar = if has_bars() { ProgressBar::new(length) } else { ProgressBar::hidden() };
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar
}

/// Returns a message for work without a known end, hidden like a [`bar`].
pub fn spinner(message: String) -> ProgressBar {
    bar(0, "{spinner} {msg}").with_message(message)
}

/// Progress of work in steps: a bar with the remaining time on a terminal, else a line for each step.
pub struct Steps {
    bar: ProgressBar,
    done: AtomicU64,
    total: u64,
}

impl Steps {
    pub fn new(total: u64) -> Steps {
        let bar = bar(total, "{wide_bar} {pos}/{len} {elapsed_precise}, {eta_precise} left");
        Steps { bar, done: AtomicU64::new(0), total }
    }

    /// Reports the end of a step.
    pub fn advance(&self, step: &str) {
        let line = self.line(step);
        self.bar.set_position(self.done.load(Ordering::Relaxed));
        if self.bar.is_hidden() {
            print_line(&line);
        }
    }

    /// Counts a step and returns its line.
    fn line(&self, step: &str) -> String {
        format!("{}/{} {step}", self.done.fetch_add(1, Ordering::Relaxed) + 1, self.total)
    }
}

impl Drop for Steps {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// Prints a line about the work, unless `--quiet` is given.
pub fn print_line(line: &str) {
    if is_at_least(Verbosity::Normal) {
        to_standard_error(line);
    }
}

/// Prints a line to standard error. If nobody reads it, or its disk is full, the work continues: `eprintln!` would panic.
pub fn to_standard_error(line: &str) {
    // There is no other place to report it.
    let _ = writeln!(std::io::stderr(), "{line}");
}

pub struct TerminalProgress {
    bar: ProgressBar,
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

    /// Returns the progress of one of many parts: a bar on a terminal, else a single line.
    pub fn of_step(part: String) -> TerminalProgress {
        if has_bars() {
            return TerminalProgress::of_part(part);
        }
        print_line(&part);
        TerminalProgress::new()
    }

    fn with(part: Option<String>) -> TerminalProgress {
        let bar = bar(1000, "{msg:>8} {wide_bar} {percent:>3} % {elapsed:>4}");
        TerminalProgress { bar, part, stage: Mutex::new(None), furthest: AtomicU64::new(0) }
    }

    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }

    /// Shows the highest progress so far.
    fn show(&self, stage: Stage, fraction: f64) {
        let thousandths = (stage.overall(fraction) * 1000.0) as u64;
        let furthest = self.furthest.fetch_max(thousandths, Ordering::Relaxed).max(thousandths);
        self.bar.set_position(furthest);
    }
}

impl Drop for TerminalProgress {
    fn drop(&mut self) {
        self.finish();
    }
}

impl Progress for TerminalProgress {
    fn enter(&self, stage: Stage) {
        *self.stage.lock().unwrap_or_else(|poisoned| poisoned.into_inner()) = Some(stage);
        self.show(stage, 0.0);
        let name = stage.name();
        let line = self.part.as_ref().map_or(name.to_owned(), |part| format!("{part}: {name}"));
        if !self.bar.is_hidden() {
            self.bar.set_message(line);
        } else if self.part.is_some() || is_at_least(Verbosity::Verbose) {
            print_line(&line);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_counted_in_their_lines() {
        let steps = Steps::new(2);
        assert_eq!(
            [steps.line("normal 5000"), steps.line("normal 5001")],
            ["1/2 normal 5000", "2/2 normal 5001"]
        );
    }

    #[test]
    fn bars_are_drawn_on_a_terminal_without_quiet() {
        for (is_terminal, verbosity, expected) in [
            (true, Verbosity::Quiet, false),
            (true, Verbosity::Normal, true),
            (false, Verbosity::Verbose, false),
        ] {
            assert_eq!(shows_bars(is_terminal, verbosity as u8), expected, "{is_terminal} {verbosity:?}");
        }
    }
}
