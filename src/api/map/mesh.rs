//! `/v1/homes/{home}/map/mesh`: the surface as triangles, made by the worker or on request.

use super::format::{Format, named};
use super::{App, LevelQuery, Revision, apart, tag_of_content};
use crate::api::bodies::{FileBytes, attachment, head_alone, send, send_made, to_the_end};
use crate::api::error::Error;
use crate::api::extract::{HomePath, Query, invalid_query, query_number};
use crate::api::fairness::MakerPlaces;
use crate::api::problems::{CommonProblems, MapProblems};
use crate::api::reply::{Head, known, tagged};
use axum::Extension;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;
use bytes::Bytes;
use serde::Deserialize;
use tracing::{error, warn};
use viola_home::{MESH_TRIANGLES, Mesh};
use viola_storage::{BlobReader, LevelSurface, MESH_POINTS, MapFile, MapLevel, StorageError, map_file};

/// Bounds of `triangles`.
const TRIANGLES: std::ops::RangeInclusive<usize> = 1_000..=500_000;

/// The format and the size of a mesh.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(in crate::api) struct MeshQuery {
    /// `glb`, `usdz` or `obj`; default: `glb`.
    #[param(value_type = Option<MeshFormat>, example = "glb")]
    format: Option<String>,
    /// Maximum number of triangles; default: 200 000.
    #[param(value_type = Option<usize>, minimum = 1_000, maximum = 500_000)]
    triangles: Option<String>,
}

/// The file format of a mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq, utoipa::ToSchema)]
#[schema(rename_all = "lowercase")]
pub(in crate::api) enum MeshFormat {
    Glb,
    Usdz,
    Obj,
}

const FORMATS: [Format<MeshFormat>; 3] = [
    (MeshFormat::Glb, "glb", "model/gltf-binary"),
    (MeshFormat::Usdz, "usdz", "model/vnd.usdz+zip"),
    (MeshFormat::Obj, "obj", "model/obj"),
];

impl MeshFormat {
    fn write(self, mesh: &Mesh) -> Vec<u8> {
        match self {
            MeshFormat::Glb => mesh.glb(),
            MeshFormat::Usdz => mesh.usdz(),
            MeshFormat::Obj => mesh.obj().into_bytes(),
        }
    }
}

fn triangles(asked: Option<&str>) -> Result<usize, Error> {
    let what = format!("a number from {} to {}", TRIANGLES.start(), TRIANGLES.end());
    let number = query_number("triangles", asked, |number| TRIANGLES.contains(number), &what)?;
    Ok(number.unwrap_or(MESH_TRIANGLES))
}

/// Get the surface of a home as a triangle mesh
///
/// The mesh has vertex colours, and a named part for each object (its id) and for each class of the rest. A hole in
/// the points stays a hole. Units are metres and y is up: a point (x, y, z) of the LiDAR map's frame is (x, z, -y). The
/// service makes the GLB of the current revision with the default number of triangles after each merge. Others are made on
/// request, which takes some seconds; keep them with their `ETag`, which stays while the points and the objects' classes and
/// boxes do.
#[utoipa::path(get, path = "/v1/homes/{home}/map/mesh", tag = "map", params(HomePath, MeshQuery, LevelQuery),
    responses((status = 200, description = "The mesh", content(
            (FileBytes = "model/gltf-binary"), (FileBytes = "model/vnd.usdz+zip"), (FileBytes = "model/obj"))),
        (status = 304, description = "The client has it"), CommonProblems, MapProblems))]
