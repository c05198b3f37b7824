//! `viola evaluate`: clips with a known truth, methods that find it, results that survive an interruption,
//! and tables that add up.

mod command;
mod flat;
mod methods;
mod resume;
mod survey;
mod table;

use viola_align::AlignParams;
use viola_geometry::progress::Silent;
use viola_lab::evaluate::{ClipResult, Method, Run, Suite};

/// Runs methods on all clips of a suite.
pub fn run(suite: &dyn Suite, methods: &[Method], workers: usize) -> Vec<ClipResult> {
    let observe = AlignParams::default();
    let run = Run { suite, methods, observe: &observe, workers, journal: None, program: "", pictures: None };
    run.results(&Silent, &|_| {}).unwrap()
}
