//! Classes of points: true labels of pictures give the true classes, and shapes, floor and answer use them.

use image::RgbImage;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use viola_align as align;
use viola_align::{AlignParams, Observation};
use viola_formats::clip::Clip;
use viola_geometry::Pose3;
use viola_geometry::progress::Silent;
use viola_geometry::taxonomy::Class;
use viola_lab::evaluate::Oracle;
use viola_lab::simulate::{ClipParams, Home, HomeParams, Sensor, Set, SimulatedClip, clip_in_memory};
use viola_network::RuntimeParams;
use viola_network::manifest::Manifest;
use viola_reconstruct::label::{ClassMap, Labeller, SegmentError, Segmenter, SurfaceNetwork, label_map};
use viola_reconstruct::{Label, LabelParams};
use viola_testing::process::viola;

fn simulated(set: Set, seed: u64, frames: usize) -> Arc<SimulatedClip> {
    let home = Home::generate(&HomeParams::new(set, seed));
    let survey = home.survey();
    let color_width = Sensor::PhoneLidar.depth_camera().width;
    let params = ClipParams { frames, color_width, ..ClipParams::default() };
    Arc::new(home.clip(&survey, 0, &params))
}

/// Fails on all pictures, and counts them.
#[derive(Default)]
struct Broken(AtomicUsize);

impl Segmenter for Broken {
    fn segment(&self, _: &RgbImage) -> Result<ClassMap, SegmentError> {
        self.0.fetch_add(1, Ordering::Relaxed);
        Err(SegmentError::NotFinite)
    }

    fn name(&self) -> String {
        "broken".into()
    }
}

/// Fails on the second picture.
struct Flaky {
    oracle: Arc<Oracle>,
    asked: AtomicUsize,
}

impl Segmenter for Flaky {
    fn segment(&self, picture: &RgbImage) -> Result<ClassMap, SegmentError> {
        match self.asked.fetch_add(1, Ordering::Relaxed) {
            1 => Err(SegmentError::NotFinite),
            _ => self.oracle.segment(picture),
        }
    }

    fn name(&self) -> String {
        "flaky".into()
    }
}

fn observe(clip: &Clip, label: LabelParams) -> Observation {
    align::observe(clip, None, &AlignParams { label, ..AlignParams::default() }, &Silent).unwrap()
}

/// Returns the fraction of the seen points for which `right` holds, without those for which it is `None`.
fn share(seen: &Observation, right: impl Fn(Class, f32) -> Option<bool>) -> f64 {
    let points = seen.cloud_in_clip.points.iter().filter(|p| p.label.views > 0);
    let judged: Vec<bool> = points.filter_map(|p| right(p.label.class, p.position_m[2])).collect();
    assert!(judged.len() > 1000, "{}", judged.len());
    judged.iter().filter(|right| **right).count() as f64 / judged.len() as f64
}

#[test]
fn true_pictures_give_true_classes() {
    for (set, seed) in [(Set::Normal, 6), (Set::Changed, 8)] {
        let (clip, oracle) = Oracle::with_clip(simulated(set, seed, 12), 1.0, 0);
        for by_shape in [false, true] {
            let label = LabelParams { segmenter: Some(oracle.clone()), by_shape, ..LabelParams::default() };
            let seen = observe(&clip, label);
            let report = seen.labels.clone().unwrap();
            assert_eq!(report.by, oracle.name());
            assert!(report.key_frames > 0 && report.key_frames == seen.pictures.len());
            // Points labelled floor lie at the floor; by shape also level points lower than a step.
            let at_floor_m = if by_shape { 0.12 } else { 0.06 };
            let floor = share(&seen, |class, z| (class == Class::Floor).then_some(z.abs() <= at_floor_m));
            assert!(floor > 0.97, "{set:?} {by_shape}: {floor}");
            // No point at the height of furniture is labelled ceiling; these homes have no attic.
            let low = share(&seen, |class, z| {
                (class == Class::Ceiling || z < 1.9).then_some(z > 1.9 || class != Class::Ceiling)
            });
            assert!(low > 0.999, "{set:?} {by_shape}: {low}");
        }
    }
}

