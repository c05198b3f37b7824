//! Output files and folders.

use anyhow::{Context, Result, bail};
use std::fs::{self, File};
use std::io::{BufWriter, ErrorKind, Write};
use std::path::Path;

/// Writes a file beside `path` and gives it that name when it is whole: a command that fails or is interrupted replaces
/// nothing. A pipe or a device is written directly.
pub fn write_whole<T>(path: &Path, write: impl FnOnce(&mut BufWriter<File>) -> Result<T>) -> Result<T> {
    let cannot = || format!("cannot write {}", path.display());
    // A link keeps pointing to its file.
    let target = path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
    let is_direct = fs::metadata(&target).is_ok_and(|data| !data.is_file());
    let mut part = target.file_name().with_context(cannot)?.to_os_string();
    part.push(".part");
    let part = if is_direct { target.clone() } else { target.with_file_name(part) };
    let written = (|| {
        let mut to = BufWriter::new(File::create(&part).with_context(cannot)?);
        let value = write(&mut to)?;
        to.flush().with_context(cannot)?;
        if !is_direct {
            to.get_ref().sync_all().with_context(cannot)?;
            fs::rename(&part, &target).with_context(cannot)?;
        }
        Ok(value)
    })();
    if written.is_err() && !is_direct {
        // The error is that of the writing.
        let _ = fs::remove_file(&part);
    }
    written
}

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
    fn a_write_that_fails_replaces_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("map.yaml");
        let half = |to: &mut BufWriter<File>| {
            to.write_all(b"half")?;
            bail!("no more")
        };
        write_whole(&path, |to| Ok(to.write_all(b"first")?)).unwrap();
        assert!(write_whole::<()>(&path, half).is_err());
        assert_eq!(fs::read(&path).unwrap(), b"first");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

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
