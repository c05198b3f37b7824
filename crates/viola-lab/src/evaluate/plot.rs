//! Plots of a run, as SVG: error against coverage, and the reliability of the probabilities.

mod chart;

use super::{Calibration, ClipResult};
use chart::{Axis, Chart};

/// Colours distinguishable with any colour vision (Okabe and Ito, 2008).
const INKS: [&str; 7] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000"];

/// Returns the names of the methods, in the order of their first results.
fn methods(results: &[ClipResult]) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for result in results {
        if !names.contains(&result.method.as_str()) {
            names.push(&result.method);
        }
    }
    names
}

/// Plots every clip's errors against the fraction of the map that it covers (paper, "The effect of the
/// reconstruction's coverage"): rotation above, translation below, with the bounds of success. A clip without
/// a pose is at the upper edge.
pub fn error_against_coverage(results: &[ClipResult]) -> String {
    let most = results.iter().map(|r| 100.0 * r.coverage).fold(1.0, f64::max);
    let coverage = Axis::linear("coverage of the map, %", 0.0, (most / 10.0).ceil() * 10.0, 10.0);
    let rotation = Axis::logarithmic("rotation error, deg", 0.01, 1000.0);
    let translation = Axis::logarithmic("translation error, m", 0.001, 100.0);
    let mut upper = Chart::new(coverage.clone(), rotation);
    let mut lower = Chart::new(coverage, translation);
    upper.line(&[(0.0, 10.0), (most, 10.0)], "#d00000");
    lower.line(&[(0.0, 0.3), (most, 0.3)], "#0000d0");
    let names = methods(results);
    for (name, ink) in names.iter().zip(INKS.iter().cycle()) {
        for r in results.iter().filter(|r| r.method == *name) {
            let x = 100.0 * r.coverage;
            upper.dot(x, r.rotation_error_deg.unwrap_or(f64::INFINITY), ink);
            lower.dot(x, r.translation_error_m.unwrap_or(f64::INFINITY), ink);
        }
        upper.legend(name, ink);
    }
    chart::stack("Error against coverage: red 10 deg, blue 0.3 m", [upper, lower])
}

/// Plots the success rate against the stated probability for each method with probabilities; none without
/// any.
pub fn reliability(results: &[ClipResult]) -> Option<String> {
    let mut chart = Chart::new(
        Axis::linear("probability, as said", 0.0, 1.0, 0.1),
        Axis::linear("share of successes", 0.0, 1.0, 0.1),
    )
    .with_low_legend();
    chart.line(&[(0.0, 0.0), (1.0, 1.0)], "#808080");
    let mut titles = Vec::new();
    for (name, ink) in methods(results).iter().zip(INKS.iter().cycle()) {
        let Some(calibration) = Calibration::of(results.iter().filter(|r| r.method == *name)) else {
            continue;
        };
        let used: Vec<_> = calibration.bins.iter().filter(|bin| bin.count > 0).collect();
        let curve: Vec<(f64, f64)> = used.iter().map(|b| (b.mean_probability, b.success_rate)).collect();
        chart.line(&curve, ink);
        for bin in used {
            chart.dot(bin.mean_probability, bin.success_rate, ink);
            chart.label(bin.mean_probability, bin.success_rate, &bin.count.to_string());
        }
        chart.legend(name, ink);
        titles.push(format!("{name} {:.3}", calibration.expected_calibration_error));
    }
    (!titles.is_empty())
        .then(|| chart::stack(&format!("Expected calibration error: {}", titles.join(", ")), [chart]))
}
