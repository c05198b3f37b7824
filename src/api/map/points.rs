//! `/v1/homes/{home}/map/points`: streamed tile by tile, so that memory does not grow with the map.

use super::format::{Format, accepted, named};
use super::made_file::{self, Spool};
use super::scene::classes;
use super::{App, LevelQuery, Revision, tag_of_content};
use crate::api::bodies::{FileBytes, attachment, head_alone, sized};
use crate::api::error::Error;
use crate::api::extract::{HomePath, Query, invalid_query, query_number};
use crate::api::problems::{CommonProblems, MapProblems};
use crate::api::reply::{Head, known, tagged};
use crate::api::types::ClassName;
use axum::Extension;
use axum::body::Body;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;
use bytes::Bytes;
use futures::{Stream, StreamExt, TryStreamExt};
use serde::Deserialize;
use std::fs::File;
use std::io::{self, BufWriter};
use std::sync::Arc;
use viola_home::{ClipNumbers, Glb, MAP_VOXEL_M, Ply, PointFilter, TileBytes, write_e57, write_laz};
use viola_storage::{MapFile, StorageError, map_file};

/// The filter and the format of points.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(in crate::api) struct PointsQuery {
    /// Only these classes, by name, separated by commas.
    #[param(value_type = Option<Vec<ClassName>>, style = Form, explode = false, min_items = 1, example = json!(["wall", "floor"]))]
    classes: Option<String>,
    /// Only points in this box: `x0,y0,z0,x1,y1,z1` in metres in the LiDAR map's frame.
    #[param(value_type = Option<Vec<f64>>, style = Form, explode = false, min_items = 6, max_items = 6,
        example = json!([0, 0, 0, 4, 3, 2.5]))]
    r#box: Option<String>,
    /// Only points between these heights above the floor, in metres.
    #[param(value_type = Option<Vec<f64>>, style = Form, explode = false, min_items = 2, max_items = 2,
        example = json!([0.1, 2]))]
    z: Option<String>,
    /// Side of cubes in metres, 0.03 to 1: the points in a cube are replaced by their mean.
    #[param(value_type = Option<f64>, minimum = 0.03, maximum = 1)]
    voxel: Option<String>,
    /// `ply`, `glb`, `e57` or `laz`; default: the format in `Accept`, else `ply`.
    #[param(value_type = Option<PointFormat>, example = "glb")]
    format: Option<String>,
}

/// The file format of points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, utoipa::ToSchema)]
#[schema(rename_all = "lowercase")]
pub(in crate::api) enum PointFormat {
    Ply,
    Glb,
    E57,
    Laz,
}

const FORMATS: [Format<PointFormat>; 4] = [
    (PointFormat::Ply, "ply", "model/ply"),
    (PointFormat::Glb, "glb", "model/gltf-binary"),
    (PointFormat::E57, "e57", "model/e57"),
    (PointFormat::Laz, "laz", "application/vnd.laszip"),
];

/// A format whose head is known once the points are counted: it is sent while the points are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::api) enum Streamed {
    Ply,
    Glb,
}

fn numbers<const N: usize>(field: &'static str, text: &str, what: &str) -> Result<[f32; N], Error> {
    let parsed: Result<Vec<f32>, _> = text.split(',').map(|part| part.trim().parse()).collect();
    let parsed = parsed.ok().filter(|all| all.iter().all(|number| number.is_finite()));
    let fixed = parsed.and_then(|all| <[f32; N]>::try_from(all).ok());
    fixed.ok_or_else(|| invalid_query(field, format!("{field} is {what}, numbers with commas between them")))
}

