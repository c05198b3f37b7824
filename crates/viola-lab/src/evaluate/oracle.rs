//! Classes of simulated pictures from the truth, with errors: what a network would say of pictures that are less plain
//! than simulated ones.

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

/// Errors come in patches: so many side by side in a picture.
const PATCHES: usize = 8;
/// The probability that is given to the class that is named; the others share the rest.
const SURE: f32 = 0.7;

/// Knows the pictures of one clip. Each patch of a picture is named as it is with the probability `accuracy`, and
/// otherwise as another patch of the same picture.
pub struct Oracle {
    recorded: Arc<SimulatedClip>,
    accuracy: f64,
    seed: u64,
    /// Frames by their pictures' hashes.
    frames: Mutex<FxHashMap<u64, usize>>,
}

impl Oracle {
    /// A recording as a clip, and the oracle that knows its pictures.
    pub fn with_clip(recorded: Arc<SimulatedClip>, accuracy: f64, seed: u64) -> (Clip, Arc<Oracle>) {
        let oracle = Oracle { recorded: recorded.clone(), accuracy, seed, frames: Mutex::default() };
        let oracle = Arc::new(oracle);
        let listener = oracle.clone();
        let hear = move |index: usize, frame: &Frame| {
            let mut frames = listener.frames.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
            frames.insert(hash(&frame.color), index);
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
        let mut dice = ChaCha8Rng::seed_from_u64(self.seed.wrapping_add(index as u64));
        // From where in the picture each patch has its names: in most cases from itself.
        let sources: Vec<usize> = (0..PATCHES * PATCHES)
            .map(|patch| {
                if dice.random::<f64>() < self.accuracy {
                    patch
                } else {
                    dice.random_range(0..PATCHES * PATCHES)
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
        format!("the truth, {} % of it right", self.accuracy * 100.0)
    }
}
