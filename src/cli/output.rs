//! Output files, folders and tables.

use anyhow::{Context, Result, bail};
use serde_json::Value;
use std::fs::{self, File, TryLockError};
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

/// Writes a temporary file beside `path` and gives it that name when it is whole: a command that fails or is interrupted
/// replaces nothing. A pipe or a device is written directly.
pub fn write_whole<T>(path: &Path, write: impl FnOnce(&mut BufWriter<File>) -> Result<T>) -> Result<T> {
    let cannot = || format!("cannot write {}", path.display());
    // A link keeps pointing to its file.
    let target = path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
    if fs::metadata(&target).is_ok_and(|data| !data.is_file()) {
        let mut to = BufWriter::new(File::create(&target).with_context(cannot)?);
        let value = write(&mut to).with_context(cannot)?;
        to.flush().with_context(cannot)?;
        return Ok(value);
    }
    let (folder, name) = (target.parent().with_context(cannot)?, target.file_name().with_context(cannot)?);
    // Not tempfile's own files, which only their owner may read.
    let new = |part: &Path| File::options().read(true).write(true).create_new(true).open(part);
    let part = tempfile::Builder::new().prefix(name).suffix(".part").make_in(folder, new);
    // The temporary file is removed when `part` is dropped.
    let (file, part) = part.with_context(cannot)?.into_parts();
    let mut to = BufWriter::new(file);
    let value = write(&mut to).with_context(cannot)?;
    to.flush().with_context(cannot)?;
    to.get_ref().sync_all().with_context(cannot)?;
    part.persist(&target).map_err(|failed| failed.error).with_context(cannot)?;
    Ok(value)
}

/// [`write_whole`] of bytes or of a text.
pub fn write_bytes(path: &Path, bytes: impl AsRef<[u8]>) -> Result<()> {
    write_whole(path, |to| Ok(to.write_all(bytes.as_ref())?))
}

/// Makes a folder and those above it, if they are missing.
pub fn folder(path: &Path) -> Result<()> {
    fs::create_dir_all(path).with_context(|| format!("cannot make the folder {}", path.display()))
}

/// Keeps other processes of this program from writing into a folder.
pub struct OwnFolder {
    /// Closing it ends the lock; `None` if the file system has no locks.
    _lock: Option<File>,
}

/// Makes a folder for the outputs of this process alone. Fails if no file can be made in it, so that this is known before the
/// work, and if another process writes into it: the folder would have files of both.
pub fn own_folder(path: &Path) -> Result<OwnFolder> {
    folder(path)?;
    tempfile::tempfile_in(path)
        .with_context(|| format!("cannot write into the folder {}", path.display()))?;
    let Ok(lock) = File::open(path) else { return Ok(OwnFolder { _lock: None }) };
    match lock.try_lock() {
        Ok(()) => Ok(OwnFolder { _lock: Some(lock) }),
        Err(TryLockError::WouldBlock) => {
            bail!("another process writes into the folder {}; choose another --out", path.display())
        }
        Err(TryLockError::Error(_)) => Ok(OwnFolder { _lock: None }),
    }
}

/// Removes a file of an earlier run, if it is there.
pub fn remove(path: &Path) -> Result<()> {
    match fs::remove_file(path) {
        Err(error) if !matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
            Err(error).with_context(|| format!("cannot remove {}", path.display()))
        }
        _ => Ok(()),
    }
}

/// Refuses outputs that would replace an input file or lie in an input folder. `flag` names the outputs.
pub fn refuse_to_overwrite(inputs: &[PathBuf], outputs: &[PathBuf], flag: &str) -> Result<()> {
    let real: Vec<PathBuf> = outputs.iter().map(|output| resolved(output)).collect();
    for input in inputs {
        // The reader reports a missing input.
        let Ok(read) = input.canonicalize() else { continue };
        let Some(at) = real.iter().position(|output| output.starts_with(&read)) else { continue };
        let (input, output) = (input.display(), outputs[at].display());
        if read.is_dir() {
            bail!("{output} would be written into the input folder {input}; choose another {flag}");
        }
        bail!("the input {input} would be overwritten by {output}; choose another {flag}");
    }
    Ok(())
}

/// Returns the path without links, even of a file or folder that does not exist yet.
fn resolved(path: &Path) -> PathBuf {
    // An empty path is the working folder.
    let here = Path::new(".").join(path);
    let absolute = std::path::absolute(&here).unwrap_or(here);
    let real = absolute.ancestors().find_map(|existing| {
        let rest = absolute.strip_prefix(existing).ok()?;
        Some(existing.canonicalize().ok()?.join(rest))
    });
    real.unwrap_or(absolute)
}

