//! `/v1/homes/{home}/lidar-maps`: the LiDAR maps of all levels

use super::App;
use super::access::Caller;
use super::bodies::{FileBytes, to_the_end};
use super::error::Error;
use super::extract::{HomePath, LevelPath, LevelRevisionPath, Query};
use super::lidar_map::{self, CurrentLidarMap, PutAnswer, PutQuery};
use super::list::{List, ListPage, ListQuery};
use super::problems::{CommonProblems, FileProblems, LidarMapProblems};
use super::reply::Document;
use super::types::LidarMapRevision;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, StatusCode};
use axum::response::Response;
use serde::Serialize;

/// The current LiDAR maps of a home
#[derive(Serialize, utoipa::ToSchema)]
pub(super) struct LidarMaps {
    /// One for each level, by the levels' names.
    items: Vec<CurrentLidarMap>,
}

/// List the current LiDAR maps of a home, one for each level
#[utoipa::path(get, path = "/v1/homes/{home}/lidar-maps", tag = "lidar-map", params(HomePath),
    responses((status = 200, description = "The current revision of each level", body = LidarMaps), CommonProblems))]
pub(super) async fn list_lidar_maps(
    State(app): State<App>,
    HomePath { home }: HomePath,
) -> Result<Document<LidarMaps>, Error> {
    let maps = app.storage.lidar_maps(&home).await?;
    Ok(Document(LidarMaps { items: maps.into_iter().map(CurrentLidarMap::from).collect() }))
}

/// Upload the LiDAR map of a level
///
/// A home has a LiDAR map for each storey, at most 8. The body is the file; its format is detected from its
/// content. A new file is a new revision, and every clip of the home is queued to be aligned to the maps of all
/// levels at once. Sending the current file again changes nothing. `PUT .../lidar-map` is the same for the level
/// `main`.
#[utoipa::path(put, path = "/v1/homes/{home}/lidar-maps/{level}", tag = "lidar-map",
    params(LevelPath, PutQuery,
        ("If-Match" = Option<String>, Header, description = "The `ETag` of the LiDAR map that the file replaces"),
        ("If-None-Match" = Option<String>, Header, description = "`*` if the level must have no LiDAR map yet"),
        ("Content-Digest" = Option<String>, Header, pattern = "^sha-256=:[A-Za-z0-9+/]{43}=:$", description = "SHA-256 of the body"),
        ("Repr-Digest" = Option<String>, Header, pattern = "^sha-256=:[A-Za-z0-9+/]{43}=:$", description = "SHA-256 of the body")),
    request_body(content = FileBytes, content_type = "application/octet-stream",
        description = "Any format of `PUT .../lidar-map`"),
    responses(
        (status = 200, description = "This is the current revision already; or the result of a dry run", body = PutAnswer,
            headers(("ETag" = String, description = "Of the LiDAR map, for `If-Match` of the next change"))),
        (status = 201, description = "A new revision", body = LidarMapRevision,
            headers(("ETag" = String, description = "Of the LiDAR map, for `If-Match` of the next change"))),
        LidarMapProblems, CommonProblems, FileProblems))]
pub(super) async fn put_level_lidar_map(
    State(app): State<App>,
    caller: Caller,
    LevelPath { home, level }: LevelPath,
    Query(query): Query<PutQuery>,
    request: Request,
) -> Result<Response, Error> {
    lidar_map::put(app, &caller, home, level, query, request).await
}

/// Make an earlier revision of a LiDAR map the current one again
///
/// The file of the earlier revision becomes a new revision, and every clip of the home is queued to be aligned to it. If
/// the current revision has the same file, nothing changes.
#[utoipa::path(post, path = "/v1/homes/{home}/lidar-maps/{level}/revisions/{revision}/restore", tag = "lidar-map",
    params(LevelRevisionPath,
        ("If-Match" = Option<String>, Header, description = "The `ETag` of the LiDAR map that it replaces")),
    responses(
        (status = 200, description = "The current revision has this file already", body = LidarMapRevision,
            headers(("ETag" = String, description = "Of the LiDAR map, for `If-Match` of the next change"))),
        (status = 201, description = "The new revision", body = LidarMapRevision,
            headers(("ETag" = String, description = "Of the LiDAR map, for `If-Match` of the next change"))),
        (status = 412, description = "The LiDAR map was changed since it was read: `changed-meanwhile`"),
        (status = 507, description = "The service or the tenant has no room left: `storage-full`, `tenant-full`"),
        CommonProblems))]
