//! What is in an export, file by file.

use super::super::App;
use crate::api::map::points::{Format, Points};
use crate::home::{ClipNumbers, PointFilter};
use crate::storage::{BlobReader, Clip, ClipFilter, Home, HomeId, Page, StorageError, map_file, result_file};
use futures::TryStreamExt;
use serde::Serialize;
use std::io::Write;
use tokio::runtime::Handle;
use zip::CompressionMethod;
use zip::write::{SimpleFileOptions, StreamWriter, ZipWriter};

const README: &str = include_str!("README.txt");
/// Clips that are read at a time.
const PAGE: u32 = 50;

/// Why an export broke off.
#[derive(Debug, thiserror::Error)]
pub(super) enum ExportError {
    #[error(transparent)]
    Storage(#[from] StorageError),
    #[error("the zip could not be written: {0}")]
    Zip(#[from] zip::result::ZipError),
    #[error("the zip could not be sent: {0}")]
    Write(#[from] std::io::Error),
    #[error("the home's map changed too often while it was read")]
    Changing,
}

/// A home that is exported.
pub(super) struct Contents {
    pub app: App,
    pub home: HomeId,
    pub about: Home,
    pub runtime: Handle,
}

type Zip<W> = ZipWriter<StreamWriter<W>>;

impl Contents {
    pub fn write(self, writer: impl Write) -> Result<(), ExportError> {
        let mut zip = ZipWriter::new_stream(writer);
        file(&mut zip, "README.txt", README.as_bytes())?;
        document(&mut zip, "home.json", &self.about)?;
        self.lidar_map(&mut zip)?;
        self.map(&mut zip)?;
        let mut page = Page { limit: PAGE, after: None };
        loop {
            let clips =
                self.runtime.block_on(self.app.storage.clips(&self.home, &ClipFilter::default(), &page))?;
            for clip in &clips {
                self.clip(&mut zip, clip)?;
            }
            match clips.last() {
                Some(last) if clips.len() == PAGE as usize => page.after = Some(last.id),
                _ => break,
            }
        }
        zip.finish()?;
        Ok(())
    }

    fn lidar_map<W: Write>(&self, zip: &mut Zip<W>) -> Result<(), ExportError> {
        let map = match self.runtime.block_on(self.app.storage.lidar_map(&self.home)) {
            Err(StorageError::NoLidarMap) => return Ok(()),
            map => map?,
        };
        document(zip, "lidar-map/lidar-map.json", &map)?;
        file(zip, "lidar-map/file", &self.runtime.block_on(self.app.storage.lidar_map_file(map.id()))?)?;
        let image = self.runtime.block_on(self.app.storage.lidar_map_image(&self.home))?;
        self.blob(zip, "lidar-map/image.png", image)
    }

    fn map<W: Write>(&self, zip: &mut Zip<W>) -> Result<(), ExportError> {
        let storage = &self.app.storage;
        let Some(map) = self.runtime.block_on(storage.home_map(&self.home, None))? else { return Ok(()) };
        document(zip, "map/map.json", &map)?;
        for name in [map_file::PLAN_PNG, map_file::PLAN_SVG, map_file::PLAN_GEOJSON, map_file::SCENE] {
            let files = self.runtime.block_on(storage.home_map_files(&self.home, map.revision, name))?;
            for found in &files {
                let blob =
                    self.runtime.block_on(storage.read_map_file(found))?.ok_or(ExportError::Changing)?;
                self.blob(zip, &format!("map/{name}"), blob)?;
            }
        }
        for (format, name) in [(Format::Ply, "map/points.ply"), (Format::Glb, "map/points.glb")] {
            let tiles =
                self.runtime.block_on(storage.home_map_files(&self.home, map.revision, map_file::TILE))?;
            let points = Points {
                app: self.app.clone(),
                clips: ClipNumbers::new(map.clips.iter().map(|clip| &clip.clip)),
                filter: PointFilter::default(),
            };
            // More points than a GLB can hold are in the PLY.
            let Ok((head, _)) = self.runtime.block_on(points.head(format, &map, &tiles)) else { continue };
            zip.start_file(name, stored())?;
            let mut body = std::pin::pin!(points.body(format, head, tiles));
            while let Some(bytes) = self.runtime.block_on(body.try_next())? {
                zip.write_all(&bytes)?;
            }
        }
        Ok(())
    }

    fn clip<W: Write>(&self, zip: &mut Zip<W>, clip: &Clip) -> Result<(), ExportError> {
        let folder = format!("clips/{}", clip.id);
        document(zip, &format!("{folder}/clip.json"), clip)?;
        for name in [result_file::OVERLAY, result_file::COMPLETION, result_file::SCAN, result_file::CLOUD] {
            if let Some(blob) = self.runtime.block_on(self.app.storage.clip_result(clip, name))? {
                self.blob(zip, &format!("{folder}/{name}"), blob)?;
            }
        }
        // Removed since the list was read: then it is not in the export.
        if let Some(blob) = self.runtime.block_on(self.app.storage.clip_recording(clip.id))? {
            self.blob(zip, &format!("{folder}/recording"), blob)?;
        }
        Ok(())
    }

    fn blob<W: Write>(&self, zip: &mut Zip<W>, name: &str, mut blob: BlobReader) -> Result<(), ExportError> {
        zip.start_file(name, stored())?;
        while let Some(bytes) = self.runtime.block_on(blob.stream.try_next())? {
            zip.write_all(&bytes)?;
        }
        Ok(())
    }
}

/// Pictures, recordings and floats do not get smaller.
fn stored() -> SimpleFileOptions {
    SimpleFileOptions::default().compression_method(CompressionMethod::Stored).large_file(true)
}

fn file<W: Write>(zip: &mut Zip<W>, name: &str, bytes: &[u8]) -> Result<(), ExportError> {
    zip.start_file(name, SimpleFileOptions::default())?;
    zip.write_all(bytes)?;
    Ok(())
}

fn document<W: Write>(zip: &mut Zip<W>, name: &str, value: &impl Serialize) -> Result<(), ExportError> {
    let text = serde_json::to_vec_pretty(value).map_err(std::io::Error::other)?;
    file(zip, name, &text)
}
