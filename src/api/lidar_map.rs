//! `/v1/homes/{home}/lidar-map`: the LiDAR map of the level `main`

use super::App;
use super::access::Caller;
use super::bodies::{FileBytes, receive, send, to_the_end};
use super::clips::flag;
use super::error::{Defence, Error};
use super::extract::{HomePath, Query};
use super::list::{List, ListPage, ListQuery};
use super::names::file_name;
use super::problems::{CommonProblems, FileProblems, LidarMapProblems};
use super::reply::{Document, may_change, may_repeat, tag_of, tag_of_document, tagged, unless_known, unmet};
use super::types::{LidarInfo, LidarMapRevision, PictureFrame};
use axum::extract::{Request, State};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use serde::{Deserialize, Serialize};
use tracing::warn;
use viola_align::later_from_earlier;
use viola_formats::lidar::{LidarMap, MAX_FILE_BYTES};
use viola_geometry::LevelName;
use viola_home as home;
use viola_storage::{Arrived, FromEarlier, HomeId, NewLidarMap, StorageError};

/// The parameter by which a page makes the address of a new picture another one.
const REVISION: &str = "Ignored. A page sends the `lidar_map_revision` of the home, so that its browser does not show the picture \
    of an earlier map";

/// The current LiDAR map and the frame of its picture
#[derive(Serialize, utoipa::ToSchema)]
pub(super) struct CurrentLidarMap {
    #[serde(flatten)]
    map: LidarMapRevision,
    /// Frame of `image.png`.
    image: PictureFrame,
}

/// The query of an upload of a LiDAR map.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct PutQuery {
    /// With `true`, the file is only checked: the answer has a summary of the file, and nothing is kept or queued. A file that
    /// the upload would refuse is refused.
    #[param(value_type = Option<bool>, example = true)]
    dry_run: Option<String>,
    /// Name of the file; its download has it.
    #[param(
        min_length = 1,
        max_length = 255,
        pattern = "^[^\\x00-\\x1f\\x7f-\\x9f]*[^\\s\\x00-\\x1f\\x7f-\\x9f][^\\x00-\\x1f\\x7f-\\x9f]*$",
        example = "valetudo.json"
    )]
    filename: Option<String>,
}

/// The result of a dry run
#[derive(Serialize, utoipa::ToSchema)]
pub(super) struct LidarMapDryRun {
    /// Size of the file.
    #[schema(example = 15540)]
    size_bytes: u64,
    understood: LidarInfo,
    /// Number of clips that would be aligned again; 0 if this is the current revision's file.
    #[schema(example = 3)]
    clips_to_align: i64,
}

/// The answer to an upload of a LiDAR map.
#[derive(utoipa::ToSchema)]
#[serde(untagged)]
#[expect(dead_code, reason = "it only describes the answer")]
pub(super) enum PutAnswer {
    Revision(Box<LidarMapRevision>),
    DryRun(Box<LidarMapDryRun>),
}

/// Upload the LiDAR map of the level `main`
///
/// A home with one storey has this map only. The body is the file; its format is detected from its content. A new file is a new revision, and every
/// clip of the home is queued to be aligned to it. Sending the current file again changes nothing.
#[utoipa::path(put, path = "/v1/homes/{home}/lidar-map", tag = "lidar-map",
    params(HomePath, PutQuery,
        ("If-Match" = Option<String>, Header, description = "The `ETag` of the LiDAR map that the file replaces"),
        ("If-None-Match" = Option<String>, Header, description = "`*` if the level must have no LiDAR map yet"),
        ("Content-Digest" = Option<String>, Header, pattern = "^sha-256=:[A-Za-z0-9+/]{43}=:$", description = "SHA-256 of the body"),
        ("Repr-Digest" = Option<String>, Header, pattern = "^sha-256=:[A-Za-z0-9+/]{43}=:$", description = "SHA-256 of the body")),
    request_body(content = FileBytes, content_type = "application/octet-stream",
        description = "Valetudo (JSON or PNG), the file of a Roborock, Dreame or Viomi robot, a zip of a ROS map_server yaml \
            and its image, a CARMEN log, or points as CSV, PLY or PCD"),
    responses(
        (status = 200, description = "This is the current revision already; or the result of a dry run", body = PutAnswer,
            headers(("ETag" = String, description = "Of the LiDAR map, for `If-Match` of the next change"))),
        (status = 201, description = "A new revision", body = LidarMapRevision,
            headers(("ETag" = String, description = "Of the LiDAR map, for `If-Match` of the next change"))),
        LidarMapProblems, CommonProblems, FileProblems))]