pub(super) async fn restore_lidar_map(
    State(app): State<App>,
    caller: Caller,
    LevelRevisionPath { home, level, revision }: LevelRevisionPath,
    headers: HeaderMap,
) -> Result<Response, Error> {
    let earlier = lidar_map::of_revision(&app, &home, level, revision).await?;
    let mut from_current = None;
    if !lidar_map::is_current(&app, &home, level, &earlier.sha256).await? {
        app.limits.check_quota(&app.storage, &caller.tenant, earlier.size_bytes).await?;
        let file = app.storage.earlier_lidar_map_file(&home, &earlier).await?;
        from_current = lidar_map::from_current(&app, &home, level, file).await;
    }
    to_the_end(async move {
        let is_expected = lidar_map::is_expected_or_same(&headers, &earlier.sha256);
        let (max_bytes, now) = (app.limits.storage_bytes, app.storage.now());
        let restored =
            app.storage.restore_lidar_map(&home, &earlier, from_current, max_bytes, is_expected, now);
        let (current, is_new) = restored.await?;
        app.queue.wake();
        Ok(lidar_map::answer(current, is_new))
    })
    .await
}

/// Get the current LiDAR map of a level: the summary of its file
#[utoipa::path(get, path = "/v1/homes/{home}/lidar-maps/{level}", tag = "lidar-map", params(LevelPath),
    responses((status = 200, description = "The current revision", body = CurrentLidarMap), CommonProblems))]
pub(super) async fn get_level_lidar_map(
    State(app): State<App>,
    LevelPath { home, level }: LevelPath,
) -> Result<Document<CurrentLidarMap>, Error> {
    Ok(Document(lidar_map::current(&app, &home, level).await?.into()))
}

/// Remove a level: its LiDAR maps, and what people chose and corrected on it
///
/// Every clip of the home is queued to be aligned to the other levels. The last level cannot be removed.
#[utoipa::path(delete, path = "/v1/homes/{home}/lidar-maps/{level}", tag = "lidar-map",
    params(LevelPath, ("If-Match" = Option<String>, Header, description = "The `ETag` of the LiDAR map as it was read")),
    responses(
        (status = 204, description = "The level is removed"),
        (status = 412, description = "The LiDAR map was changed since it was read: `changed-meanwhile`"),
        (status = 409, description = "The home has no other level: `last-level`"),
        CommonProblems))]
pub(super) async fn delete_level(
    State(app): State<App>,
    LevelPath { home, level }: LevelPath,
    headers: HeaderMap,
) -> Result<StatusCode, Error> {
    to_the_end(async move {
        let is_expected = lidar_map::is_expected(&headers);
        app.storage.delete_lidar_map(&home, level, is_expected, app.storage.now()).await?;
        app.queue.wake();
        Ok(StatusCode::NO_CONTENT)
    })
    .await
}

/// Get a picture of the current LiDAR map of a level
#[utoipa::path(get, path = "/v1/homes/{home}/lidar-maps/{level}/image.png", tag = "lidar-map", params(LevelPath),
    responses((status = 200, description = "The picture", body = FileBytes, content_type = "image/png"), CommonProblems))]
pub(super) async fn get_level_lidar_map_image(
    State(app): State<App>,
    LevelPath { home, level }: LevelPath,
    headers: HeaderMap,
) -> Result<Response, Error> {
    lidar_map::image(&app, &lidar_map::current(&app, &home, level).await?, &headers).await
}

/// List all revisions of the LiDAR map of a level, newest first
#[utoipa::path(get, path = "/v1/homes/{home}/lidar-maps/{level}/revisions", tag = "lidar-map",
    params(LevelPath, ListQuery),
    responses((status = 200, description = "One page", body = List<LidarMapRevision>), CommonProblems))]
pub(super) async fn list_level_lidar_map_revisions(
    State(app): State<App>,
    LevelPath { home, level }: LevelPath,
    query: ListPage,
) -> Result<Document<List<LidarMapRevision>>, Error> {
    let revisions = app.storage.lidar_map_revisions(&home, level, &query.page()?).await?;
    if revisions.is_empty() && !level.is_main() {
        // Refuses a level that does not exist.
        lidar_map::current(&app, &home, level).await?;
    }
    Ok(Document(query.list(revisions, |revision| revision.revision)?))
}