impl PointsQuery {
    fn filter(&self) -> Result<PointFilter, Error> {
        let classes = self.classes.as_deref().map(|names| classes("classes", names)).transpose()?;
        let corners =
            self.r#box.as_deref().map(|text| numbers::<6>("box", text, "x0,y0,z0,x1,y1,z1")).transpose()?;
        if corners.is_some_and(|c| (0..3).any(|axis| c[axis] > c[axis + 3])) {
            return Err(invalid_query("box", "the box is empty: its first corner is the lower one"));
        }
        let heights = self.z.as_deref().map(|text| numbers::<2>("z", text, "low,high")).transpose()?;
        if heights.is_some_and(|[low, high]| low > high) {
            return Err(invalid_query("z", "nothing lies between these heights: the lower one comes first"));
        }
        let (sides, what) = (MAP_VOXEL_M..=1.0, format!("a number from {MAP_VOXEL_M} to 1"));
        let voxel_m = query_number("voxel", self.voxel.as_deref(), |side| sides.contains(side), &what)?;
        Ok(PointFilter {
            classes,
            box_m: corners.map(|[a, b, c, d, e, f]| ([a, b, c], [d, e, f])),
            z_m: heights.map(|[low, high]| (low, high)),
            voxel_m,
        })
    }
}

/// Get the points of one level of a home's map, in the frame of its LiDAR map
///
/// The answer is a binary PLY with normals, colours, classes (`label`, an id of `GET /v1/classes`),
/// probabilities, views and clips (indices in the map's list of clips), a binary glTF with a node and a
/// material for each class, an E57 or a LAZ. E57 and LAZ are made before they are sent, one file at a time.
/// Filters are combined: a point must pass all of them. A correction of an object or a room, such as a name, leaves the
/// points and their `ETag` as they are.
#[utoipa::path(get, path = "/v1/homes/{home}/map/points", tag = "map", params(HomePath, PointsQuery, LevelQuery),
    responses(
        (status = 200, description = "The points", content(
            (FileBytes = "model/ply"), (FileBytes = "model/gltf-binary"), (FileBytes = "model/e57"),
            (FileBytes = "application/vnd.laszip"))),
        (status = 304, description = "The client has them"), CommonProblems, MapProblems))]
