//! The folder of the real recordings.

use crate::skipped;
use std::path::PathBuf;

const VARIABLE: &str = "VIOLA_TEST_DATA";

/// Returns the folder of all real recordings, if the environment names it.
pub fn root() -> Option<PathBuf> {
    let root = std::env::var_os(VARIABLE).map(PathBuf::from);
    if root.is_none() {
        skipped("real recordings", "set VIOLA_TEST_DATA to their folder");
    }
    root
}

/// Returns one folder of the real recordings. If the environment names a folder without it, this panics: a
/// typing mistake must not skip a test.
pub fn folder(name: &str) -> Option<PathBuf> {
    let path = root()?.join(name);
    assert!(path.is_dir(), "{VARIABLE} is set but {} is not there", path.display());
    Some(path)
}
