//! MI-GAN (Sargsyan et al., "MI-GAN: A Simple Baseline for Image Inpainting on Mobile Devices", 2023): one
//! run fills a hole, without randomness and without a prompt.

use super::{InpaintError, Inpainter, hole};
use image::{GrayImage, RgbImage};
use std::sync::Arc;
use viola_network::manifest::{Channels, Input, Layout};
use viola_network::signature::{expect, one};
use viola_network::{Data, Element, Network, Tensor};

/// A network from the bytes of a picture, 1 x 3 x height x width, and of a mask, 1 x 1 x height x width with
/// 255 where the picture is kept, to the bytes of the filled picture. The file contains all steps: it crops
/// the hole's surroundings, resizes them to the training size and puts the result back.
pub(super) struct MiGan {
    name: String,
    network: Arc<Network>,
    picture: String,
    mask: String,
    result: String,
}

impl MiGan {
    /// Checks a network against its entry. `output` and `mask` are the names in the entry's output; the
    /// default input names are `image` and `mask`.
    pub(super) fn new(
        entry: &str,
        network: Arc<Network>,
        input: &Input,
        output: Option<&str>,
        mask: Option<&str>,
    ) -> Result<MiGan, String> {
        if input.width.pixels().is_some() || input.height.pixels().is_some() {
            return Err("its entry gives the picture a size; only networks for any size are run".to_owned());
        }
        if input.layout != Layout::Nchw || input.channels != Channels::Rgb {
            return Err(
                "its entry asks for another order than 1 x red, green, blue x rows x columns".to_owned()
            );
        }
        let inputs = network.inputs();
        let picture = one(inputs, Some(input.name.as_deref().unwrap_or("image")), "input")?;
        let mask = one(inputs, Some(mask.unwrap_or("mask")), "input")?;
        let result = one(network.outputs(), output, "output")?;
        expect(picture, "input", Element::U8, &[Some(1), Some(3), None, None])?;
        expect(mask, "input", Element::U8, &[Some(1), Some(1), None, None])?;
        expect(result, "output", Element::U8, &[Some(1), Some(3), None, None])?;
        if let Some(other) = inputs.iter().find(|info| info.name != picture.name && info.name != mask.name) {
            return Err(format!("it has an input {} that nothing is known of", other.name));
        }
        let (picture, mask, result) = (picture.name.clone(), mask.name.clone(), result.name.clone());
        Ok(MiGan { name: format!("{entry}, {}", network.runtime()), network, picture, mask, result })
    }
}

impl Inpainter for MiGan {
    fn inpaint(
        &self,
        picture: &RgbImage,
        hole: &GrayImage,
        _seed: u64,
        keep_going: &dyn Fn() -> bool,
    ) -> Result<RgbImage, InpaintError> {
        if !hole::any(picture, hole)? {
            return Ok(picture.clone());
        }
        if !keep_going() {
            return Err(InpaintError::Cancelled);
        }
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        let mask = hole.pixels().map(|value| if hole::is_hole(value) { 0 } else { 255 }).collect();
        let inputs = [
            (self.picture.as_str(), Tensor::u8([1, 3, height, width], planes(picture))),
            (self.mask.as_str(), Tensor::u8([1, 1, height, width], mask)),
        ];
        let [result] = self.network.run(&inputs, [&self.result])?;
        let filled = read(&result, width, height)?;
        Ok(hole::put_back(picture, hole, &filled))
    }

    fn name(&self) -> String {
        self.name.clone()
    }
}

/// Returns a picture's bytes colour by colour, as networks take them.
fn planes(picture: &RgbImage) -> Vec<u8> {
    (0..3).flat_map(|c| picture.pixels().map(move |pixel| pixel.0[c])).collect()
}

/// Returns the picture of 1 x 3 x height x width bytes.
fn read(result: &Tensor, width: usize, height: usize) -> Result<RgbImage, InpaintError> {
    let misfit = || InpaintError::Shape {
        got: format!("{:?} {:?}", result.data.element(), result.shape),
        want: format!("U8 [1, 3, {height}, {width}]"),
    };
    let Data::U8(bytes) = &result.data else { return Err(misfit()) };
    let size = width * height;
    if result.shape != [1, 3, height, width] || bytes.len() != 3 * size {
        return Err(misfit());
    }
    let pixels = (0..size).flat_map(|at| [0, 1, 2].map(|c| bytes[c * size + at])).collect();
    RgbImage::from_raw(width as u32, height as u32, pixels).ok_or_else(misfit)
}
