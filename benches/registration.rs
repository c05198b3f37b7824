//! Times registration, view rendering and completion on one thread: `cargo bench`. Maps: simulated flats and,
//! if `VIOLA_TEST_DATA` is set, a real apartment. `cargo bench -- --paper` also times `paper` on the same
//! clips (minutes).

use image::{GrayImage, RgbImage};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;
use viola_align::complete::inpaint::{InpaintError, Inpainter};
use viola_align::complete::monocular::{DepthError, DepthEstimator};
use viola_align::complete::{self, Imagination, View, ViewStrategy};
use viola_align::{Activation, AlignParams, CompleteParams, register_completing};
use viola_geometry::progress::Silent;
use viola_lab::evaluate::{HomeClips, HomesParams, Method, Sample, Scene, SceneClips, Suite, Unit, excerpts};

fn main() {
    let with_paper = std::env::args().any(|argument| argument == "--paper");
    let mut methods = vec![Method::named("viola", 0, None).expect("viola is a method")];
    methods.extend(with_paper.then(|| Method::named("paper", 0, None).expect("paper is a method")));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("one thread can be had");
    pool.install(|| {
        let homes = HomeClips::new(HomesParams { seeds: 1000..1010, ..HomesParams::default() });
        measure("simulated flats, 60 frames", &homes, &methods);
        match std::env::var_os("VIOLA_TEST_DATA") {
            Some(root) => {
                measure("real apartment, 20 frames", &apartment(Path::new(&root)), &methods);
                render(&apartment(Path::new(&root)));
                complete(&apartment(Path::new(&root)));
            }
            None => println!("VIOLA_TEST_DATA is not set: no real apartment"),
        }
    });
}

fn apartment(root: &Path) -> SceneClips {
    let scene = root.join("scannet/scene0000_00");
    let lidar = scene.join("lidar");
    let scene = Scene::open(&scene, &lidar.join("points.csv"), &lidar.join("ground_truth.json"))
        .expect("VIOLA_TEST_DATA names the folder with the data");
    let ranges = excerpts(scene.clip.frames().len(), 20).into_iter().step_by(3).collect();
    SceneClips::new(scene, ranges, Unit::Metres)
}

/// Times rendering of the views that the paper's strategy chooses for the suite's clips.
fn render(suite: &dyn Suite) {
    let params = AlignParams::default();
    let mut milliseconds = Vec::new();
    for index in (0..suite.cases().len()).step_by(3) {
        let sample = suite.sample(index, &params, &Silent).expect("a clip of the suite is observed");
        let Some(Sample { observation, .. }) = sample else { continue };
        let (Some(key), Some(clip_from_world)) = (observation.keys.first(), observation.clip_from_world)
        else {
            continue;
        };
        let voxel_m = observation.cloud_in_clip.voxel_m;
        let points = complete::render::thin(&observation.cloud_in_clip.points, voxel_m);
        let camera = complete::camera_like(key.readings.camera());
        for key in observation.keys.iter().step_by(5) {
            let view = View::of(key, &clip_from_world).back(0.5);
            let begun = Instant::now();
            let rendering = complete::render::render(&points, voxel_m, &camera, &view.clip_from_camera());
            milliseconds.push(begun.elapsed().as_secs_f64() * 1e3);
            assert!(rendering.covered() > 0.0);
        }
    }
    milliseconds.sort_by(f64::total_cmp);
    println!(
        "rendering 512 x 384 of the fused surface: median {:.1} ms, at most {:.1} ms over {} views",
        milliseconds[milliseconds.len() / 2],
        milliseconds[milliseconds.len() - 1],
        milliseconds.len()
    );
}

/// Inpainter of no cost: returns the picture unchanged.
struct Grey;

impl Inpainter for Grey {
    fn inpaint(
        &self,
        picture: &RgbImage,
        _hole: &GrayImage,
        _seed: u64,
        _keep_going: &dyn Fn() -> bool,
    ) -> Result<RgbImage, InpaintError> {
        Ok(picture.clone())
    }

    fn name(&self) -> String {
        "grey".into()
    }
}

/// Depth estimator of no cost: constant depth.
struct Flat;

impl DepthEstimator for Flat {
    fn depth(&self, picture: &RgbImage) -> Result<Vec<f32>, DepthError> {
        Ok(vec![2.0; (picture.width() * picture.height()) as usize])
    }

    fn name(&self) -> String {
        "flat".into()
    }
}

/// Times completion without its networks: structure, and each view.
fn complete(suite: &dyn Suite) {
    let params = AlignParams::default();
    let imagination = Imagination {
        inpainter: Arc::new(Grey),
        estimator: Some(Arc::new(Flat)),
        views: ViewStrategy::StepBack,
        max_views: 6,
    };
    let with = |when, imagination| AlignParams {
        complete: CompleteParams { when, imagination, ..CompleteParams::default() },
        ..params.clone()
    };
    let ways = [
        with(Activation::Never, None),
        with(Activation::Always, None),
        with(Activation::Always, Some(imagination)),
    ];
    let (mut structure, mut views) = (Vec::new(), Vec::new());
    for index in (0..suite.cases().len()).step_by(3) {
        let sample = suite.sample(index, &params, &Silent).expect("a clip of the suite is observed");
        let Some(Sample { observation, target, .. }) = sample else { continue };
        let timed = ways.each_ref().map(|way| {
            let begun = Instant::now();
            let (_, completion) =
                register_completing(&observation, target.as_deref().as_slice(), way, &Silent)
                    .expect("nobody cancels");
            (begun.elapsed().as_secs_f64() * 1e3, completion.map_or(0, |completion| completion.views.len()))
        });
        structure.push(timed[1].0 - timed[0].0);
        if timed[2].1 > 0 {
            views.push((timed[2].0 - timed[1].0) / timed[2].1 as f64);
        }
    }
    for (what, mut milliseconds) in [("structure and registering again", structure), ("each view", views)] {
        milliseconds.sort_by(f64::total_cmp);
        let median = milliseconds.get(milliseconds.len() / 2).copied().unwrap_or(f64::NAN);
        println!(
            "completion, {what}, without networks: median {median:.1} ms over {} clips",
            milliseconds.len()
        );
    }
}

/// Prints the median over clips of each clip's fastest run of three; `paper` runs once.
fn measure(name: &str, suite: &dyn Suite, methods: &[Method]) {
    let params = AlignParams::default();
    let samples: Vec<Sample> = (0..suite.cases().len())
        .filter_map(|index| suite.sample(index, &params, &Silent).expect("a clip of the suite is observed"))
        .collect();
    let mut medians = Vec::new();
    for method in methods {
        let runs = if method.name == "paper" { 1 } else { 3 };
        let mut seconds: Vec<f64> = samples
            .iter()
            .map(|sample| {
                let run = || {
                    let begun = Instant::now();
                    method.register(sample, &Silent).expect("nobody cancels");
                    begun.elapsed().as_secs_f64()
                };
                (0..runs).map(|_| run()).fold(f64::INFINITY, f64::min)
            })
            .collect();
        seconds.sort_by(f64::total_cmp);
        let (low, high) = (seconds[0], seconds[seconds.len() - 1]);
        let median = seconds[seconds.len() / 2];
        medians.push(median);
        println!(
            "{name}, {}: median {:.1} ms, {:.1} to {:.1} ms over {} clips",
            method.name,
            median * 1e3,
            low * 1e3,
            high * 1e3,
            seconds.len()
        );
    }
    if let [viola, paper] = medians[..] {
        println!("{name}: paper / viola = {:.0}", paper / viola);
    }
}
