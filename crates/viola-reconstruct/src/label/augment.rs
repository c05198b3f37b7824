//! Test-time augmentation: a network's mean over changes of a picture's light is more stable (paper III-A).

use super::{ClassMap, SegmentError, Segmenter};
use image::RgbImage;

/// Changes of brightness, contrast and colour; each maps a channel's value 0..255 given the pixel's grey.
const CHANGES: [fn(f32, f32) -> f32; 3] = [
    |value, _| value * 1.25,
    |value, _| (value - 128.0) * 0.75 + 128.0,
    |value, grey| grey + (value - grey) * 0.6,
];

/// Number of changes.
pub const AUGMENTATIONS: usize = CHANGES.len();

/// Returns the mean of the network's class maps of the picture and of its first `changes` changes.
pub(super) fn segment(
    segmenter: &dyn Segmenter,
    picture: &RgbImage,
    changes: usize,
) -> Result<ClassMap, SegmentError> {
    let mut map = segmenter.segment(picture)?;
    let used = &CHANGES[..changes.min(CHANGES.len())];
    for change in used {
        let other = segmenter.segment(&changed(picture, *change))?;
        if other.probabilities.len() != map.probabilities.len() {
            return Err(SegmentError::Shape {
                got: format!("{} x {}", other.width, other.height),
                want: format!("{} x {} as for the picture before", map.width, map.height),
            });
        }
        for (sum, p) in map.probabilities.iter_mut().zip(&other.probabilities) {
            *sum += p;
        }
    }
    let fraction = 1.0 / (used.len() + 1) as f32;
    map.probabilities.iter_mut().for_each(|p| *p *= fraction);
    Ok(map)
}

fn changed(picture: &RgbImage, change: fn(f32, f32) -> f32) -> RgbImage {
    let mut out = picture.clone();
    for pixel in out.pixels_mut() {
        let [r, g, b] = pixel.0.map(f32::from);
        let grey = 0.299 * r + 0.587 * g + 0.114 * b;
        pixel.0 = [r, g, b].map(|value| change(value, grey).round().clamp(0.0, 255.0) as u8);
    }
    out
}
