//! The weights of a network: a file, or bytes that are part of the program.

use super::{NetworkError, check};
use std::path::{Path, PathBuf};

/// Path of the surface network in a models folder. A file there replaces the built-in weights.
const COLUMNS: &str = "columns/columns.onnx";

/// The weights of a network.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Weights {
    File(PathBuf),
    /// Bytes of an ONNX file in the program, named by its path in a models folder.
    BuiltIn {
        file: &'static str,
        bytes: &'static [u8],
    },
}

impl Weights {
    /// Returns the built-in weights for a path in a models folder.
    pub(super) fn built_in(file: &Path) -> Option<Weights> {
        // In the program, so that every installation labels surfaces.
        let bytes = include_bytes!("../../../models/columns/columns.onnx");
        (file == Path::new(COLUMNS)).then_some(Weights::BuiltIn { file: COLUMNS, bytes })
    }

    /// Returns the file's name for messages.
    pub(super) fn name(&self) -> String {
        match self {
            Weights::File(path) => check::name(path),
            Weights::BuiltIn { file, .. } => format!("{file} of the program"),
        }
    }

    /// Checks that a file exists and has an allowed size.
    pub(super) fn check(&self) -> Result<(), NetworkError> {
        match self {
            Weights::File(path) => check::file(path),
            Weights::BuiltIn { .. } => Ok(()),
        }
    }
}
