//! Counts of true and answered coarse classes.

use super::LabelRow;
use super::coarse::{self, COARSE};
use std::collections::BTreeMap;

/// Confusion matrix: truth by answer.
pub(super) struct Confusion {
    counts: [[f64; COARSE.len()]; COARSE.len()],
}

impl Confusion {
    pub(super) fn new() -> Confusion {
        Confusion { counts: [[0.0; COARSE.len()]; COARSE.len()] }
    }

    pub(super) fn add(&mut self, truth: usize, said: usize, weight: f64) {
        self.counts[truth][said] += weight;
    }

    fn total(&self) -> f64 {
        self.counts.iter().flatten().sum::<f64>().max(1e-9)
    }

    pub(super) fn accuracy(&self, group: impl Fn(usize) -> usize) -> f64 {
        let mut right = 0.0;
        for (truth, row) in self.counts.iter().enumerate() {
            for (said, count) in row.iter().enumerate() {
                right += if group(truth) == group(said) { *count } else { 0.0 };
            }
        }
        right / self.total()
    }

    fn iou(&self, is_in: impl Fn(usize) -> bool) -> Option<f64> {
        let (mut both, mut either, mut true_ones) = (0.0, 0.0, 0.0);
        for (truth, row) in self.counts.iter().enumerate() {
            for (said, count) in row.iter().enumerate() {
                let (t, s) = (is_in(truth), is_in(said));
                both += if t && s { *count } else { 0.0 };
                either += if t || s { *count } else { 0.0 };
                true_ones += if t { *count } else { 0.0 };
            }
        }
        (true_ones > 0.0).then(|| both / either)
    }

    pub(super) fn row(&self, variant: &str, pixel_accuracy: Option<f64>, vertices: usize) -> LabelRow {
        let iou: BTreeMap<String, f64> = COARSE
            .iter()
            .enumerate()
            .filter_map(|(i, name)| Some(((*name).to_owned(), self.iou(|class| class == i)?)))
            .collect();
        LabelRow {
            variant: variant.to_owned(),
            pixel_accuracy,
            voxel_accuracy: self.accuracy(|class| class),
            structure_accuracy: self.accuracy(coarse::structure),
            mean_iou: iou.values().sum::<f64>() / iou.len().max(1) as f64,
            wall_or_opening_iou: self.iou(|class| coarse::structure(class) == 1).unwrap_or(0.0),
            iou,
            calibration_error: None,
            vertices,
            without_point: None,
            key_frames: 0,
            network_ms: None,
            rest_ms_per_key_frame: None,
        }
    }
}
