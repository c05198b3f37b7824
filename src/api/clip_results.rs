//! Pictures and clouds of one clip.

use super::App;
use super::bodies::{FileBytes, head_alone, send, send_made};
use super::error::{Defence, Error};
use super::extract::ClipPath;
use super::problems::CommonProblems;
use super::reply::{Head, known, tag_of, tag_of_made, tagged, unless_known};
use super::types::ClipScan;
use axum::Extension;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;
use viola_home::{MAP_VOXEL_M, UnknownFileFormat, cloud_ply, read_cloud_ply};
use viola_storage::{BlobReader, Clip, StorageError, result_file};

/// The media type of PLY.
const PLY: &str = "model/ply";

/// The parameter by which a page makes the address of a new picture another one.
const JOB: &str = "Ignored. A page sends the id of the clip's newest job, so that its browser does not show the picture \
    of an earlier one";

/// Get a picture of the LiDAR map with the clip's hit points and path
#[utoipa::path(get, path = "/v1/homes/{home}/clips/{clip}/overlay.png", tag = "clips",
    params(ClipPath, ("job" = Option<String>, Query, description = JOB)),
    responses((status = 200, description = "The picture", body = FileBytes, content_type = "image/png"), CommonProblems))]
pub(super) async fn get_clip_overlay(
    State(app): State<App>,
    path: ClipPath,
    headers: HeaderMap,
) -> Result<Response, Error> {
    send_result(&app, path, &headers, result_file::OVERLAY, "image/png").await
}

/// Get a picture of the clip's completion: the views, the filled-in pictures, and the plan before and after
#[utoipa::path(get, path = "/v1/homes/{home}/clips/{clip}/completion.png", tag = "clips",
    params(ClipPath, ("job" = Option<String>, Query, description = JOB)),
    responses((status = 200, description = "The picture", body = FileBytes, content_type = "image/png"), CommonProblems))]
pub(super) async fn get_clip_completion(
    State(app): State<App>,
    path: ClipPath,
    headers: HeaderMap,
) -> Result<Response, Error> {
    send_result(&app, path, &headers, result_file::COMPLETION, "image/png").await
}

/// Get the clip's fused points with colours, in the map's frame if the clip has a pose
///
/// The pose is the one in the home's map, else a person's choice, else that of the clip's own alignment.
/// Without a pose, the points are in the clip's frame. The comment of the PLY names the frame.
#[utoipa::path(get, path = "/v1/homes/{home}/clips/{clip}/cloud.ply", tag = "clips",
    params(ClipPath),
    responses((status = 200, description = "The points", body = FileBytes, content_type = "model/ply"), CommonProblems))]
pub(super) async fn get_clip_cloud(
    State(app): State<App>,
    ClipPath { home, clip: id }: ClipPath,
    headers: HeaderMap,
    head: Option<Extension<Head>>,
) -> Result<Response, Error> {
    let clip = app.storage.clip(&home, id).await?;
    let result = clip.result_key().ok_or(Error::NoSuchResult(clip.state.name()))?;
    let pose = clip.pose();
    let of_pose =
        pose.map(|(pose, rise_m)| [pose.x_m, pose.y_m, pose.yaw_rad, rise_m].map(f64::to_le_bytes).concat());
    let tag = tag_of_made(&[result.as_bytes(), &of_pose.unwrap_or_default()]);
    if let Some(known) = known(&headers, &tag) {
        return Ok(known);
    }
    let Some((map_from_clip, rise_m)) = pose.filter(|_| head.is_none()) else {
        let blob = file(&app, &clip, result_file::CLOUD).await?;
        let answer = if pose.is_some() { head_alone(PLY) } else { send(blob, PLY) };
        return Ok(tagged(answer, &tag));
    };
    // The points are in memory from here until they are sent.
    let place = app.makers.unsent(home.tenant()).await?;
    let bytes = file(&app, &clip, result_file::CLOUD).await?.all().await?;
    let moved = app.readers.run(home.tenant(), move || {
        let mut cloud = read_cloud_ply(&bytes, MAP_VOXEL_M)?;
        cloud.points.iter_mut().for_each(|point| point.position_m[2] += rise_m as f32);
        Ok::<_, UnknownFileFormat>(cloud_ply(&cloud, Some(&map_from_clip)))
    });
    let damaged =
        |error: UnknownFileFormat| StorageError::Column { column: "cloud.ply", detail: error.to_string() };
    let bytes = moved.await.map_err(not_made)?.map_err(damaged)?;
    Ok(tagged(send_made(bytes.into(), PLY, place), &tag))
}

