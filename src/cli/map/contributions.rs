//! The contributions of the clips, on the disk until they are fused.

use crate::jobs::Finished;
use anyhow::{Context, Result};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use viola_formats::container::Region;
use viola_geometry::LevelName;
use viola_home::{
    ClipContribution, ClipPath, LoadClips, Member, PlacedClip, Recording, camera_poses, read_features,
};
use viola_reconstruct::Feature;
use viola_storage::result_file;

/// The files of a clip's result that a map is fused from.
const FILES: [&str; 3] = [result_file::CLOUD, result_file::VIEWS, result_file::FEATURES];

/// The contributions one after the other in one unnamed file: a killed process leaves nothing behind.
pub struct Contributions {
    file: File,
    folder: PathBuf,
    /// Bytes of each clip's files in `file`, by the name of its contribution.
    places: BTreeMap<String, [Range<u64>; 3]>,
    end: u64,
}

impl Contributions {
    /// Makes the file inside `folder`: the temporary folder of the system is often in memory.
    pub fn new_in(folder: &Path) -> Result<Contributions> {
        let file = tempfile::tempfile_in(folder);
        let file = file.with_context(|| format!("cannot make a file in {}", folder.display()))?;
        Ok(Contributions { file, folder: folder.to_owned(), places: BTreeMap::new(), end: 0 })
    }

    /// Keeps the contribution of a clip under a name.
    pub fn keep(&mut self, name: &str, finished: &Finished) -> Result<()> {
        let mut places = [0..0, 0..0, 0..0];
        for (place, wanted) in places.iter_mut().zip(FILES) {
            let found = finished.files.iter().find(|(file, _)| *file == wanted);
            let bytes = found.map_or(&[][..], |(_, bytes)| bytes);
            let written = self.file.write_all(bytes);
            written.with_context(|| format!("cannot write a file in {}", self.folder.display()))?;
            *place = self.end..self.end + bytes.len() as u64;
            self.end = place.end;
        }
        self.places.insert(name.to_owned(), places);
        Ok(())
    }

    /// Returns the paths of the placed clips, each with its level: the cameras of the newest clips of each level, and
    /// only the frames of the others.
    pub fn paths(&self, clips: &[PlacedClip]) -> Result<Vec<(LevelName, ClipPath)>> {
        let mut paths = Vec::with_capacity(clips.len());
        for (index, clip) in clips.iter().enumerate() {
            let level = clip.level;
            let newer = clips[index + 1..].iter().filter(|newer| newer.level == level).count();
            let poses = if newer < Recording::MAX_PATHS {
                let [_, views, _] = self.places(&clip.contribution)?;
                camera_poses(&self.read(views)?)?
            } else {
                Vec::new()
            };
            paths.push((level, ClipPath::new(clip.clip, clip.map_from_clip, clip.rise_m, &poses)));
        }
        Ok(paths)
    }

    /// Returns the places of the files of a contribution.
    fn places(&self, contribution: &str) -> Result<&[Range<u64>; 3]> {
        self.places.get(contribution).context("a contribution was not kept")
    }

    fn read(&self, place: &Range<u64>) -> Result<Vec<u8>> {
        let bytes = self.bytes(place);
        bytes.with_context(|| format!("cannot read a file in {}", self.folder.display()))
    }

    fn bytes(&self, place: &Range<u64>) -> io::Result<Vec<u8>> {
        let whole = Region::whole(self.file.try_clone()?)?;
        let mut bytes = vec![0; (place.end - place.start) as usize];
        whole.read_exact_at(place.start, &mut bytes)?;
        Ok(bytes)
    }
}

impl LoadClips<anyhow::Error> for Contributions {
    fn contributions(&mut self, members: &[&Member]) -> Result<Vec<ClipContribution>> {
        let read = |member: &&Member| {
            let [cloud, views, _] = self.places(&member.contribution)?;
            Ok(ClipContribution::read(&self.read(cloud)?, &self.read(views)?)?)
        };
        members.iter().map(read).collect()
    }

    fn features(&mut self, members: &[&Member]) -> Result<Vec<Vec<Feature>>> {
        let read = |member: &&Member| {
            let [_, _, features] = self.places(&member.contribution)?;
            Ok(read_features(&self.read(features)?)?)
        };
        members.iter().map(read).collect()
    }
}
