//! The files of an export.

use super::archive::Archive;
use crate::api::App;
use crate::api::error::Error;
use crate::api::map::Revision;
use crate::api::map::points::{Points, Streamed};
use crate::api::types;
use viola_geometry::LevelName;
use viola_home::PointFilter;
use viola_storage::{Clip, ClipFilter, Home, HomeId, MapLevel, Page, StorageError, map_file, result_file};

const README: &str = include_str!("README.txt");
/// Number of clips read at a time.
const PAGE: u32 = 50;

/// The reason for which an export broke off.
#[derive(Debug, thiserror::Error)]
pub(super) enum ExportError {
    #[error(transparent)]
    Storage(#[from] StorageError),
    #[error("the zip could not be written: {0}")]
    Zip(#[from] zip::result::ZipError),
    #[error("the zip could not be written: {0}")]
    Write(#[from] std::io::Error),
    #[error("the home's map could not be read: {0}")]
    Map(Box<Error>),
    #[error("nobody reads the zip any more")]
    Abandoned,
    #[error("the home's map changed too often while it was read")]
    Changing,
}

/// Files of the map that cannot be read.
impl From<Error> for ExportError {
    fn from(error: Error) -> ExportError {
        match error {
            Error::MapRevisionRemoved { .. } => ExportError::Changing,
            Error::Storage(error) => ExportError::Storage(error),
            error => ExportError::Map(Box::new(error)),
        }
    }
}

/// Returns the folder of a level's files. Those of `main` have the folder of homes with one level.
fn folder(name: &str, level: LevelName) -> String {
    if level.is_main() { name.to_owned() } else { format!("{name}/{level}") }
}

/// A home that is exported.
pub(super) struct Contents {
    pub app: App,
    pub home: HomeId,
    pub about: Home,
}

impl Contents {
    pub async fn write(self, mut zip: Archive) -> Result<(), ExportError> {
        zip.file("README.txt", README.as_bytes()).await?;
        zip.document("home.json", &types::Home::from(self.about.clone())).await?;
        self.lidar_maps(&mut zip).await?;
        self.map(&mut zip).await?;
        let mut page = Page { limit: PAGE, after: None };
        loop {
            let clips = self.app.storage.clips(&self.home, &ClipFilter::default(), &page).await?;
            for listed in &clips {
                // The clips before it may take an hour to send: it may have a newer answer by then, and no files of the listed
                // one, or be removed.
                match self.app.storage.clip(&self.home, listed.id).await {
                    Ok(clip) => self.clip(&mut zip, &clip).await?,
                    Err(StorageError::NoSuchClip) => {}
                    Err(error) => return Err(error.into()),
                }
            }
            match clips.last() {
                Some(last) if clips.len() == PAGE as usize => page.after = Some(last.id),
                _ => break,
            }
        }
        zip.finish().await
    }

    async fn lidar_maps(&self, zip: &mut Archive) -> Result<(), ExportError> {
        let storage = &self.app.storage;
        for map in storage.lidar_maps(&self.home).await? {
            let folder = folder("lidar-map", map.level);
            let document = types::LidarMapRevision::from(map.clone());
            zip.document(&format!("{folder}/lidar-map.json"), &document).await?;
            zip.file(&format!("{folder}/file"), &storage.lidar_map_file(map.id()).await?).await?;
            let image = storage.lidar_map_image(&map).await?;
            zip.stream(&format!("{folder}/image.png"), image.stream).await?;
        }
        Ok(())
    }

    async fn map(&self, zip: &mut Archive) -> Result<(), ExportError> {
        let storage = self.app.storage.clone();
        let Some(map) = storage.home_map(&self.home, None).await? else { return Ok(()) };
        zip.document("map/map.json", &types::HomeMap::from(map.clone())).await?;
        let revision = Revision { storage, home: self.home.clone(), map };
        for level in &revision.map.levels {
            map_level(zip, &revision, level).await?;
        }
        Ok(())
    }

    async fn clip(&self, zip: &mut Archive, clip: &Clip) -> Result<(), ExportError> {
        let storage = &self.app.storage;
        let folder = format!("clips/{}", clip.id);
        zip.document(&format!("{folder}/clip.json"), &types::Clip::from(clip.clone())).await?;
        let names = [
            result_file::OVERLAY,
            result_file::COMPLETION,
            result_file::SCAN,
            result_file::CLOUD,
            result_file::THUMBNAIL,
            result_file::FRAMES,
        ];
        for name in names {
            if let Some(blob) = storage.clip_result(clip, name).await? {
                zip.stream(&format!("{folder}/{name}"), blob.stream).await?;
            } else if let Err(lost) = storage.check_result_removed(clip, name).await {
                // The next job makes it again. The rest of the home does not depend on it.
                tracing::error!(home = %self.home, clip = %clip.id, %lost, "an export is without a file");
            }
        }
        // A recording that was removed meanwhile is not in the export.
        if let Some(blob) = storage.clip_recording(clip.id).await? {
            zip.stream(&format!("{folder}/recording"), blob.stream).await?;
        }
        Ok(())
    }
}

/// Adds the files of a level of the map.
async fn map_level(zip: &mut Archive, revision: &Revision, level: &MapLevel) -> Result<(), ExportError> {
    let folder = folder("map", level.level);
    for name in map_file::PLANS.into_iter().chain([map_file::SCENE]) {
        for found in &revision.files(level.level, name).await? {
            zip.stream(&format!("{folder}/{name}"), revision.blob(found).await?.stream).await?;
        }
    }
    for (format, name) in [(Streamed::Ply, "points.ply"), (Streamed::Glb, "points.glb")] {
        let tiles = revision.files(level.level, map_file::TILE).await?;
        let points = Points::new(revision, PointFilter::default());
        // Points that are too many for a GLB are in the PLY.
        let head = match points.head(format, level.info.points, &tiles).await {
            Ok((head, _)) => head,
            Err(Error::InvalidQuery { .. }) => continue,
            Err(error) => return Err(error.into()),
        };
        zip.stream(&format!("{folder}/{name}"), points.body(format, head, tiles)).await?;
    }
    Ok(())
}
