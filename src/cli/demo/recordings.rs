//! Recordings for the demo: a simulated home's map and clips as files, and the true poses.

use anyhow::{Context, Result};
use std::fs;
use std::io::BufWriter;
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
        fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
        let home = Home::generate(&HomeParams::new(Set::Normal, seed));
        let survey = home.survey();
        let params = ClipParams { frames, ..ClipParams::default() };
        let filmed: Vec<_> = (0..CLIPS).map(|index| home.clip(&survey, index, &params)).collect();
        let map = folder.join("valetudo.json");
        fs::write(&map, valetudo_json(&survey).to_string())
            .with_context(|| format!("cannot write {}", map.display()))?;
        let plan = folder.join("plan.png");
        fs::write(&plan, plan_png(&home, &survey, &filmed.iter().collect::<Vec<_>>()))
            .with_context(|| format!("cannot write {}", plan.display()))?;
        let mut clips = vec![];
        for (index, clip) in filmed.iter().enumerate() {
            let name = format!("clip_{index}");
            let path = folder.join(format!("{name}.zip"));
            let file = fs::File::create(&path).with_context(|| format!("cannot write {}", path.display()))?;
            write_scannet_zip(clip, BufWriter::new(file))?;
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
