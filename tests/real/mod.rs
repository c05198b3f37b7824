//! Where the real recordings are.

use std::path::PathBuf;

/// A folder of the real data; none, said plainly, when `VIOLA_TEST_DATA` does not name it. A variable that
/// names a folder without the data is an error: nothing may be skipped by a typing mistake.
pub fn data(folder: &str) -> Option<PathBuf> {
    let Some(root) = std::env::var_os("VIOLA_TEST_DATA") else {
        eprintln!("SKIPPED: set VIOLA_TEST_DATA to the folder that holds {folder}");
        return None;
    };
    let path = PathBuf::from(root).join(folder);
    assert!(path.is_dir(), "VIOLA_TEST_DATA is set but {} is not there", path.display());
    Some(path)
}