/// Returns the refusal of a file that cannot be made now: the words of a reader are for the sender of a file.
fn not_made(refusal: Defence) -> Defence {
    match refusal {
        Defence::ReadersBusy { wait } | Defence::TookTooLong { limit: wait } => Defence::MakersBusy { wait },
        other => other,
    }
}

/// Get the clip's hits at the vacuum's height and its cameras, in the clip's frame, to draw it at any pose
#[utoipa::path(get, path = "/v1/homes/{home}/clips/{clip}/scan", tag = "clips",
    params(ClipPath),
    responses((status = 200, description = "Hits and cameras", body = ClipScan), CommonProblems))]
pub(super) async fn get_clip_scan(
    State(app): State<App>,
    path: ClipPath,
    headers: HeaderMap,
) -> Result<Response, Error> {
    send_result(&app, path, &headers, result_file::SCAN, "application/json").await
}

/// Get a small picture of the clip: its sharpest frame of about five, upright
///
/// The job that aligns the clip makes it. Its longest side has 320 pixels. A clip without an answer returns 404
/// `result-not-found`; a clip without a colour picture, or with an answer of an earlier version, `no-thumbnail`.
#[utoipa::path(get, path = "/v1/homes/{home}/clips/{clip}/thumbnail.jpg", tag = "clips",
    params(ClipPath, ("job" = Option<String>, Query, description = JOB)),
    responses((status = 200, description = "The picture", body = FileBytes, content_type = "image/jpeg"),
        (status = 304, description = "The client has it"), CommonProblems))]
pub(super) async fn get_clip_thumbnail(
    State(app): State<App>,
    path: ClipPath,
    headers: HeaderMap,
) -> Result<Response, Error> {
    let clip = app.storage.clip(&path.home, path.clip).await?;
    let result = clip.result_key().ok_or(Error::NoSuchResult(clip.state.name()))?;
    let blob = app.storage.clip_result(&clip, result_file::THUMBNAIL).await?.ok_or(Error::NoThumbnail)?;
    Ok(unless_known(&headers, &tag_of(&[result.as_bytes()]), || send(blob, "image/jpeg")))
}

/// Get a few frames of a clip that is not aligned, side by side and upright
///
/// The job that aligned the clip makes it. A frame without colour shows its depth in grey. An aligned clip, and a clip
/// without an answer, return 404 `result-not-found`.
#[utoipa::path(get, path = "/v1/homes/{home}/clips/{clip}/frames.jpg", tag = "clips",
    params(ClipPath, ("job" = Option<String>, Query, description = JOB)),
    responses((status = 200, description = "The picture", body = FileBytes, content_type = "image/jpeg"),
        (status = 304, description = "The client has it"), CommonProblems))]
pub(super) async fn get_clip_frames(
    State(app): State<App>,
    path: ClipPath,
    headers: HeaderMap,
) -> Result<Response, Error> {
    send_result(&app, path, &headers, result_file::FRAMES, "image/jpeg").await
}

async fn send_result(
    app: &App,
    path: ClipPath,
    headers: &HeaderMap,
    name: &str,
    media_type: &'static str,
) -> Result<Response, Error> {
    let clip = app.storage.clip(&path.home, path.clip).await?;
    let blob = file(app, &clip, name).await?;
    let tag = tag_of(&[clip.result_key().unwrap_or_default().as_bytes()]);
    Ok(unless_known(headers, &tag, || send(blob, media_type)))
}

/// Returns a file of the clip's newest answer. The loss of one that every answer has is a fault of the service.
async fn file(app: &App, clip: &Clip, name: &str) -> Result<BlobReader, Error> {
    match app.storage.clip_result(clip, name).await? {
        Some(blob) => Ok(blob),
        None => {
            app.storage.check_result_removed(clip, name).await?;
            Err(Error::NoSuchResult(clip.state.name()))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn nobody_who_asks_for_points_is_told_to_send_a_file() {
        let wait = Duration::from_secs(60);
        for refusal in [Defence::ReadersBusy { wait }, Defence::TookTooLong { limit: wait }] {
            let problem = Error::from(not_made(refusal)).problem();
            assert_eq!((problem.status, problem.kind.as_str()), (503, "urn:viola:problem:makers-busy"));
            assert!(problem.detail.ends_with("ask again later"), "{}", problem.detail);
        }
    }
}
