//! `viola evaluate`: poses, classes, homes, clips placed together, changes and tracking against a known truth.

mod changes;
mod each_home;
mod home;
mod joint;
mod labels;
mod report;
mod track;
mod unused;

use super::args::{NetworkArguments, numbers};
use super::output;
use super::progress::Steps;
use super::provenance::{commit, program, words};
use anyhow::{Context, Result, bail};
use clap::Args;
use serde::Serialize;
use serde_json::json;
use std::ops::Range;
use std::path::{Path, PathBuf};
use viola_align::{AlignParams, MadeBy};
use viola_geometry::progress::Silent;
use viola_lab::evaluate::{
    self, ClipResult, DrawnClips, DrawnParams, HomeClips, HomesParams, Journal, Method, NoMethod, Run, Scene,
    SceneClips, Suite, SurveyParams, Unit,
};
use viola_lab::simulate::{ClipParams, Set};
use viola_network::manifest::Task;
use viola_reconstruct::{LabelParams, TrackParams};

/// Length of clips by default, in frames.
const DEFAULT_FRAMES: usize = 60;

#[derive(Args)]
#[command(group = clap::ArgGroup::new("source").required(true))]
pub struct EvaluateArguments {
    /// Recording with true poses, in any layout that `viola align` reads.
    #[arg(long, group = "source")]
    scene: Option<PathBuf>,
    /// Sets of simulated homes, instead of a scene: normal, upper, repeated, changed, storeys, drifted,
    /// glass, crowded; separated by commas.
    #[arg(long, group = "source", value_delimiter = ',')]
    set: Vec<Set>,
    /// LiDAR map with free cells, instead of a scene: clips are drawn inside it. May be given several times.
    #[arg(long, group = "source")]
    map: Vec<PathBuf>,
    /// Seeds of the simulated homes; END is excluded.
    #[arg(
        long,
        value_name = "FIRST..END",
        default_value = "1000..1100",
        value_parser = super::align::range::<u64>,
        conflicts_with_all = ["scene", "map"]
    )]
    seeds: Range<u64>,
    /// Least accuracy of labels that simulated pictures get from the truth, 0 to 1: a wrong label may be right by
    /// chance. They replace a network, because simulated pictures are too plain for one.
    #[arg(
        long,
        value_name = "FRACTION",
        value_parser = share,
        conflicts_with_all = ["scene", "map", "labels", "joint", "track"]
    )]
    picture_labels: Option<f64>,
    /// Also align every simulated clip to the map of another home, in which no pose is right.
    #[arg(long, conflicts_with_all = ["scene", "map", "labels", "home", "joint", "changes", "track"])]
    foreign: bool,
    /// Withhold the poses of simulated clips, so that they are tracked by pictures and accelerometer. The
    /// clips then have four times the frame rate.
    #[arg(long, conflicts_with_all = ["scene", "map", "labels", "home", "joint", "changes", "track"])]
    withhold_poses: bool,
    /// Error of the poses of simulated devices after one metre of path, in metres.
    #[arg(
        long,
        default_value_t = ClipParams::default().drift,
        value_parser = numbers::drift_m,
        conflicts_with_all = ["scene", "map", "track"]
    )]
    drift: f64,
    /// Multiply poses and depth of each clip by a factor between 0.2 and 5, drawn at random, and withhold their unit.
    #[arg(long, conflicts_with_all = ["map", "labels", "home", "joint", "changes", "track", "fit"])]
    rescale: bool,
    /// Multiply poses and depth of each clip by this factor, and say that they are metres.
    #[arg(
        long,
        value_name = "FACTOR",
        value_parser = numbers::factor,
        conflicts_with_all = ["map", "labels", "home", "joint", "changes", "track", "fit", "rescale"]
    )]
    wrong_scale: Option<f64>,
    /// Use the poses of devices without refinement, even if they drift.
    #[arg(long, conflicts_with_all = ["map", "labels", "home", "joint", "changes", "track"])]
    keep_poses: bool,
    /// Fit the model to this run's results and write it to FILE: the weights of the loss, the temperature and
    /// the coefficients of the probability (`crates/viola-align/src/score/model.json`).
    #[arg(long, value_name = "FILE")]
    fit: Option<PathBuf>,
    /// LiDAR map of the scene; by default it is simulated from the mesh in SCENE/mesh.
    #[arg(long, requires = "truth", conflicts_with_all = ["set", "map", "labels", "track"])]
    lidar: Option<PathBuf>,
    /// JSON file with the true map_from_world {x_m, y_m, yaw_rad}.
    #[arg(long, requires = "lidar", conflicts_with_all = ["set", "map", "labels", "track"])]
    truth: Option<PathBuf>,
    /// Lengths of the clips in frames, separated by commas; default: 60. For each length, the scene is cut into half-overlapping excerpts.
    #[arg(long, value_delimiter = ',', value_parser = numbers::frames)]
    frames: Vec<usize>,
    /// Number of clips. Scene: excerpts of each length, drawn at random. Simulated: clips of each home,
    /// default 3 (1 with --track, 14 with --joint, 6 with --changes, none with --home). Map: clips of each map, default 10.
    #[arg(long, value_parser = numbers::clips, conflicts_with_all = ["labels"])]
    clips: Option<usize>,
    /// Evaluate the classes of points, instead of poses: of a scene against its labelled mesh, of simulated
    /// clips against the true surface, one clip of each length for each home.
    #[arg(long, conflicts_with_all = ["map", "fit"])]
    labels: bool,
    /// Evaluate the fused map, its rooms and its objects, instead of poses: for a scene against its labelled
    /// mesh, for simulated homes against their truth. The points of simulated homes are sampled from the true surface
    /// of all rooms, without clips, fusion and errors of poses, unless --clips gives a number of clips of each home; these are
    /// mapped as `viola map` does. Aligned clips in the output folder are not aligned again.
    #[arg(long, conflicts_with_all = ["map", "labels", "fit"])]
    home: bool,
    /// Evaluate the clips of simulated homes placed together, instead of each by itself: --clips of each home
    /// (default 14), of one length. Aligned clips in the output folder are not aligned again.
    #[arg(long, conflicts_with_all = ["scene", "map", "labels", "home", "fit"])]
    joint: bool,
    /// Evaluate the changes of objects that the maps of simulated homes report. Homes of the set `changed` are filmed
    /// in two visits of --clips each (default 6); in the others nothing changes, and their maps grow clip by clip.
    /// Aligned clips in the output folder are not aligned again.
    #[arg(long, conflicts_with_all = ["scene", "map", "labels", "home", "joint", "fit"])]
    changes: bool,
    /// Evaluate camera tracking by pictures alone against the clip's poses, instead of the alignment.
    #[arg(long, conflicts_with_all = ["map", "labels", "home", "joint", "changes", "fit"])]
    track: bool,
    /// With --track: poses of the scene's frames by other programs, in the format of benches/peers/track.py.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["set", "map"])]
    trajectories: Vec<PathBuf>,
    #[command(flatten)]
    networks: NetworkArguments,
    /// Names of the methods to compare, separated by commas. A wrong name lists all.
    #[arg(
        long,
        default_value = "viola",
        value_delimiter = ',',
        conflicts_with_all = ["labels", "home", "joint", "changes", "track"]
    )]
    methods: Vec<String>,
    /// Output folder for tables, plots and pictures. Results of poses that it already has are not computed again.
    #[arg(long)]
    out: PathBuf,
    /// Seed of the random draws: excerpts, clips in a map, samples of RANSAC.
    #[arg(long, default_value_t = 0, value_parser = numbers::seed, allow_negative_numbers = true)]
    seed: u64,
    /// Number of clips in parallel, each on one thread; default: the number of cores.
    #[arg(
        long,
        value_parser = numbers::threads,
        conflicts_with_all = ["labels", "home", "joint", "changes", "track"]
    )]
    threads: Option<usize>,
}

