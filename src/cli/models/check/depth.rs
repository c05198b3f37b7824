//! Check of a depth network.

use super::{CheckArguments, opened, timed};
use anyhow::{Context, Result};
use image::{Rgb, RgbImage};
use viola_align::complete::monocular::open_estimator;
use viola_network::RuntimeParams;
use viola_network::manifest::ModelEntry;

/// Colours from near to far.
const COLORS: [[f32; 3]; 5] = [
    [180.0, 4.0, 38.0],
    [244.0, 152.0, 80.0],
    [240.0, 232.0, 160.0],
    [70.0, 160.0, 190.0],
    [40.0, 40.0, 120.0],
];

pub(super) fn run(
    entry: &ModelEntry,
    arguments: &CheckArguments,
    params: &RuntimeParams,
    picture: &RgbImage,
) -> Result<RgbImage> {
    let estimator = opened(entry, arguments, params, open_estimator)?;
    let depth = timed(arguments.runs, || estimator.depth(picture))?;

    let mut sorted = depth.clone();
    sorted.sort_by(f32::total_cmp);
    let at = |share: f64| sorted[((sorted.len() - 1) as f64 * share) as usize];
    println!(
        "depth:   {:.3} at the nearest, {:.3} in the middle, {:.3} at the farthest",
        at(0.0),
        at(0.5),
        at(1.0)
    );
    let (near, far) = (at(0.02), at(0.98));
    let colors = depth.iter().flat_map(|depth| color((depth - near) / (far - near).max(f32::MIN_POSITIVE)).0);
    RgbImage::from_raw(picture.width(), picture.height(), colors.collect())
        .context("there is not one depth for each pixel")
}

/// Returns the colour at a fraction of the way from near to far.
fn color(share: f32) -> Rgb<u8> {
    let at = share.clamp(0.0, 1.0) * (COLORS.len() - 1) as f32;
    let below = (at as usize).min(COLORS.len() - 2);
    let part = at - below as f32;
    Rgb([0, 1, 2].map(|c| (COLORS[below][c] * (1.0 - part) + COLORS[below + 1][c] * part).round() as u8))
}
