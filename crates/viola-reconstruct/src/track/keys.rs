//! Compact key frames, small enough for thousands.

use super::corners::{Corner, Describer};
use super::picture::{Layer, Pyramid};
use super::reference::Reference;
use viola_geometry::{Pinhole, Pose3};

/// Steps of the kept depth, a metre.
const DEPTH_STEPS_A_M: f32 = 5_000.0;

/// A key frame: its picture at the finest layer, three bytes a pixel, and its corners.
#[derive(Debug, Clone)]
pub(super) struct KeyFrame {
    /// Index among the tracked frames.
    pub frame: usize,
    pub segment: usize,
    /// In the segment's own world.
    pub world_from_key: Pose3,
    pub corners: Vec<Corner>,
    words: Vec<u32>,
    camera: Pinhole,
    grey: Vec<u8>,
    depth: Vec<u16>,
    pub median_depth_m: f64,
}

impl KeyFrame {
    pub fn new(
        frame: usize,
        segment: usize,
        world_from_key: Pose3,
        pyramid: &Pyramid,
        describer: &Describer,
    ) -> KeyFrame {
        let layer = pyramid.finest();
        let corners = describer.corners(layer);
        // 255 marks a pixel that the colour camera does not see.
        let grey = |grey: &f32| if grey.is_finite() { (grey * 254.0).round() as u8 } else { 255 };
        let mut depths: Vec<f32> =
            layer.depth_m.iter().copied().filter(|depth| *depth > 0.0).step_by(16).collect();
        depths.sort_by(f32::total_cmp);
        KeyFrame {
            frame,
            segment,
            world_from_key,
            words: words(&corners),
            corners,
            camera: layer.camera,
            grey: layer.grey.iter().map(grey).collect(),
            depth: layer.depth_m.iter().map(|depth| (depth * DEPTH_STEPS_A_M).round() as u16).collect(),
            median_depth_m: f64::from(depths.get(depths.len() / 2).copied().unwrap_or(1.0)),
        }
    }

    pub fn pyramid(&self) -> Pyramid {
        let grey = |grey: &u8| if *grey == 255 { f32::NAN } else { f32::from(*grey) / 254.0 };
        Pyramid::from_layer(Layer {
            camera: self.camera,
            grey: self.grey.iter().map(grey).collect(),
            depth_m: self.depth.iter().map(|depth| f32::from(*depth) / DEPTH_STEPS_A_M).collect(),
        })
    }

    pub fn reference(&self) -> Reference {
        Reference::new(&self.pyramid())
    }

    /// Returns the number of descriptor words that two key frames have in common.
    pub fn similarity(&self, other: &KeyFrame) -> usize {
        let (mut i, mut j, mut common) = (0, 0, 0);
        // Without branches on the order of the words, which no processor predicts.
        while let (Some(a), Some(b)) = (self.words.get(i), other.words.get(j)) {
            i += usize::from(a <= b);
            j += usize::from(b <= a);
            common += usize::from(a == b);
        }
        common
    }

    /// Returns its size in bytes.
    pub fn bytes(&self) -> usize {
        self.grey.len()
            + 2 * self.depth.len()
            + self.corners.len() * size_of::<Corner>()
            + 4 * self.words.len()
    }
}

/// Returns the parts of the descriptors, in order: pictures of one place have many of them in common.
fn words(corners: &[Corner]) -> Vec<u32> {
    let part = |corner: &Corner, k: usize| {
        ((k as u32) << 16) | (corner.bits[k / 4] >> (16 * (k % 4))) as u32 & 0xffff
    };
    let mut words: Vec<u32> = corners.iter().flat_map(|c| (0..16).map(move |k| part(c, k))).collect();
    words.sort_unstable();
    words.dedup();
    words
}
