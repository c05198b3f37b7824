//! Opens a segmentation network of the manifest.

use super::logits::Logits;
use super::mask2former::Mask2Former;
use super::picture::{self, Fit, PictureInput, Raster};
use super::{ClassMap, SegmentError, Segmenter};
use image::RgbImage;
use std::sync::Arc;
use viola_network::Element::F32;
use viola_network::Network;
use viola_network::manifest::{ModelEntry, Output};
use viola_network::signature::{expect, one};

/// Returns a segmenter for a loaded network, after a check of the network against its entry.
pub fn open_segmenter(entry: &ModelEntry, network: Arc<Network>) -> Result<Box<dyn Segmenter>, SegmentError> {
    let misfit = |problem: String| SegmentError::Misfit { network: entry.name.clone(), problem };
    let (Some(input), Some(output), Some(table)) = (&entry.input, &entry.output, entry.classes) else {
        return Err(misfit("it is not a segmentation network".to_owned()));
    };
    let head = match output {
        Output::Logits { name, align_corners, first_class, softmax } => {
            let logits = Logits::new(table, *first_class, *align_corners, *softmax);
            let info = one(network.outputs(), name.as_deref(), "output").map_err(misfit)?;
            expect(info, "output", F32, &[Some(1), Some(logits.channels()), None, None]).map_err(misfit)?;
            Head::Logits { output: info.name.clone(), logits }
        }
        Output::Mask2former { class_queries, mask_queries } => {
            let queries = Mask2Former { table };
            let classes = one(network.outputs(), Some(class_queries), "output").map_err(misfit)?;
            let masks = one(network.outputs(), Some(mask_queries), "output").map_err(misfit)?;
            expect(classes, "output", F32, &[Some(1), None, Some(table.classes().len() + 1)])
                .map_err(misfit)?;
            expect(masks, "output", F32, &[Some(1), None, None, None]).map_err(misfit)?;
            Head::Mask2Former { classes: classes.name.clone(), masks: masks.name.clone(), queries }
        }
        Output::Depth { .. } | Output::Inpainting { .. } | Output::Diffusion(_) => {
            return Err(misfit("it is not a segmentation network".to_owned()));
        }
    };
    let input = PictureInput::of(&network, input).map_err(misfit)?;
    let raster = network.outputs().iter().find(|info| info.name == head.raster()).and_then(|info| {
        let (height, width) = (info.axis(2)?, info.axis(3)?);
        (width > 0 && height > 0).then_some(Raster { width, height })
    });
    Ok(Box::new(NetworkSegmenter {
        name: format!("{}, {}", entry.name, network.runtime()),
        input,
        raster,
        head,
        network,
    }))
}

/// Reader of the network's outputs.
enum Head {
    Logits { output: String, logits: Logits },
    Mask2Former { classes: String, masks: String, queries: Mask2Former },
}

impl Head {
    /// Returns the output whose last axes are the raster.
    fn raster(&self) -> &str {
        match self {
            Head::Logits { output, .. } => output,
            Head::Mask2Former { masks, .. } => masks,
        }
    }

    fn align_corners(&self) -> bool {
        match self {
            Head::Logits { logits, .. } => logits.align_corners,
            Head::Mask2Former { .. } => false,
        }
    }
}

struct NetworkSegmenter {
    name: String,
    network: Arc<Network>,
    input: PictureInput,
    /// Size of the output if the file states it.
    raster: Option<Raster>,
    head: Head,
}

impl Segmenter for NetworkSegmenter {
    fn segment(&self, picture: &RgbImage) -> Result<ClassMap, SegmentError> {
        let size = Raster { width: picture.width() as usize, height: picture.height() as usize };
        if size.width == 0 || size.height == 0 {
            return Err(SegmentError::NoPicture);
        }
        let align_corners = self.head.align_corners();
        let fit = match self.input.fixed {
            Some(input) => Fit::into_fixed(size, input, self.raster, align_corners),
            None => Fit::by_rule(size, &self.input.rule),
        };
        let input = picture::tensor(picture, fit, &self.input.rule, align_corners);
        let inputs = [(self.input.name.as_str(), input)];
        match &self.head {
            Head::Logits { output, logits } => {
                let [output] = self.network.run(&inputs, [output])?;
                logits.read(&output, fit)
            }
            Head::Mask2Former { classes, masks, queries } => {
                let [classes, masks] = self.network.run(&inputs, [classes, masks])?;
                queries.read(&classes, &masks, fit)
            }
        }
    }

    fn name(&self) -> String {
        self.name.clone()
    }
}
