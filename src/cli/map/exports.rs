//! The files of a level for other programs: points as E57 and LAZ, and the recording.

use super::files::{HomeFiles, LevelFiles};
use crate::cli::output;
use anyhow::Result;
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::Path;
use uuid::Builder;
use viola_home::{ClipPath, RecordedObject, Recording, point_bytes, write_e57, write_laz};
use viola_storage::MapObject;

impl HomeFiles<'_> {
    /// Writes `points.e57`, `points.laz` and `home.mcap` of a level as the API sends them.
    pub(super) fn write_exports(&self, level: &LevelFiles, folder: &Path) -> Result<()> {
        let mut sum = Sha256::new();
        self.points(level).for_each(|point| sum.update(point_bytes(&point)));
        let mut id = [0; 16];
        id.copy_from_slice(&sum.finalize()[..16]);
        let id = Builder::from_custom_bytes(id).into_uuid();
        write_file(&folder.join("points.e57"), |file| write_e57(file, id, self.points(level).map(Ok)))?;
        write_file(&folder.join("points.laz"), |file| {
            write_laz(BufWriter::new(file), id, self.points(level).map(Ok))
        })?;
        let objects: Vec<RecordedObject> = self.objects_on(level).map(MapObject::recorded).collect();
        let paths = self.paths.iter().filter(|(of, _)| *of == level.level);
        let paths: Vec<ClipPath> = paths.map(|(_, path)| path.clone()).collect();
        let recording = Recording {
            level: level.level,
            time_ms: self.time_ms.unwrap_or_default(),
            paths: &paths,
            objects: &objects,
            lidar: Some(level.lidar),
        };
        write_file(&folder.join("home.mcap"), |file| {
            recording.write(BufWriter::new(file), self.points(level).map(Ok))
        })
    }
}

/// [`output::write_whole`] through a handle of its own.
fn write_file(path: &Path, write: impl FnOnce(File) -> io::Result<()>) -> Result<()> {
    output::write_whole(path, |to| Ok(write(to.get_ref().try_clone()?)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::io::{Read, Seek, Write};

    #[test]
    fn an_export_that_fails_replaces_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("points.e57");
        fs::write(&path, "first").unwrap();
        let error = write_file(&path, |mut file| {
            file.write_all(b"half")?;
            Err(io::Error::other("no more"))
        });
        assert!(format!("{:#}", error.unwrap_err()).ends_with("points.e57: no more"));
        assert_eq!(fs::read(&path).unwrap(), b"first");
        // E57 reads back what it wrote.
        let whole = write_file(&path, |mut file| {
            file.write_all(b"second")?;
            file.rewind()?;
            let mut text = String::new();
            file.read_to_string(&mut text)?;
            if text == "second" { Ok(()) } else { Err(io::Error::other(text)) }
        });
        whole.unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"second");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
