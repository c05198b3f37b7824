//! Accuracy of point classes against a mesh with labelled vertices.

mod coarse;
mod confusion;
mod floors;
mod objects;
mod simulated;
mod together;
mod truth;

pub use coarse::{COARSE, coarse};
pub(super) use floors::shows_floor;
pub use floors::{FloorRow, floors, floors_markdown};
pub use objects::{FoundFurniture, ObjectsRow};
pub use simulated::simulated;
pub use together::together;
pub use truth::{Folding, Truth, TruthError};

use super::calibration::Calibration;
use super::cells::Cells;
use confusion::Confusion;
use image::RgbImage;
use rustc_hash::{FxHashMap, FxHasher};
use serde::Serialize;
use std::collections::BTreeMap;
use std::hash::{Hash, Hasher};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Instant;
use viola_align as align;
use viola_align::{AlignError, AlignParams};
use viola_formats::clip::Clip;
use viola_geometry::Point3;
use viola_geometry::progress::{Progress, Stage};
use viola_geometry::stopwatch::Stopwatch;
use viola_geometry::taxonomy::CLASSES;
use viola_reconstruct::label::{self, ClassMap, SegmentError, Segmenter};
use viola_reconstruct::{LabelParams, PointCloud};

/// Accuracy of one labelling variant.
#[derive(Debug, Clone, Serialize)]
pub struct LabelRow {
    pub variant: String,
    /// Fraction of the pairs of a labelled vertex and a picture that sees it with the right class; none without
    /// pictures.
    pub pixel_accuracy: Option<f64>,
    /// Fraction of the labelled vertices with the right class; for single frames the mean over vertices of
    /// the fraction of pictures.
    pub voxel_accuracy: f64,
    /// Voxel accuracy with all classes folded to floor, wall or opening, ceiling, and object.
    pub structure_accuracy: f64,
    /// Mean over the classes in the truth.
    pub mean_iou: f64,
    pub iou: BTreeMap<String, f64>,
    /// IoU of walls with their openings: doors, windows, curtains.
    pub wall_or_opening_iou: f64,
    /// Expected calibration error of the points' probabilities; none for single frames.
    pub calibration_error: Option<f64>,
    /// Number of the labelled vertices above; of simulated clips the fused points.
    pub vertices: usize,
    /// Number of the labelled vertices that were seen, but have no fused point near them and do not count above. None if
    /// it is unknown which vertices were seen.
    pub without_point: Option<usize>,
    pub key_frames: usize,
    /// Time of one network pass.
    pub network_ms: Option<f64>,
    /// Rest of the stage, per key frame given to the network (without a network: per fused key frame).
    pub rest_ms_per_key_frame: Option<f64>,
}

/// Maximum distance from a vertex to its labelled point.
const NEAR_M: f64 = 0.06;