impl EvaluateArguments {
    /// Returns the lengths of the clips in frames.
    fn lengths(&self) -> Vec<usize> {
        if self.frames.is_empty() { vec![DEFAULT_FRAMES] } else { self.frames.clone() }
    }

    /// Returns the unit of the clips.
    fn unit(&self) -> Unit {
        match self.wrong_scale {
            Some(factor) => Unit::Wrong(factor),
            None if self.rescale => Unit::Withheld,
            None => Unit::Metres,
        }
    }

    /// Returns the first length, for evaluations of clips of one length.
    fn first_length(&self) -> usize {
        self.frames.first().copied().unwrap_or(DEFAULT_FRAMES)
    }
}

pub fn run(arguments: &EvaluateArguments) -> Result<()> {
    unused::refuse(arguments).unwrap_or_else(|error| error.exit());
    let out = &arguments.out;
    if arguments.labels {
        return match &arguments.scene {
            Some(scene) => labels::scene(arguments, scene),
            None => labels::simulated(arguments),
        };
    }
    if arguments.track {
        return track::run(arguments);
    }
    if arguments.joint {
        return joint::run(arguments);
    }
    if arguments.changes {
        return changes::run(arguments);
    }
    if arguments.home {
        return match &arguments.scene {
            Some(scene) => home::scene(arguments, scene),
            None => home::simulated(arguments),
        };
    }
    let mut methods = methods(arguments)?;
    if arguments.fit.is_some() {
        methods.iter_mut().for_each(Method::list_all);
    }
    let pictures = out.join("failed");
    output::folder(&pictures)?;
    let suite = suite(arguments)?;
    if suite.cases().is_empty() {
        bail!("there are no clips: the recording is shorter than the lengths asked for");
    }
    let networks = &arguments.networks;
    let label = match () {
        () if arguments.scene.is_some() => networks.labels()?,
        // Drawn clips have no surface.
        () if !arguments.map.is_empty() => LabelParams::default(),
        () => networks.surface_labels()?,
    };
    let track = TrackParams { refine: !arguments.keep_poses, ..TrackParams::default() };
    let observe = AlignParams { seed: arguments.seed, label, track, ..AlignParams::default() };
    let workers = match arguments.threads {
        Some(threads) => threads,
        None => std::thread::available_parallelism()?.get(),
    };
    let journal = Journal::open(&out.join("results.jsonl"))?;
    let run = Run {
        suite: suite.as_ref(),
        methods: &methods,
        observe: &observe,
        workers,
        journal: Some(&journal),
        program: &format!("{} {}", program()?, networks.content(&tasks(arguments))?),
        pictures: Some(&pictures),
    };
    let steps = Steps::new(run.total() as u64);
    let results = run.results(&Silent, &|result| steps.advance(&report::line(result)))?;
    drop(steps);
    if let Some(path) = &arguments.fit {
        fit(arguments, &results, path)?;
    }
    let left_out = run.left_out(&results);
    if results.is_empty() {
        bail!("none of the {left_out} clips has a true pose");
    }
    let measured = report::Measured {
        labels_by: report::labels_by(arguments, &observe.label),
        workers: (journal.found() == 0).then_some(workers),
        left_out,
    };
    report::write_all(arguments, &measured, &results)
}

