//! `/v1/homes/{home}/map`

mod changes;
mod format;
mod made_file;
mod mesh;
pub(super) mod points;
mod recording;
mod robot;
mod scene;

pub(super) use changes::{__path_get_map_changes, get_map_changes};
pub(super) use mesh::{__path_get_map_mesh, MeshFormat, get_map_mesh};
pub(super) use points::{__path_get_map_points, get_map_points};
pub(super) use recording::{__path_get_map_recording, RecordingFormat, get_map_recording};
pub(super) use robot::{__path_get_map_robot, RobotFormat, get_map_robot};
pub(super) use scene::{
    __path_get_map_coverage, __path_get_map_objects, __path_get_map_plan, __path_get_map_rooms, PlanFormat,
    get_map_coverage, get_map_objects, get_map_plan, get_map_rooms,
};

pub use scene::{objects_document, rooms_document};

use super::App;
use super::error::Error;
use super::extract::{HomePath, Query};
use super::list::{List, ListPage, ListQuery};
use super::problems::{CommonProblems, MapProblems};
use super::reply::{Document, tag_of_made};
use super::types::{self, LeftOut};
use axum::extract::State;
use serde::{Deserialize, Serialize};
use std::collections::HashSet;
use std::fmt::Display;
use uuid::Uuid;
use viola_geometry::LevelName;
use viola_storage::{HomeId, HomeMap, MapFile, MapLevel, Storage};

/// A revision of a home's map, and the clips that are not in it
#[derive(Debug, Clone, PartialEq, Serialize, utoipa::ToSchema)]
pub(super) struct CurrentMap {
    #[serde(flatten)]
    map: types::HomeMap,
    /// The home's other clips that are not in its newest map, with the reasons.
    left_out: Vec<LeftOut>,
    /// State of the home's newest map, also beside an earlier revision.
    state: types::MapState,
}

/// The query of everything that belongs to a map.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct RevisionQuery {
    /// An earlier revision that is still kept; default: the current one.
    #[param(value_type = Option<i64>, minimum = 1)]
    revision: Option<String>,
}

/// The query of what belongs to one level of a map.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct LevelQuery {
    /// The level; default: `main`, or the first by name in a home without a level of this name.
    #[param(value_type = Option<types::LevelName>)]
    level: Option<String>,
    /// An earlier revision that is still kept; default: the current one.
    #[param(value_type = Option<i64>, minimum = 1)]
    revision: Option<String>,
}

/// Returns the level of a map that a query names.
fn level<'a>(map: &'a HomeMap, asked: Option<&str>) -> Result<&'a MapLevel, Error> {
    let Some(name) = asked else {
        let main = map.levels.iter().find(|level| level.level.is_main());
        return main.or(map.levels.first()).ok_or(Error::NoSuchMap);
    };
    map.levels.iter().find(|level| level.level.as_str() == name).ok_or_else(|| {
        let names: Vec<&str> = map.levels.iter().map(|level| level.level.as_str()).collect();
        let detail = format!("the map has no level of this name; its levels are {}", names.join(", "));
        Error::InvalidQuery { field: Some("level"), detail }
    })
}

/// Returns the requested revision of a home's map, by default the current one.
async fn revision(app: &App, home: &HomeId, asked: Option<&str>) -> Result<HomeMap, Error> {
    kept(&app.storage, home, number("revision", asked, 1)?).await
}

/// Parses a number of a query.
fn number(field: &'static str, text: Option<&str>, least: i64) -> Result<Option<i64>, Error> {
    let parse = |text: &str| {
        text.parse::<i64>().ok().filter(|number| *number >= least).ok_or_else(|| Error::InvalidQuery {
            field: Some(field),
            detail: format!("{field} is a number from {least}"),
        })
    };
    text.map(parse).transpose()
}

/// Returns a revision that is kept, by default the current one.
async fn kept(storage: &Storage, home: &HomeId, number: Option<i64>) -> Result<HomeMap, Error> {
    if let Some(map) = storage.home_map(home, number).await? {
        return Ok(map);
    }
    let current = storage.home_map(home, None).await?;
    let (Some(number), Some(current)) = (number, current) else { return Err(Error::NoSuchMap) };
    Err(no_revision(number, current.revision))
}

/// Returns a level's files of one name. A revision that was removed meanwhile is refused: its list has only the files that later
/// ones share.
pub(super) async fn map_files(
    storage: &Storage,
    home: &HomeId,
    revision: i64,
    level: LevelName,
    name: &str,
) -> Result<Vec<MapFile>, Error> {
    let files = storage.home_map_files(home, revision, level, name).await?;
    kept(storage, home, Some(revision)).await?;
    Ok(files)
}

/// Returns the refusal of a revision that is not there: it was removed, or never made.
fn no_revision(revision: i64, current: i64) -> Error {
    if revision < current { Error::MapRevisionRemoved { revision } } else { Error::NoSuchMap }
}

