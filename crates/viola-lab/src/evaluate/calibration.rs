//! Calibration of probabilities (Naeini et al., 2015).

use super::ClipResult;
use serde::Serialize;

/// Results with a probability, in ten bins.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Calibration {
    pub bins: [Bin; 10],
    /// Mean over the results of the difference between a bin's mean probability and its success rate.
    pub expected_calibration_error: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Bin {
    pub count: usize,
    pub mean_probability: f64,
    pub success_rate: f64,
}

impl Calibration {
    /// Returns the calibration; none if no result has a probability.
    pub fn of<'a>(results: impl IntoIterator<Item = &'a ClipResult>) -> Option<Calibration> {
        let answer = |result: &ClipResult| Some((result.probability?, result.is_success()));
        Calibration::of_answers(results.into_iter().filter_map(answer))
    }

    /// Returns the calibration of probabilities and whether their answers were right; none without answers.
    pub fn of_answers(answers: impl IntoIterator<Item = (f64, bool)>) -> Option<Calibration> {
        let mut bins = [Bin::default(); 10];
        for (probability, is_right) in answers {
            let bin = &mut bins[((probability * 10.0).max(0.0) as usize).min(9)];
            bin.count += 1;
            bin.mean_probability += probability;
            bin.success_rate += f64::from(u8::from(is_right));
        }
        let total: usize = bins.iter().map(|bin| bin.count).sum();
        let mut error = 0.0;
        for bin in bins.iter_mut().filter(|bin| bin.count > 0) {
            bin.mean_probability /= bin.count as f64;
            bin.success_rate /= bin.count as f64;
            error += bin.count as f64 * (bin.mean_probability - bin.success_rate).abs();
        }
        (total > 0).then(|| Calibration { bins, expected_calibration_error: error / total as f64 })
    }
}
