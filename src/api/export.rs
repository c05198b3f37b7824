//! `/v1/homes/{home}/export`: all data of a home as one zip, written while it is sent.

mod archive;
mod contents;

use super::App;
use super::bodies::{FileBytes, attachment};
use super::error::Error;
use super::extract::HomePath;
use super::fairness::ExportPlace;
use super::problems::{CommonProblems, ExportProblems};
use archive::Archive;
use axum::body::Body;
use axum::extract::State;
use axum::http::{HeaderValue, header};
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use contents::{Contents, ExportError};
use futures::{FutureExt, StreamExt, stream};
use std::io;
use tokio::sync::mpsc;
use tokio_util::task::AbortOnDropHandle;
use tracing::Instrument;

/// Export a home as one zip
///
/// The zip has the LiDAR map, the current fused map (points, plan, rooms, objects, coverage), every clip with
/// its recording, answer and pictures, and a README. It is written while it is sent: a zip that was cut off
/// has no directory at its end, and no program opens it. The number of concurrent exports is limited.
#[utoipa::path(get, path = "/v1/homes/{home}/export", tag = "homes", params(HomePath),
    responses((status = 200, description = "The zip", body = FileBytes, content_type = "application/zip"),
        CommonProblems, ExportProblems))]
pub(super) async fn export_home(
    State(app): State<App>,
    HomePath { home }: HomePath,
) -> Result<Response, Error> {
    let place = app.exports.take(home.tenant())?;
    let about = app.storage.home(&home).await?;
    let name = format!("{home}.zip");
    let (archive, pieces) = Archive::new(place.compressing());
    let writing = Contents { app, home, about }.write(archive).in_current_span();
    let answer =
        ([(header::CONTENT_TYPE, HeaderValue::from_static("application/zip"))], body(writing, pieces, place))
            .into_response();
    Ok(attachment(answer, &name))
}

/// Returns the body of the zip. A task writes it, because it takes turns with other exports: if only the connection polled it,
/// a slow reader would keep its turn. The task waits for the reader, ends with the connection, and then the place is free.
fn body(
    writing: impl Future<Output = Result<(), ExportError>> + Send + 'static,
    pieces: mpsc::Receiver<Bytes>,
    place: ExportPlace,
) -> Body {
    let pieces = stream::unfold((pieces, place), |(mut pieces, place)| async {
        pieces.recv().await.map(|piece| (Ok(piece), (pieces, place)))
    });
    let writing = AbortOnDropHandle::new(tokio::spawn(writing));
    let failed = writing.into_stream().filter_map(|written| async {
        let error: Box<dyn std::error::Error + Send + Sync> = match written {
            Ok(Ok(())) => return None,
            Ok(Err(error)) => error.into(),
            Err(error) => error.into(),
        };
        tracing::error!(%error, "an export broke off");
        // Breaks the answer off, so that the reader notices the error.
        Some(Err(io::Error::other(error)))
    });
    Body::from_stream(stream::select(pieces, failed))
}
