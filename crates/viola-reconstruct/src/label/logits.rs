//! Networks with one value for each class and pixel: DeepLab, SegFormer and similar ones.

use super::numbers::{all_finite, exp};
use super::picture::{Fit, Raster};
use super::{ClassMap, SegmentError};
use viola_geometry::taxonomy::{CLASSES, Class, ClassTable};
use viola_network::Tensor;

/// Pixels processed at once, so that their rows stay in the processor's nearest cache.
const RUN: usize = 512;

/// Converts the channels of an output to our classes.
#[derive(Debug, Clone)]
pub(super) struct Logits {
    pub(super) align_corners: bool,
    pub(super) softmax: bool,
    /// Our class of each channel.
    fold: Vec<Class>,
}

impl Logits {
    pub(super) fn new(table: ClassTable, first_class: usize, align_corners: bool, softmax: bool) -> Logits {
        let before = std::iter::repeat_n(Class::Other, first_class);
        let fold = before.chain(table.classes().iter().copied()).collect();
        Logits { align_corners, softmax, fold }
    }

    pub(super) fn channels(&self) -> usize {
        self.fold.len()
    }

    /// Returns the class map of an output 1 x channels x height x width.
    pub(super) fn read(&self, output: &Tensor, fit: Fit) -> Result<ClassMap, SegmentError> {
        let channels = self.channels();
        let misfit = || SegmentError::Shape {
            got: format!("{:?} {:?}", output.data.element(), output.shape),
            want: format!("F32 [1, {channels}, height, width]"),
        };
        let (&[1, got, height, width], Some(values)) = (output.shape.as_slice(), output.as_f32()) else {
            return Err(misfit());
        };
        if got != channels || width == 0 || height == 0 || values.len() != channels * width * height {
            return Err(misfit());
        }
        if !all_finite(values) {
            return Err(SegmentError::NotFinite);
        }
        let crop = fit.crop(Raster { width, height }, self.align_corners);
        let mut map = ClassMap {
            width: crop.width,
            height: crop.height,
            align_corners: self.align_corners,
            probabilities: vec![0.0; crop.width * crop.height * CLASSES],
        };
        let mut scratch = Scratch::default();
        for (from, to, length) in runs(width, crop) {
            let row = |channel: usize| &values[channel * width * height + from..][..length];
            scratch.fold(length, &self.fold, self.softmax, row);
            scratch.write(length, &mut map.probabilities[to * CLASSES..][..length * CLASSES]);
        }
        Ok(map)
    }
}

/// Returns the runs of a raster's crop: start in the raster, start in the crop, and length.
pub(super) fn runs(width: usize, crop: Raster) -> Vec<(usize, usize, usize)> {
    // Uncropped rows are contiguous.
    let (rows, length) =
        if crop.width == width { (1, width * crop.height) } else { (crop.height, crop.width) };
    (0..rows)
        .flat_map(|row| {
            (0..length)
                .step_by(RUN)
                .map(move |at| (row * width + at, row * length + at, RUN.min(length - at)))
        })
        .collect()
}

/// Sums for each of our classes over a run of pixels, class by class.
#[derive(Default)]
pub(super) struct Scratch {
    largest: Vec<f32>,
    pub(super) sums: Vec<f32>,
}