pub(super) async fn put_lidar_map(
    State(app): State<App>,
    caller: Caller,
    HomePath { home }: HomePath,
    Query(query): Query<PutQuery>,
    request: Request,
) -> Result<Response, Error> {
    put(app, &caller, home, LevelName::MAIN, query, request).await
}

/// Receives, reads and stores the map of a level.
pub(super) async fn put(
    app: App,
    caller: &Caller,
    home: HomeId,
    level: LevelName,
    query: PutQuery,
    request: Request,
) -> Result<Response, Error> {
    let about = app.storage.home(&home).await?;
    let dry_run = flag("dry_run", query.dry_run.as_deref())?;
    let file_name = file_name(query.filename)?;
    let headers = request.headers().clone();
    let (file, _arrival) = receive(&app, home.tenant(), request, MAX_FILE_BYTES).await?;
    let (mut new, bytes) = app.readers.run(home.tenant(), move || open(level, file, file_name)).await??;
    let is_same = is_current(&app, &home, level, &new.file.sha256).await?;
    let is_expected = is_expected_or_same(&headers, &new.file.sha256);
    if !is_same {
        app.limits.check_quota(&app.storage, &caller.tenant, new.bytes()).await?;
    }
    if dry_run {
        let checked = app.storage.check_lidar_map(&home, level, is_expected).await;
        checked.map_err(|error| unmet(&headers, error))?;
        let report = LidarMapDryRun {
            size_bytes: new.file.size_bytes,
            understood: new.info.into(),
            clips_to_align: if is_same { 0 } else { about.clips.iter().sum() },
        };
        return Ok(Document(report).into_response());
    }
    if !is_same {
        new.from_earlier = from_current(&app, &home, level, bytes).await;
    }
    to_the_end(async move {
        let max_bytes = app.limits.storage_bytes;
        let put = app.storage.put_lidar_map(&home, new, max_bytes, is_expected, app.storage.now()).await;
        let (revision, is_new) = put.map_err(|error| unmet(&headers, error))?;
        app.queue.wake();
        Ok(answer(revision, is_new))
    })
    .await
}

/// Returns the answer with a revision that is the current one now. Its entity tag is that of the level's LiDAR map, which has
/// more members.
pub(super) fn answer(revision: viola_storage::LidarMapRevision, is_new: bool) -> Response {
    let status = if is_new { StatusCode::CREATED } else { StatusCode::OK };
    let tag = tag_of_document(&CurrentLidarMap::from(revision.clone()));
    let document = Document(LidarMapRevision::from(revision));
    tagged((status, document).into_response(), &tag)
}

/// Returns whether a level's current map has a file already: storing it would change nothing.
pub(super) async fn is_current(
    app: &App,
    home: &HomeId,
    level: LevelName,
    sha256: &str,
) -> Result<bool, Error> {
    let maps = app.storage.lidar_maps(home).await?;
    Ok(maps.iter().any(|map| map.level == level && map.sha256 == sha256))
}