/// Returns the error for a file that the store does not have: its revision was removed meanwhile, or the file was lost.
async fn missing(storage: &Storage, home: &HomeId, revision: i64, file: &MapFile) -> Error {
    match storage.check_map_file_removed(file).await {
        Ok(()) => without_file(storage, home, revision).await,
        Err(lost) => lost.into(),
    }
}

/// Returns the error for a file that a revision does not have: the revision was removed meanwhile, or is of an earlier version.
async fn without_file(storage: &Storage, home: &HomeId, revision: i64) -> Error {
    kept(storage, home, Some(revision)).await.err().unwrap_or(Error::NoSuchMap)
}

/// Returns the entity tag of an answer that is made of files of a map: revisions that share the files have one tag.
fn tag_of_content(files: &[MapFile], parts: &[&[u8]]) -> String {
    let keys: Vec<&[u8]> = files.iter().map(|file| file.key().as_bytes()).collect();
    tag_of_made(&[parts, keys.as_slice()].concat())
}

/// Returns the entity tag of an answer that is made of a revision, from everything else that it depends on.
fn tag_of_file(map: &HomeMap, parts: &[&[u8]]) -> String {
    let revision = map.revision.to_le_bytes();
    let created_at = map.created_at.as_millisecond().to_le_bytes();
    tag_of_made(&[&[&revision[..], &created_at[..]], parts].concat())
}

/// Get the fused map of a home: its clips, the clips left out with their reasons, and its contents
///
/// Every change of the clips, their results or their choices creates a new revision shortly afterwards; until then
/// `state` is `due`. A request with `If-None-Match` and the `ETag` of an earlier answer gets 304 if nothing has changed.
#[utoipa::path(get, path = "/v1/homes/{home}/map", tag = "map", params(HomePath, RevisionQuery),
    responses(
        (status = 200, description = "The revision", body = CurrentMap),
        (status = 304, description = "Nothing changed"), CommonProblems, MapProblems))]
pub(super) async fn get_map(
    State(app): State<App>,
    HomePath { home }: HomePath,
    Query(query): Query<RevisionQuery>,
) -> Result<Document<CurrentMap>, Error> {
    // A merge that ends between the two reads must not make an earlier revision `current`.
    let state = app.storage.map_state(&home).await?.into();
    let map = revision(&app, &home, query.revision.as_deref()).await?;
    let left_out = app.storage.clips_left_out(&home).await?;
    // They are not in the newest revision, and an earlier one may have some of them.
    let inside: HashSet<Uuid> = map.clips.iter().map(|clip| clip.clip).collect();
    let left_out = left_out.into_iter().filter(|left_out| !inside.contains(&left_out.clip));
    let left_out = left_out.map(LeftOut::from).collect();
    Ok(Document(CurrentMap { map: map.into(), left_out, state }))
}

/// List the revisions of a home's map that are kept, newest first
#[utoipa::path(get, path = "/v1/homes/{home}/map/revisions", tag = "map", params(HomePath, ListQuery),
    responses((status = 200, description = "One page", body = List<types::HomeMap>), CommonProblems))]
pub(super) async fn list_map_revisions(
    State(app): State<App>,
    HomePath { home }: HomePath,
    query: ListPage,
) -> Result<Document<List<types::HomeMap>>, Error> {
    let maps = app.storage.home_map_revisions(&home, &query.page()?).await?;
    Ok(Document(query.list(maps, |map| map.revision)?))
}

/// Runs work on a thread that may block.
async fn apart<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> T {
    match tokio::task::spawn_blocking(work).await {
        Ok(done) => done,
        Err(error) => std::panic::resume_unwind(error.into_panic()),
    }
}

/// Returns the name under which a browser saves a file of one level: what it is, and the level unless that is `main`.
fn file_name(
    home: impl Display,
    revision: impl Display,
    what: &str,
    level: LevelName,
    ending: &str,
) -> String {
    let level = if level.is_main() { String::new() } else { format!("-{level}") };
    format!("{home}-{revision}-{what}{level}.{ending}")
}

#[cfg(test)]
mod tests {
    use super::points::Points;
    use super::*;
    use crate::api::reply::tag_of;
    use std::path::Path;
    use std::sync::Arc;
    use std::time::Duration;
    use viola_align::Alignment;
    use viola_formats::clip::Clip;
    use viola_formats::lidar::LidarMap;
    use viola_home::{ClipNumbers, PointFilter, TileKey};
    use viola_storage::{
        AttemptEnd, NewClip, NewLidarMap, NewRevision, RetryPolicy, StorageParams, map_file,
    };
    use viola_testing::{room, zips};