/// Returns the rows: geometry alone, and with a network single frames, voting, and voting with its additions.
/// `progress` is called with the name of each variant.
pub fn evaluate(
    clip: &Clip,
    truth: &Truth,
    segmenter: Option<Arc<dyn Segmenter>>,
    params: &AlignParams,
    progress: &dyn Fn(String) -> Box<dyn Progress>,
) -> Result<Vec<LabelRow>, AlignError> {
    let mut rows = Vec::new();
    let segmenter = segmenter.map(Timed::around);
    // The first variant determines the pictures that the network sees.
    let mut views: Option<Vec<u32>> = None;
    let by_shape = params.label.by_shape;
    let augmentations = label::AUGMENTATIONS;
    let variants = [
        ("voting", true, 0, false, false),
        ("voting + augmentation", true, augmentations, false, false),
        ("voting + geometry", true, 0, by_shape, false),
        ("voting + augmentation + geometry", true, augmentations, by_shape, false),
        ("voting + augmentation + volume", true, augmentations, by_shape, true),
        ("geometry", false, 0, by_shape, false),
        ("volume", false, 0, by_shape, true),
    ];
    for (variant, network, augmentations, by_shape, volume) in variants {
        if network && segmenter.is_none() || volume && params.label.surface.is_none() {
            continue;
        }
        let timed = segmenter.clone().filter(|_| network);
        let before_s = timed.as_ref().map_or(0.0, |timed| timed.seconds());
        let label = LabelParams {
            segmenter: timed.clone().map(|timed| timed as Arc<dyn Segmenter>),
            augmentations,
            by_shape,
            surface: params.label.surface.clone().filter(|_| volume),
            ..params.label.clone()
        };
        let progress = progress(variant.to_owned());
        let watch = Stopwatch::around(progress.as_ref(), std::time::Instant::now);
        let observation = align::observe(clip, None, &AlignParams { label, ..params.clone() }, &watch)?;
        let seconds = watch.stop();
        if let (None, Some(segmenter)) = (&views, &segmenter) {
            let single =
                single_frames(clip, &observation.pictures, truth, segmenter.as_ref(), progress.as_ref())?;
            rows.push(single.row(truth));
            views = Some(single.views);
        }
        let Some(clip_from_world) = observation.clip_from_world else { continue };
        let said = Said::of(&observation.cloud_in_clip, truth, |p| clip_from_world * p);
        let key_frames = observation.labels.as_ref().map_or(0, |labels| labels.key_frames);
        let looked_at = if key_frames > 0 { key_frames } else { observation.key_frames };
        let stages = [Stage::Label, Stage::Floor].map(|s| seconds.get(s.name()).copied().unwrap_or(0.0));
        let network_s = timed.as_ref().map_or(0.0, |timed| timed.seconds()) - before_s;
        rows.push(LabelRow {
            variant: variant.to_owned(),
            key_frames,
            network_ms: timed.map(|timed| timed.seconds() * 1e3 / timed.calls().max(1) as f64),
            rest_ms_per_key_frame: Some(
                (stages.iter().sum::<f64>() - network_s) * 1e3 / looked_at.max(1) as f64,
            ),
            ..said.row(truth, views.as_deref())
        });
    }
    Ok(rows)
}

/// A timed segmenter with a cache: every variant shows it the same pictures.
struct Timed {
    inner: Arc<dyn Segmenter>,
    /// By the picture's hash.
    said: Mutex<FxHashMap<u64, ClassMap>>,
    nanoseconds: AtomicU64,
    calls: AtomicU64,
}

impl Timed {
    fn around(inner: Arc<dyn Segmenter>) -> Arc<Timed> {
        Arc::new(Timed {
            inner,
            said: Mutex::default(),
            nanoseconds: AtomicU64::new(0),
            calls: AtomicU64::new(0),
        })
    }

    fn seconds(&self) -> f64 {
        self.nanoseconds.load(Ordering::Relaxed) as f64 * 1e-9
    }

    fn calls(&self) -> u64 {
        self.calls.load(Ordering::Relaxed)
    }
}

impl Segmenter for Timed {
    fn segment(&self, picture: &RgbImage) -> Result<ClassMap, SegmentError> {
        /// Maximum cached class maps, of one or two megabytes each.
        const MAX_CACHED: usize = 1000;
        let mut hasher = FxHasher::default();
        picture.as_raw().hash(&mut hasher);
        let key = hasher.finish();
        let said = || self.said.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        if let Some(map) = said().get(&key) {
            return Ok(map.clone());
        }
        let since = Instant::now();
        let map = self.inner.segment(picture)?;
        self.nanoseconds.fetch_add(since.elapsed().as_nanos() as u64, Ordering::Relaxed);
        self.calls.fetch_add(1, Ordering::Relaxed);
        if said().len() < MAX_CACHED {
            said().insert(key, map.clone());
        }
        Ok(map)
    }

    fn name(&self) -> String {
        self.inner.name()
    }
}

