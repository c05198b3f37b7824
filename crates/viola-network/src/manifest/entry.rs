//! One network of the manifest, checked.

use super::form::{Input, Output, Source};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use viola_geometry::taxonomy::ClassTable;

/// What a file of the models folder is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Task {
    /// A class for each pixel of a picture.
    Segmentation,
    /// A distance for each pixel.
    Depth,
    /// Colours for the holes of a picture.
    Inpainting,
    /// Not a network, but the library that runs them.
    Runtime,
}

/// One network, checked.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelEntry {
    pub name: String,
    pub task: Task,
    /// The file, relative to the models folder; it never leads out of it.
    pub file: PathBuf,
    pub licence: String,
    /// How a picture goes in. Every network has it, a runtime does not.
    pub input: Option<Input>,
    pub output: Option<Output>,
    /// The list that the output's classes are numbered by. Every segmentation network has it.
    pub classes: Option<ClassTable>,
    pub source: Source,
    /// Of the file, in hexadecimal. A user's own export has none.
    pub sha256: Option<String>,
}

impl ModelEntry {
    /// Where the file lies or would lie.
    pub fn path(&self, models: &Path) -> PathBuf {
        models.join(&self.file)
    }
}