/// The same clip labelled from true pictures and by shape alone.
#[test]
fn shapes_alone_agree_with_the_truth() {
    let (clip, oracle) = Oracle::with_clip(simulated(Set::Normal, 6, 12), 1.0, 0);
    let oracle = LabelParams { segmenter: Some(oracle), by_shape: false, ..LabelParams::default() };
    let (truth, shapes) = (observe(&clip, oracle), observe(&clip, LabelParams::default()));
    assert_eq!(shapes.labels.unwrap().by, "geometry");
    let (mut both, mut either) = ([0u32; 2], [0u32; 2]);
    for (t, s) in truth.cloud_in_clip.points.iter().zip(&shapes.cloud_in_clip.points) {
        if t.label.views == 0 {
            continue;
        }
        let opening = |class: Class| {
            matches!(class, Class::Wall | Class::Door | Class::Window | Class::Curtain | Class::Picture)
        };
        for (i, is_in) in [|c: Class| c == Class::Floor || c == Class::Rug, opening].into_iter().enumerate() {
            let (t, s) = (is_in(t.label.class), is_in(s.label.class));
            both[i] += u32::from(t && s);
            either[i] += u32::from(t || s);
        }
    }
    let iou = [0, 1].map(|i| f64::from(both[i]) / f64::from(either[i]));
    // The thresholds for the real apartment: 0.85 and 0.65.
    assert!(iou[0] >= 0.85 && iou[1] >= 0.65, "{iou:?}");
}

#[test]
fn a_network_that_fails_leaves_geometry_and_a_reason() {
    let clip = clip_in_memory(simulated(Set::Normal, 3, 6));
    let plain = observe(&clip, LabelParams::default());
    let failed = LabelParams { segmenter: Some(Arc::new(Broken::default())), ..LabelParams::default() };
    let absent = LabelParams { unavailable: Some("it is gone".into()), ..LabelParams::default() };
    let broken = LabelParams { surface: Some(surface_network("columns_nan.onnx")), ..LabelParams::default() };
    for (label, code) in
        [(failed, "network_failed"), (absent, "network_unavailable"), (broken, "network_failed")]
    {
        let seen = observe(&clip, label);
        assert_eq!(seen.labels.as_ref().unwrap().by, "geometry");
        assert!(seen.reasons.iter().any(|reason| reason.code == code), "{:?}", seen.reasons);
        assert_eq!(seen.cloud_in_clip, plain.cloud_in_clip);
    }
}

#[test]
fn surface_above_the_slices_of_the_network_is_no_failure() {
    let clip = clip_in_memory(simulated(Set::Normal, 3, 6));
    let mut cloud = observe(&clip, LabelParams::default()).cloud_in_clip;
    let params = LabelParams { surface: Some(surface_network("columns.onnx")), ..LabelParams::default() };
    let labeller = Labeller::segment_pictures(&clip, &mut cloud, &[], None, &params, &Silent).unwrap();
    let labelled = labeller.add_shapes(&mut cloud, &Pose3::translation(0.0, 0.0, 9.0), &params);
    assert_eq!((labelled.report.by.as_str(), labelled.remark), ("geometry", None));
}

#[test]
fn a_picture_on_which_the_network_fails_leaves_the_other_pictures() {
    let (clip, oracle) = Oracle::with_clip(simulated(Set::Normal, 6, 12), 1.0, 0);
    let with = |segmenter: Arc<dyn Segmenter>| {
        observe(&clip, LabelParams { segmenter: Some(segmenter), ..LabelParams::default() })
    };
    let whole = with(oracle.clone());
    let seen = with(Arc::new(Flaky { oracle, asked: AtomicUsize::new(0) }));
    let mut pictures = whole.pictures.clone();
    pictures.remove(1);
    assert_eq!(seen.pictures, pictures);
    let report = seen.labels.clone().unwrap();
    assert_eq!((report.by.as_str(), report.key_frames), ("flaky", pictures.len()));
    let failed = seen.reasons.iter().find(|reason| reason.code == "network_failed").unwrap();
    assert!(failed.detail.contains(&format!("without 1 of {} pictures", whole.pictures.len())), "{failed:?}");
    let pictured =
        |seen: &Observation| seen.cloud_in_clip.points.iter().filter(|p| p.label.views > 0).count();
    assert!(2 * pictured(&seen) > pictured(&whole), "{} of {}", pictured(&seen), pictured(&whole));
    assert!(whole.reasons.iter().all(|reason| reason.code != "network_failed"), "{:?}", whole.reasons);
    // After three failures the others are not tried: each may take seconds.
    let broken = Arc::new(Broken::default());
    assert!(whole.pictures.len() > 3 && with(broken.clone()).pictures.is_empty(), "{:?}", whole.pictures);
    assert_eq!(broken.0.load(Ordering::Relaxed), 3);
}

