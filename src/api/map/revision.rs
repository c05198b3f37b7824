//! A revision of a home's map and its files, as requests read them. It may be removed meanwhile.

use crate::api::App;
use crate::api::error::Error;
use crate::api::extract::{invalid_query, query_number};
use crate::api::reply::tag_of_made;
use bytes::Bytes;
use std::sync::Arc;
use viola_geometry::LevelName;
use viola_storage::{BlobReader, HomeId, HomeMap, MapFile, MapLevel, MapScene, Storage, map_file};

/// A revision of a home's map.
#[derive(Clone)]
pub(in crate::api) struct Revision {
    pub storage: Arc<Storage>,
    pub home: HomeId,
    pub map: HomeMap,
}

impl Revision {
    /// Returns the revision that a query names, by default the current one.
    pub async fn asked(app: &App, home: HomeId, asked: Option<&str>) -> Result<Revision, Error> {
        Revision::kept(app, home, number("revision", asked, 1)?).await
    }

    /// Returns a revision that is kept, by default the current one.
    pub async fn kept(app: &App, home: HomeId, number: Option<i64>) -> Result<Revision, Error> {
        let map = kept_map(&app.storage, &home, number).await?;
        Ok(Revision { storage: app.storage.clone(), home, map })
    }

    /// Returns the level that a query names; by default `main`, or the first one.
    pub fn level(&self, asked: Option<&str>) -> Result<&MapLevel, Error> {
        let levels = &self.map.levels;
        let Some(name) = asked else {
            let main = levels.iter().find(|level| level.level.is_main());
            return main.or(levels.first()).ok_or(Error::NoSuchMap);
        };
        levels.iter().find(|level| level.level.as_str() == name).ok_or_else(|| {
            let names: Vec<&str> = levels.iter().map(|level| level.level.as_str()).collect();
            let detail = format!("the map has no level of this name; its levels are {}", names.join(", "));
            invalid_query("level", detail)
        })
    }

    /// Returns a level's files of one name. Of a removed revision the list has only those that later ones share, so it is
    /// refused.
    pub async fn files(&self, level: LevelName, name: &str) -> Result<Vec<MapFile>, Error> {
        let files = self.storage.home_map_files(&self.home, self.map.revision, level, name).await?;
        self.check_kept().await?;
        Ok(files)
    }

    /// Returns a level's one file of a name. A revision of an earlier version may have none.
    pub async fn file(&self, level: LevelName, name: &str) -> Result<MapFile, Error> {
        match self
            .storage
            .home_map_files(&self.home, self.map.revision, level, name)
            .await?
            .into_iter()
            .next()
        {
            Some(file) => Ok(file),
            None => Err(self.removed_or(Error::NoSuchMap).await),
        }
    }

    pub async fn blob(&self, file: &MapFile) -> Result<BlobReader, Error> {
        self.there(file, self.storage.read_map_file(file).await?).await
    }

    pub async fn bytes(&self, file: &MapFile) -> Result<Bytes, Error> {
        self.there(file, self.storage.map_file_bytes(file).await?).await
    }

    pub async fn scene(&self, level: LevelName) -> Result<MapScene, Error> {
        let file = self.file(level, map_file::SCENE).await?;
        self.there(&file, self.storage.map_scene(&file).await?).await
    }

    /// Returns what was read of a file; refuses a file that the store does not have: its revision was removed meanwhile, or the
    /// file was lost.
    async fn there<T>(&self, file: &MapFile, read: Option<T>) -> Result<T, Error> {
        let Some(read) = read else {
            self.storage.check_map_file_removed(file).await?;
            return Err(self.removed_or(Error::NoSuchMap).await);
        };
        Ok(read)
    }

    async fn removed_or(&self, other: Error) -> Error {
        self.check_kept().await.err().unwrap_or(other)
    }

    /// Refuses a revision that was removed meanwhile.
    pub async fn check_kept(&self) -> Result<(), Error> {
        kept_map(&self.storage, &self.home, Some(self.map.revision)).await.map(drop)
    }

    /// Returns the name under which a browser saves a file of one level: what it is, and the level unless that is `main`.
    pub fn file_name(&self, what: &str, level: LevelName, ending: &str) -> String {
        let level = if level.is_main() { String::new() } else { format!("-{level}") };
        format!("{}-{}-{what}{level}.{ending}", self.home, self.map.revision)
    }

    /// Returns the entity tag of an answer that is made of the revision, from everything else that it depends on.
    pub fn tag(&self, parts: &[&[u8]]) -> String {
        let revision = self.map.revision.to_le_bytes();
        let created_at = self.map.created_at.as_millisecond().to_le_bytes();
        tag_of_made(&[&[&revision[..], &created_at[..]], parts].concat())
    }
}

/// Returns the map of a revision. The refusal tells one that was removed from one that was never made.
async fn kept_map(storage: &Storage, home: &HomeId, number: Option<i64>) -> Result<HomeMap, Error> {
    if let Some(map) = storage.home_map(home, number).await? {
        return Ok(map);
    }
    match (number, storage.home_map(home, None).await?) {
        (Some(revision), Some(current)) if revision < current.revision => {
            Err(Error::MapRevisionRemoved { revision })
        }
        _ => Err(Error::NoSuchMap),
    }
}

/// Parses a revision of a query.
pub(super) fn number(field: &'static str, text: Option<&str>, least: i64) -> Result<Option<i64>, Error> {
    query_number(field, text, |number| *number >= least, &format!("a number from {least}"))
}
