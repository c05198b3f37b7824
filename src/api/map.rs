//! `/v1/homes/{home}/map`

pub(super) mod changes;
mod format;
mod made_file;
pub(super) mod mesh;
pub(super) mod points;
pub(super) mod recording;
mod revision;
pub(super) mod robot;
pub(super) mod scene;

pub(super) use revision::Revision;
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
use uuid::Uuid;
use viola_storage::MapFile;

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

/// Returns the entity tag of an answer that is made of files of a map: revisions that share the files have one tag.
fn tag_of_content(files: &[MapFile], parts: &[&[u8]]) -> String {
    let keys: Vec<&[u8]> = files.iter().map(|file| file.key().as_bytes()).collect();
    tag_of_made(&[parts, keys.as_slice()].concat())
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
    let Revision { map, home, .. } = Revision::asked(&app, home, query.revision.as_deref()).await?;
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
    use viola_geometry::LevelName;
    use viola_home::{PointFilter, TileKey};
    use viola_storage::{
        AttemptEnd, HomeId, NewClip, NewLidarMap, NewRevision, RetryPolicy, Storage, StorageParams, map_file,
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
    async fn different_files_have_different_names() {
        let folder = tempfile::tempdir().unwrap();
        let storage = Arc::new(Storage::open(&StorageParams::in_folder(folder.path())).await.unwrap());
        let home = home_with_due_map(&storage, folder.path()).await;
        make_revision(&storage, &home, 1).await;
        let map = storage.home_map(&home, None).await.unwrap().unwrap();
        let revision = Revision { storage: storage.clone(), home, map };
        let name = |what, level: &str, ending| revision.file_name(what, level.parse().unwrap(), ending);
        assert_eq!(name("points", "main", "glb"), "h-1-points.glb");
        assert_eq!(name("mesh", "main", "glb"), "h-1-mesh.glb");
        assert_eq!(name("mesh", "upper", "glb"), "h-1-mesh-upper.glb");
        storage.close().await;
    }

    #[tokio::test]
    async fn a_revision_that_is_removed_during_a_request_is_told_as_removed() {
        let folder = tempfile::tempdir().unwrap();
        let storage = Arc::new(Storage::open(&StorageParams::in_folder(folder.path())).await.unwrap());
        let (home, level) = (home_with_due_map(&storage, folder.path()).await, LevelName::MAIN);
        make_revision(&storage, &home, 1).await;
        let revision = async || {
            let map = storage.home_map(&home, None).await.unwrap().unwrap();
            Revision { storage: storage.clone(), home: home.clone(), map }
        };
        let first = revision().await;
        let tiles = first.files(level, map_file::TILE).await.unwrap();
        let points = Points::new(&first, PointFilter::default());
        for number in 2..=6 {
            make_revision(&storage, &home, number).await;
        }
        let last = revision().await;
        let cases = [
            (points.of_tile(&tiles[0]).await.unwrap_err(), "map-revision-removed"),
            (first.files(level, map_file::TILE).await.unwrap_err(), "map-revision-removed"),
            (first.bytes(&tiles[0]).await.unwrap_err(), "map-revision-removed"),
            (first.file(level, map_file::PLAN_SVG).await.unwrap_err(), "map-revision-removed"),
            (last.file(level, map_file::PLAN_SVG).await.unwrap_err(), "map-not-found"),
        ];
        for (error, code) in cases {
            assert_eq!(error.problem().kind, format!("urn:viola:problem:{code}"), "{error}");
        }
        let current = last.files(level, map_file::TILE).await.unwrap();
        std::fs::remove_file(folder.path().join("blobs").join(current[0].key())).unwrap();
        let lost = last.bytes(&current[0]).await.unwrap_err();
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
}
