//! Votes of the key frames on the class of each site (paper eq. 1).

use super::sites::Sites;
use super::{ClassMap, LabelParams, SegmentError, Segmenter, augment};
use crate::error::ReconstructError;
use crate::key_frame::KeyFrame;
use crate::label::params::{KEY_ANGLE_RAD, KEY_DISTANCE_M};
use crate::quarter_turn::QuarterTurn;
use rayon::prelude::*;
use viola_formats::clip::{Clip, Frame};
use viola_geometry::progress::{self, Progress};
use viola_geometry::taxonomy::CLASSES;
use viola_geometry::{Point3, Pose3, Vector3};

/// Votes of the pictures for each site. Memory grows with the surface, not with the frames.
#[derive(Debug, Clone)]
pub(super) struct Votes {
    /// [`CLASSES`] values for each site: confidence times probability, summed over the pictures that see it.
    pub(super) sums: Vec<f32>,
    /// Number of pictures that see each site.
    pub(super) views: Vec<u16>,
}

/// The votes of a clip's pictures.
pub(super) struct Voted {
    pub(super) votes: Votes,
    /// Indices in the clip of the segmented frames.
    pub(super) pictures: Vec<usize>,
    /// Errors of the pictures on which the network failed.
    pub(super) failures: Vec<SegmentError>,
}

/// Sites processed together. They lie side by side, so most sites out of view are skipped as a chunk.
const CHUNK: usize = 1024;
/// Maximum number of frames decoded at a time.
const BATCH: usize = 4;
/// A network that fails on so many pictures and has segmented none fails on the others, too, each in the time of a picture.
const MAX_FAILURES: usize = 3;

/// The pictures of a clip.
pub(super) struct Recording<'a> {
    pub clip: &'a Clip,
    pub key_frames: &'a [KeyFrame],
    pub up_in_world: Option<&'a Vector3>,
}

impl Recording<'_> {
    /// Returns the turn that sets the picture of a key frame upright.
    fn turn(&self, key: &KeyFrame) -> QuarterTurn {
        let up = self.up_in_world.map(|up| key.world_from_camera.rotation.inverse() * up.normalize());
        up.map_or(QuarterTurn::None, |up| QuarterTurn::upright(&up))
    }
}

/// Streams the chosen key frames again, segments each upright, and adds its votes for the sites that it sees.
/// `sites` are in the world frame. A picture on which the network fails has no votes; if it fails on all, or on the first
/// [`MAX_FAILURES`], the first error is returned.
pub(super) fn vote(
    recording: &Recording,
    sites: &Sites,
    segmenter: &dyn Segmenter,
    params: &LabelParams,
    progress: &dyn Progress,
) -> Result<Result<Voted, SegmentError>, ReconstructError> {
    let (mut pictures, mut failures) = (Vec::new(), Vec::new());
    let mut votes = Votes { sums: vec![0.0; sites.len() * CLASSES], views: vec![0; sites.len()] };
    let balls = balls(sites);
    let chosen = choose(recording.key_frames);
    let mut frames = recording.clip.stream(chosen.iter().map(|key| key.index).collect());
    let at_a_time = recording.clip.batch(BATCH);
    for (done, batch) in chosen.chunks(at_a_time).enumerate() {
        progress::check(progress)?;
        for (i, (frame, key)) in frames.next_batch(at_a_time).into_iter().zip(batch).enumerate() {
            progress::check(progress)?;
            progress.advance((done * at_a_time + i) as f64 / chosen.len() as f64);
            let frame = match frame {
                Ok(frame) => frame,
                Err(error) if error.is_service_fault() => return Err(ReconstructError::Clip(error)),
                // It was decoded before; if that fails now, the other frames are enough.
                Err(_) => continue,
            };
            let Some(picture) = &frame.color else { continue };
            let turn = recording.turn(key);
            let turned = turn.of_picture(picture);
            match augment::segment(segmenter, &turned, params.augmentations) {
                Ok(map) => {
                    votes.add(sites, &balls, &frame, &key.world_from_camera, &Turned { map, turn });
                    pictures.push(key.index);
                }
                Err(error) => failures.push(error),
            }
            if pictures.is_empty() && failures.len() == MAX_FAILURES {
                return Ok(Err(failures.swap_remove(0)));
            }
        }
    }
    match failures.first() {
        Some(error) if pictures.is_empty() => Ok(Err(error.clone())),
        _ => Ok(Ok(Voted { votes, pictures, failures })),
    }
}