fn surface_network(file: &str) -> Arc<SurfaceNetwork> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/models").join(file);
    let network = viola_network::open(&path, &RuntimeParams::default()).unwrap();
    let manifest = Manifest::built_in().unwrap();
    Arc::new(SurfaceNetwork::new(manifest.find("columns").unwrap(), network).unwrap())
}

/// A network of random weights says nothing sensible, but of every point.
#[test]
fn a_surface_network_labels_without_pictures() {
    let clip = clip_in_memory(simulated(Set::Normal, 3, 6));
    let label = LabelParams { surface: Some(surface_network("columns.onnx")), ..LabelParams::default() };
    let (seen, plain) = (observe(&clip, label), observe(&clip, LabelParams::default()));
    assert!(seen.labels.unwrap().by.starts_with("columns, "));
    assert_ne!(seen.cloud_in_clip, plain.cloud_in_clip);
    // The floor and the scan do not depend on it.
    assert_eq!((seen.floor, seen.scan), (plain.floor, plain.scan));
}

/// Pictures that leave two classes open: the network's answer for the map decides.
#[test]
fn a_surface_network_votes_beside_the_pictures_of_a_map() {
    let network = surface_network("columns.onnx");
    let seen = observe(&clip_in_memory(simulated(Set::Normal, 3, 6)), LabelParams::default()).cloud_in_clip;
    let labels = |label: Label| {
        let mut map = seen.clone();
        map.points.iter_mut().for_each(|point| point.label = label);
        label_map(&map, map.points.len(), Some(&network)).labels
    };
    let by_network = labels(Label::NONE);
    let mut decided = 0;
    for (one, other) in
        [(Class::Sofa, Class::Chair), (Class::Bed, Class::Plant), (Class::Chair, Class::Toilet)]
    {
        let open = Label::new(one, 0.5, 3).with_others([(other, 0.5)]);
        for (label, heard) in labels(open).iter().zip(&by_network) {
            let fraction = |class| heard.fractions().find(|(said, _)| *said == class).map_or(0, |(_, f)| f);
            let (p, q) = (fraction(one), fraction(other));
            if p.abs_diff(q) > 2 {
                decided += 1;
                assert_eq!(label.class, if p > q { one } else { other }, "{p} {q}");
            }
        }
    }
    assert!(decided > 100, "{decided}");
}

/// The answer must not depend on the number of threads.
#[test]
fn threads_change_nothing() {
    let (clip, oracle) = Oracle::with_clip(simulated(Set::Normal, 4, 6), 1.0, 0);
    let surface = surface_network("columns.onnx");
    let with = |threads: usize| {
        let (segmenter, surface) = (Some(oracle.clone() as Arc<dyn Segmenter>), Some(surface.clone()));
        let label = LabelParams { segmenter, surface, ..LabelParams::default() };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| observe(&clip, label).cloud_in_clip)
    };
    let one = with(1);
    assert!(one.points.iter().any(|point| point.label.views > 0));
    assert_eq!(one, with(3));
}

#[test]
fn a_broken_model_file_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let model = std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/models/segformer.onnx")).unwrap();
    std::fs::write(folder.path().join("mine.onnx"), &model[..model.len() / 2]).unwrap();
    std::fs::write(
        folder.path().join("models.toml"),
        "[[network]]\nname = \"mine\"\ntask = \"segmentation\"\nfile = \"mine.onnx\"\nlicence = \"none\"\n\
         source = { kind = \"export\", how = \"made by a test\" }\nclasses = \"ade20k\"\n\
         input = { width = \"any\", height = \"any\" }\noutput = { kind = \"logits\" }\n",
    )
    .unwrap();
    let output = viola()
        .args(["align", "--clip", "no.zip", "--lidar", "no.csv", "--out"])
        .arg(folder.path().join("out"))
        .arg("--models")
        .arg(folder.path())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success() && said.contains("mine"), "{said}");
}