/// Fits the model to the results and writes it.
fn fit(arguments: &EvaluateArguments, results: &[ClipResult], path: &Path) -> Result<()> {
    let fitted_to =
        format!("{}, clips of {:?} frames, {} clips", source(arguments), arguments.lengths(), results.len());
    let made_by =
        MadeBy { command: words().collect::<Vec<_>>().join(" "), fitted_to, commit: commit(), note: None };
    let model = evaluate::fit(results, made_by)
        .context("the probability cannot be fitted: the results are all right or all wrong")?;
    output::write_bytes(path, serde_json::to_string_pretty(&model)? + "\n")
}

/// Returns the source of the clips, for the fitted model.
fn source(arguments: &EvaluateArguments) -> String {
    if let Some(scene) = &arguments.scene {
        return format!("scene {}", scene.display());
    }
    if !arguments.map.is_empty() {
        let maps: Vec<String> = arguments.map.iter().map(|map| map.display().to_string()).collect();
        return format!("maps {}", maps.join(", "));
    }
    let sets: Vec<&str> = arguments.set.iter().map(|set| set.name()).collect();
    format!("sets {}, seeds {:?}", sets.join(", "), arguments.seeds)
}

/// Returns whether a method needs the networks for inpainting and depth.
fn needs_imagination(arguments: &EvaluateArguments) -> bool {
    let needs =
        |name: &String| matches!(Method::named(name, arguments.seed, None), Err(NoMethod::NeedsNetworks(_)));
    arguments.methods.iter().any(needs)
}

