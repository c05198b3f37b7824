//! Labels of a home's map: its whole surface shows more of each object than a clip does.

use super::combine::{self, Alone, ByClass};
use super::segments::segments;
use super::sites::Sites;
use super::structure;
use super::surface::SurfaceNetwork;
use crate::cloud::{Label, PointCloud};
use viola_geometry::taxonomy::CLASSES;

/// Returns the label of each point of a map, whose z axis is up and whose floor is at 0. The labels of `map` are those of
/// its clips. Pictures decide in the segments that they show; in the others it is the mean of the surface network's
/// answers for the clips and for the map. The answer for the map is left out if the network fails.
pub fn label_map(map: &PointCloud, network: Option<&SurfaceNetwork>) -> Vec<Label> {
    let mut sites = Sites::new(map);
    let (shapes, _) = structure::shapes(&sites);
    let segments = segments(&sites);
    // The network needs the memory.
    sites.neighbours = Vec::new();
    let of_clips = first_labels(map, &sites);
    let of_map = network.and_then(|network| network.classify_map(&sites).ok());
    let surface = |site: usize| {
        let of_clips = by_class(&of_clips[site]).filter(|_| of_clips[site].views == 0);
        match (of_clips, of_map.as_ref().and_then(|of_map| by_class(&of_map[site]))) {
            (Some(one), Some(other)) => Some(std::array::from_fn(|i| (one[i] + other[i]) / 2.0)),
            (one, other) => one.or(other),
        }
    };
    let pictures = |site: usize| {
        let label = &of_clips[site];
        (by_class(label).unwrap_or([0.0; CLASSES]), label.views)
    };
    // The labels of clips with pictures have heard the network already.
    let alone = Alone::Fallback(combine::surfaced(&segments, &shapes, surface));
    let labels = combine::combined(&segments, &shapes, pictures, &alone);
    sites.of_point.iter().map(|site| labels[*site as usize]).collect()
}

/// Returns the label of the first point of each site; a map has one point for nearly each.
fn first_labels(map: &PointCloud, sites: &Sites) -> Vec<Label> {
    let mut labels = vec![Label::NONE; sites.len()];
    // The first point of a site is set last.
    for (point, site) in map.points.iter().zip(&sites.of_point).rev() {
        labels[*site as usize] = point.label;
    }
    labels
}

/// Returns the known probabilities of a label; `None` without any.
fn by_class(label: &Label) -> Option<ByClass> {
    let mut out = [0f32; CLASSES];
    label.shares().for_each(|(class, share)| out[class as usize] += f32::from(share) / 255.0);
    (out.iter().sum::<f32>() > 0.0).then_some(out)
}