impl Scratch {
    /// Sums the channels' softmax, or values without `softmax`, by class; not yet divided by the total.
    fn fold<'a>(&mut self, length: usize, fold: &[Class], softmax: bool, row: impl Fn(usize) -> &'a [f32]) {
        self.clear(length);
        if softmax {
            self.largest.clear();
            self.largest.resize(length, f32::NEG_INFINITY);
            for channel in 0..fold.len() {
                for (largest, value) in self.largest.iter_mut().zip(row(channel)) {
                    *largest = if *value > *largest { *value } else { *largest };
                }
            }
        }
        for (channel, class) in fold.iter().enumerate() {
            let sums = &mut self.sums[class.id() as usize * length..][..length];
            if softmax {
                for ((sum, value), largest) in sums.iter_mut().zip(row(channel)).zip(&self.largest) {
                    *sum += exp(value - largest);
                }
            } else {
                for (sum, value) in sums.iter_mut().zip(row(channel)) {
                    *sum += value.max(0.0);
                }
            }
        }
    }

    pub(super) fn clear(&mut self, length: usize) {
        self.sums.clear();
        self.sums.resize(CLASSES * length, 0.0);
    }

    /// Writes the sums pixel by pixel, normalised to one for each pixel.
    pub(super) fn write(&self, length: usize, into: &mut [f32]) {
        for (pixel, into) in into.chunks_exact_mut(CLASSES).enumerate() {
            let mut total = 0.0;
            for (class, p) in into.iter_mut().enumerate() {
                *p = self.sums[class * length + pixel];
                total += *p;
            }
            // A pixel without evidence for any class becomes `Other`.
            if total > f32::MIN_POSITIVE {
                into.iter_mut().for_each(|p| *p /= total);
            } else {
                into.fill(0.0);
                into[Class::Other.id() as usize] = 1.0;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHOLE: Raster = Raster { width: 40, height: 30 };

    fn values(channels: usize) -> Vec<f32> {
        (0..channels * 10 * 8).map(|i| ((i * 7919) % 1009) as f32 * 0.05 - 30.0).collect()
    }

    /// Compares the map with the definition in double precision, pixel by pixel.
    fn check(softmax: bool, fit: Fit, crop: (usize, usize)) {
        let logits = Logits::new(ClassTable::Ade20k, 1, false, softmax);
        let values = values(151);
        let map = logits.read(&Tensor::f32([1, 151, 8, 10], values.clone()), fit).unwrap();
        assert_eq!((map.width, map.height), crop);
        for (pixel, got) in map.probabilities.chunks_exact(CLASSES).enumerate() {
            let (x, y) = (pixel % crop.0, pixel / crop.0);
            let mut wanted = [0.0f64; CLASSES];
            for channel in 0..151 {
                let value = f64::from(values[(channel * 8 + y) * 10 + x]);
                let class = if channel == 0 { Class::Other } else { ClassTable::Ade20k.fold(channel - 1) };
                wanted[class.id() as usize] += if softmax { value.exp() } else { value.max(0.0) };
            }
            let total: f64 = wanted.iter().sum();
            for (got, wanted) in got.iter().zip(wanted) {
                assert!((f64::from(*got) - wanted / total).abs() < 1e-6, "{x} {y}");
            }
        }
    }

    #[test]
    fn pixels_are_folded_by_the_definition() {
        let part = Fit { input: WHOLE, content: Raster { width: 28, height: 30 } };
        check(true, Fit { input: WHOLE, content: WHOLE }, (10, 8));
        check(false, Fit { input: WHOLE, content: WHOLE }, (10, 8));
        check(true, part, (7, 8));
        check(false, part, (7, 8));
    }

    #[test]
    fn what_says_nothing_is_other() {
        let logits = Logits::new(ClassTable::Home, 0, false, false);
        let fit = Fit { input: WHOLE, content: WHOLE };
        let map = logits.read(&Tensor::f32([1, CLASSES, 1, 1], vec![0.0; CLASSES]), fit).unwrap();
        assert_eq!(map.probabilities[Class::Other.id() as usize], 1.0);
    }

    #[test]
    fn other_outputs_are_refused() {
        let logits = Logits::new(ClassTable::Ade20k, 0, false, true);
        let fit = Fit { input: WHOLE, content: WHOLE };
        for shape in [vec![1, 151, 8, 10], vec![1, 150, 80], vec![2, 150, 8, 5], vec![1, 150, 0, 10], vec![]]
        {
            let numbers = shape.iter().product();
            let read = logits.read(&Tensor::f32(shape.clone(), vec![0.0; numbers]), fit);
            assert!(matches!(read, Err(SegmentError::Shape { .. })), "{shape:?}: {read:?}");
        }
        let bytes = logits.read(&Tensor::u8([1, 150, 8, 10], vec![0; 12000]), fit);
        assert!(matches!(bytes, Err(SegmentError::Shape { .. })));
        let mut infinite = vec![0.0; 12000];
        infinite[7000] = f32::INFINITY;
        let read = logits.read(&Tensor::f32([1, 150, 8, 10], infinite), fit);
        assert_eq!(read, Err(SegmentError::NotFinite));
    }
}
