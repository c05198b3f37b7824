//! `/v1/homes/{home}/export`: all data of a home as one zip, written while it is sent.

mod archive;
mod contents;

use super::App;
use super::bodies::{FileBytes, attachment};
use super::error::Error;
use super::extract::HomePath;
use super::fairness::{FairPlace, FairPlaces};
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

/// Maximum number of concurrent exports. Each reads one blob at a time and holds about a megabyte.
const EXPORTS: usize = 64;
/// Maximum number for one tenant, so that others find a place.
const EXPORTS_OF_TENANT: usize = 16;

/// Returns the places of exports.
pub(super) fn exports() -> FairPlaces {
    FairPlaces::new(EXPORTS, EXPORTS_OF_TENANT)
}

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
    // Each waiting export would hold a connection.
    let place = app.exports.try_take(home.tenant());
    let place = place.ok_or(Error::TooManyExports { most: EXPORTS, most_of_tenant: EXPORTS_OF_TENANT })?;
    let about = app.storage.home(&home).await?;
    let name = format!("{home}.zip");
    let (archive, pieces) = Archive::new(app.compressing.clone());
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
    place: FairPlace,
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tenant_takes_its_share_and_leaves_the_rest() {
        let places = exports();
        let take_all = |tenant: &str| -> Vec<FairPlace> {
            (0..EXPORTS_OF_TENANT).map(|_| places.try_take(tenant).unwrap()).collect()
        };
        let mut held = take_all("acme");
        assert!(places.try_take("acme").is_none());
        for tenant in 0..EXPORTS / EXPORTS_OF_TENANT - 1 {
            held.extend(take_all(&format!("tenant-{tenant}")));
        }
        assert!(places.try_take("late").is_none(), "all {EXPORTS} places are taken");
        held.pop();
        held.push(places.try_take("late").unwrap());
        held.clear();
        assert_eq!(take_all("acme").len(), EXPORTS_OF_TENANT, "the places are free again");
    }
}
