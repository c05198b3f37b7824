//! A checked network of the manifest.

use super::form::{Input, Output, Source};
use crate::Weights;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use viola_geometry::taxonomy::ClassTable;

/// Task of a file in the models folder.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Task {
    /// A class for each pixel of a picture.
    Segmentation,
    /// A distance for each pixel.
    Depth,
    /// Colours for the holes of a picture.
    Inpainting,
    /// A class for each voxel of a fused surface.
    Surface,
    /// The library that runs networks, not a network.
    Runtime,
}

/// A checked network.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelEntry {
    pub name: String,
    pub task: Task,
    /// The file, relative to the models folder and inside it.
    pub file: PathBuf,
    pub licence: String,
    /// Format of the input. Networks for pictures have one.
    pub input: Option<Input>,
    pub output: Option<Output>,
    /// Class table of the output. Only segmentation networks have one, and all of them do.
    pub classes: Option<ClassTable>,
    pub source: Source,
    /// SHA-256 of the file in hexadecimal. A user's own export has none.
    pub sha256: Option<String>,
}

impl ModelEntry {
    /// Returns the path of the file, which may not exist yet.
    pub fn path(&self, models: &Path) -> PathBuf {
        models.join(&self.file)
    }

    /// Returns the weights: the file in the models folder, else those in the program; `None` if there are
    /// neither.
    pub fn weights(&self, models: Option<&Path>) -> Option<Weights> {
        let file = models.map(|models| self.path(models)).filter(|path| path.is_file());
        let built_in = || Weights::built_in(&self.file).filter(|_| self.source.is_built_in());
        file.map(Weights::File).or_else(built_in)
    }
}
