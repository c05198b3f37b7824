//! The list of networks: what each is for, how a picture goes in, what comes out, and where it is had.
//!
//! `models/models.toml` is part of the program. A `models.toml` in the user's models folder adds networks, and
//! replaces those of the same name.

mod diffusion;
mod error;
mod form;

pub use diffusion::{Diffusion, Scheduler};
pub use error::ManifestError;
pub use form::{Channels, Input, Layout, Output, Side, Source};

use crate::taxonomy::ClassTable;
use form::Document;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// The name of a manifest in a models folder.
pub const FILE: &str = "models.toml";
/// The largest manifest that is read, in bytes.
pub const MAX_BYTES: u64 = 1 << 20;
/// The most networks of one manifest.
pub const MAX_NETWORKS: usize = 1000;

const BUILT_IN: &str = include_str!("../../models/models.toml");

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

/// The networks that are known: the user's own first, then the built-in ones, each in its file's order.
#[derive(Debug, Clone, PartialEq)]
pub struct Manifest {
    pub networks: Vec<ModelEntry>,
}

impl Manifest {
    /// The built-in networks.
    pub fn built_in() -> Result<Manifest, ManifestError> {
        Manifest::parse(BUILT_IN)
    }

    /// The networks that the models folder's own manifest tells, and the built-in ones.
    pub fn with_folder(models: &Path) -> Result<Manifest, ManifestError> {
        let built_in = Manifest::built_in()?;
        let path = models.join(FILE);
        let text = match read(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(built_in),
            Err(source) => return Err(ManifestError::Unreadable { source }),
        };
        if text.len() as u64 > MAX_BYTES {
            return Err(ManifestError::TooLarge);
        }
        let mut networks = Manifest::parse(&text)?.networks;
        for entry in built_in.networks {
            if !networks.iter().any(|own| own.name == entry.name) {
                networks.push(entry);
            }
        }
        Ok(Manifest { networks })
    }

    pub fn parse(text: &str) -> Result<Manifest, ManifestError> {
        let document: Document =
            toml::from_str(text).map_err(|error| ManifestError::Form { reason: error.to_string() })?;
        if document.network.len() > MAX_NETWORKS {
            return Err(ManifestError::TooMany);
        }
        let mut networks: Vec<ModelEntry> = Vec::with_capacity(document.network.len());
        for form in document.network {
            let entry = form.check()?;
            if networks.iter().any(|other| other.name == entry.name) {
                return Err(ManifestError::Twice { name: entry.name });
            }
            networks.push(entry);
        }
        Ok(Manifest { networks })
    }

    pub fn find(&self, name: &str) -> Option<&ModelEntry> {
        self.networks.iter().find(|entry| entry.name == name)
    }

    /// The first network for a task whose file lies in the models folder.
    pub fn installed(&self, task: Task, models: &Path) -> Option<&ModelEntry> {
        self.networks.iter().find(|entry| entry.task == task && entry.path(models).is_file())
    }
}

/// The file's text, cut just above the bound.
fn read(path: &Path) -> std::io::Result<String> {
    use std::io::Read;
    let mut text = String::new();
    std::fs::File::open(path)?.take(MAX_BYTES + 1).read_to_string(&mut text)?;
    Ok(text)
}

/// The first network for a task that is installed in a models folder, by the folder's own manifest and the
/// built-in one.
pub fn installed(task: Task, models: &Path) -> Result<Option<ModelEntry>, ManifestError> {
    Ok(Manifest::with_folder(models)?.installed(task, models).cloned())
}

#[cfg(test)]
mod tests;
