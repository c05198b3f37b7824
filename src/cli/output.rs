//! Output folders.

use anyhow::{Context, Result, bail};
use std::fs;
use std::io::ErrorKind;
use std::path::Path;

/// Removes a file of an earlier run, if it is there.
pub fn remove(path: &Path) -> Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => {
            Err(error).with_context(|| format!("cannot remove {}", path.display()))
        }
        _ => Ok(()),
    }
}

/// Refuses an input file that lies in the output folder under the name of an output.
pub fn refuse_to_overwrite(input: &Path, out: &Path, outputs: &[&str]) -> Result<()> {
    let Ok(input_path) = input.canonicalize() else { return Ok(()) };
    let is_output = |name: &&str| out.join(name).canonicalize().is_ok_and(|path| path == input_path);
    if outputs.iter().any(is_output) {
        bail!("{} would be overwritten; choose another folder with --out", input.display());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_input_is_not_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let map = folder.path().join("map.json");
        fs::write(&map, "{}").unwrap();
        let refused = |out: &Path, outputs: &[&str]| refuse_to_overwrite(&map, out, outputs).is_err();
        assert!(refused(folder.path(), &["plan.svg", "map.json"]));
        assert!(!refused(folder.path(), &["plan.svg"]));
        assert!(!refused(&folder.path().join("out"), &["map.json"]));
        remove(&map).unwrap();
        remove(&map).unwrap();
        assert!(!map.exists());
    }
}
