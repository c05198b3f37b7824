//! Journal of results, one JSON line each, so that an interrupted run can resume.

use super::{ClipResult, JournalError};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A file of results. Results of other arguments stay in it and are ignored.
pub struct Journal {
    path: PathBuf,
    known: HashMap<Key, ClipResult>,
    /// Number of results that [`find`](Journal::find) returned.
    found: AtomicUsize,
    file: Mutex<File>,
}

#[derive(PartialEq, Eq, Hash)]
struct Key {
    fingerprint: String,
    method: String,
    set: String,
    frames: usize,
    clip: String,
}

#[derive(Serialize, Deserialize)]
struct Line<R> {
    /// Hash of everything that the result depends on.
    fingerprint: String,
    result: R,
}

impl Journal {
    /// Opens or creates the file. An incomplete last line, left by an interrupted run, is removed.
    pub fn open(path: &Path) -> Result<Journal, JournalError> {
        let failed = |source| JournalError::File { path: path.to_owned(), source };
        // Each line goes to the end of the file, even if another process has added lines.
        let file = OpenOptions::new().read(true).append(true).create(true).open(path).map_err(failed)?;
        let mut known = HashMap::new();
        let mut complete_bytes = 0;
        let mut reader = BufReader::new(&file);
        let mut text = Vec::new();
        for line in 1.. {
            text.clear();
            let bytes = reader.read_until(b'\n', &mut text).map_err(failed)?;
            if text.last() != Some(&b'\n') {
                break;
            }
            complete_bytes += bytes as u64;
            let Line { fingerprint, result } = serde_json::from_slice::<Line<ClipResult>>(&text)
                .map_err(|source| JournalError::Damaged { path: path.to_owned(), line, source })?;
            known.insert(key(&fingerprint, &result), result);
        }
        if !text.is_empty() {
            file.set_len(complete_bytes).map_err(failed)?;
        }
        Ok(Journal { path: path.to_owned(), known, found: AtomicUsize::new(0), file: Mutex::new(file) })
    }

    /// Returns the result of an earlier run, if any.
    pub(super) fn find(&self, fingerprint: &str, method: &str, case: &super::Case) -> Option<&ClipResult> {
        let result = self.known.get(&Key {
            fingerprint: fingerprint.to_owned(),
            method: method.to_owned(),
            set: case.set.clone(),
            frames: case.frames,
            clip: case.name.clone(),
        });
        self.found.fetch_add(usize::from(result.is_some()), Ordering::Relaxed);
        result
    }

    /// Returns the number of results that a run took from the journal.
    pub fn found(&self) -> usize {
        self.found.load(Ordering::Relaxed)
    }

    pub(super) fn append(&self, fingerprint: &str, result: &ClipResult) -> Result<(), JournalError> {
        let failed = |source| JournalError::File { path: self.path.clone(), source };
        let line = Line { fingerprint: fingerprint.to_owned(), result };
        let mut text = serde_json::to_vec(&line).map_err(|e| failed(e.into()))?;
        text.push(b'\n');
        self.file.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).write_all(&text).map_err(failed)
    }
}

fn key(fingerprint: &str, result: &ClipResult) -> Key {
    Key {
        fingerprint: fingerprint.to_owned(),
        method: result.method.clone(),
        set: result.set.clone(),
        frames: result.frames,
        clip: result.clip.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use viola_align::AlignmentState;

    #[test]
    fn two_runs_at_once_overwrite_no_line_of_each_other() {
        let path = std::env::temp_dir().join(format!("viola-lab-journal-{}.jsonl", std::process::id()));
        let result = ClipResult::example(AlignmentState::Aligned, Some((0.1, 0.01)));
        let (first, second) = (Journal::open(&path).unwrap(), Journal::open(&path).unwrap());
        for (journal, fingerprint) in [(&first, "a"), (&second, "b"), (&first, "c"), (&second, "d")] {
            journal.append(fingerprint, &result).unwrap();
        }
        assert_eq!(Journal::open(&path).unwrap().known.len(), 4);
        std::fs::remove_file(&path).unwrap();
    }
}
