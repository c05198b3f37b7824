//! `viola evaluate --track`: evaluates the tracking of clips by their pictures alone.

use super::{EvaluateArguments, save_json, save_table};
use crate::cli::output;
use crate::cli::progress::print_line;
use anyhow::{Context, Result, ensure};
use std::fs;
use std::path::Path;
use viola_formats::clip::{Clip, Frame};
use viola_geometry::Pose3;
use viola_lab::evaluate::track::{Foreign, TrackRow, foreign, markdown, ours, summary};
use viola_lab::simulate::{ClipParams, Home, HomeParams};
use viola_reconstruct::TrackParams;

/// Frame rate of simulated recordings.
const RATE_HZ: f64 = 10.0;
/// Number of frames decoded at a time.
const BATCH: usize = 16;

/// Writes `track.json` and `track.md`.
pub fn run(arguments: &EvaluateArguments) -> Result<()> {
    let out = &arguments.out;
    output::folder(out)?;
    let params = TrackParams { seed: arguments.seed, ..TrackParams::default() };
    let (rows, mut text) = match &arguments.scene {
        Some(path) => {
            let rows = scene(path, &arguments.trajectories, &params)?;
            (rows, String::new())
        }
        None => simulated(arguments, &params)?,
    };
    text += &markdown(&rows);
    save_json(out, "track.json", &rows)?;
    save_table(out, "track.md", &text)
}

fn scene(path: &Path, trajectories: &[std::path::PathBuf], params: &TrackParams) -> Result<Vec<TrackRow>> {
    let clip = Clip::open(path).with_context(|| format!("clip {}", path.display()))?;
    let name = path.file_name().map_or("clip".into(), |name| name.to_string_lossy().into_owned());
    let truth: Vec<Option<Pose3>> = clip.frames().iter().map(|frame| frame.world_from_camera).collect();
    let mut stream = clip.stream((0..truth.len()).collect());
    let mut frames: Vec<Frame> = Vec::new();
    while frames.len() < truth.len() {
        let batch = stream.next_batch(BATCH);
        ensure!(!batch.is_empty(), "the clip ended early");
        frames.extend(batch.into_iter().collect::<Result<Vec<_>, _>>()?);
    }
    let params = TrackParams { shutter: clip.shutter(), ..params.clone() };
    let mut rows = ours(&name, &frames, &truth, &params)?;
    for file in trajectories {
        let text = fs::read_to_string(file).with_context(|| format!("cannot read {}", file.display()))?;
        let others: Vec<Foreign> =
            serde_json::from_str(&text).with_context(|| format!("{} has no trajectories", file.display()))?;
        let before = rows.len();
        for other in others.iter().filter(|other| other.clip == name) {
            let (poses, frames) = (other.poses.len(), truth.len());
            ensure!(poses == frames, "{} has {poses} poses; {name} has {frames} frames", file.display());
            rows.push(foreign(other, &truth));
        }
        ensure!(rows.len() > before, "{} has no poses of the clip {name}", file.display());
    }
    Ok(rows)
}

/// Tracks clips of simulated homes without the device's poses; returns the rows and a table by sets.
fn simulated(arguments: &EvaluateArguments, params: &TrackParams) -> Result<(Vec<TrackRow>, String)> {
    let frames = arguments.first_length();
    let (mut rows, mut text) = (Vec::new(), String::new());
    for &set in &arguments.set {
        let mut of_set = Vec::new();
        for seed in arguments.seeds.clone() {
            let home = Home::generate(&HomeParams::new(set, seed));
            let survey = home.survey();
            for number in 0..arguments.clips.unwrap_or(1) as u64 {
                let recording = ClipParams { frames, rate_hz: RATE_HZ, ..ClipParams::default() };
                let clip = home.clip(&survey, number, &recording);
                let rendered: Vec<Frame> = (0..frames).map(|index| clip.frame(index)).collect();
                let truth: Vec<_> = clip.truth.home_from_camera.iter().copied().map(Some).collect();
                let name = format!("{} {seed:06}_{number}", set.name());
                let of_clip = ours(&name, &rendered, &truth, params)?;
                markdown(&of_clip).lines().skip(2).take(2).for_each(print_line);
                of_set.extend(of_clip);
            }
        }
        text += &format!("{}, {frames} frames at {RATE_HZ} Hz:\n\n{}\n", set.name(), summary(&of_set));
        rows.extend(of_set);
    }
    Ok((rows, text))
}