/// Returns the sharpest key frame of each stretch: the network is slow, neighbours give the same classes, and
/// blurred pictures give worse ones.
fn choose(key_frames: &[KeyFrame]) -> Vec<&KeyFrame> {
    let mut chosen: Vec<&KeyFrame> = Vec::new();
    let mut begin: Option<&KeyFrame> = None;
    for key in key_frames {
        let far = begin.is_none_or(|begin| {
            let step = begin.world_from_camera.inverse() * key.world_from_camera;
            step.translation.vector.norm() >= KEY_DISTANCE_M || step.rotation.angle() >= KEY_ANGLE_RAD
        });
        match chosen.last_mut() {
            Some(sharpest) if !far => {
                if key.sharpness > sharpest.sharpness {
                    *sharpest = key;
                }
            }
            _ => {
                chosen.push(key);
                begin = Some(key);
            }
        }
    }
    chosen
}

/// The class map of a picture that was turned.
struct Turned {
    map: ClassMap,
    turn: QuarterTurn,
}

impl Turned {
    /// Samples the probabilities at a pixel of the picture before its turn.
    fn sample(&self, pixel: [f32; 2], size: [u32; 2], into: &mut [f32; CLASSES]) {
        let [u, v] = self.turn.of_pixel(pixel, size);
        let [width, height] = self.turn.of_size(size).map(|side| side as usize);
        self.map.sample(u, v, width, height, into);
    }
}

/// Returns the centre and radius of each chunk.
fn balls(sites: &Sites) -> Vec<(Point3, f64)> {
    let ball = |chunk: &[Point3]| {
        let sum: Vector3 = chunk.iter().map(|p| p.coords).sum();
        let centre = Point3::from(sum / chunk.len() as f64);
        (centre, chunk.iter().map(|p| (p - centre).norm()).fold(0.0, f64::max))
    };
    sites.positions_m.chunks(CHUNK).map(ball).collect()
}

impl Votes {
    /// Returns the sums of a site, and the number of pictures that see it.
    pub(super) fn of(&self, site: usize) -> ([f32; CLASSES], u16) {
        let sums = &self.sums[site * CLASSES..][..CLASSES];
        (std::array::from_fn(|class| sums[class]), self.views[site])
    }

    fn add(
        &mut self,
        sites: &Sites,
        balls: &[(Point3, f64)],
        frame: &Frame,
        world_from_camera: &Pose3,
        map: &Turned,
    ) {
        let look = Look { frame, camera_from_world: world_from_camera.inverse() };
        let chunks = self.sums.par_chunks_mut(CHUNK * CLASSES).zip(self.views.par_chunks_mut(CHUNK));
        chunks.enumerate().for_each(|(i, (sums, views))| {
            let (centre, radius_m) = &balls[i];
            if !look.may_see(centre, *radius_m) {
                return;
            }
            let mut probabilities = [0f32; CLASSES];
            for (j, (sums, views)) in sums.chunks_exact_mut(CLASSES).zip(views).enumerate() {
                let site = i * CHUNK + j;
                let Some((u, v)) = look.pixel(&sites.positions_m[site], &sites.normals[site]) else {
                    continue;
                };
                let camera = &frame.color_camera;
                map.sample([u, v], [camera.width, camera.height], &mut probabilities);
                let confidence = probabilities.iter().copied().fold(0.0, f32::max);
                for (sum, p) in sums.iter_mut().zip(&probabilities) {
                    *sum += confidence * p;
                }
                *views = views.saturating_add(1);
            }
        });
    }
}

/// One camera's view of the sites.
pub(super) struct Look<'a> {
    pub(super) frame: &'a Frame,
    pub(super) camera_from_world: Pose3,
}

