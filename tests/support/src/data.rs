//! The folder of the real recordings.

use crate::skipped;
use std::path::PathBuf;

const VARIABLE: &str = "VIOLA_TEST_DATA";

/// The folder of all real recordings, where the environment names it.
pub fn root() -> Option<PathBuf> {
    let root = std::env::var_os(VARIABLE).map(PathBuf::from);
    if root.is_none() {
        skipped("real recordings", "set VIOLA_TEST_DATA to their folder");
    }
    root
}

/// One folder of the real recordings. A variable that names a folder without it is an error: nothing may be skipped by a
/// typing mistake.
pub fn folder(name: &str) -> Option<PathBuf> {
    let path = root()?.join(name);
    assert!(path.is_dir(), "{VARIABLE} is set but {} is not there", path.display());
    Some(path)
}
