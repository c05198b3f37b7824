//! The files of a level for other programs: points as E57 and LAZ, and the recording.

use anyhow::{Context, Result};
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

fn write_file(path: &Path, write: impl FnOnce(File) -> io::Result<()>) -> Result<()> {
    // E57 reads back what it wrote.
    let file = File::options().read(true).write(true).create(true).truncate(true).open(path);
    file.and_then(write).with_context(|| format!("cannot write {}", path.display()))
}
