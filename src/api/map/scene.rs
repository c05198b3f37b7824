//! The contents of a map beyond its points: `.../map/rooms`, `objects`, `coverage` and `plan`.

use super::format::{Format, accepted, named};
use super::{App, LevelQuery, Revision, tag_of_content};
use crate::api::bodies::{FileBytes, inline, send};
use crate::api::error::Error;
use crate::api::extract::{HomePath, Query, invalid_query};
use crate::api::problems::{CommonProblems, MapProblems};
use crate::api::reply::{Document, known, tagged};
use crate::api::types::{ClassName, Coverage, LevelName, MapObject, Room};
use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};
use viola_geometry::taxonomy::Class;
use viola_storage::{MapScene, map_file};

/// The rooms of a home: the segments of its LiDAR map, or computed from it if it has none
#[derive(Serialize, utoipa::ToSchema)]
pub(in crate::api) struct MapRooms {
    /// Revision of the home's map.
    revision: i64,
    rooms: Vec<Room>,
}

/// The objects of a home
#[derive(Serialize, utoipa::ToSchema)]
pub(in crate::api) struct MapObjects {
    /// Revision of the home's map.
    revision: i64,
    objects: Vec<MapObject>,
}

/// The part of the LiDAR map that the clips have seen
#[derive(Serialize, utoipa::ToSchema)]
pub(in crate::api) struct MapCoverage {
    /// Revision of the home's map.
    revision: i64,
    #[serde(flatten)]
    coverage: Coverage,
}

/// Returns the document of `GET .../map/rooms`.
pub fn rooms_document(revision: i64, rooms: Vec<viola_storage::MapRoom>) -> impl Serialize {
    MapRooms { revision, rooms: rooms.into_iter().map(Room::from).collect() }
}

/// Returns the document of `GET .../map/objects`.
pub fn objects_document(revision: i64, objects: Vec<viola_storage::MapObject>) -> impl Serialize {
    MapObjects { revision, objects: objects.into_iter().map(MapObject::from).collect() }
}

/// The filter of a home's objects.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(in crate::api) struct ObjectsQuery {
    /// Only these classes, by name, separated by commas.
    #[param(value_type = Option<Vec<ClassName>>, style = Form, explode = false, min_items = 1, example = json!(["sofa", "bed"]))]
    class: Option<String>,
    /// Only the objects of this level; default: those of all levels.
    #[param(value_type = Option<LevelName>)]
    level: Option<String>,
    /// An earlier revision that is still kept; default: the current one.
    #[param(value_type = Option<i64>, minimum = 1)]
    revision: Option<String>,
}

/// The filter of a home's rooms.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(in crate::api) struct RoomsQuery {
    /// Only the rooms of this level; default: those of all levels.
    #[param(value_type = Option<LevelName>)]
    level: Option<String>,
    /// An earlier revision that is still kept; default: the current one.
    #[param(value_type = Option<i64>, minimum = 1)]
    revision: Option<String>,
}

/// The file format of a plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, utoipa::ToSchema)]
#[schema(rename_all = "lowercase")]
pub(in crate::api) enum PlanFormat {
    Png,
    Svg,
    Pdf,
    Geojson,
    Dxf,
    Json,
}

const FORMATS: [Format<PlanFormat>; 6] = [
    (PlanFormat::Svg, "svg", "image/svg+xml"),
    (PlanFormat::Png, "png", "image/png"),
    (PlanFormat::Pdf, "pdf", "application/pdf"),
    (PlanFormat::Geojson, "geojson", "application/geo+json"),
    (PlanFormat::Dxf, "dxf", "image/vnd.dxf"),
    (PlanFormat::Json, "json", "application/json"),
];

/// The format of a plan.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(in crate::api) struct PlanQuery {
    /// `svg`, `png`, `pdf`, `geojson`, `dxf` or `json`; default: the format in `Accept`, else `svg`.
    #[param(value_type = Option<PlanFormat>, example = "png")]
    format: Option<String>,
}

/// Get the rooms of a home
#[utoipa::path(get, path = "/v1/homes/{home}/map/rooms", tag = "map", params(HomePath, RoomsQuery),
    responses((status = 200, description = "The rooms", body = MapRooms),
        (status = 304, description = "The client has them"), CommonProblems, MapProblems))]
pub(in crate::api) async fn get_map_rooms(
    State(app): State<App>,
    HomePath { home }: HomePath,
    Query(query): Query<RoomsQuery>,
) -> Result<Response, Error> {
    let revision = Revision::asked(&app, home, query.revision.as_deref()).await?;
    let scenes = scenes(&revision, query.level.as_deref()).await?;
    let rooms = scenes.into_iter().flat_map(|scene| scene.rooms).collect();
    Ok(Document(rooms_document(revision.map.revision, rooms)).into_response())
}

/// Get the objects of a home: furniture and appliances, each with its box, its room and the clips that saw it
#[utoipa::path(get, path = "/v1/homes/{home}/map/objects", tag = "map", params(HomePath, ObjectsQuery),
    responses((status = 200, description = "The objects", body = MapObjects),
        (status = 304, description = "The client has them"), CommonProblems, MapProblems))]
