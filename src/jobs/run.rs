//! The method, and its run in this process.

use super::align_clip::{AlignJobError, Finished, JobParams, LevelFile};
use super::attempt_error::{AttemptError, MethodResult};
use super::shared_progress::SharedProgress;
use futures::FutureExt;
use futures::future::BoxFuture;
use std::fs;
use std::io;
use std::path::Path;
use std::sync::Arc;
use viola_geometry::progress::Progress;
use viola_storage::LocalFile;

/// Function from a clip's file, the home's LiDAR maps and parameters to an answer. It may take long and may panic.
pub type Method = fn(&Path, &[LevelFile], &JobParams, &dyn Progress) -> Result<Finished, AlignJobError>;

/// The running method. [`SharedProgress::cancel`] asks it to stop.
pub(super) type Working = BoxFuture<'static, MethodResult>;

/// Input of the method.
pub(super) struct Inputs {
    pub clip: LocalFile,
    /// True if the clip's unit is unknown.
    pub unknown_scale: bool,
    pub levels: Vec<LevelFile>,
}

impl Inputs {
    /// Returns the size of the files.
    pub fn bytes(&self) -> io::Result<u64> {
        let maps: usize = self.levels.iter().map(|file| file.bytes.len()).sum();
        Ok(fs::metadata(&*self.clip)?.len().saturating_add(maps as u64))
    }
}

/// Runs the method in this process.
pub(super) fn run_here(
    method: Method,
    params: Arc<JobParams>,
    inputs: Inputs,
    progress: Arc<SharedProgress>,
) -> Working {
    let waiting = Waiting(progress.clone());
    let work = move || method(&inputs.clip, &inputs.levels, &params, progress.as_ref());
    let work = tokio::task::spawn_blocking(work);
    let ended = async move {
        let _waiting = waiting;
        match work.await {
            Ok(ended) => ended.map_err(AttemptError::from),
            // The process ends.
            Err(error) if error.is_cancelled() => Err(AttemptError::Cancelled),
            Err(panic) => Err(AttemptError::internal(panic)),
        }
    };
    ended.boxed()
}

/// Cancels the method when its caller is dropped.
struct Waiting(Arc<SharedProgress>);

impl Drop for Waiting {
    fn drop(&mut self) {
        self.0.cancel();
    }
}
