//! Stage 4: every point of the clip gets a class, with a probability (paper III-A).
//!
//! Pictures speak by a network's class probabilities, summed over the key frames that see a place; shapes
//! speak by the planes that they lie in. Without a network shapes alone tell floor, wall and ceiling.

mod augment;
mod class_map;
mod combine;
mod logits;
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
mod vote;

pub use augment::AUGMENTATIONS;
pub use class_map::ClassMap;
pub use open::{installed, open_segmenter};
pub use params::LabelParams;
pub use segmenter::{SegmentError, Segmenter};
pub use structure::{Shape, Wall};

use super::cloud::{Label, PointCloud};
use super::error::ReconstructError;
use super::key_frame::KeyFrame;
use super::reason::Reason;
use sites::Sites;
use viola_formats::clip::{Clip, Frame};
use viola_geometry::progress::Progress;
use viola_geometry::taxonomy::{CLASSES, Class};
use viola_geometry::{Point3, Pose3};
use vote::{Look, Votes};

/// The class with the largest sum within the family with the largest sum; its share is its probability.
pub(super) fn likeliest(sums: &[f32], views: u16) -> Label {
    let total: f32 = sums.iter().sum();
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
    if total > 0.0 { Label::new(best, most.1 / total, views) } else { Label::NONE }
}

/// Networks divide their say between classes that look alike: what such a family gets together counts first.
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

/// How the points of an answer were labelled.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize, utoipa::ToSchema)]
pub struct LabelReport {
    /// `geometry` where no network was used, else the network and what ran it.
    pub by: String,
    /// Pictures that the network looked at.
    pub key_frames: usize,
}

/// Where a point of the world is in a frame's colour picture, in pixels; none if the frame does not see it.
pub fn seen_at(point_in_world: &Point3, frame: &Frame, world_from_camera: &Pose3) -> Option<(f32, f32)> {
    let camera = world_from_camera.translation.vector;
    let towards = camera - point_in_world.coords;
    Look { frame, camera_from_world: world_from_camera.inverse() }.pixel(point_in_world, &towards)
}

/// The labels of a clip in the making: the pictures are heard before the floor is known, the shapes after it.
pub struct Labeller {
    sites: Sites,
    votes: Option<Votes>,
    pub report: LabelReport,
    /// The places in the clip of the frames that the network looked at.
    pub pictures: Vec<usize>,
    /// Why there are no votes though there is a network.
    pub remark: Option<Reason>,
}

impl Labeller {
    /// Hears the pictures, and writes what they say into the cloud.
    pub fn listen(
        clip: &Clip,
        cloud_in_world: &mut PointCloud,
        key_frames: &[KeyFrame],
        params: &LabelParams,
        progress: &dyn Progress,
    ) -> Result<Labeller, ReconstructError> {
        let sites = Sites::new(cloud_in_world);
        let report = LabelReport { by: "geometry".into(), key_frames: 0 };
        let mut labeller = Labeller { sites, votes: None, report, pictures: Vec::new(), remark: None };
        let Some(segmenter) = &params.segmenter else {
            let remark = |why: &String| {
                Reason::new("network_unavailable", format!("the classes come from geometry alone: {why}"))
            };
            labeller.remark = params.unavailable.as_ref().map(remark);
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
                    format!("the classes come from geometry alone, because of {}: {error}", segmenter.name());
                labeller.remark = Some(Reason::new("network_failed", detail));
            }
        }
        Ok(labeller)
    }

    /// Adds what the shapes say, once the floor is known, and tells the walls. `cloud` is the one that was
    /// listened to, in any frame.
    pub fn finish(
        mut self,
        cloud: &mut PointCloud,
        clip_from_world: &Pose3,
        params: &LabelParams,
    ) -> Vec<Wall> {
        if !params.by_shape {
            return Vec::new();
        }
        self.sites.transform(clip_from_world);
        let (shapes, walls) = structure::shapes(&self.sites);
        let labels = match &self.votes {
            Some(votes) => combine::combined(&self.sites, votes, &shapes),
            None => combine::shaped(&shapes),
        };
        self.write(&labels, cloud);
        walls
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

    /// Sums by class, and the class and probability that they come to.
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
}