/// Returns the tasks of the networks that poses depend on.
fn tasks(arguments: &EvaluateArguments) -> Vec<Task> {
    let mut tasks = Vec::new();
    if arguments.map.is_empty() {
        tasks.push(Task::Surface);
    }
    if arguments.scene.is_some() {
        tasks.push(Task::Segmentation);
    }
    if needs_imagination(arguments) {
        tasks.extend([Task::Inpainting, Task::Depth]);
    }
    tasks
}

fn methods(arguments: &EvaluateArguments) -> Result<Vec<Method>> {
    // Loaded only if a method needs them: a checkpoint may take gigabytes.
    let imagination = if needs_imagination(arguments) { arguments.networks.imagination()? } else { None };
    let method = |name: &String| Ok(Method::named(name, arguments.seed, imagination.as_ref())?);
    arguments.methods.iter().map(method).collect()
}

fn suite(arguments: &EvaluateArguments) -> Result<Box<dyn Suite>> {
    if let Some(path) = &arguments.scene {
        return scene(arguments, path);
    }
    if !arguments.map.is_empty() {
        let params = DrawnParams {
            seed: arguments.seed,
            clips: arguments.clips.unwrap_or(DrawnParams::default().clips),
            frames: arguments.lengths(),
            ..DrawnParams::default()
        };
        return Ok(Box::new(DrawnClips::open(&arguments.map, params)?));
    }
    Ok(Box::new(HomeClips::new(homes(arguments))))
}

fn homes(arguments: &EvaluateArguments) -> HomesParams {
    HomesParams {
        sets: arguments.set.clone(),
        seeds: arguments.seeds.clone(),
        clips_per_home: arguments.clips.unwrap_or(default_clips(arguments)) as u64,
        frames: arguments.lengths(),
        picture_labels: arguments.picture_labels,
        foreign: arguments.foreign,
        withhold_poses: arguments.withhold_poses,
        drift: arguments.drift,
        unit: arguments.unit(),
    }
}

fn default_clips(arguments: &EvaluateArguments) -> usize {
    match () {
        () if arguments.joint => 14,
        () if arguments.changes => 6,
        () => 3,
    }
}

/// Returns the scene with the given LiDAR map, or with one cut out of its mesh.
fn scene_of(arguments: &EvaluateArguments, path: &Path) -> Result<Scene> {
    if let (Some(lidar), Some(truth)) = (&arguments.lidar, &arguments.truth) {
        return Ok(Scene::open(path, lidar, truth)?);
    }
    let params = SurveyParams { seed: arguments.seed, ..SurveyParams::default() };
    let (scene, survey) = Scene::open_with_mesh(path, &params)?;
    // Saved so that it can be inspected, and reused by --lidar and --truth.
    save(&arguments.out, "lidar.csv", &survey.points_csv())?;
    let truth = json!({
        "map_from_world": survey.map_from_world,
        "vacuum_height_m": params.height_m,
        "floor_in_world_m": survey.floor_m,
        "sensors_in_map": survey.sensors_m.iter().map(|s| [s.x, s.y]).collect::<Vec<_>>(),
    });
    save_json(&arguments.out, "lidar_truth.json", &truth)?;
    Ok(scene)
}

fn scene(arguments: &EvaluateArguments, path: &Path) -> Result<Box<dyn Suite>> {
    let scene = scene_of(arguments, path)?;
    let total = scene.clip.frames().len();
    let cut = |length: &usize| match arguments.clips {
        Some(count) => evaluate::random_excerpts(total, *length, count, arguments.seed),
        None => evaluate::excerpts(total, *length),
    };
    let ranges = arguments.lengths().iter().flat_map(cut).collect();
    Ok(Box::new(SceneClips::new(scene, ranges, arguments.unit())))
}

fn share(text: &str) -> Result<f64, String> {
    let share = text.parse::<f64>().map_err(|error| error.to_string())?;
    if (0.0..=1.0).contains(&share) { Ok(share) } else { Err(format!("{text} is not between 0 and 1")) }
}

fn save(out: &Path, name: &str, text: &str) -> Result<()> {
    output::write_bytes(&out.join(name), text)
}

fn save_json(out: &Path, name: &str, value: &impl Serialize) -> Result<()> {
    save(out, name, &serde_json::to_string_pretty(value)?)
}

/// Saves a table and prints it.
fn save_table(out: &Path, name: &str, table: &str) -> Result<()> {
    save(out, name, table)?;
    print!("{table}");
    Ok(())
}
