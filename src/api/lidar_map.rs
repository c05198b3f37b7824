//! `/v1/homes/{home}/lidar-map`: the LiDAR map of the level `main`

use super::App;
use super::access::Caller;
use super::bodies::{FileBytes, receive, send, to_the_end};
use super::error::Error;
use super::extract::{HomePath, Query};
use super::list::{List, ListQuery};
use super::problems::{CommonProblems, FileProblems};
use super::types::{LidarMapRevision, PictureFrame};
use crate::storage::{self, Arrived, HomeId, NewLidarMap};
use axum::Json;
use axum::extract::{Request, State};
use axum::http::StatusCode;
use axum::response::Response;
use jiff::Timestamp;
use serde::Serialize;
use viola_formats::lidar::{LidarMap, MAX_FILE_BYTES};
use viola_geometry::LevelName;
use viola_home as home;

/// The current LiDAR map and the frame of its picture
#[derive(Serialize, utoipa::ToSchema)]
pub(super) struct CurrentLidarMap {
    #[serde(flatten)]
    map: LidarMapRevision,
    /// Frame of `image.png`.
    image: PictureFrame,
}

/// Upload the LiDAR map of the level `main`
///
/// A home with one storey has this map only. The body is the file; its format is detected from its content. A new file is a new revision, and every
/// clip of the home is queued to be aligned to it. Sending the current file again changes nothing.
#[utoipa::path(put, path = "/v1/homes/{home}/lidar-map", tag = "lidar-map", params(HomePath),
    request_body(content = FileBytes, content_type = "application/octet-stream",
        description = "Valetudo (JSON or PNG), the file of a Roborock, Dreame or Viomi robot, a zip of a ROS map_server yaml \
            and its image, a CARMEN log, or points as CSV, PLY or PCD"),
    responses(
        (status = 200, description = "This is the current revision already", body = LidarMapRevision),
        (status = 201, description = "A new revision", body = LidarMapRevision),
        CommonProblems, FileProblems))]
pub(super) async fn put_lidar_map(
    State(app): State<App>,
    caller: Caller,
    HomePath { home }: HomePath,
    request: Request,
) -> Result<(StatusCode, Json<LidarMapRevision>), Error> {
    put(app, &caller, home, LevelName::MAIN, request).await
}

/// Receives, reads and stores the map of a level.
pub(super) async fn put(
    app: App,
    caller: &Caller,
    home: HomeId,
    level: LevelName,
    request: Request,
) -> Result<(StatusCode, Json<LidarMapRevision>), Error> {
    app.storage.home(&home).await?;
    let file = receive(&app, request, MAX_FILE_BYTES).await?;
    let new = app.readers.run(home.tenant(), move || open(level, file)).await??;
    app.limits.room(&app.storage, &caller.tenant, new.bytes()).await?;
    to_the_end(async move {
        let (revision, is_new) = app.storage.put_lidar_map(&home, new, Timestamp::now()).await?;
        app.queue.wake();
        let status = if is_new { StatusCode::CREATED } else { StatusCode::OK };
        Ok((status, Json(revision.into())))
    })
    .await
}

fn open(level: LevelName, file: Arrived) -> Result<NewLidarMap, Error> {
    let bytes = file.read()?;
    let map = LidarMap::read(&bytes)?;
    Ok(NewLidarMap { level, file, image_png: home::lidar_png(&map), info: map.info })
}

/// Get the current LiDAR map of the level `main`: the summary of its file
#[utoipa::path(get, path = "/v1/homes/{home}/lidar-map", tag = "lidar-map", params(HomePath),
    responses((status = 200, description = "The current revision", body = CurrentLidarMap), CommonProblems))]
pub(super) async fn get_lidar_map(
    State(app): State<App>,
    HomePath { home }: HomePath,
) -> Result<Json<CurrentLidarMap>, Error> {
    Ok(Json(app.storage.lidar_map(&home, LevelName::MAIN).await?.into()))
}

impl From<storage::LidarMapRevision> for CurrentLidarMap {
    fn from(map: storage::LidarMapRevision) -> CurrentLidarMap {
        let image = home::PictureFrame::of(&map.info);
        CurrentLidarMap { map: map.into(), image: image.into() }
    }
}

/// Get a picture of the current LiDAR map of the level `main`
#[utoipa::path(get, path = "/v1/homes/{home}/lidar-map/image.png", tag = "lidar-map", params(HomePath),
    responses((status = 200, description = "The picture", body = FileBytes, content_type = "image/png"), CommonProblems))]
pub(super) async fn get_lidar_map_image(
    State(app): State<App>,
    HomePath { home }: HomePath,
) -> Result<Response, Error> {
    Ok(send(app.storage.lidar_map_image(&home, LevelName::MAIN).await?, "image/png"))
}

/// List all revisions of the LiDAR map of the level `main`, newest first
#[utoipa::path(get, path = "/v1/homes/{home}/lidar-map/revisions", tag = "lidar-map",
    params(HomePath, ListQuery),
    responses((status = 200, description = "One page", body = List<LidarMapRevision>), CommonProblems))]
pub(super) async fn list_lidar_map_revisions(
    State(app): State<App>,
    HomePath { home }: HomePath,
    Query(query): Query<ListQuery>,
) -> Result<Json<List<LidarMapRevision>>, Error> {
    let revisions = app.storage.lidar_map_revisions(&home, LevelName::MAIN, &query.page()?).await?;
    Ok(Json(query.list(revisions, |revision| revision.revision)?))
}
