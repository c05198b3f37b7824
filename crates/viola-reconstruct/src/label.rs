//! Stage 4: every point of the clip gets a class, with a probability (paper III-A).
//!
//! Pictures give a network's class probabilities, summed over the key frames that see a place. Shapes are
//! classified by their planes, and by a network for surfaces. Without a network, shapes alone give floor,
//! wall and ceiling.

mod augment;
mod class_map;
mod columns;
mod combine;
mod logits;
mod map;
mod mask2former;
pub mod numbers;
mod open;
mod params;
pub mod picture;
mod planes;
mod segmenter;
mod segments;
mod sites;
mod structure;
mod surface;
mod vote;

pub use augment::AUGMENTATIONS;
pub use class_map::ClassMap;
pub use map::label_map;
pub use open::open_segmenter;
pub use params::LabelParams;
pub use segmenter::{SegmentError, Segmenter};
pub use structure::{Shape, Wall};
pub use surface::SurfaceNetwork;

use super::cloud::{Label, OTHER_CLASSES, PointCloud};
use super::error::ReconstructError;
use super::key_frame::KeyFrame;
use super::reason::Reason;
use sites::Sites;
use viola_formats::clip::{Clip, Frame};
use viola_geometry::progress::Progress;
use viola_geometry::taxonomy::{CLASSES, Class};
use viola_geometry::{Point3, Pose3};
use vote::{Look, Votes};

/// Returns the class with the largest sum in the family with the largest sum; its fraction of all sums is
/// its probability.
pub(super) fn likeliest(sums: &[f32], views: u16) -> Label {
    likeliest_beside(sums, 0.0, views)
}

/// The same if classes that are not in `sums` have `rest` together.
pub fn likeliest_beside(sums: &[f32], rest: f32, views: u16) -> Label {
    let total: f32 = sums.iter().sum::<f32>() + rest;
    let mut families = [0f32; CLASSES];
    for (class, sum) in Class::ALL.iter().zip(sums) {
        families[family(*class) as usize] += sum;
    }
    let (mut best, mut most) = (Class::Other, (0.0, 0.0));
    for (class, &sum) in Class::ALL.iter().zip(sums) {
        let rank = (families[family(*class) as usize], sum);
        if rank > most {
            (best, most) = (*class, rank);
        }
    }
    if total > 0.0 {
        Label::new(best, most.1 / total, views).with_others(next_best(sums, best, total))
    } else {
        Label::NONE
    }
}

/// Returns the classes with the largest sums beside `best`, of equal ones the first, with their fractions.
fn next_best(sums: &[f32], best: Class, total: f32) -> [(Class, f32); OTHER_CLASSES] {
    let mut next = [(Class::Other, 0.0); OTHER_CLASSES];
    for (class, &sum) in Class::ALL.iter().zip(sums).filter(|(class, _)| **class != best) {
        if let Some(place) = next.iter().position(|(_, other)| sum > *other) {
            next[place..].rotate_right(1);
            next[place] = (*class, sum);
        }
    }
    next.map(|(class, sum)| (class, sum / total))
}

/// Returns the family of a class. Networks split probability between similar classes, so that the sum of
/// the family is compared first.
fn family(class: Class) -> Class {
    match class {
        Class::Curtain => Class::Window,
        Class::Shelf => Class::Cabinet,
        Class::Desk => Class::Table,
        Class::Rug => Class::Floor,
        Class::Pillow => Class::Bed,
        other => other,
    }
}

/// Summary of the labelling for the answer.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct LabelReport {
    /// `geometry` if no network was used. Else the networks with their runtimes, separated by `; `: first the
    /// one for pictures, then the one for surfaces.
    pub by: String,
    /// Number of segmented pictures; 0 if no network for pictures was used.
    pub key_frames: usize,
}

/// Returns the pixel of a world point in a frame's colour picture; `None` if the frame does not see it.
pub fn seen_at(point_in_world: &Point3, frame: &Frame, world_from_camera: &Pose3) -> Option<(f32, f32)> {
    let camera = world_from_camera.translation.vector;
    let towards = camera - point_in_world.coords;
    Look { frame, camera_from_world: world_from_camera.inverse() }.pixel(point_in_world, &towards)
}

/// The outcome of [`Labeller::finish`].
pub struct Labelled {
    pub walls: Vec<Wall>,
    pub report: LabelReport,
    /// Reason why the surface network was not used though there is one.
    pub remark: Option<Reason>,
}

/// Labels a clip in two steps: by pictures before the floor is known, by shapes after it.
pub struct Labeller {
    sites: Sites,
    votes: Option<Votes>,
    pub report: LabelReport,
    /// Indices in the clip of the frames that the network segmented.
    pub pictures: Vec<usize>,
    /// Reasons why a requested network was not used.
    pub remarks: Vec<Reason>,
}

