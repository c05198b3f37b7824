//! The manifest of networks: task, input, output and source of each.
//!
//! `models/models.toml` is part of the program. A `models.toml` in the user's models folder adds networks,
//! and replaces those of the same name.

mod diffusion;
mod entry;
mod error;
mod form;

pub use diffusion::{Diffusion, Scheduler};
pub use entry::{ModelEntry, Task};
pub use error::{MAX_BYTES, MAX_NETWORKS, ManifestError};
pub use form::{Channels, Input, Layout, Output, Side, Source};

use super::Weights;
use form::Document;
use std::path::Path;

/// The name of a manifest in a models folder.
pub const FILE: &str = "models.toml";
const BUILT_IN: &str = include_str!("../../../models/models.toml");

/// All known networks: the user's own first, then the built-in ones, each in its file's order.
#[derive(Debug, Clone, PartialEq)]
pub struct Manifest {
    pub networks: Vec<ModelEntry>,
}

impl Manifest {
    /// Returns the built-in networks.
    pub fn built_in() -> Result<Manifest, ManifestError> {
        Manifest::parse(BUILT_IN)
    }

    /// Returns the networks of the models folder's own manifest, then the built-in ones.
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

    /// Returns the first network for a task whose weights are in the models folder or in the program.
    pub fn installed(&self, task: Task, models: Option<&Path>) -> Option<Installed> {
        let of_task = self.networks.iter().filter(|entry| entry.task == task);
        let with_weights =
            |entry: &ModelEntry| Some(Installed { weights: entry.weights(models)?, entry: entry.clone() });
        of_task.filter_map(with_weights).next()
    }
}

/// A network whose weights exist.
#[derive(Debug, Clone, PartialEq)]
pub struct Installed {
    pub entry: ModelEntry,
    pub weights: Weights,
}

/// Reads the file's text, cut one byte above the limit.
fn read(path: &Path) -> std::io::Result<String> {
    use std::io::Read;
    let mut text = String::new();
    std::fs::File::open(path)?.take(MAX_BYTES + 1).read_to_string(&mut text)?;
    Ok(text)
}

/// Returns the first installed network for a task, by the models folder's own manifest and the built-in one.
/// Without a folder only networks in the program are installed.
pub fn installed(task: Task, models: Option<&Path>) -> Result<Option<Installed>, ManifestError> {
    let manifest = models.map_or_else(Manifest::built_in, Manifest::with_folder)?;
    Ok(manifest.installed(task, models))
}

#[cfg(test)]
mod tests;
