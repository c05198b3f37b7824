//! The simulated homes of an evaluation, one after the other.

use super::{EvaluateArguments, homes};
use crate::cli::output;
use crate::cli::progress::print_line;
use crate::cli::provenance::program;
use crate::cli::sum;
use anyhow::Result;
use sha2::{Digest, Sha256};
use std::path::Path;
use viola_align::AlignParams;
use viola_lab::evaluate::HomesParams;
use viola_lab::simulate::Set;
use viola_network::manifest::Task;

/// Evaluates each simulated home of all sets; aligned clips are kept in the folder `clips` of the output, in one folder
/// for each program with its networks and parameters.
pub(super) fn each_home<T>(
    arguments: &EvaluateArguments,
    evaluate: impl Fn(Set, u64, &HomesParams, &AlignParams, &Path) -> Result<T>,
) -> Result<Vec<T>> {
    let label = arguments.networks.surface_labels()?;
    let params = AlignParams { seed: arguments.seed, label, ..AlignParams::default() };
    let homes = homes(arguments);
    // The clips of a home do not depend on the other homes, nor on their number.
    let of_clip = HomesParams { sets: Vec::new(), seeds: 0..0, clips_per_home: 0, ..homes.clone() };
    let weights = arguments.networks.content(&[Task::Surface])?;
    let name = Sha256::digest(format!("{} {of_clip:?} {params:?} {weights}", program()?));
    let folder = arguments.out.join("clips").join(sum::hexadecimal(&name[..8]));
    output::folder(&folder)?;
    let mut done = Vec::new();
    for &set in &homes.sets {
        for seed in homes.seeds.clone() {
            done.push(evaluate(set, seed, &homes, &params, &folder)?);
            print_line(&format!("{} {seed}", set.name()));
        }
    }
    Ok(done)
}
