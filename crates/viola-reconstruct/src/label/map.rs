//! Labels of a home's map: its surface shows more of each object than a clip does.

use super::SegmentError;
use super::columns::View;
use super::combine::{self, Alone};
use super::instances::agree;
use super::likeliest::{ByClass, by_class};
use super::segments::segments;
use super::sites::Sites;
use super::structure;
use super::surface::SurfaceNetwork;
use crate::cloud::{Label, PointCloud};
use viola_geometry::Point3;

/// Labels of a piece of a map.
pub struct MapLabels {
    /// The labels of the points that were asked for.
    pub labels: Vec<Label>,
    /// Reason why the surface network was not used though there is one.
    pub failure: Option<SegmentError>,
}

/// Returns the labels of the first `count` points of a piece of a map, whose z axis is up and whose floor is at 0; the
/// others are the surface around them. The labels of `map` are those of its clips. In the segments that pictures show, the
/// surface network's answer for the map votes beside them; in the others it is the mean of its answers for the clips and for
/// the map. Pieces of furniture agree on the network's answers. The answer for the map is left out if the network fails.
pub fn label_map(map: &PointCloud, count: usize, network: Option<&SurfaceNetwork>) -> MapLabels {
    let mut sites = Sites::new(map);
    let (shapes, _) = structure::shapes(&sites);
    let segments = segments(&sites);
    // The network needs the memory.
    sites.neighbours = Vec::new();
    let of_clips = first_labels(map, &sites);
    let of_point = &sites.of_point[..count];
    // Sites are numbered in the order of their points.
    let asked = of_point.iter().max().map_or(0, |last| *last as usize + 1);
    let (of_map, failure) = match network.map(|network| network.classify_in(&View::default(), &sites, asked))
    {
        // Without surface in the network's slices, it has nothing to say.
        None | Some(Err(SegmentError::NoSurface { .. })) => (None, None),
        Some(Ok(of_map)) => (Some(of_map), None),
        Some(Err(failure)) => (None, Some(failure)),
    };
    let surface = |site: usize| {
        let label = &of_clips[site];
        let of_clips = (label.views == 0 && label.fractions().next().is_some()).then(|| by_class(label));
        match (of_clips, of_map.as_ref().and_then(|of_map| of_map.of(site))) {
            (Some(one), Some(other)) => Some(std::array::from_fn(|i| (one[i] + other[i]) / 2.0)),
            (one, other) => one.or(other),
        }
    };
    let mut said: Vec<Option<ByClass>> = (0..sites.len()).map(surface).collect();
    if let Some(of_map) = &of_map {
        let centre = |(site, at): (usize, &Point3)| of_map.to_centre(site).map(|towards_m| at + towards_m);
        let centres_m: Vec<Option<Point3>> = sites.positions_m.iter().enumerate().map(centre).collect();
        agree(&mut said, &centres_m);
    }
    let pictures = |site: usize| {
        let label = &of_clips[site];
        (by_class(label), label.views)
    };
    let surfaced = combine::surfaced(&segments, &shapes, |site| said[site]);
    // The labels of pictured points have heard the network's answers for the clips, but not that for the map.
    let alone = Alone { labels: surfaced, is_voter: of_map.is_some() };
    let labels = combine::combined(&segments, &shapes, pictures, &alone);
    MapLabels { labels: of_point.iter().map(|site| labels[*site as usize]).collect(), failure }
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