/// Classes that single pictures give the vertices that they see.
struct Single {
    /// Votes of each vertex, by coarse class.
    said: Vec<[u32; COARSE.len()]>,
    /// Number of pictures that see each vertex.
    views: Vec<u32>,
    pictures: usize,
}

fn single_frames(
    clip: &Clip,
    pictures: &[usize],
    truth: &Truth,
    segmenter: &dyn Segmenter,
    progress: &dyn Progress,
) -> Result<Single, AlignError> {
    let count = truth.vertices_m.len();
    let mut single = Single { said: vec![[0; COARSE.len()]; count], views: vec![0; count], pictures: 0 };
    let mut probabilities = [0f32; CLASSES];
    for &index in pictures {
        viola_geometry::progress::check(progress)?;
        let frame = clip.load(index)?;
        let Some(world_from_camera) = frame.header.world_from_camera else { continue };
        let Some(picture) = &frame.color else { continue };
        let Ok(map) = segmenter.segment(picture) else { continue };
        single.pictures += 1;
        let (width, height) = picture.dimensions();
        for (i, vertex) in truth.vertices_m.iter().enumerate() {
            if truth.classes[i].is_none() {
                continue;
            }
            if let Some((u, v)) = label::seen_at(vertex, &frame, &world_from_camera) {
                map.sample(u, v, width as usize, height as usize, &mut probabilities);
                single.said[i][coarse::likeliest(&probabilities)] += 1;
                single.views[i] += 1;
            }
        }
    }
    Ok(single)
}

impl Single {
    fn row(&self, truth: &Truth) -> LabelRow {
        let (mut by_vertex, mut by_pixel, mut vertices) = (Confusion::new(), Confusion::new(), 0);
        for (i, class) in truth.classes.iter().enumerate() {
            let Some(class) = class.filter(|_| self.views[i] > 0) else { continue };
            vertices += 1;
            for (said, &count) in self.said[i].iter().enumerate() {
                by_pixel.add(class, said, f64::from(count));
                by_vertex.add(class, said, f64::from(count) / f64::from(self.views[i]));
            }
        }
        let pixel_accuracy = Some(by_pixel.accuracy(|class| class));
        // Pictures need no points.
        LabelRow {
            key_frames: self.pictures,
            without_point: Some(0),
            ..by_vertex.row("single frames", pixel_accuracy, vertices)
        }
    }
}

/// The class of the nearest labelled point of each vertex.
struct Said {
    classes: Vec<Option<(usize, f32)>>,
}

impl Said {
    fn of(cloud: &PointCloud, truth: &Truth, place: impl Fn(&Point3) -> Point3) -> Said {
        let cells = Cells::new(NEAR_M, cloud.points.iter().map(|point| (point.position(), point)));
        let nearest = |vertex: &Point3| {
            let at = place(vertex);
            let around = cells.around(&at).map(|point| ((point.position() - at).norm(), point.label));
            let near = around.filter(|(distance_m, _)| *distance_m < NEAR_M);
            let (_, label) = near.min_by(|a, b| a.0.total_cmp(&b.0))?;
            Some((coarse(label.class), label.probability()))
        };
        Said { classes: truth.vertices_m.iter().map(nearest).collect() }
    }

    /// Counts the vertices that a picture sees; without `views` all with a point near them.
    fn row(&self, truth: &Truth, views: Option<&[u32]>) -> LabelRow {
        let (mut by_vertex, mut by_pixel, mut answers) = (Confusion::new(), Confusion::new(), Vec::new());
        let mut without_point = 0;
        for (i, class) in truth.classes.iter().enumerate() {
            let seen = views.map_or(1, |views| views[i]);
            let Some(class) = class.filter(|_| seen > 0) else { continue };
            let Some((said, p)) = self.classes[i] else {
                without_point += 1;
                continue;
            };
            answers.push((f64::from(p), class == said));
            by_vertex.add(class, said, 1.0);
            by_pixel.add(class, said, f64::from(seen));
        }
        let pixel_accuracy = views.map(|_| by_pixel.accuracy(|class| class));
        let row = by_vertex.row("", pixel_accuracy, answers.len());
        let calibration = Calibration::of_answers(answers);
        LabelRow {
            calibration_error: calibration.map(|c| c.expected_calibration_error),
            without_point: views.map(|_| without_point),
            ..row
        }
    }
}

