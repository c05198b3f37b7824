//! Mask2Former and related networks (Cheng et al., "Masked-attention Mask Transformer for Universal Image
//! Segmentation", 2022): each query has a class and a mask of the pixels that it covers.

use super::logits::{Scratch, runs};
use super::numbers::{all_finite, exp, sigmoid};
use super::picture::{Fit, Raster};
use super::{ClassMap, SegmentError};
use viola_geometry::taxonomy::{CLASSES, ClassTable};
use viola_network::Tensor;

/// Maximum number of queries of an output; published networks have 100 or 200.
const MAX_QUERIES: usize = 2000;

/// Converts queries to our classes.
#[derive(Debug, Clone)]
pub(super) struct Mask2Former {
    pub(super) table: ClassTable,
}

impl Mask2Former {
    /// Returns the class map of class queries 1 x queries x (classes + 1), whose last class is "nothing", and
    /// mask queries 1 x queries x height x width. A pixel's value for a class is the sum over the queries of
    /// the query's probability for the class times the pixel's probability in the query's mask.
    pub(super) fn read(&self, classes: &Tensor, masks: &Tensor, fit: Fit) -> Result<ClassMap, SegmentError> {
        let known = self.table.classes().len();
        let misfit = || SegmentError::Shape {
            got: format!(
                "{:?} {:?} and {:?} {:?}",
                classes.data.element(),
                classes.shape,
                masks.data.element(),
                masks.shape
            ),
            want: format!("F32 [1, queries, {}] and F32 [1, queries, height, width]", known + 1),
        };
        let (&[1, queries, columns], Some(class_values)) = (classes.shape.as_slice(), classes.as_f32())
        else {
            return Err(misfit());
        };
        let (&[1, rows, height, width], Some(mask_values)) = (masks.shape.as_slice(), masks.as_f32()) else {
            return Err(misfit());
        };
        let fits = columns == known + 1
            && rows == queries
            && (1..=MAX_QUERIES).contains(&queries)
            && width > 0
            && height > 0
            && class_values.len() == queries * columns
            && mask_values.len() == queries * height * width;
        if !fits {
            return Err(misfit());
        }
        if !all_finite(class_values) || !all_finite(mask_values) {
            return Err(SegmentError::NotFinite);
        }
        let weights: Vec<[f32; CLASSES]> =
            class_values.chunks_exact(columns).map(|row| self.weights(row)).collect();
        let crop = fit.crop(Raster { width, height }, false);
        let mut map = ClassMap {
            width: crop.width,
            height: crop.height,
            align_corners: false,
            probabilities: vec![0.0; crop.width * crop.height * CLASSES],
        };
        let mut scratch = Scratch::default();
        let mut mask = Vec::new();
        for (from, to, length) in runs(width, crop) {
            scratch.clear(length);
            for (query, weights) in weights.iter().enumerate() {
                let logits = &mask_values[query * width * height + from..][..length];
                mask.clear();
                mask.extend(logits.iter().map(|x| sigmoid(*x)));
                // Classes outside the table have no weight.
                let known = scratch.sums.chunks_exact_mut(length).zip(weights).filter(|(_, w)| **w > 0.0);
                for (sums, weight) in known {
                    for (sum, covered) in sums.iter_mut().zip(&mask) {
                        *sum += weight * covered;
                    }
                }
            }
            scratch.write(length, &mut map.probabilities[to * CLASSES..][..length * CLASSES]);
        }
        Ok(map)
    }

    /// Returns a query's probability for each of our classes; without "nothing", the sum is below one.
    fn weights(&self, logits: &[f32]) -> [f32; CLASSES] {
        let largest = logits.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        let total: f32 = logits.iter().map(|x| exp(x - largest)).sum();
        let mut weights = [0.0; CLASSES];
        for (logit, class) in logits.iter().zip(self.table.classes()) {
            weights[class.id() as usize] += exp(logit - largest) / total;
        }
        weights
    }
}