/// Prints a list: the documents of its items as JSON, or a table with a row for each.
pub fn print_list<T, const N: usize>(
    items: &[T],
    as_json: bool,
    document: impl Fn(&T) -> Value,
    head: [&str; N],
    row: impl Fn(&T) -> [String; N],
) -> Result<()> {
    if as_json {
        let documents: Vec<Value> = items.iter().map(document).collect();
        println!("{}", serde_json::to_string_pretty(&documents)?);
    } else {
        let rows: Vec<_> = std::iter::once(head.map(str::to_owned)).chain(items.iter().map(row)).collect();
        print!("{}", columns(&rows));
    }
    Ok(())
}

/// Returns the rows with aligned columns.
pub fn columns<const N: usize>(rows: &[[String; N]]) -> String {
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let widths: [usize; N] = std::array::from_fn(width);
    let mut text = String::new();
    for row in rows {
        let cells: Vec<String> =
            row.iter().zip(widths).map(|(cell, width)| format!("{cell:<width$}")).collect();
        text += cells.join("  ").trim_end();
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_write_that_fails_replaces_nothing_and_leaves_the_files_of_others_alone() {
        let folder = tempfile::tempdir().unwrap();
        let (path, other) = (folder.path().join("map.yaml"), folder.path().join("map.yaml.part"));
        let half = |to: &mut BufWriter<File>| {
            to.write_all(b"half")?;
            bail!("no more")
        };
        fs::write(&other, "mine").unwrap();
        write_bytes(&path, b"first").unwrap();
        let error = write_whole::<()>(&path, half).unwrap_err();
        assert!(error.to_string().starts_with("cannot write "), "{error}");
        assert_eq!(fs::read(&other).unwrap(), b"mine");
        assert_eq!(fs::read(&path).unwrap(), b"first");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
    }

    #[test]
    fn a_folder_is_written_by_one_process_at_a_time() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("new/out");
        let own = own_folder(&out).unwrap();
        let told = own_folder(&out).err().map(|error| error.to_string()).unwrap_or_default();
        assert!(told.starts_with("another process writes into the folder "), "{told}");
        own_folder(&out.join("other")).unwrap();
        drop(own);
        own_folder(&out).unwrap();
        assert_eq!(fs::read_dir(&out).unwrap().count(), 1);
    }

    #[test]
    fn columns_are_as_wide_as_their_longest_cell() {
        let rows = [["clip", "state", "why"], ["clé", "a long state", ""], ["a-long-name", "ok", "none"]];
        assert_eq!(
            columns(&rows.map(|row| row.map(str::to_owned))),
            "clip         state         why\nclé          a long state\na-long-name  ok            none\n"
        );
    }

    #[test]
    fn an_input_is_not_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir_all(at("clip/depth")).unwrap();
        for file in ["home.mcap", "clip/cloud.ply", "clips.zip"] {
            fs::write(at(file), "mine").unwrap();
        }
        for (input, outputs, words) in [
            ("home.mcap", &["home.mcap"][..], "the input "),
            ("home.mcap", &["plan.svg", "clip/../home.mcap"], "the input "),
            ("home.mcap", &["", "plan.svg", "out/home.mcap"], ""),
            ("clip", &["clip"], "would be written into the input folder "),
            ("clip", &["clip/cloud.ply"], "would be written into the input folder "),
            ("clip", &["clip/depth/new/answer"], "would be written into the input folder "),
            ("clip", &["", "clip.zip", "clips", "answer/clip"], ""),
            ("clip/cloud.ply", &["clip", "clip/result.json"], ""),
            ("missing", &["", "missing"], ""),
        ] {
            let outputs: Vec<PathBuf> = outputs.iter().map(|name| at(name)).collect();
            let answer = refuse_to_overwrite(&[at("clips.zip"), at(input)], &outputs[..], "--out");
            let told = answer.map_or_else(|error| error.to_string(), |()| String::new());
            assert!(
                told.contains(words) && told.is_empty() == words.is_empty(),
                "{input} {outputs:?}: {told}"
            );
            assert!(told.is_empty() || told.ends_with("choose another --out"), "{told}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_link_to_an_input_is_not_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("clip")).unwrap();
        fs::write(at("clip/cloud.ply"), "mine").unwrap();
        std::os::unix::fs::symlink(at("clip"), at("link")).unwrap();
        std::os::unix::fs::symlink(at("clip/cloud.ply"), at("points.ply")).unwrap();
        for (input, output, is_refused) in [
            ("clip", "link/new", true),
            ("clip", "points.ply", true),
            ("clip/cloud.ply", "points.ply", true),
            ("points.ply", "link/cloud.ply", true),
            ("clip/cloud.ply", "link/new", false),
        ] {
            let answer = refuse_to_overwrite(&[at(input)], &[at(output)], "--out");
            assert_eq!(answer.is_err(), is_refused, "{input} {output}");
        }
    }

    #[test]
    fn a_file_is_removed_if_it_is_there() {
        let folder = tempfile::tempdir().unwrap();
        let map = folder.path().join("map.json");
        fs::write(&map, "{}").unwrap();
        remove(&map).unwrap();
        remove(&map).unwrap();
        assert!(!map.exists());
    }
}