/// Returns the rows as a Markdown table.
pub fn markdown(rows: &[LabelRow]) -> String {
    let names: Vec<&str> =
        COARSE.iter().copied().filter(|n| rows.iter().any(|row| row.iou.contains_key(*n))).collect();
    let mut out = format!(
        "| variant | vertices | without a point | pixel | voxel | structure | mean IoU | {} | wall or opening | calibration error | network | rest |\n",
        names.join(" | ")
    );
    out += &format!("|{}\n", "---|".repeat(11 + names.len()));
    let percent = |fraction: f64| format!("{:.1} %", fraction * 100.0);
    for row in rows {
        let classes: Vec<String> =
            names.iter().map(|n| row.iou.get(*n).map_or("-".into(), |iou| format!("{iou:.2}"))).collect();
        let ms = |value: Option<f64>| value.map_or("-".into(), |ms| format!("{ms:.1} ms"));
        out += &format!(
            "| {} | {} | {} | {} | {} | {} | {:.3} | {} | {:.2} | {} | {} | {} |\n",
            row.variant,
            row.vertices,
            row.without_point.map_or("-".into(), |count| count.to_string()),
            row.pixel_accuracy.map_or("-".into(), percent),
            percent(row.voxel_accuracy),
            percent(row.structure_accuracy),
            row.mean_iou,
            classes.join(" | "),
            row.wall_or_opening_iou,
            row.calibration_error.map_or("-".into(), |error| format!("{error:.3}")),
            ms(row.network_ms),
            ms(row.rest_ms_per_key_frame),
        );
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use viola_geometry::Pose3;
    use viola_reconstruct::{CloudPoint, Label};

    /// Four labelled vertices, one metre apart. Points are near the first two, pictures see the first three.
    #[test]
    fn vertices_without_a_point_are_counted() {
        let truth = Truth {
            vertices_m: (0..4).map(|x| Point3::new(f64::from(x), 0.0, 0.0)).collect(),
            classes: vec![Some(0); 4],
        };
        let point = |x: f32| CloudPoint {
            position_m: [x, 0.0, 0.0],
            normal: [0.0, 0.0, 1.0],
            color: [0; 3],
            label: Label::NONE,
            weight: 1,
        };
        let cloud =
            |xs: &[f32]| PointCloud { points: xs.iter().copied().map(point).collect(), voxel_m: 0.03 };
        let said = Said::of(&cloud(&[0.01, 1.02]), &truth, |p| *p);
        for (views, vertices, without_point) in
            [(Some(&[2, 1, 1, 0][..]), 2, Some(1)), (Some(&[0, 1, 0, 0]), 1, Some(0)), (None, 2, None)]
        {
            let row = said.row(&truth, views);
            assert_eq!((row.vertices, row.without_point), (vertices, without_point), "{views:?}");
            assert_eq!(row.pixel_accuracy.is_some(), views.is_some());
        }

        let clips = [(cloud(&[0.0, 2.0, 3.0]), Pose3::identity())];
        let [single, fused] = together(&truth, &clips, &cloud(&[0.0, 1.0]), |p| *p);
        assert_eq!((single.vertices, single.without_point), (1, Some(1)));
        assert_eq!((fused.vertices, fused.without_point), (1, Some(2)));
        let table = markdown(&[fused]);
        assert!(table.contains("\n| fused | 1 | 2 | - | "), "{table}");
    }
}
