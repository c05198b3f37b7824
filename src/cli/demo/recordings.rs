//! Recordings for the demo: a simulated home's map and clips as files, and the true poses.

use crate::cli::output;
use anyhow::Result;
use std::path::{Path, PathBuf};
use viola_geometry::Pose2;
use viola_lab::simulate::{ClipParams, Home, HomeParams, Set, plan_png, valetudo_json, write_scannet_zip};

const CLIPS: u64 = 3;

pub struct Recordings {
    /// Valetudo JSON.
    pub map: PathBuf,
    /// Picture of the home from above, with the paths of the clips.
    pub plan: PathBuf,
    pub clips: Vec<Recording>,
}

pub struct Recording {
    pub name: String,
    pub path: PathBuf,
    pub rooms: Vec<String>,
    /// The true pose.
    pub map_from_clip: Pose2,
}

impl Recordings {
    pub fn make(seed: u64, frames: usize, folder: &Path) -> Result<Recordings> {
        output::folder(folder)?;
        let home = Home::generate(&HomeParams::new(Set::Normal, seed));
        let survey = home.survey();
        let params = ClipParams { frames, ..ClipParams::default() };
        let filmed: Vec<_> = (0..CLIPS).map(|index| home.clip(&survey, index, &params)).collect();
        let map = folder.join("valetudo.json");
        output::write_bytes(&map, valetudo_json(&survey).to_string())?;
        let plan = folder.join("plan.png");
        output::write_bytes(&plan, plan_png(&home, &survey, &filmed.iter().collect::<Vec<_>>()))?;
        let mut clips = vec![];
        for (index, clip) in filmed.iter().enumerate() {
            let name = format!("clip_{index}");
            let path = folder.join(format!("{name}.zip"));
            output::write_whole(&path, |to| Ok(write_scannet_zip(clip, to)?))?;
            let truth = &clip.truth;
            clips.push(Recording {
                name,
                path,
                rooms: truth.rooms.clone(),
                map_from_clip: truth.map_from_clip,
            });
        }
        Ok(Recordings { map, plan, clips })
    }
}
