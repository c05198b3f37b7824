//! Stage 4: every point of the clip gets a class, with a probability (paper III-A).
//!
//! Pictures give a network's class probabilities, summed over the key frames that see a place. Shapes are
//! classified by their planes, and by a network for surfaces. Without a network, shapes alone give floor,
//! wall and ceiling.

mod augment;
mod class_map;
mod columns;
mod combine;
mod instances;
mod likeliest;
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
pub use likeliest::likeliest_beside;
pub use map::{MapLabels, label_map};
pub use open::open_segmenter;
pub use params::LabelParams;
pub use segmenter::{SegmentError, Segmenter};
pub use structure::{Shape, Wall};
pub use surface::SurfaceNetwork;

use super::cloud::{Label, PointCloud};
use super::error::ReconstructError;
use super::key_frame::KeyFrame;
use super::reason::Reason;
use combine::Alone;
use sites::Sites;
use viola_formats::clip::{Clip, Frame};
use viola_geometry::progress::Progress;
use viola_geometry::{Point3, Pose3, Vector3};
use vote::{Look, Recording, Voted, Votes};

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

/// The outcome of [`Labeller::add_shapes`].
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
    /// Segments the pictures, and writes their labels into the cloud. The pictures are set upright if the upward direction
    /// is known.
    pub fn segment_pictures(
        clip: &Clip,
        cloud_in_world: &mut PointCloud,
        key_frames: &[KeyFrame],
        up_in_world: Option<&Vector3>,
        params: &LabelParams,
        progress: &dyn Progress,
    ) -> Result<Labeller, ReconstructError> {
        let sites = Sites::new(cloud_in_world);
        let report = LabelReport { by: "geometry".into(), key_frames: 0 };
        let unavailable = |why: &String| {
            let detail = format!("the answer was made without a requested network: {why}");
            Reason::new("network_unavailable", detail)
        };
        let remarks = params.unavailable.iter().map(unavailable).collect();
        let mut labeller = Labeller { sites, votes: None, report, pictures: Vec::new(), remarks };
        let Some(segmenter) = params.segmenter.as_ref().filter(|_| clip.has_color()) else {
            return Ok(labeller);
        };
        let recording = Recording { clip, key_frames, up_in_world };
        match vote::vote(&recording, &labeller.sites, segmenter.as_ref(), params, progress)? {
            Ok(Voted { votes, pictures, failures }) => {
                labeller.write(&combine::voted(&votes), cloud_in_world);
                labeller.votes = Some(votes);
                if let Some(error) = failures.first() {
                    let (name, failed) = (segmenter.name(), failures.len());
                    let all = pictures.len() + failed;
                    let detail = format!(
                        "the classes come without {failed} of {all} pictures, because of {name}: {error}"
                    );
                    labeller.remarks.push(Reason::new("network_failed", detail));
                }
                labeller.report = LabelReport { by: segmenter.name(), key_frames: pictures.len() };
                labeller.pictures = pictures;
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
    /// [`Labeller::segment_pictures`], in any frame.
    pub fn add_shapes(
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
            // Without surface in the network's slices, it has nothing to say.
            None | Some((_, Err(SegmentError::NoSurface { .. }))) => None,
            Some((network, Err(error))) => {
                let detail = format!("the surface network {} was not used: {error}", network.name());
                remark = Some(Reason::new("network_failed", detail));
                None
            }
        };
        let labels = if self.votes.is_none() && surface.is_none() {
            combine::shaped(&shapes)
        } else {
            let segments = segments::segments(&self.sites);
            let labels = match &surface {
                Some(surface) => combine::surfaced(&segments, &shapes, |site| surface[site]),
                None => combine::shaped(&shapes),
            };
            // Pictures are weighted by the shapes already, so shapes alone are no voter.
            let alone = Alone { labels, is_voter: surface.is_some() };
            match &self.votes {
                Some(votes) => combine::combined(&segments, &shapes, |site| votes.of(site), &alone),
                None => alone.labels,
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
