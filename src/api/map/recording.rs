//! `/v1/homes/{home}/map/recording`: one level of the map as a recording, for viewers of robots' data.

use super::format::{Format, named};
use super::made_file::make;
use super::points::Points;
use super::{App, LevelQuery, Revision, apart};
use crate::api::bodies::{FileBytes, attachment, head_alone, sized};
use crate::api::error::Error;
use crate::api::extract::{HomePath, Query};
use crate::api::problems::{CommonProblems, MapProblems};
use crate::api::reply::{Head, known, tagged};
use axum::Extension;
use axum::body::Body;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;
use bytes::Bytes;
use jiff::Timestamp;
use serde::Deserialize;
use std::fs::File;
use std::io::{self, BufWriter, ErrorKind};
use viola_formats::lidar::LidarMap;
use viola_geometry::LevelName;
use viola_home::{ClipPath, MapPoint, PointFilter, RecordedObject, Recording, camera_poses};
use viola_storage::{LidarMapRevision, MapClip, MapLevel, MapObject, StorageError, map_file, result_file};

/// The format of a recording.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(in crate::api) struct RecordingQuery {
    /// `mcap`, which is the default.
    #[param(value_type = Option<RecordingFormat>, example = "mcap")]
    format: Option<String>,
}

/// The file format of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq, utoipa::ToSchema)]
#[schema(rename_all = "lowercase")]
pub(in crate::api) enum RecordingFormat {
    Mcap,
}

/// The media type is that of IANA.
const FORMATS: [Format<RecordingFormat>; 1] = [(RecordingFormat::Mcap, "mcap", "application/vnd.mcap")];

/// Get one level of a home's map as a recording for Foxglove, Rerun and other viewers
///
/// The answer is an MCAP file with messages of Foxglove's schemas in Protocol Buffers: the points, the paths of the
/// clips' cameras, the objects' boxes with their names, the LiDAR map as a grid, and the frames of the clips. Units
/// are metres, in the frame of the level's LiDAR map, z up. All messages have one time, that of the newest clip. The
/// file is made on request.
#[utoipa::path(get, path = "/v1/homes/{home}/map/recording", tag = "map",
    params(HomePath, RecordingQuery, LevelQuery),
    responses(
        (status = 200, description = "The recording", content((FileBytes = "application/vnd.mcap"))),
        (status = 304, description = "The client has it"), CommonProblems, MapProblems))]
pub(in crate::api) async fn get_map_recording(
    State(app): State<App>,
    HomePath { home }: HomePath,
    Query(query): Query<RecordingQuery>,
    Query(of): Query<LevelQuery>,
    headers: HeaderMap,
    head: Option<Extension<Head>>,
) -> Result<Response, Error> {
    let (_, format_name, media_type) = named(&FORMATS, query.format.as_deref().unwrap_or("mcap"))?;
    let revision = Revision::asked(&app, home, of.revision.as_deref()).await?;
    let level = revision.level(of.level.as_deref())?;
    let lidar_map =
        app.storage.lidar_map_revision(&revision.home, level.level, level.lidar_map_revision).await?;
    // The cameras are those of the clips' present results, and the LiDAR map may be removed before the revision is.
    let results = app.storage.result_keys(&revision.home).await?;
    let clips = revision.map.clips.iter();
    let results: Vec<&str> = clips.map(|clip| results.get(&clip.clip).map_or("", String::as_str)).collect();
    let tag = revision.tag(&[
        level.level.as_str().as_bytes(),
        media_type.as_bytes(),
        results.join(",").as_bytes(),
        &[u8::from(lidar_map.is_some())],
    ]);
    if let Some(known) = known(&headers, &tag) {
        return Ok(known);
    }
    let answer = match head {
        Some(_) => head_alone(media_type),
        None => sized(recorded(&app, &revision, level, lidar_map.as_ref()).await?, media_type),
    };
    let name = revision.file_name("recording", level.level, format_name);
    Ok(tagged(attachment(answer, &name), &tag))
}

/// Makes the recording; returns its body and its size.
async fn recorded(
    app: &App,
    revision: &Revision,
    level: &MapLevel,
    lidar_map: Option<&LidarMapRevision>,
) -> Result<(Body, u64), Error> {
    let places = app.makers.file(revision.home.tenant()).await?;
    let tiles = revision.files(level.level, map_file::TILE).await?;
    let times = revision.map.clips.iter().filter_map(|clip| clip.recorded_at);
    let level_map = LevelMap {
        level: level.level,
        time_ms: times.max().map(Timestamp::as_millisecond),
        paths: paths(revision, level.level).await?,
        objects: revision.scene(level.level).await?.objects,
        lidar: match lidar_map {
            Some(map) => Some(app.storage.lidar_map_file(map.id()).await?),
            None => None,
        },
    };
    let points = Points::new(revision, PointFilter::default());
    make(places, &points, &tiles, move |out, spool| level_map.write(out, spool)).await
}

/// The contents of a recording.
struct LevelMap {
    level: LevelName,
    time_ms: Option<i64>,
    paths: Vec<ClipPath>,
    objects: Vec<MapObject>,
    lidar: Option<Bytes>,
}

impl LevelMap {
    fn write(&self, out: File, points: impl Iterator<Item = io::Result<MapPoint>>) -> io::Result<()> {
        let damaged = |error| io::Error::new(ErrorKind::InvalidData, error);
        let lidar = self.lidar.as_ref().map(|file| LidarMap::read(file)).transpose().map_err(damaged)?;
        let objects: Vec<RecordedObject> = self.objects.iter().map(MapObject::recorded).collect();
        let recording = Recording {
            level: self.level,
            time_ms: self.time_ms.unwrap_or_default(),
            paths: &self.paths,
            objects: &objects,
            lidar: lidar.as_ref(),
        };
        recording.write(BufWriter::new(out), points)
    }
}

/// Returns the paths of the level's clips: the cameras of the newest clips, and only the frames of the others.
async fn paths(revision: &Revision, level: LevelName) -> Result<Vec<ClipPath>, Error> {
    let clips: Vec<&MapClip> = revision.map.clips.iter().filter(|clip| clip.level == level).collect();
    let without_cameras = clips.len().saturating_sub(Recording::MAX_PATHS);
    let mut paths = Vec::with_capacity(clips.len());
    for (index, clip) in clips.into_iter().enumerate() {
        let views = if index < without_cameras { None } else { views(revision, clip).await? };
        let poses = match views {
            Some(views) => apart(move || camera_poses(&views)).await,
            None => Ok(Vec::new()),
        };
        let damaged = |_| StorageError::Column { column: "views.bin", detail: "it is damaged".to_owned() };
        let poses = poses.map_err(damaged)?;
        paths.push(ClipPath::new(clip.clip, clip.map_from_clip, clip.rise_m, &poses));
    }
    Ok(paths)
}

/// Returns the file with the cameras of a clip; `None` if the clip was removed since.
async fn views(revision: &Revision, clip: &MapClip) -> Result<Option<Bytes>, StorageError> {
    match revision.storage.clip(&revision.home, clip.clip).await {
        Ok(clip) => revision.storage.clip_result_bytes(&clip, result_file::VIEWS).await,
        Err(StorageError::NoSuchClip) => Ok(None),
        Err(error) => Err(error),
    }
}
