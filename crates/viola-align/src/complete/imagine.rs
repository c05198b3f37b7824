//! Completes the cloud view by view: render, fill the picture, complete its depth, fuse. Each view sees the
//! points that earlier views added (paper III-D).

use super::inpaint::{InpaintError, Inpainter};
use super::monocular::DepthEstimator;
use super::structure::Extended;
use super::view::{View, camera_like};
use super::viewpoints::{self, PointSets, ViewParams, ViewStrategy};
use super::{depth, fusion, render};
use crate::AlignError;
use crate::observe::Observation;
use image::{GrayImage, RgbImage};
use std::sync::Arc;
use viola_geometry::Pinhole;
use viola_geometry::progress::{self, Progress};
use viola_geometry::taxonomy::{CLASSES, Class};
use viola_reconstruct::CloudPoint;
use viola_reconstruct::label::Segmenter;

/// Networks and views for the completion of pictures.
#[derive(Clone)]
pub struct Imagination {
    pub inpainter: Arc<dyn Inpainter>,
    /// `None` uses the planes of the walls and the floor.
    pub estimator: Option<Arc<dyn DepthEstimator>>,
    pub views: ViewStrategy,
    pub max_views: usize,
}

impl std::fmt::Debug for Imagination {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Imagination")
            .field("inpainter", &self.inpainter.name())
            .field("estimator", &self.estimator.as_ref().map(|estimator| estimator.name()))
            .field("views", &self.views)
            .field("max_views", &self.max_views)
            .finish()
    }
}

impl PartialEq for Imagination {
    fn eq(&self, other: &Self) -> bool {
        format!("{self:?}") == format!("{other:?}")
    }
}

/// A completed view with its intermediate pictures.
#[derive(Debug, Clone)]
pub struct CompletedView {
    pub view: View,
    pub camera: Pinhole,
    /// The rendered cloud, black without a surface's front or its colour.
    pub rendered: RgbImage,
    /// 255 for filled pixels.
    pub mask: GrayImage,
    pub inpainted: RgbImage,
    /// On a coarser raster; 0 if unknown.
    pub depth_m: Vec<f32>,
    pub depth_camera: Pinhole,
    /// Number of points that it added.
    pub added: usize,
}

/// Result of the imagination.
#[derive(Debug, Clone, Default)]
pub struct Imagined {
    pub points: Vec<CloudPoint>,
    pub views: Vec<CompletedView>,
    pub sets: PointSets,
    /// True if the time budget ended before the last view.
    pub cut_short: bool,
    /// Error of a network, which ended the imagination.
    pub failure: Option<String>,
}

/// Minimum fraction of a view with a colour: with less there is no context.
const MIN_COLORED: f64 = 0.15;
/// Maximum fraction of a view with a surface: with more there is no need for completion.
const MAX_COVERED: f64 = 0.99;

/// Further inputs of the imagination.
pub(super) struct Setting<'a> {
    /// The walls that end rays without a network for depth.
    pub walls: &'a Extended,
    /// Finds the floor in filled pictures.
    pub segmenter: Option<&'a dyn Segmenter>,
    pub vacuum_height_m: f64,
    pub seed: u64,
}

/// Completes `observation`, which has its floor at 0; `given` are the points of earlier completion.
pub(super) fn imagine(
    observation: &Observation,
    given: &[CloudPoint],
    imagination: &Imagination,
    setting: &Setting,
    progress: &dyn Progress,
) -> Result<Imagined, AlignError> {
    let Some(key) = observation.keys.first() else { return Ok(Imagined::default()) };
    let camera = camera_like(key.readings.camera());
    let params = ViewParams {
        strategy: imagination.views,
        vacuum_height_m: setting.vacuum_height_m,
        max_views: imagination.max_views,
    };
    let (views, sets) = viewpoints::views(observation, &camera, &params);
    let voxel_m = observation.cloud_in_clip.voxel_m;
    let known = [observation.cloud_in_clip.points.as_slice(), given].concat();
    let mut surface = render::thin(&known, voxel_m);
    let observed = surface.len();
    let mut imagined = Imagined { sets, ..Imagined::default() };
    for (number, view) in views.iter().enumerate() {
        progress::check(progress)?;
        if progress.out_of_time() {
            imagined.cut_short = true;
            break;
        }
        progress.advance(number as f64 / views.len() as f64);
        let clip_from_camera = view.clip_from_camera();
        let rendering = render::render(&surface, voxel_m, &camera, &clip_from_camera);
        if rendering.colored() < MIN_COLORED || rendering.covered() >= MAX_COVERED {
            continue;
        }
        let mask = rendering.mask();
        let keep_going = || !progress.cancelled();
        let seed = setting.seed.wrapping_add(number as u64);
        let inpainted = match imagination.inpainter.inpaint(&rendering.color, &mask, seed, &keep_going) {
            Ok(inpainted) => inpainted,
            Err(InpaintError::Cancelled) => return Err(AlignError::Cancelled),
            Err(error) => {
                imagined.failure = Some(format!("{}: {error}", imagination.inpainter.name()));
                break;
            }
        };
        let completed = match &imagination.estimator {
            None => Some(depth::by_planes(&rendering, &clip_from_camera, &|eye, ray| {
                setting.walls.first_hit(eye, ray)
            })),
            Some(estimator) => match estimator.depth(&inpainted) {
                Ok(estimated) => {
                    let floor = setting.segmenter.and_then(|segmenter| floor_pixels(segmenter, &inpainted));
                    depth::complete(&rendering, &inpainted, &estimated, floor.as_deref(), &clip_from_camera)
                }
                Err(error) => {
                    imagined.failure = Some(format!("{}: {error}", estimator.name()));
                    break;
                }
            },
        };
        let Some(completed) = completed else { continue };
        let before = surface.len();
        surface.extend(fusion::points(&completed, &inpainted, &clip_from_camera));
        surface = render::thin(&surface, voxel_m);
        imagined.views.push(CompletedView {
            view: *view,
            camera,
            rendered: rendering.color,
            mask,
            inpainted,
            depth_camera: completed.camera,
            depth_m: completed.depth_m,
            added: surface.len() - before,
        });
    }
    let made_up = surface.split_off(observed);
    imagined.points = fusion::without_outliers(made_up, &surface, voxel_m);
    Ok(imagined)
}

/// Returns the pixels that a segmentation labels as floor; `None` if it fails, as depth needs no floor.
fn floor_pixels(segmenter: &dyn Segmenter, picture: &RgbImage) -> Option<Vec<bool>> {
    let map = segmenter.segment(picture).ok()?;
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let mut probabilities = [0f32; CLASSES];
    let floor = (0..width * height).map(|i| {
        map.sample((i % width) as f32, (i / width) as f32, width, height, &mut probabilities);
        probabilities[Class::Floor as usize] + probabilities[Class::Rug as usize] > 0.5
    });
    Some(floor.collect())
}