pub(in crate::api) async fn get_map_points(
    State(app): State<App>,
    HomePath { home }: HomePath,
    Query(query): Query<PointsQuery>,
    Query(of): Query<LevelQuery>,
    headers: HeaderMap,
    head: Option<Extension<Head>>,
) -> Result<Response, Error> {
    let filter = query.filter()?;
    let format = query.format.as_deref().or_else(|| accepted(&FORMATS, &headers));
    let (format, format_name, media_type) = named(&FORMATS, format.unwrap_or("ply"))?;
    let revision = Revision::asked(&app, home, of.revision.as_deref()).await?;
    let level = revision.level(of.level.as_deref())?;
    let tiles = revision.files(level.level, map_file::TILE).await?;
    // A point has the index of its clip in the map's list.
    let clips: Vec<u8> = revision.map.clips.iter().flat_map(|clip| clip.clip.into_bytes()).collect();
    let asked = [&query.classes, &query.r#box, &query.z, &query.voxel];
    let [classes, corners, heights, voxel] = asked.map(|text| text.as_deref().unwrap_or_default().as_bytes());
    let of_map = [level.level.as_str().as_bytes(), media_type.as_bytes(), clips.as_slice()];
    let tag = tag_of_content(&tiles, &[&of_map[..], &[classes, corners, heights, voxel]].concat());
    if let Some(known) = known(&headers, &tag) {
        return Ok(known);
    }
    let points = Points::new(&revision, filter);
    let name = revision.file_name("points", level.level, format_name);
    let answer = match format {
        PointFormat::Ply => {
            sized(points.streamed(Streamed::Ply, level.info.points, tiles).await?, media_type)
        }
        PointFormat::Glb => {
            sized(points.streamed(Streamed::Glb, level.info.points, tiles).await?, media_type)
        }
        PointFormat::E57 | PointFormat::Laz if head.is_some() => head_alone(media_type),
        PointFormat::E57 | PointFormat::Laz => {
            let write = if format == PointFormat::Laz { laz } else { e57 };
            let places = app.makers.file(revision.home.tenant()).await?;
            sized(made_file::make(places, &points, &tiles, write).await?, media_type)
        }
    };
    Ok(tagged(attachment(answer, &name), &tag))
}

fn laz(out: File, points: Spool) -> io::Result<()> {
    write_laz(BufWriter::new(out), points.id, points)
}

fn e57(out: File, points: Spool) -> io::Result<()> {
    write_e57(out, points.id, points)
}

/// A stream of a revision's points.
pub(in crate::api) struct Points {
    pub revision: Revision,
    clips: ClipNumbers,
    filter: PointFilter,
}

impl Points {
    pub fn new(revision: &Revision, filter: PointFilter) -> Points {
        let clips = ClipNumbers::new(revision.map.clips.iter().map(|clip| &clip.clip));
        Points { revision: revision.clone(), clips, filter }
    }

    /// Returns the body of an answer and its size.
    async fn streamed(self, format: Streamed, all: usize, tiles: Vec<MapFile>) -> Result<(Body, u64), Error> {
        let (head, size_bytes) = self.head(format, all, &tiles).await?;
        Ok((Body::from_stream(self.body(format, head, tiles)), size_bytes))
    }

    /// Returns the bytes before the points, and the total size. Both formats begin with the number of points:
    /// the tiles are read once to count them before they are sent, except for a PLY of `all` points.
    pub async fn head(
        &self,
        format: Streamed,
        all: usize,
        tiles: &[MapFile],
    ) -> Result<(Vec<u8>, u64), Error> {
        if format == Streamed::Ply && self.filter.is_everything() {
            let ply = Ply::new(all);
            return Ok((ply.head(), ply.size_bytes()));
        }
        let mut count = 0;
        let mut glb = Glb::default();
        for tile in tiles {
            let points = self.of_tile(tile).await?;
            count += points.len() / viola_home::POINT_BYTES;
            if format == Streamed::Glb {
                glb.announce(&points);
            }
        }
        match format {
            Streamed::Ply => {
                let ply = Ply::new(count);
                Ok((ply.head(), ply.size_bytes()))
            }
            Streamed::Glb => {
                let size_bytes = glb.size_bytes().ok_or_else(|| {
                    invalid_query(
                        "format",
                        "the points are more than a GLB can hold, 4 GiB; ask for ply, or for fewer",
                    )
                })?;
                Ok((glb.head(), size_bytes))
            }
        }
    }

    pub fn body(
        self,
        format: Streamed,
        head: Vec<u8>,
        tiles: Vec<MapFile>,
    ) -> impl Stream<Item = Result<Bytes, Error>> + use<> {
        let points = Arc::new(self);
        let tiles = futures::stream::iter(tiles).then(move |tile| {
            let points = points.clone();
            async move {
                let bytes = points.of_tile(&tile).await?;
                Ok::<_, Error>(Bytes::from(if format == Streamed::Glb { Glb::tile(&bytes) } else { bytes }))
            }
        });
        let points = futures::stream::once(async { Ok(Bytes::from(head)) }).chain(tiles);
        points.inspect_err(|error| {
            // The revision or the home was removed meanwhile.
            if error.is_refusal() {
                tracing::info!(%error, "points broke off");
            } else {
                tracing::error!(%error, "points broke off");
            }
        })
    }

    pub(super) async fn of_tile(&self, tile: &MapFile) -> Result<Vec<u8>, Error> {
        let bytes = self.revision.bytes(tile).await?;
        let damaged = || StorageError::Column { column: "tile", detail: "it is damaged".to_owned() };
        let tile = TileBytes::read(&bytes).map_err(|_| damaged())?;
        Ok(self.filter.of_tile(&tile, &self.clips).map_err(|_| damaged())?)
    }
}
