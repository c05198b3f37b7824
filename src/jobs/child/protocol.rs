//! Messages of a child: one JSON message a line. The answer and its files lie in the job's folder.

use crate::jobs::align_clip::Finished;
use crate::jobs::attempt_error::{AttemptError, MethodResult};
use serde::{Deserialize, Serialize};
use std::fs;
use std::io;
use std::path::Path;
use viola_geometry::progress::{EarlyPose, Stage};
use viola_storage::result_file;

const ALIGNMENT: &str = "alignment.json";

#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Message {
    /// A stage begins.
    Enter(Stage),
    /// This fraction of the stage is done.
    Advance(f64),
    /// A pose is known before the answer.
    EarlyPose(EarlyPose),
    /// The answer is in the folder. The last message.
    Finished,
    /// There is no answer. The last message.
    Failed(AttemptError),
}

/// Writes an answer into the job's folder.
pub(super) fn write_result(folder: &Path, finished: &Finished) -> io::Result<()> {
    for (name, bytes) in &finished.files {
        fs::write(folder.join(name), bytes)?;
    }
    fs::write(folder.join(ALIGNMENT), serde_json::to_vec(&finished.alignment)?)
}

/// Reads the answer of a child that has finished.
pub(super) fn read_result(folder: &Path) -> MethodResult {
    let alignment = fs::read(folder.join(ALIGNMENT)).map_err(AttemptError::system)?;
    let alignment = serde_json::from_slice(&alignment).map_err(AttemptError::internal)?;
    let mut files = Vec::new();
    for name in result_file::ALL {
        match fs::read(folder.join(name)) {
            Ok(bytes) => files.push((name, bytes)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            Err(error) => return Err(AttemptError::system(error)),
        }
    }
    Ok(Finished { alignment, files })
}
