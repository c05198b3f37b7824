//! The simulated homes of an evaluation, one after the other.

use super::evaluate::{EvaluateArguments, homes};
use super::progress::tell;
use anyhow::{Context, Result};
use std::fs;
use std::path::Path;
use viola_align::AlignParams;
use viola_lab::evaluate::HomesParams;
use viola_lab::simulate::Set;

/// Evaluates each simulated home of all sets; aligned clips are kept in the folder `clips` of the output.
pub(super) fn each_home<T>(
    arguments: &EvaluateArguments,
    evaluate: impl Fn(Set, u64, &HomesParams, &AlignParams, &Path) -> Result<T>,
) -> Result<Vec<T>> {
    let folder = arguments.out.join("clips");
    fs::create_dir_all(&folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
    let label = arguments.networks.surface_labels()?;
    let params = AlignParams { seed: arguments.seed, label, ..AlignParams::default() };
    let homes = homes(arguments);
    let mut done = Vec::new();
    for &set in &homes.sets {
        for seed in homes.seeds.clone() {
            done.push(evaluate(set, seed, &homes, &params, &folder)?);
            tell(&format!("{} {seed}", set.name()));
        }
    }
    Ok(done)
}