pub(in crate::api) async fn get_map_mesh(
    State(app): State<App>,
    HomePath { home }: HomePath,
    Query(query): Query<MeshQuery>,
    Query(of): Query<LevelQuery>,
    headers: HeaderMap,
    head: Option<Extension<Head>>,
) -> Result<Response, Error> {
    let (format, format_name, media_type) = named(&FORMATS, query.format.as_deref().unwrap_or("glb"))?;
    let budget = triangles(query.triangles.as_deref())?;
    let revision = Revision::asked(&app, home, of.revision.as_deref()).await?;
    let level = revision.level(of.level.as_deref())?;
    let tiles = revision.files(level.level, map_file::TILE).await?;
    let objects = revision.scene(level.level).await?.mesh_parts();
    let tag = tag_of_content(&tiles, &[objects.as_bytes(), format_name.as_bytes(), &budget.to_le_bytes()]);
    if let Some(known) = known(&headers, &tag) {
        return Ok(known);
    }
    let wanted = Wanted { revision: &revision, level, format, budget };
    let answer = match wanted.stored().await? {
        Stored::Whole(blob) => send(blob, media_type),
        stored => {
            wanted.check_points()?;
            match head {
                Some(_) => head_alone(media_type),
                None => wanted.make(&app, media_type, stored).await?,
            }
        }
    };
    let name = revision.file_name("mesh", level.level, format_name);
    Ok(tagged(attachment(answer, &name), &tag))
}

/// A mesh that a request asks for.
struct Wanted<'a> {
    revision: &'a Revision,
    level: &'a MapLevel,
    format: MeshFormat,
    budget: usize,
}

/// The file of a mesh that the worker made.
enum Stored {
    Whole(BlobReader),
    /// The store lost it, or bytes of it.
    Damaged(MapFile),
    Absent,
}

impl Wanted<'_> {
    /// Returns the file that the worker made, if there is one.
    async fn stored(&self) -> Result<Stored, Error> {
        if self.format != MeshFormat::Glb || self.budget != MESH_TRIANGLES {
            return Ok(Stored::Absent);
        }
        let storage = &self.revision.storage;
        let Some(file) = self.revision.files(self.level.level, map_file::MESH).await?.pop() else {
            return Ok(Stored::Absent);
        };
        let damage = match storage.read_map_file(&file).await {
            Ok(Some(blob)) => return Ok(Stored::Whole(blob)),
            Ok(None) => match storage.check_map_file_removed(&file).await {
                Ok(()) => return Ok(Stored::Absent),
                Err(lost) => lost,
            },
            Err(damage @ StorageError::DamagedFile { .. }) => damage,
            Err(error) => return Err(error.into()),
        };
        error!(home = %self.revision.home, %damage, "a mesh is made again, and replaces the stored one");
        Ok(Stored::Damaged(file))
    }

    /// Refuses a level of which no mesh is made.
    fn check_points(&self) -> Result<(), Error> {
        let points = self.level.info.points;
        if points <= MESH_POINTS {
            return Ok(());
        }
        let detail =
            format!("the level has {points} points, a mesh is made of {MESH_POINTS} at most; get its points");
        Err(invalid_query("level", detail))
    }

    /// Returns the answer with a file that is made for this request.
    async fn make(&self, app: &App, media_type: &'static str, stored: Stored) -> Result<Response, Error> {
        let Revision { storage, home, map } = self.revision;
        let MakerPlaces { unsent, making } = app.makers.mesh(home.tenant()).await?;
        let surface = storage.level_surface(home, map.revision, self.level.level).await?;
        // Of a revision that was removed meanwhile, only the tiles that later ones share were read.
        self.revision.check_kept().await?;
        let surface: LevelSurface = surface.ok_or(Error::NoSuchMap)?;
        let (format, budget) = (self.format, self.budget);
        let make = move || {
            // The work continues if the client leaves, so it holds the place.
            let _making = making;
            format.write(&surface.mesh(budget))
        };
        let bytes = Bytes::from(apart(make).await);
        if let Stored::Damaged(file) = stored {
            self.replace(file, bytes.clone()).await;
        }
        Ok(send_made(bytes, media_type, unsent))
    }

    /// Stores a mesh in the place of a damaged one, so that later requests need not make it.
    async fn replace(&self, damaged: MapFile, glb: Bytes) {
        let Revision { storage, home, .. } = self.revision.clone();
        let replaced =
            to_the_end(
                async move { storage.replace_mesh(&home, &damaged, glb.to_vec(), storage.now()).await },
            );
        if let Err(error) = replaced.await {
            warn!(home = %self.revision.home, %error, "a damaged mesh could not be replaced");
        }
    }
}
