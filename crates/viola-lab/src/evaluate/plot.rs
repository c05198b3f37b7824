//! Plots of a run, as SVG: error against coverage, risk against coverage, and the reliability of the
//! probabilities.

mod chart;

use super::{Calibration, ClipResult, SUCCESS_DEG, SUCCESS_M};
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
/// a pose is at the upper edge; clips without a true pose are left out.
pub fn error_against_coverage(results: &[ClipResult]) -> String {
    let most = results.iter().filter_map(|r| r.coverage).fold(0.01, f64::max) * 100.0;
    let coverage = Axis::linear("coverage of the map, %", 0.0, (most / 10.0).ceil() * 10.0, 10.0);
    let rotation = Axis::logarithmic("rotation error, deg", 0.01, 1000.0);
    let translation = Axis::logarithmic("translation error, m", 0.001, 100.0);
    let mut upper = Chart::new(coverage.clone(), rotation);
    let mut lower = Chart::new(coverage, translation);
    upper.line(&[(0.0, SUCCESS_DEG), (most, SUCCESS_DEG)], "#d00000");
    lower.line(&[(0.0, SUCCESS_M), (most, SUCCESS_M)], "#0000d0");
    let names = methods(results);
    for (name, ink) in names.iter().zip(INKS.iter().cycle()) {
        let covered = results.iter().filter(|r| r.method == *name).filter_map(|r| Some((r, r.coverage?)));
        for (r, coverage) in covered {
            let x = 100.0 * coverage;
            upper.dot(x, r.rotation_error_deg.unwrap_or(f64::INFINITY), ink);
            lower.dot(x, r.translation_error_m.unwrap_or(f64::INFINITY), ink);
        }
        upper.legend(name, ink);
    }
    chart::stack("Error against coverage: red 10 deg, blue 0.3 m", [upper, lower])
}

/// Plots the fraction of wrong answers among the surest clips against their fraction of all clips, for each method
/// with probabilities; none without any (El-Yaniv and Wiener, 2010).
pub fn risk_against_coverage(results: &[ClipResult]) -> Option<String> {
    let mut chart = Chart::new(
        Axis::linear("surest clips, share of all", 0.0, 1.0, 0.1),
        Axis::linear("wrong among them", 0.0, 0.5, 0.05),
    );
    let mut any = false;
    for (name, ink) in methods(results).iter().zip(INKS.iter().cycle()) {
        let of: Vec<&ClipResult> = results.iter().filter(|r| r.method == *name).collect();
        let curve = risk_curve(&of);
        if !curve.is_empty() {
            chart.line(&curve, ink);
            chart.legend(name, ink);
            any = true;
        }
    }
    any.then(|| chart::stack("Risk against coverage, clips ordered by probability", [chart]))
}

/// Returns for each number of the surest clips their fraction of all, and the fraction of wrong ones among them.
/// Clips of equal probability are taken at once.
fn risk_curve(results: &[&ClipResult]) -> Vec<(f64, f64)> {
    let mut told: Vec<(f64, bool)> =
        results.iter().filter_map(|r| Some((r.probability?, r.is_success()))).collect();
    told.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (mut curve, mut wrong) = (Vec::new(), 0usize);
    for (i, (probability, right)) in told.iter().enumerate() {
        wrong += usize::from(!right);
        if told.get(i + 1).is_none_or(|next| next.0 < *probability) {
            curve.push(((i + 1) as f64 / results.len() as f64, wrong as f64 / (i + 1) as f64));
        }
    }
    curve
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

#[cfg(test)]
mod tests {
    use super::*;
    use viola_align::AlignmentState::Ambiguous;

    #[test]
    fn risk_grows_with_the_clips_that_are_less_sure() {
        let clip = |probability: Option<f64>, right: bool| ClipResult {
            probability,
            ..ClipResult::example(Ambiguous, Some((1.0, if right { 0.1 } else { 2.0 })))
        };
        let clips = [clip(Some(0.5), false), clip(Some(0.9), true), clip(None, false), clip(Some(0.5), true)];
        let of: Vec<&ClipResult> = clips.iter().collect();
        assert_eq!(risk_curve(&of), [(0.25, 0.0), (0.75, 1.0 / 3.0)]);
    }
}