impl Look<'_> {
    /// Returns whether any point of a ball can be in the picture.
    fn may_see(&self, centre: &Point3, radius_m: f64) -> bool {
        let at = self.camera_from_world * centre;
        let camera = &self.frame.depth_camera;
        let (wide, high) = (f64::from(camera.width) / camera.fx, f64::from(camera.height) / camera.fy);
        // Twice the half widths, so that a principal point off the middle does not matter.
        at.z > -radius_m && {
            let reach_m = at.z.max(0.0) + radius_m;
            at.x.abs() - radius_m < reach_m * wide && at.y.abs() - radius_m < reach_m * high
        }
    }

    /// Returns the pixel of a site in the colour picture if the camera sees it: in both pictures, facing the
    /// camera, and at the depth that was measured there.
    pub(super) fn pixel(&self, position_m: &Point3, normal: &Vector3) -> Option<(f32, f32)> {
        let at = self.camera_from_world * position_m;
        if at.z < 0.15 || (self.camera_from_world.rotation * normal).dot(&at.coords) > 0.0 {
            return None;
        }
        let inside = |value: f64, size: u32| value >= -0.5 && value < f64::from(size) - 0.5;
        let camera = &self.frame.depth_camera;
        let (u, v) = (camera.fx * at.x / at.z + camera.cx, camera.fy * at.y / at.z + camera.cy);
        if !inside(u, camera.width) || !inside(v, camera.height) {
            return None;
        }
        let depth_m = f64::from(self.frame.depth.at((u + 0.5) as u32, (v + 0.5) as u32));
        if depth_m <= 0.0 || (depth_m - at.z).abs() > 0.05 + 0.01 * at.z {
            return None;
        }
        let camera = &self.frame.color_camera;
        let (u, v) = (camera.fx * at.x / at.z + camera.cx, camera.fy * at.y / at.z + camera.cy);
        (inside(u, camera.width) && inside(v, camera.height)).then_some((u as f32, v as f32))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::RgbImage;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use viola_formats::clip::{ClipInfo, DepthImage, FrameHeader};
    use viola_geometry::Pinhole;
    use viola_geometry::progress::Silent;

    /// Keeps the number of frames that wait for it beside each picture.
    struct Waiting {
        decoded: Arc<AtomicUsize>,
        segmented: AtomicUsize,
        most: AtomicUsize,
    }

    impl Segmenter for Waiting {
        fn segment(&self, _: &RgbImage) -> Result<ClassMap, SegmentError> {
            let before = self.segmented.fetch_add(1, Ordering::Relaxed);
            self.most.fetch_max(self.decoded.load(Ordering::Relaxed) - before, Ordering::Relaxed);
            let probabilities = vec![1.0 / CLASSES as f32; CLASSES];
            Ok(ClassMap { width: 1, height: 1, align_corners: false, probabilities })
        }

        fn name(&self) -> String {
            "waiting".to_owned()
        }
    }

    #[test]
    fn of_large_pictures_fewer_are_in_memory_at_a_time() {
        for (side, most) in [(640, BATCH), (4000, 3), (9000, 1)] {
            let decoded = Arc::new(AtomicUsize::new(0));
            let camera = Pinhole { width: 4, height: 3, fx: 4.0, fy: 4.0, cx: 1.5, cy: 1.0 };
            let header = |number: u32| FrameHeader {
                number,
                time_s: None,
                world_from_camera: None,
                force_in_camera: None,
            };
            let count = Arc::clone(&decoded);
            let load = move |index: usize| {
                count.fetch_add(1, Ordering::Relaxed);
                Frame {
                    header: header(index as u32),
                    color_camera: camera,
                    color: Some(RgbImage::new(4, 3)),
                    depth_camera: camera,
                    depth: DepthImage { width: 4, height: 3, depth_m: vec![0.0; 12] },
                }
            };
            let info = ClipInfo::in_memory(8, [side, side], [4, 3]);
            let clip = Clip::from_frames(info, (0..8).map(header).collect(), None, load);
            let key = |index: usize| {
                let pose = Pose3::translation(index as f64, 0.0, 0.0);
                KeyFrame { index, ..KeyFrame::blind(pose) }
            };
            let key_frames: Vec<KeyFrame> = (0..8).map(key).collect();
            let recording = Recording { clip: &clip, key_frames: &key_frames, up_in_world: None };
            let segmenter = Waiting { decoded, segmented: AtomicUsize::new(0), most: AtomicUsize::new(0) };
            let params = LabelParams::default();
            let voted = vote(&recording, &Sites::default(), &segmenter, &params, &Silent).unwrap();
            assert_eq!(voted.ok().map(|voted| voted.pictures.len()), Some(8), "{side}");
            assert_eq!(segmenter.most.into_inner(), most, "{side}");
        }
    }
}
