//! The contributions of the clips, in a temporary folder until they are fused.

use crate::jobs::Finished;
use crate::storage::result_file;
use anyhow::{Context, Result};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use viola_home::{ClipContribution, Member};

/// The files of a clip's result that a map is fused from.
const FILES: [&str; 2] = [result_file::CLOUD, result_file::VIEWS];

/// Contributions by name. The folder is removed with this value.
pub struct Contributions(TempDir);

impl Contributions {
    /// Makes the folder inside `out`: the temporary folder of the system is often in memory.
    pub fn new_in(out: &Path) -> Result<Contributions> {
        let folder = tempfile::Builder::new().prefix(".clips-").tempdir_in(out);
        folder.map(Contributions).with_context(|| format!("cannot make a folder in {}", out.display()))
    }

    fn path(&self, name: &str, file: &str) -> PathBuf {
        self.0.path().join(format!("{name}-{file}"))
    }

    /// Keeps what the clip called `name` contributes.
    pub fn keep(&self, name: &str, finished: &Finished) -> Result<()> {
        for (file, bytes) in finished.files.iter().filter(|(file, _)| FILES.contains(file)) {
            let path = self.path(name, file);
            fs::write(&path, bytes).with_context(|| format!("cannot write {}", path.display()))?;
        }
        Ok(())
    }

    pub fn load(&self, member: &Member) -> Result<ClipContribution> {
        let [cloud, views] = FILES.map(|file| {
            let path = self.path(&member.share, file);
            fs::read(&path).with_context(|| format!("cannot read {}", path.display()))
        });
        Ok(ClipContribution::read(&cloud?, &views?)?)
    }
}
