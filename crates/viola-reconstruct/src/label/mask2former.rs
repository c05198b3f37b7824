//! Mask2Former and related networks (Cheng et al., "Masked-attention Mask Transformer for Universal Image
//! Segmentation", 2022): each query has a class and a mask of the pixels that it covers.

use super::logits::{Scratch, runs};
use super::numbers::{all_finite, exp, sigmoid};
use super::picture::{Fit, Raster};
use super::{ClassMap, SegmentError};
use viola_geometry::taxonomy::{CLASSES, Class, ClassTable};
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
    /// the query's probability for the class times the pixel's probability in the query's mask. If the sum over the
    /// classes is below one, the rest is the value of [`Class::Other`].
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
        let (mut mask, mut rest) = (Vec::new(), Vec::new());
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
            add_uncovered(&mut scratch.sums, length, &mut rest);
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

/// Adds the part of each pixel that no query covers to [`Class::Other`]; otherwise a pixel without queries would be as
/// sure as any. `rest` is scratch.
fn add_uncovered(sums: &mut [f32], length: usize, rest: &mut Vec<f32>) {
    rest.clear();
    rest.resize(length, 1.0);
    for sums in sums.chunks_exact(length) {
        rest.iter_mut().zip(sums).for_each(|(rest, sum)| *rest -= sum);
    }
    let other = &mut sums[Class::Other.id() as usize * length..][..length];
    other.iter_mut().zip(rest).for_each(|(sum, rest)| *sum += rest.max(0.0));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks the probability of the floor and of `Other` in a pixel of queries for the floor with the same logit of
    /// their masks.
    fn check(queries: usize, mask: f32, floor: f32, other: f32) {
        let known = ClassTable::Home.classes().len();
        let row = |_| (0..=known).map(|class| if class == Class::Floor as usize { 30.0 } else { 0.0 });
        let classes = Tensor::f32([1, queries, known + 1], (0..queries).flat_map(row).collect());
        let masks = Tensor::f32([1, queries, 1, 1], vec![mask; queries]);
        let whole = Raster { width: 4, height: 4 };
        let reader = Mask2Former { table: ClassTable::Home };
        let map = reader.read(&classes, &masks, Fit { input: whole, content: whole }).unwrap();
        let [got_floor, got_other] =
            [Class::Floor, Class::Other].map(|class| map.probabilities[class as usize]);
        assert!(
            (got_floor - floor).abs() < 1e-3 && (got_other - other).abs() < 1e-3,
            "{queries} {mask}: {map:?}"
        );
    }

    #[test]
    fn pixels_that_no_query_covers_are_other() {
        check(2, -8.0, 0.0, 1.0);
        check(1, 0.0, 0.5, 0.5);
        check(2, 0.0, 1.0, 0.0);
        check(3, 8.0, 1.0, 0.0);
    }
}
