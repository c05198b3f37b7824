//! The files of an evaluation of poses, and the lines of its progress.

use super::{EvaluateArguments, save, save_json};
use crate::cli::provenance::{commit, words};
use anyhow::Result;
use serde_json::{Value, json};
use viola_lab::evaluate::{self, ClipResult, plot};
use viola_reconstruct::LabelParams;

/// Returns the line of a result.
pub(super) fn line(r: &ClipResult) -> String {
    let error = match (r.rotation_error_deg, r.translation_error_m) {
        (Some(deg), Some(m)) => format!("{deg:.2} deg, {m:.3} m"),
        _ if r.foreign => "another home".to_owned(),
        _ => "no pose".to_owned(),
    };
    let scale = r.scale_error.map_or_else(String::new, |error| format!(", scale {:+.2} %", 100.0 * error));
    format!(
        "{} {} {} {}: {error}{scale}, {:?}, {:.2} s",
        r.set, r.frames, r.clip, r.method, r.state, r.register_seconds
    )
}

/// Facts about a run beside its results.
pub(super) struct Measured {
    pub labels_by: Option<String>,
    /// Number of clips at a time; `None` if results are those of an earlier process.
    pub workers: Option<usize>,
    /// Number of clips without a true pose.
    pub left_out: usize,
}

/// Returns the source of the labels of points; `None` for drawn clips, which have none.
pub(super) fn labels_by(arguments: &EvaluateArguments, label: &LabelParams) -> Option<String> {
    let networks = label.networks();
    match arguments.picture_labels {
        _ if !arguments.map.is_empty() => None,
        Some(share) => Some(format!("the truth, at least {:.0} % of it right; {networks}", share * 100.0)),
        None => Some(networks),
    }
}

/// Writes and prints the tables, and writes the plots.
pub(super) fn write_all(
    arguments: &EvaluateArguments,
    measured: &Measured,
    results: &[ClipResult],
) -> Result<()> {
    let Measured { labels_by, workers, left_out } = measured;
    let out = &arguments.out;
    let rows = evaluate::tabulate(results);
    let peak = workers.and_then(|_| evaluate::peak_memory_bytes());
    let mut table = evaluate::markdown(&rows);
    if *left_out > 0 {
        table += &format!("\n{left_out} clips have no true pose and are left out.\n");
    }
    if let (Some(peak), Some(workers)) = (peak, workers) {
        let mib = peak / (1 << 20);
        table += &format!(
            "\nPeak memory of the process, all methods with {workers} clips at a time: {mib} MiB (VmHWM).\n\
             Times are those of one thread; with more than one clip at a time they share memory and caches.\n"
        );
    }
    let mut run = described(arguments);
    run["labels_by"] = json!(labels_by);
    run["clips_at_a_time"] = json!(workers);
    run["peak_memory_bytes"] = json!(peak);
    run["clips_without_true_pose"] = json!(left_out);
    save_json(out, "table.json", &rows)?;
    save(out, "table.md", &table)?;
    save(out, "clips.csv", &evaluate::clips_csv(results))?;
    save_json(out, "run.json", &run)?;
    save(out, "coverage.svg", &plot::error_against_coverage(results))?;
    if let Some(svg) = plot::risk_against_coverage(results) {
        save(out, "risk.svg", &svg)?;
    }
    if let Some(svg) = plot::reliability(results) {
        save(out, "reliability.svg", &svg)?;
    }
    print!("{table}");
    Ok(())
}

/// Returns the arguments that decide the results. The program's own path is left out.
fn described(arguments: &EvaluateArguments) -> Value {
    let typed = words().skip(1);
    let command: Vec<String> = std::iter::once("viola".to_owned()).chain(typed).collect();
    json!({
        "version": env!("CARGO_PKG_VERSION"),
        "commit": commit(),
        "command": command.join(" "),
        "methods": arguments.methods,
        "sets": arguments.set.iter().map(|set| set.name()).collect::<Vec<_>>(),
        "seeds": format!("{:?}", arguments.seeds),
        "frames": arguments.lengths(),
        "clips": arguments.clips,
        "seed": arguments.seed,
        "picture_labels": arguments.picture_labels,
        "foreign": arguments.foreign,
        "withhold_poses": arguments.withhold_poses,
        "drift": arguments.drift,
        "rescale": arguments.rescale,
        "wrong_scale": arguments.wrong_scale,
        "keep_poses": arguments.keep_poses,
    })
}
