//! `viola simulate`: writes a furnished home with its vacuum's map and clips to a folder.

use super::args::numbers;
use super::output;
use super::progress::print_line;
use anyhow::{Result, bail};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use viola_lab::simulate::{
    Catalogue, ClipParams, Home, HomeParams, Sensor, Set, SimulatedClip, plan_png, points_csv, ros_pgm,
    ros_yaml, valetudo_json, write_scannet_zip,
};

/// More clips than one home needs; each is a file of megabytes.
const MAX_CLIPS: u64 = 999;
/// The files beside the clips.
const FILES: [&str; 6] = ["truth.json", "valetudo.json", "map.yaml", "map.pgm", "points.csv", "plan.png"];

#[derive(clap::Args)]
pub struct SimulateArguments {
    /// Kind of homes: normal, upper, repeated, changed, storeys (the ground floor), drifted,
    /// glass, crowded.
    #[arg(long, default_value = "normal")]
    set: Set,
    /// Seed of the simulated home.
    #[arg(long, default_value_t = 1, value_parser = numbers::seed, allow_negative_numbers = true)]
    seed: u64,
    /// Number of clips.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u64).range(..=MAX_CLIPS))]
    clips: u64,
    /// Frames of each clip.
    #[arg(long, default_value_t = 60, value_parser = numbers::frames)]
    frames: usize,
    /// Depth sensor: phone-lidar, structured-light.
    #[arg(long, default_value = "phone-lidar")]
    sensor: Sensor,
    /// Error of the device's poses after one metre of path, in metres.
    #[arg(long, default_value_t = ClipParams::default().drift, value_parser = numbers::drift_m)]
    drift: f64,
    /// Folder of furniture meshes, which replace pieces of the same class and a similar size: CLASS-NAME.ply in metres,
    /// the width along x, the back at +y, z up.
    #[arg(long, value_name = "DIR")]
    furniture: Option<PathBuf>,
    /// Output folder, created if it is missing.
    #[arg(long)]
    out: PathBuf,
}

pub fn run(arguments: &SimulateArguments) -> Result<()> {
    let out = &arguments.out;
    output::folder(out)?;
    refuse_files_of_others(out, arguments.clips, earlier_clips(out))?;
    print_line("making a home and mapping it with its vacuum");
    let catalogue = arguments.furniture.as_deref().map(Catalogue::open).transpose()?.unwrap_or_default();
    let home = Home::furnished(&HomeParams::new(arguments.set, arguments.seed), &catalogue);
    let survey = home.survey();
    let params = ClipParams {
        frames: arguments.frames,
        sensor: arguments.sensor,
        drift: arguments.drift,
        ..ClipParams::default()
    };
    let film = |index: u64| {
        print_line(&format!("filming clip {} of {}", index + 1, arguments.clips));
        home.clip(&survey, index, &params)
    };
    let clips: Vec<SimulatedClip> = (0..arguments.clips).map(film).collect();
    let truth = json!({
        "home": home.truth(),
        "vacuum_height_m": survey.vacuum_height_m,
        "map_from_home": {
            "valetudo.json": survey.valetudo_from_home(),
            "map.yaml": survey.robot_from_home,
            "points.csv": survey.robot_from_home,
        },
        "clips": clips.iter().map(|clip| &clip.truth).collect::<Vec<_>>(),
    });
    save_truth(out, &truth, arguments.clips)?;
    save(out, "valetudo.json", serde_json::to_string(&valetudo_json(&survey))?)?;
    save(out, "map.yaml", ros_yaml(&survey, "map.pgm"))?;
    save(out, "map.pgm", ros_pgm(&survey))?;
    save(out, "points.csv", points_csv(&survey))?;
    save(out, "plan.png", plan_png(&home, &survey, &clips.iter().collect::<Vec<_>>()))?;
    for (index, clip) in (0..).zip(&clips) {
        let path = out.join(clip_name(index));
        output::write_whole(&path, |to| Ok(write_scannet_zip(clip, to)?))?;
    }
    // Last, because printing ends the program if nobody reads it.
    let names = FILES.into_iter().map(str::to_owned).chain((0..arguments.clips).map(clip_name));
    names.for_each(|name| println!("{}", out.join(name).display()));
    Ok(())
}

/// Writes the truth: first, because it tells the next run that the other files are those of this one. Clips of an earlier run
/// with more clips, which may be of another home, go before it: no later run would know them.
fn save_truth(out: &Path, truth: &Value, clips: u64) -> Result<()> {
    let earlier = earlier_clips(out).unwrap_or_default();
    (clips..earlier).try_for_each(|index| output::remove(&out.join(clip_name(index))))?;
    save(out, "truth.json", serde_json::to_string_pretty(truth)?)
}

/// Returns the number of clips that an earlier run wrote, by its truth; `None` without one.
fn earlier_clips(out: &Path) -> Option<u64> {
    let truth = std::fs::read(out.join("truth.json")).ok()?;
    let truth: Value = serde_json::from_slice(&truth).ok()?;
    Some((truth["clips"].as_array()?.len() as u64).min(MAX_CLIPS))
}

/// Refuses to replace files that no earlier run wrote: a robot's map and its recordings may have the same names.
fn refuse_files_of_others(out: &Path, clips: u64, earlier: Option<u64>) -> Result<()> {
    let beside = FILES.iter().filter(|_| earlier.is_none()).map(|name| (*name).to_owned());
    let names = beside.chain((earlier.unwrap_or_default()..clips).map(clip_name));
    match names.map(|name| out.join(name)).find(|path| path.symlink_metadata().is_ok()) {
        Some(path) => bail!("{} is not of an earlier simulation; choose another --out", path.display()),
        None => Ok(()),
    }
}

fn clip_name(index: u64) -> String {
    format!("clip_{index}.zip")
}

fn save(folder: &Path, name: &str, bytes: impl AsRef<[u8]>) -> Result<()> {
    output::write_bytes(&folder.join(name), bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn files_that_no_run_wrote_are_not_replaced() {
        for (name, text, is_refused) in [
            ("map.yaml", "", true),
            ("truth.json", "{}", true),
            ("truth.json", r#"{"clips": [{}]}"#, false),
            ("clip_1.zip", "", true),
            ("clip_2.zip", "", false),
            ("notes.txt", "", false),
        ] {
            let folder = tempfile::tempdir().unwrap();
            fs::write(folder.path().join(name), text).unwrap();
            let answer = refuse_files_of_others(folder.path(), 2, earlier_clips(folder.path()));
            assert_eq!(answer.is_err(), is_refused, "{name}: {answer:?}");
        }
    }

    #[test]
    fn clips_of_an_earlier_run_are_removed() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for name in ["clip_0.zip", "clip_1.zip", "clip_2.zip", "clip_10.zip", "clip_x.zip"] {
            fs::write(at(name), "").unwrap();
        }
        let left_after = |truth: &str| {
            fs::write(at("truth.json"), truth).unwrap();
            // Nothing else of the run is written yet.
            save_truth(folder.path(), &json!({"clips": [{}]}), 1).unwrap();
            assert_eq!(earlier_clips(folder.path()), Some(1));
            fs::remove_file(at("truth.json")).unwrap();
            let entries = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name());
            let mut left: Vec<_> = entries.collect();
            left.sort();
            left
        };
        // A file that no earlier run wrote is the user's own.
        assert_eq!(left_after("").len(), 5);
        assert_eq!(left_after(r#"{"clips": [{}, {}, {}]}"#), ["clip_0.zip", "clip_10.zip", "clip_x.zip"]);
    }
}
