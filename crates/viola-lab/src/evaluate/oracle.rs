//! Segmentation oracle: true classes of simulated pictures with errors. Simulated pictures are too plain for
//! a network.

use crate::simulate::{SimulatedClip, clip_in_memory_heard};
use image::RgbImage;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rustc_hash::{FxHashMap, FxHasher};
use std::hash::{Hash, Hasher};
use std::sync::{Arc, Mutex};
use viola_formats::clip::{Clip, Frame};
use viola_geometry::taxonomy::CLASSES;
use viola_reconstruct::label::{ClassMap, SegmentError, Segmenter};

/// Patches per side of a picture; errors are constant in a patch.
const PATCHES: usize = 8;
/// Probability of the named class; the others share the rest.
const SURE: f32 = 0.7;

/// Segmenter for the pictures of one clip. A patch has its true classes with probability `accuracy`,
/// otherwise those of any patch of the same picture, which may be the same: at least `accuracy` of the pixels are right.
/// Frames with the same sum of seed and index have their errors in the same patches.
pub struct Oracle {
    recorded: Arc<SimulatedClip>,
    accuracy: f64,
    seed: u64,
    /// Frame indices by picture hash.
    frames: Mutex<FxHashMap<u64, usize>>,
}

impl Oracle {
    /// Returns a recording as a clip, and the oracle for its pictures.
    pub fn with_clip(recorded: Arc<SimulatedClip>, accuracy: f64, seed: u64) -> (Clip, Arc<Oracle>) {
        let oracle = Oracle { recorded: recorded.clone(), accuracy, seed, frames: Mutex::default() };
        let oracle = Arc::new(oracle);
        let listener = oracle.clone();
        let hear = move |index: usize, frame: &Frame| {
            let mut frames = listener.frames.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
            frames.extend(frame.color.as_ref().map(|picture| (hash(picture), index)));
        };
        (clip_in_memory_heard(recorded, hear), oracle)
    }
}

fn hash(picture: &RgbImage) -> u64 {
    let mut hasher = FxHasher::default();
    picture.as_raw().hash(&mut hasher);
    hasher.finish()
}

impl Segmenter for Oracle {
    fn segment(&self, picture: &RgbImage) -> Result<ClassMap, SegmentError> {
        let frames = self.frames.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        let known = frames.get(&hash(picture)).copied();
        drop(frames);
        let Some(index) = known else {
            return Err(SegmentError::Run("the picture is not of this clip".into()));
        };
        let labels = self.recorded.labels(index);
        let (width, height) = (labels.width as usize, labels.height as usize);
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed.wrapping_add(index as u64));
        // Source patch of each patch's classes: mostly itself.
        let sources: Vec<usize> = (0..PATCHES * PATCHES)
            .map(|patch| {
                if rng.random::<f64>() < self.accuracy {
                    patch
                } else {
                    rng.random_range(0..PATCHES * PATCHES)
                }
            })
            .collect();
        let (wide, high) = (width.div_ceil(PATCHES), height.div_ceil(PATCHES));
        let rest = (1.0 - SURE) / (CLASSES - 1) as f32;
        let mut probabilities = vec![rest; width * height * CLASSES];
        for y in 0..height {
            for x in 0..width {
                let source = sources[y / high * PATCHES + x / wide];
                let from_x = (source % PATCHES * wide + x % wide).min(width - 1);
                let from_y = (source / PATCHES * high + y % high).min(height - 1);
                let class = usize::from(labels.classes[from_y * width + from_x]);
                probabilities[(y * width + x) * CLASSES + class] = SURE;
            }
        }
        Ok(ClassMap { width, height, align_corners: false, probabilities })
    }

    fn name(&self) -> String {
        format!("the truth, at least {:.0} % of it right", self.accuracy * 100.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{ClipParams, Home, HomeParams, Set};

    /// Half of the patches are drawn again, and those may get their own classes again.
    #[test]
    fn at_least_the_named_share_of_the_classes_is_right() {
        let home = Home::generate(&HomeParams::new(Set::Normal, 6));
        let recording = ClipParams { frames: 1, color_width: 160, ..ClipParams::default() };
        let recorded = Arc::new(home.clip(&home.survey(), 0, &recording));
        let (clip, oracle) = Oracle::with_clip(recorded.clone(), 0.5, 0);
        let picture = clip.load(0).unwrap().color.unwrap();
        let map = oracle.segment(&picture).unwrap();
        let labels = recorded.labels(0);
        let of_pixel = map.probabilities.chunks_exact(CLASSES).zip(&labels.classes);
        let right = of_pixel.filter(|(p, class)| p[usize::from(**class)] == SURE).count();
        assert!(right * 2 > map.width * map.height, "{right} of {} x {}", map.width, map.height);
        assert_eq!(oracle.name(), "the truth, at least 50 % of it right");
    }
}
