//! `/v1/homes/{home}/export`: everything of a home as one zip, written while it is sent.

mod contents;

use super::App;
use super::bodies::FileBytes;
use super::error::Error;
use super::extract::HomePath;
use super::problems::CommonProblems;
use axum::body::Body;
use axum::extract::State;
use axum::http::{HeaderValue, header};
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use contents::Contents;
use std::io::{BufWriter, Write};
use tokio::runtime::Handle;
use tokio::sync::mpsc;

/// Pieces of an export, and how many are written ahead of a slow reader.
const PIECE_BYTES: usize = 256 << 10;
const AHEAD: usize = 4;

/// Everything of a home as one zip
///
/// The LiDAR map, the current fused map (points, plan, rooms, objects, coverage), and every clip with its recording, its
/// answer and its pictures; a README inside says what is what. It is written while it is sent: a zip that was cut off
/// has no directory at its end, and no program opens it.
#[utoipa::path(get, path = "/v1/homes/{home}/export", tag = "homes", params(HomePath),
    responses((status = 200, description = "The zip", body = FileBytes, content_type = "application/zip"), CommonProblems))]
pub(super) async fn export_home(
    State(app): State<App>,
    HomePath { home }: HomePath,
) -> Result<Response, Error> {
    let about = app.storage.home(&home).await?;
    let (sender, receiver) = mpsc::channel(AHEAD);
    let runtime = Handle::current();
    let name = format!("attachment; filename=\"{home}.zip\"");
    let span = tracing::Span::current();
    tokio::task::spawn_blocking(move || {
        let _entered = span.enter();
        let mut out = BufWriter::with_capacity(PIECE_BYTES, Pieces(sender.clone()));
        let written = Contents { app, home, about, runtime }.write(&mut out);
        if let Err(error) = written.and_then(|()| Ok(out.flush()?)) {
            tracing::error!(%error, "an export broke off");
            // The reader hears of it by an answer that breaks off.
            let _ = sender.blocking_send(Err(std::io::Error::other(error)));
        }
    });
    let pieces = futures::stream::unfold(receiver, |mut receiver| async {
        receiver.recv().await.map(|piece| (piece, receiver))
    });
    let body = Body::from_stream(pieces);
    let mut answer =
        ([(header::CONTENT_TYPE, HeaderValue::from_static("application/zip"))], body).into_response();
    if let Ok(name) = HeaderValue::from_str(&name) {
        answer.headers_mut().insert(header::CONTENT_DISPOSITION, name);
    }
    Ok(answer)
}

/// What is written goes to the reader of the answer, as fast as that takes it.
struct Pieces(mpsc::Sender<std::io::Result<Bytes>>);

impl Write for Pieces {
    fn write(&mut self, piece: &[u8]) -> std::io::Result<usize> {
        let gone = |_| std::io::Error::from(std::io::ErrorKind::BrokenPipe);
        self.0.blocking_send(Ok(Bytes::copy_from_slice(piece))).map_err(gone)?;
        Ok(piece.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}
