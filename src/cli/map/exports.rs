//! The files of a level for other programs: points as E57 and LAZ, and the recording.

use crate::cli::output;
use anyhow::Result;
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::Path;
use uuid::Builder;
use viola_formats::lidar::LidarMap;
use viola_geometry::LevelName;
use viola_home::{
    ClipNumbers, ClipPath, MapPoint, RecordedObject, Recording, Tile, point_bytes, write_e57, write_laz,
};

/// One level of a home's map.
pub struct LevelExports<'a> {
    pub level: LevelName,
    pub tiles: &'a [Tile],
    pub numbers: &'a ClipNumbers,
    pub objects: Vec<RecordedObject<'a>>,
    pub paths: Vec<ClipPath>,
    /// Time of the newest clip, if known.
    pub time_ms: Option<i64>,
    pub lidar: &'a LidarMap,
}

impl LevelExports<'_> {
    /// Writes `points.e57`, `points.laz` and `home.mcap` as the API sends them.
    pub fn write(&self, folder: &Path) -> Result<()> {
        let mut sum = Sha256::new();
        self.points().for_each(|point| sum.update(point_bytes(&point)));
        let mut id = [0; 16];
        id.copy_from_slice(&sum.finalize()[..16]);
        let id = Builder::from_custom_bytes(id).into_uuid();
        write_file(&folder.join("points.e57"), |file| write_e57(file, id, self.points().map(Ok)))?;
        write_file(&folder.join("points.laz"), |file| {
            write_laz(BufWriter::new(file), id, self.points().map(Ok))
        })?;
        let recording = Recording {
            level: self.level,
            time_ms: self.time_ms.unwrap_or_default(),
            paths: &self.paths,
            objects: &self.objects,
            lidar: Some(self.lidar),
        };
        write_file(&folder.join("home.mcap"), |file| {
            recording.write(BufWriter::new(file), self.points().map(Ok))
        })
    }

    fn points(&self) -> impl Iterator<Item = MapPoint> {
        self.tiles.iter().flat_map(|tile| self.numbers.in_map(tile))
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
