//! Check of a segmentation network.

use super::super::drawing::drawing;
use super::{CheckArguments, opened, timed};
use anyhow::Result;
use image::RgbImage;
use viola_geometry::taxonomy::{CLASSES, Class};
use viola_network::RuntimeParams;
use viola_network::manifest::ModelEntry;
use viola_reconstruct::label::{ClassMap, open_segmenter};

pub(super) fn run(
    entry: &ModelEntry,
    arguments: &CheckArguments,
    params: &RuntimeParams,
    picture: &RgbImage,
) -> Result<RgbImage> {
    let segmenter = opened(entry, arguments, params, open_segmenter)?;
    let map = timed(arguments.runs, || segmenter.segment(picture))?;

    let classes = classes(&map, picture);
    let shares = shares(&classes);
    for (class, share) in &shares {
        println!("{:16} {:5.1} %", class.name(), share * 100.0);
    }
    Ok(drawing(picture, &classes, &shares))
}

/// Returns the likeliest class of each pixel.
fn classes(map: &ClassMap, picture: &RgbImage) -> Vec<Class> {
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let mut p = [0.0; CLASSES];
    let mut classes = Vec::with_capacity(width * height);
    for y in 0..height {
        for x in 0..width {
            map.sample(x as f32, y as f32, width, height, &mut p);
            let best = Class::ALL.iter().max_by(|a, b| p[a.id() as usize].total_cmp(&p[b.id() as usize]));
            classes.push(best.copied().unwrap_or(Class::Other));
        }
    }
    classes
}

/// Returns the classes in the picture with their shares of it, largest first.
fn shares(classes: &[Class]) -> Vec<(Class, f64)> {
    let mut shares: Vec<(Class, f64)> = Class::ALL
        .iter()
        .map(|class| (*class, classes.iter().filter(|c| *c == class).count() as f64 / classes.len() as f64))
        .filter(|(_, share)| *share > 0.0)
        .collect();
    shares.sort_by(|a, b| b.1.total_cmp(&a.1));
    shares
}