impl Labeller {
    /// Segments the pictures, and writes their labels into the cloud.
    pub fn listen(
        clip: &Clip,
        cloud_in_world: &mut PointCloud,
        key_frames: &[KeyFrame],
        params: &LabelParams,
        progress: &dyn Progress,
    ) -> Result<Labeller, ReconstructError> {
        let sites = Sites::new(cloud_in_world);
        let report = LabelReport { by: "geometry".into(), key_frames: 0 };
        let unavailable = |why: &String| {
            let detail = format!("the classes come without a network that was requested: {why}");
            Reason::new("network_unavailable", detail)
        };
        let remarks = params.unavailable.iter().map(unavailable).collect();
        let mut labeller = Labeller { sites, votes: None, report, pictures: Vec::new(), remarks };
        let Some(segmenter) = params.segmenter.as_ref().filter(|_| clip.has_color()) else {
            return Ok(labeller);
        };
        match vote::vote(clip, key_frames, &labeller.sites, segmenter.as_ref(), params, progress)? {
            Ok(votes) => {
                labeller.write(&combine::voted(&votes), cloud_in_world);
                labeller.votes = Some(votes);
                labeller.pictures = vote::choose(key_frames).iter().map(|key| key.index).collect();
                let key_frames = labeller.pictures.len();
                labeller.report = LabelReport { by: segmenter.name(), key_frames };
            }
            Err(error) => {
                let detail =
                    format!("the classes come without pictures, because of {}: {error}", segmenter.name());
                labeller.remarks.push(Reason::new("network_failed", detail));
            }
        }
        Ok(labeller)
    }

    /// Adds the surface network and the shapes to the labels once the floor is known. `cloud` is the cloud of
    /// [`Labeller::listen`], in any frame.
    pub fn finish(
        mut self,
        cloud: &mut PointCloud,
        clip_from_world: &Pose3,
        params: &LabelParams,
    ) -> Labelled {
        if !params.by_shape {
            return Labelled { walls: Vec::new(), report: self.report, remark: None };
        }
        self.sites.transform(clip_from_world);
        let (shapes, walls) = structure::shapes(&self.sites);
        let surface = params.surface.as_ref().map(|network| (network, network.classify(&self.sites)));
        let mut remark = None;
        let surface = match surface {
            Some((network, Ok(classes))) => {
                self.report.by = match &self.votes {
                    Some(_) => format!("{}; {}", self.report.by, network.name()),
                    None => network.name().to_owned(),
                };
                Some(classes)
            }
            Some((network, Err(error))) => {
                let detail = format!("the surface network {} was not used: {error}", network.name());
                remark = Some(Reason::new("network_failed", detail));
                None
            }
            None => None,
        };
        let labels = if self.votes.is_none() && surface.is_none() {
            combine::shaped(&shapes)
        } else {
            let segments = segments::segments(&self.sites);
            let alone = match &surface {
                Some(surface) => combine::surfaced(&segments, &shapes, |site| surface[site]),
                None => combine::shaped(&shapes),
            };
            match &self.votes {
                Some(votes) => combine::combined(&segments, &shapes, |site| votes.of(site), alone),
                None => alone,
            }
        };
        self.write(&labels, cloud);
        Labelled { walls, report: self.report, remark }
    }

    fn write(&self, labels: &[Label], cloud: &mut PointCloud) {
        for (point, &site) in cloud.points.iter_mut().zip(&self.sites.of_point) {
            point.label = labels[site as usize];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks the class and probability that result from sums by class.
    fn check(sums: &[(Class, f32)], want: Class, probability: f32) {
        let mut all = [0f32; CLASSES];
        for (class, sum) in sums {
            all[*class as usize] = *sum;
        }
        let label = likeliest(&all, 7);
        assert_eq!((label.class, label.views), (want, 7), "{sums:?}");
        assert!((label.probability() - probability).abs() < 0.003, "{sums:?} {}", label.probability());
    }

    #[test]
    fn families_count_before_classes() {
        check(&[(Class::Wall, 4.0), (Class::Door, 1.0)], Class::Wall, 0.8);
        check(&[(Class::Wall, 4.0), (Class::Window, 3.0), (Class::Curtain, 3.0)], Class::Window, 0.3);
        check(&[(Class::Wall, 4.0), (Class::Shelf, 3.0), (Class::Cabinet, 2.0)], Class::Shelf, 1.0 / 3.0);
        assert_eq!(likeliest(&[0.0; CLASSES], 0), Label::NONE);
    }

    #[test]
    fn the_next_classes_are_kept() {
        let mut sums = [0f32; CLASSES];
        let shares = [
            (Class::Table, 0.1),
            (Class::Sofa, 0.3),
            (Class::Bed, 0.25),
            (Class::Chair, 0.2),
            (Class::Wall, 0.05),
        ];
        shares.iter().for_each(|(class, share)| sums[*class as usize] = 2.0 * share);
        let kept: Vec<Class> = likeliest_beside(&sums, 0.2, 1).shares().map(|(class, _)| class).collect();
        assert_eq!(kept, [Class::Sofa, Class::Bed, Class::Chair, Class::Table]);
        // With the rest the sums are 2, so that the fractions are those above.
        for ((_, share), want) in likeliest_beside(&sums, 0.2, 1).shares().zip([0.3, 0.25, 0.2, 0.1]) {
            assert!((f64::from(share) / 255.0 - want).abs() < 0.003, "{share} {want}");
        }
    }
}
