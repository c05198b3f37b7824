//! `/v1/homes/{home}/map/robot`: files for robots and homes, made on request.

use super::format::{Format, named};
use super::{App, LevelQuery, Revision, apart};
use crate::api::bodies::{FileBytes, attachment, send_made};
use crate::api::error::Error;
use crate::api::extract::{HomePath, Query, invalid_query};
use crate::api::fairness::MakerPlaces;
use crate::api::problems::{CommonProblems, MapProblems};
use crate::api::reply::{known, tagged};
use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;
use serde::{Deserialize, Serialize};
use viola_formats::lidar::{LidarMap, valetudo_json};
use viola_geometry::LevelName;
use viola_home::{Ground, PlanImage, RobotLevel, Tile};
use viola_storage::{MapLevel, MapScene, StorageError, map_file};

/// The format of a file for robots.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(in crate::api) struct RobotQuery {
    /// `nav2`, `valetudo`, `matter` or `calibration`.
    #[param(value_type = RobotFormat, required = true, example = "valetudo")]
    format: Option<String>,
}

/// A file for robots and homes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, utoipa::ToSchema)]
#[schema(rename_all = "lowercase")]
pub(in crate::api) enum RobotFormat {
    /// A zip of maps and masks for Nav2.
    Nav2,
    /// The robot's map with the names of rooms, and bodies of Valetudo's REST calls.
    Valetudo,
    /// Areas and maps of Matter's Service Area cluster.
    Matter,
    /// Configuration of the Xiaomi vacuum map card for Home Assistant.
    Calibration,
}

const FORMATS: [Format<RobotFormat>; 4] = [
    (RobotFormat::Nav2, "nav2", "application/zip"),
    (RobotFormat::Valetudo, "valetudo", "application/json"),
    (RobotFormat::Matter, "matter", "application/json"),
    (RobotFormat::Calibration, "calibration", "application/json"),
];

impl RobotFormat {
    fn ending(self) -> &'static str {
        if self == RobotFormat::Nav2 { "zip" } else { "json" }
    }
}

/// Get a file for robots and homes: Nav2 maps and masks, Valetudo names and zones, Matter areas, or a map card
///
/// `nav2` is a zip, the others are JSON; docs/robots.md describes their members, frames and units. `matter` has all
/// levels unless one is given. The file is made on request; keep it with its `ETag`.
#[utoipa::path(get, path = "/v1/homes/{home}/map/robot", tag = "map", params(HomePath, RobotQuery, LevelQuery),
    responses((status = 200, description = "The file", content(
            (Object = "application/json"), (FileBytes = "application/zip"))),
        (status = 304, description = "The client has it"), CommonProblems, MapProblems))]
pub(in crate::api) async fn get_map_robot(
    State(app): State<App>,
    HomePath { home }: HomePath,
    Query(query): Query<RobotQuery>,
    Query(of): Query<LevelQuery>,
    headers: HeaderMap,
) -> Result<Response, Error> {
    let revision = Revision::asked(&app, home, of.revision.as_deref()).await?;
    let (format, format_name, media_type) = named(&FORMATS, query.format.as_deref().unwrap_or_default())?;
    let levels = match of.level.as_deref() {
        None if format == RobotFormat::Matter => revision.map.levels.as_slice(),
        asked => std::slice::from_ref(revision.level(asked)?),
    };
    let names: Vec<&str> = levels.iter().map(|level| level.level.as_str()).collect();
    let tag = revision.tag(&[names.join("/").as_bytes(), format_name.as_bytes()]);
    if let Some(known) = known(&headers, &tag) {
        return Ok(known);
    }
    // A LiDAR map as values takes up to a hundred megabytes.
    let MakerPlaces { unsent, making } = app.makers.file(revision.home.tenant()).await?;
    let mut sources = Vec::new();
    for level in levels {
        sources.push(Source::read(&revision, level, format).await?);
    }
    let make = move || {
        // The work continues if the client leaves, so it holds the place.
        let _making = making;
        write(format, &sources)
    };
    let bytes = apart(make).await?;
    let answer = send_made(bytes.into(), media_type, unsent);
    let name = match levels {
        // The other file of this format has all levels.
        [one] if format == RobotFormat::Matter && revision.map.levels.len() > 1 && one.level.is_main() => {
            revision.file_name("matter-main", one.level, format.ending())
        }
        [one] => revision.file_name(format_name, one.level, format.ending()),
        _ => revision.file_name(format_name, LevelName::MAIN, format.ending()),
    };
    Ok(tagged(attachment(answer, &name), &tag))
}