/// Returns whether a request allows to replace a LiDAR map: its conditions are about the document of the current one.
pub(super) fn is_expected(
    headers: &HeaderMap,
) -> impl Fn(Option<&viola_storage::LidarMapRevision>) -> bool + Send + use<> {
    let headers = headers.clone();
    move |map| may_change(&headers, map.map(|map| CurrentLidarMap::from(map.clone())).as_ref())
}

/// Like [`is_expected`], for a file that may be that of the current map: then the request changes nothing.
pub(super) fn is_expected_or_same(
    headers: &HeaderMap,
    sha256: &str,
) -> impl Fn(Option<&viola_storage::LidarMapRevision>) -> bool + Send + use<> {
    let (sha256, may_repeat, is_as_read) = (sha256.to_owned(), may_repeat(headers), is_expected(headers));
    move |map| {
        let is_same = map.is_some_and(|map| map.sha256 == sha256);
        is_same && may_repeat || is_as_read(map)
    }
}

/// Reads a file; returns the bytes beside what is stored.
fn open(level: LevelName, file: Arrived, file_name: Option<String>) -> Result<(NewLidarMap, Bytes), Error> {
    let bytes = Bytes::from(file.read()?);
    let map = LidarMap::read(&bytes)?;
    let image_png = home::lidar_png(&map);
    Ok((NewLidarMap { level, file, file_name, image_png, info: map.info, from_earlier: None }, bytes))
}

/// Registers a level's current map to the file that replaces it; `None` if the level has no map, and if the maps do not
/// tell the frame. Without an answer the new file is taken all the same: it may replace one that is damaged.
pub(super) async fn from_current(
    app: &App,
    home: &HomeId,
    level: LevelName,
    later: Bytes,
) -> Option<FromEarlier> {
    match registered(app, home, level, later).await {
        Ok(from_current) => from_current,
        Err(error) => {
            let cause = why_unregistered(&error);
            warn!(
                %home,
                %level,
                cause,
                "the LiDAR map is replaced, and was not registered to the new one: the clips are aligned again, and choices and \
                 corrections keep their places"
            );
            None
        }
    }
}

/// Returns why a registration ended without a result. The words of a refused file are for its sender.
fn why_unregistered(error: &Error) -> String {
    match error {
        Error::Defence(Defence::TookTooLong { limit }) => {
            format!("the comparison of the two maps took longer than {} s", limit.as_secs_f64())
        }
        Error::Defence(Defence::ReadersBusy { wait }) => {
            format!("other files were being read, and none of them ended within {} s", wait.as_secs_f64())
        }
        error => error.to_string(),
    }
}

async fn registered(
    app: &App,
    home: &HomeId,
    level: LevelName,
    later: Bytes,
) -> Result<Option<FromEarlier>, Error> {
    let maps = app.storage.lidar_maps(home).await?;
    let Some(current) = maps.into_iter().find(|map| map.level == level) else { return Ok(None) };
    let earlier = app.storage.lidar_map_file(current.id()).await?;
    let register = move || {
        // A file that an earlier version of the service took may be refused now.
        let earlier = LidarMap::read(&earlier).ok()?;
        later_from_earlier(&earlier, &LidarMap::read(&later).ok()?)
    };
    let map_from_earlier = app.readers.run(home.tenant(), register).await?;
    Ok(map_from_earlier.map(|map_from_earlier| FromEarlier { revision: current.revision, map_from_earlier }))
}

/// Get the current LiDAR map of the level `main`: the summary of its file
#[utoipa::path(get, path = "/v1/homes/{home}/lidar-map", tag = "lidar-map", params(HomePath),
    responses((status = 200, description = "The current revision", body = CurrentLidarMap), CommonProblems))]
pub(super) async fn get_lidar_map(
    State(app): State<App>,
    HomePath { home }: HomePath,
) -> Result<Document<CurrentLidarMap>, Error> {
    Ok(Document(current(&app, &home, LevelName::MAIN).await?.into()))
}