pub(in crate::api) async fn get_map_objects(
    State(app): State<App>,
    HomePath { home }: HomePath,
    Query(query): Query<ObjectsQuery>,
) -> Result<Response, Error> {
    let classes = query.class.as_deref().map(|names| classes("class", names)).transpose()?;
    let revision = Revision::asked(&app, home, query.revision.as_deref()).await?;
    let scenes = scenes(&revision, query.level.as_deref()).await?;
    let mut objects: Vec<viola_storage::MapObject> =
        scenes.into_iter().flat_map(|scene| scene.objects).collect();
    objects.retain(|object| classes.as_ref().is_none_or(|classes| classes.contains(&object.class)));
    Ok(Document(objects_document(revision.map.revision, objects)).into_response())
}

/// Get the part of the LiDAR map that the clips have seen, as a whole and by room
#[utoipa::path(get, path = "/v1/homes/{home}/map/coverage", tag = "map", params(HomePath, LevelQuery),
    responses((status = 200, description = "The shares", body = MapCoverage),
        (status = 304, description = "The client has them"), CommonProblems, MapProblems))]
pub(in crate::api) async fn get_map_coverage(
    State(app): State<App>,
    HomePath { home }: HomePath,
    Query(query): Query<LevelQuery>,
) -> Result<Response, Error> {
    let revision = Revision::asked(&app, home, query.revision.as_deref()).await?;
    let scene = revision.scene(revision.level(query.level.as_deref())?.level).await?;
    let coverage = scene.coverage.into();
    Ok(Document(MapCoverage { revision: revision.map.revision, coverage }).into_response())
}

/// Get the floor plan of a home: walls, doors and windows, rooms with their areas, and furniture
///
/// All formats show one model. GeoJSON and JSON are in metres in the LiDAR map's frame, not in degrees. DXF is in
/// metres and upright, as the pages of SVG, PNG and PDF are: the main direction of the walls is horizontal.
#[utoipa::path(get, path = "/v1/homes/{home}/map/plan", tag = "map", params(HomePath, PlanQuery, LevelQuery),
    responses((status = 200, description = "The plan", content(
            (FileBytes = "image/svg+xml"), (FileBytes = "image/png"), (FileBytes = "application/pdf"),
            (Object = "application/geo+json"), (FileBytes = "image/vnd.dxf"), (Object = "application/json"))),
        (status = 304, description = "The client has it"), CommonProblems, MapProblems))]
pub(in crate::api) async fn get_map_plan(
    State(app): State<App>,
    HomePath { home }: HomePath,
    Query(query): Query<PlanQuery>,
    Query(of): Query<LevelQuery>,
    headers: HeaderMap,
) -> Result<Response, Error> {
    let format = query.format.as_deref().or_else(|| accepted(&FORMATS, &headers));
    let (format, _, media_type) = named(&FORMATS, format.unwrap_or("svg"))?;
    let revision = Revision::asked(&app, home, of.revision.as_deref()).await?;
    let level = revision.level(of.level.as_deref())?.level;
    let file = revision.file(level, format.file()).await?;
    let tag = tag_of_content(std::slice::from_ref(&file), &[]);
    if let Some(known) = known(&headers, &tag) {
        return Ok(known);
    }
    let (what, ending) = format.file().split_once('.').unwrap_or_default();
    let name = revision.file_name(what, level, ending);
    Ok(tagged(inline(send(revision.blob(&file).await?, media_type), &name), &tag))
}

impl PlanFormat {
    fn file(self) -> &'static str {
        match self {
            PlanFormat::Png => map_file::PLAN_PNG,
            PlanFormat::Svg => map_file::PLAN_SVG,
            PlanFormat::Pdf => map_file::PLAN_PDF,
            PlanFormat::Geojson => map_file::PLAN_GEOJSON,
            PlanFormat::Dxf => map_file::PLAN_DXF,
            PlanFormat::Json => map_file::PLAN_JSON,
        }
    }
}

/// Parses names of classes, separated by commas.
pub(super) fn classes(field: &'static str, names: &str) -> Result<Vec<Class>, Error> {
    names.split(',').map(|name| class(field, name.trim())).collect()
}

/// Parses the name of a class.
pub(in crate::api) fn class(field: &'static str, name: &str) -> Result<Class, Error> {
    Class::ALL.iter().copied().find(|class| class.name() == name).ok_or_else(|| {
        let names: Vec<&str> = Class::ALL.iter().map(|class| class.name()).collect();
        invalid_query(field, format!("no class is called '{name}'; there are {}", names.join(", ")))
    })
}

/// Returns the scenes of all levels, or of one.
async fn scenes(revision: &Revision, asked: Option<&str>) -> Result<Vec<MapScene>, Error> {
    let levels = match asked {
        Some(_) => std::slice::from_ref(revision.level(asked)?),
        None => &revision.map.levels,
    };
    let mut scenes = Vec::new();
    for level in levels {
        scenes.push(revision.scene(level.level).await?);
    }
    Ok(scenes)
}
