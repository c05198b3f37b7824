//! Check of an inpainting network.

use super::{CheckArguments, print_loaded, read, timed};
use anyhow::Result;
use image::{GrayImage, Luma, RgbImage};
use std::time::Instant;
use viola_align::complete::inpaint::open_inpainter;
use viola_network::RuntimeParams;
use viola_network::manifest::ModelEntry;

/// Seed of networks that draw noise.
const SEED: u64 = 1;

pub(super) fn run(
    entry: &ModelEntry,
    arguments: &CheckArguments,
    params: &RuntimeParams,
    picture: &RgbImage,
) -> Result<RgbImage> {
    let hole = match &arguments.mask {
        Some(path) => read(path)?.into_luma8(),
        None => middle(picture.width(), picture.height()),
    };
    let start = Instant::now();
    let inpainter = open_inpainter(entry, &arguments.folder.models, params)?;
    print_loaded(&inpainter.name(), start);
    Ok(timed(arguments.runs, || inpainter.inpaint(picture, &hole, SEED, &|| true))?)
}

/// Returns a mask with one hole over the middle third of both sides.
fn middle(width: u32, height: u32) -> GrayImage {
    let within = |at: u32, side: u32| (side / 3..side - side / 3).contains(&at);
    GrayImage::from_fn(width, height, |x, y| {
        Luma([if within(x, width) && within(y, height) { 255 } else { 0 }])
    })
}
