//! Pictures and clouds of one clip.

use super::App;
use super::bodies::{FileBytes, send};
use super::error::Error;
use super::extract::ClipPath;
use super::problems::CommonProblems;
use crate::storage::HomeId;
use axum::extract::State;
use axum::response::Response;
use uuid::Uuid;

/// The LiDAR map with the clip's hit points and path drawn over it
#[utoipa::path(get, path = "/v1/homes/{home}/clips/{clip}/overlay.png", tag = "clips",
    params(ClipPath),
    responses((status = 200, description = "The picture", body = FileBytes, content_type = "image/png"), CommonProblems))]
pub(super) async fn get_clip_overlay(
    State(app): State<App>,
    ClipPath { home, clip }: ClipPath,
) -> Result<Response, Error> {
    send_result(app, home, clip, "overlay.png", "image/png").await
}

/// What was filled in where the clip left doubt: the views, what was made of them, and the plan before and after
#[utoipa::path(get, path = "/v1/homes/{home}/clips/{clip}/completion.png", tag = "clips",
    params(ClipPath),
    responses((status = 200, description = "The picture", body = FileBytes, content_type = "image/png"), CommonProblems))]
pub(super) async fn get_clip_completion(
    State(app): State<App>,
    ClipPath { home, clip }: ClipPath,
) -> Result<Response, Error> {
    send_result(app, home, clip, "completion.png", "image/png").await
}

/// The clip's fused points with colours, in the map's frame when the clip is aligned
#[utoipa::path(get, path = "/v1/homes/{home}/clips/{clip}/cloud.ply", tag = "clips",
    params(ClipPath),
    responses((status = 200, description = "The points", body = FileBytes, content_type = "model/ply"), CommonProblems))]
pub(super) async fn get_clip_cloud(
    State(app): State<App>,
    ClipPath { home, clip }: ClipPath,
) -> Result<Response, Error> {
    send_result(app, home, clip, "cloud.ply", "model/ply").await
}

async fn send_result(
    app: App,
    home: HomeId,
    id: Uuid,
    name: &str,
    media_type: &'static str,
) -> Result<Response, Error> {
    let clip = app.storage.clip(&home, id).await?;
    let blob = app.storage.clip_result(&clip, name).await?;
    Ok(send(blob.ok_or(Error::NoSuchResult(clip.state.name()))?, media_type))
}