/// Returns the current LiDAR map of a level. The refusal of a level without one names the home's levels.
pub(super) async fn current(
    app: &App,
    home: &HomeId,
    level: LevelName,
) -> Result<viola_storage::LidarMapRevision, Error> {
    match app.storage.lidar_map(home, level).await {
        Err(StorageError::NoLidarMap) => {
            let maps = app.storage.lidar_maps(home).await?;
            let levels: Vec<&str> = maps.iter().map(|map| map.level.as_str()).collect();
            Err(if levels.is_empty() {
                Error::from(StorageError::NoLidarMap)
            } else {
                Error::NoSuchLevel { level, levels: levels.join(", ") }
            })
        }
        map => Ok(map?),
    }
}

/// Returns a revision of the LiDAR map of a level. The refusal tells whether the home, the level or the revision is missing.
pub(super) async fn of_revision(
    app: &App,
    home: &HomeId,
    level: LevelName,
    revision: i64,
) -> Result<viola_storage::LidarMapRevision, Error> {
    match app.storage.lidar_map_revision(home, level, revision).await? {
        Some(map) => Ok(map),
        None => Err(current(app, home, level).await.err().unwrap_or(Error::NoSuchLidarRevision(revision))),
    }
}

impl From<viola_storage::LidarMapRevision> for CurrentLidarMap {
    fn from(map: viola_storage::LidarMapRevision) -> CurrentLidarMap {
        let image = home::PictureFrame::of(&map.info);
        CurrentLidarMap { map: map.into(), image: image.into() }
    }
}

/// Get a picture of the current LiDAR map of the level `main`
///
/// For a home without a level of this name, it is the picture of the first level by name.
#[utoipa::path(get, path = "/v1/homes/{home}/lidar-map/image.png", tag = "lidar-map",
    params(HomePath, ("revision" = Option<String>, Query, description = REVISION)),
    responses((status = 200, description = "The picture", body = FileBytes, content_type = "image/png"), CommonProblems))]
pub(super) async fn get_lidar_map_image(
    State(app): State<App>,
    HomePath { home }: HomePath,
    headers: HeaderMap,
) -> Result<Response, Error> {
    let maps = app.storage.lidar_maps(&home).await?;
    let main = maps.iter().find(|map| map.level.is_main());
    image(&app, main.or(maps.first()).ok_or(StorageError::NoLidarMap)?, &headers).await
}

/// Returns the picture of a LiDAR map.
pub(super) async fn image(
    app: &App,
    map: &viola_storage::LidarMapRevision,
    headers: &HeaderMap,
) -> Result<Response, Error> {
    let blob = app.storage.lidar_map_image(map).await?;
    Ok(unless_known(headers, &tag_of(&[map.id().as_bytes()]), || send(blob, "image/png")))
}

/// List all revisions of the LiDAR map of the level `main`, newest first
#[utoipa::path(get, path = "/v1/homes/{home}/lidar-map/revisions", tag = "lidar-map",
    params(HomePath, ListQuery),
    responses((status = 200, description = "One page", body = List<LidarMapRevision>), CommonProblems))]
pub(super) async fn list_lidar_map_revisions(
    State(app): State<App>,
    HomePath { home }: HomePath,
    query: ListPage,
) -> Result<Document<List<LidarMapRevision>>, Error> {
    let revisions = app.storage.lidar_map_revisions(&home, LevelName::MAIN, &query.page()?).await?;
    Ok(Document(query.list(revisions, |revision| revision.revision)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn a_lost_registration_is_told_without_advice_for_another_file() {
        let limit = Duration::from_secs(120);
        let table = [
            (Defence::TookTooLong { limit }, "the two maps took longer than 120 s"),
            (Defence::ReadersBusy { wait: limit }, "none of them ended within 120 s"),
        ];
        for (defence, part) in table {
            let cause = why_unregistered(&defence.into());
            assert!(cause.contains(part) && !cause.contains("send") && !cause.contains("split"), "{cause}");
        }
    }
}
