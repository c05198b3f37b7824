//! Opens a depth network of the manifest.
//!
//! FastDepth (Wofk et al., "FastDepth: Fast Monocular Depth Estimation on Embedded Systems", 2019) gives
//! metres; MiDaS (Ranftl et al., 2020), Depth Anything (Yang et al., 2024) and similar networks give inverse
//! depth up to a scale and a shift.

use super::{DepthError, DepthEstimator};
use image::RgbImage;
use std::sync::Arc;
use viola_network::manifest::{ModelEntry, Output};
use viola_network::signature::{expect, one};
use viola_network::{Element, Network, Tensor};
use viola_reconstruct::label::numbers::all_finite;
use viola_reconstruct::label::picture::{self, Fit, PictureInput, Raster};

/// Maximum side of a network's output raster, in pixels.
const MAX_SIDE: usize = 8192;
/// Maximum ratio of the farthest depth in a picture to the nearest. Inverse depth goes to zero with the
/// distance, and zero or slightly negative values are common; indoors no picture spans more.
const MAX_RATIO: f32 = 100.0;

/// Returns an estimator for a loaded network, after a check of the network against its entry.
pub fn open_estimator(
    entry: &ModelEntry,
    network: Arc<Network>,
) -> Result<Box<dyn DepthEstimator>, DepthError> {
    let misfit = |problem: String| DepthError::Misfit { network: entry.name.clone(), problem };
    let (Some(input), Some(Output::Depth { name, scale, inverse })) = (&entry.input, &entry.output) else {
        return Err(misfit("it is not a depth network".to_owned()));
    };
    let input = PictureInput::of(&network, input).map_err(misfit)?;
    let output = one(network.outputs(), name.as_deref(), "output").map_err(misfit)?;
    let axes: &[Option<usize>] = match output.shape.as_ref().map(Vec::len) {
        Some(3) => &[Some(1), None, None],
        _ => &[Some(1), Some(1), None, None],
    };
    expect(output, "output", Element::F32, axes).map_err(misfit)?;
    Ok(Box::new(NetworkEstimator {
        name: format!("{}, {}", entry.name, network.runtime()),
        output_name: output.name.clone(),
        input,
        scale: *scale,
        inverse: *inverse,
        network,
    }))
}

struct NetworkEstimator {
    name: String,
    network: Arc<Network>,
    input: PictureInput,
    output_name: String,
    scale: f32,
    inverse: bool,
}

impl DepthEstimator for NetworkEstimator {
    fn depth(&self, picture: &RgbImage) -> Result<Vec<f32>, DepthError> {
        let size = Raster { width: picture.width() as usize, height: picture.height() as usize };
        if size.width == 0 || size.height == 0 {
            return Err(DepthError::NoPicture);
        }
        // The picture fills the whole input, because a border would need a depth, too.
        let raster = self.input.fixed.unwrap_or_else(|| Fit::by_rule(size, &self.input.rule).input);
        let fit = Fit { input: raster, content: raster };
        let input = picture::tensor(picture, fit, &self.input.rule, false);
        let [output] = self.network.run(&[(&self.input.name, input)], [&self.output_name])?;
        let (values, raster) = read(&output)?;
        let depth = depths(values, self.scale, self.inverse)?;
        Ok(picture::resized(&depth, raster, size))
    }

    fn name(&self) -> String {
        self.name.clone()
    }
}

/// Returns the values of 1 x 1 x height x width or 1 x height x width.
fn read(output: &Tensor) -> Result<(&[f32], Raster), DepthError> {
    let misfit = || DepthError::Shape {
        got: format!("{:?} {:?}", output.data.element(), output.shape),
        want: "F32 [1, 1, height, width] or F32 [1, height, width]".to_owned(),
    };
    let (&[1, 1, height, width] | &[1, height, width]) = output.shape.as_slice() else {
        return Err(misfit());
    };
    let sides = 1..=MAX_SIDE;
    match output.as_f32() {
        Some(values)
            if sides.contains(&width) && sides.contains(&height) && values.len() == width * height =>
        {
            Ok((values, Raster { width, height }))
        }
        _ => Err(misfit()),
    }
}

/// Returns positive depths from a network's values.
fn depths(values: &[f32], scale: f32, inverse: bool) -> Result<Vec<f32>, DepthError> {
    if !all_finite(values) {
        return Err(DepthError::NotFinite);
    }
    let largest = values.iter().copied().fold(0.0, f32::max);
    let least = largest / MAX_RATIO;
    // Rejects also values that would overflow or underflow in the division.
    if !(least * scale).is_normal() || !(scale / least).is_normal() || !(largest * scale).is_finite() {
        return Err(DepthError::NotPositive);
    }
    let depth = |value: &f32| {
        let value = value.max(least);
        if inverse { scale / value } else { value * scale }
    };
    Ok(values.iter().map(depth).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depths_are_positive_and_grow_with_depth() {
        assert_eq!(depths(&[1.0, 2.0, 4.0], 0.5, false), Ok(vec![0.5, 1.0, 2.0]));
        assert_eq!(depths(&[1.0, 2.0, 4.0], 2.0, true), Ok(vec![2.0, 1.0, 0.5]));
        assert_eq!(depths(&[-1.0, 0.0, 4.0], 1.0, true), Ok(vec![25.0, 25.0, 0.25]));
        assert_eq!(depths(&[-1.0, 0.0, 4.0], 1.0, false), Ok(vec![0.04, 0.04, 4.0]));
    }

    #[test]
    fn what_gives_no_depth_is_told() {
        for (values, error) in [
            ([0.0, 0.0], DepthError::NotPositive),
            ([-1.0, -3.0], DepthError::NotPositive),
            ([1.0, f32::NAN], DepthError::NotFinite),
            ([1.0, f32::INFINITY], DepthError::NotFinite),
            ([0.0, 1e-44], DepthError::NotPositive),
        ] {
            for inverse in [false, true] {
                assert_eq!(depths(&values, 1.0, inverse), Err(error.clone()), "{values:?}");
            }
        }
    }
}