    /// Makes the next revision of a map, with one tile.
    async fn make_revision(storage: &Storage, home: &HomeId, number: u8) {
        storage.put_home(home, Some(&format!("name {number}")), |_| true, storage.now()).await.unwrap();
        let claim = storage.claim_merge("", Duration::from_mins(1), storage.now()).await.unwrap();
        let tile = TileKey { level: LevelName::MAIN, x: 0, y: 0 };
        let new = NewRevision { tiles: vec![(tile, Some(vec![number]))], ..NewRevision::default() };
        let claim = claim.expect("the map is due");
        assert!(storage.finish_merge(&claim, Some(&new), storage.now()).await.unwrap());
    }

    /// Returns a home whose one clip has an answer.
    async fn home_with_due_map(storage: &Storage, folder: &Path) -> HomeId {
        let (home, now): (HomeId, _) = ("h".parse().unwrap(), storage.now());
        storage.put_home(&home, None, |_| true, now).await.unwrap();
        let file = storage.incoming().unwrap().finish().await.unwrap();
        let (level, info) = (LevelName::MAIN, LidarMap::read(room::lidar_csv().as_bytes()).unwrap().info);
        let lidar =
            NewLidarMap { level, file, file_name: None, info, from_earlier: None, image_png: Vec::new() };
        storage.put_lidar_map(&home, lidar, None, |_| true, now).await.unwrap();
        let recording = folder.join("clip.zip");
        std::fs::write(&recording, zips::zip(&room::clip(2))).unwrap();
        let clip = NewClip {
            file: storage.incoming().unwrap().finish().await.unwrap(),
            info: Clip::open(&recording).unwrap().info().clone(),
            content_sha256: None,
            idempotency_key: None,
            recorded_at: None,
            title: None,
            file_name: None,
        };
        storage.add_clip(&home, clip, None, now).await.unwrap();
        let claim = storage.claim(Duration::from_mins(1), now).await.unwrap().expect("a job is due");
        let answer = AttemptEnd::Answered(Box::new(Alignment::failed()));
        assert!(storage.finish(&claim, &answer, &RetryPolicy::default(), now).await.unwrap());
        home
    }

    #[tokio::test]
    async fn a_revision_that_is_removed_during_a_request_is_told_as_removed() {
        let folder = tempfile::tempdir().unwrap();
        let storage = Arc::new(Storage::open(&StorageParams::in_folder(folder.path())).await.unwrap());
        let (home, level) = (home_with_due_map(&storage, folder.path()).await, LevelName::MAIN);
        make_revision(&storage, &home, 1).await;
        let tiles = storage.home_map_files(&home, 1, level, map_file::TILE).await.unwrap();
        let points = Points {
            storage: storage.clone(),
            home: home.clone(),
            revision: 1,
            clips: ClipNumbers::new(std::iter::empty()),
            filter: PointFilter::default(),
        };
        for number in 2..=6 {
            make_revision(&storage, &home, number).await;
        }
        let current = storage.home_map_files(&home, 6, level, map_file::TILE).await.unwrap();
        let cases = [
            (points.of_tile(&tiles[0]).await.unwrap_err(), "map-revision-removed"),
            (map_files(&storage, &home, 1, level, map_file::TILE).await.unwrap_err(), "map-revision-removed"),
            (missing(&storage, &home, 1, &tiles[0]).await, "map-revision-removed"),
            (without_file(&storage, &home, 1).await, "map-revision-removed"),
            (without_file(&storage, &home, 6).await, "map-not-found"),
        ];
        for (error, code) in cases {
            assert_eq!(error.problem().kind, format!("urn:viola:problem:{code}"), "{error}");
        }
        let lost = missing(&storage, &home, 6, &current[0]).await;
        assert!(lost.problem().status >= 500, "a lost file of a kept revision: {lost}");
        storage.delete_home(&home, |_| true, storage.now()).await.unwrap();
        let removed = points.of_tile(&tiles[0]).await.unwrap_err();
        assert_eq!(removed.problem().kind, "urn:viola:problem:home-not-found");
        storage.close().await;
    }

    #[test]
    fn the_tag_of_a_made_file_is_of_this_version() {
        let of_content = tag_of_content(&[], &[b"glb"]);
        assert_eq!(of_content, tag_of(&[env!("CARGO_PKG_VERSION").as_bytes(), b"glb"]));
        assert_ne!(of_content, tag_of_content(&[], &[b"obj"]));
    }

    #[test]
    fn different_files_have_different_names() {
        let name = |what, level: &str, ending| file_name("elm", 7, what, level.parse().unwrap(), ending);
        assert_eq!(name("points", "main", "glb"), "elm-7-points.glb");
        assert_eq!(name("mesh", "main", "glb"), "elm-7-mesh.glb");
        assert_eq!(name("mesh", "upper", "glb"), "elm-7-mesh-upper.glb");
    }
}