/// The parts of one level that a file is made of.
struct Source {
    level: LevelName,
    lidar: LidarMap,
    scene: MapScene,
    /// The LiDAR map's file, if it is Valetudo's.
    valetudo: Option<Vec<u8>>,
    /// For Nav2: the rugs and stairs.
    ground: Option<Ground>,
    /// For the map card: the frame of `plan.png`.
    image: Option<PlanImage>,
}

impl Source {
    async fn read(revision: &Revision, level: &MapLevel, format: RobotFormat) -> Result<Source, Error> {
        let Revision { storage, home, .. } = revision;
        let found = storage.lidar_map_revision(home, level.level, level.lidar_map_revision).await?;
        let found = found.ok_or(Error::NoSuchLidarRevision(level.lidar_map_revision))?;
        let file = storage.lidar_map_file(found.id()).await?;
        let read = apart(move || {
            let lidar = LidarMap::read(&file).map_err(|error| damaged("lidar map", &error.to_string()))?;
            let valetudo = valetudo_json(&file).filter(|_| format == RobotFormat::Valetudo);
            let ground = (format == RobotFormat::Nav2).then(|| Ground::new(&lidar));
            Ok::<_, Error>((lidar, valetudo, ground))
        });
        let (lidar, valetudo, mut ground) = read.await?;
        if let Some(ground) = &mut ground {
            for file in revision.files(level.level, map_file::TILE).await? {
                let bytes = revision.bytes(&file).await?;
                ground.add(&Tile::read(&bytes).map_err(|error| damaged("tile", &error.to_string()))?);
            }
        }
        let image = match format {
            RobotFormat::Calibration => Some(image(revision, level.level).await?),
            _ => None,
        };
        let scene = revision.scene(level.level).await?;
        Ok(Source { level: level.level, lidar, scene, valetudo, ground, image })
    }

    fn robot_level(&self) -> RobotLevel<'_> {
        RobotLevel {
            level: self.level,
            lidar: &self.lidar,
            rooms: self.scene.rooms.iter().map(|room| room.room.clone()).collect(),
            objects: self.scene.objects.iter().map(|object| object.for_robot()).collect(),
        }
    }
}

/// Returns the frame of a level's `plan.png`.
async fn image(revision: &Revision, level: LevelName) -> Result<PlanImage, Error> {
    let file = revision.file(level, map_file::PLAN_JSON).await?;
    PlanImage::in_plan_json(&revision.blob(&file).await?.all().await?).ok_or_else(|| {
        let detail = format!(
            "revision {} was made by an earlier version, without the frame of its picture; ask for a later one",
            revision.map.revision
        );
        invalid_query("revision", detail)
    })
}

/// Returns the file of the given levels.
fn write(format: RobotFormat, sources: &[Source]) -> Result<Vec<u8>, Error> {
    let levels: Vec<RobotLevel> = sources.iter().map(Source::robot_level).collect();
    let (Some(level), Some(source)) = (levels.first(), sources.first()) else { return Err(Error::NoSuchMap) };
    let places = || viola_home::robot_places(level);
    Ok(match (format, &source.ground, &source.image) {
        (RobotFormat::Nav2, Some(ground), _) => {
            viola_home::nav2_zip(&viola_home::nav2_files(level, &places(), ground)?)
        }
        (RobotFormat::Calibration, _, Some(image)) => json(&viola_home::calibration(level, &places(), image)),
        (RobotFormat::Matter, ..) => json(&viola_home::matter(&levels)),
        (RobotFormat::Valetudo, ..) => {
            json(&viola_home::valetudo(level, &places(), source.valetudo.as_deref()))
        }
        (RobotFormat::Nav2 | RobotFormat::Calibration, ..) => return Err(Error::NoSuchMap),
    })
}

fn json(value: &impl Serialize) -> Vec<u8> {
    serde_json::to_vec(value).expect("our own documents have text keys and cannot fail to serialise")
}

fn damaged(column: &'static str, detail: &str) -> Error {
    StorageError::Column { column, detail: detail.to_owned() }.into()
}
