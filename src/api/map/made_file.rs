//! Files whose head needs what comes later, as E57, LAZ and MCAP: they are made in a temporary file and then sent.

use super::apart;
use super::points::Points;
use crate::api::bodies::{PIECE_BYTES, holding};
use crate::api::error::Error;
use crate::api::fairness::MakerPlaces;
use axum::body::Body;
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{self, BufReader, ErrorKind, Read, Seek};
use std::path::PathBuf;
use tokio::io::AsyncWriteExt;
use tokio_util::io::ReaderStream;
use uuid::{Builder, Uuid};
use viola_home::{MapPoint, POINT_BYTES, read_point};
use viola_storage::{MapFile, StorageError};

/// The points of a map in a temporary file.
pub(super) struct Spool {
    /// Id of the points: the same points have the same id.
    pub id: Uuid,
    file: BufReader<File>,
}

impl Iterator for Spool {
    type Item = io::Result<MapPoint>;

    fn next(&mut self) -> Option<io::Result<MapPoint>> {
        let mut bytes = [0; POINT_BYTES];
        match self.file.read_exact(&mut bytes) {
            Ok(()) => Some(read_point(&bytes).map_err(|error| io::Error::new(ErrorKind::InvalidData, error))),
            // The spool has whole points.
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => None,
            Err(error) => Some(Err(error)),
        }
    }
}

fn failed(source: io::Error) -> StorageError {
    StorageError::File { path: PathBuf::from("a temporary file of points"), source }
}

async fn spool(points: &Points, tiles: &[MapFile]) -> Result<Spool, Error> {
    let mut file = tokio::fs::File::from_std(points.revision.storage.scratch_file()?);
    let mut sum = Sha256::new();
    for tile in tiles {
        let bytes = points.of_tile(tile).await?;
        sum.update(&bytes);
        file.write_all(&bytes).await.map_err(failed)?;
    }
    file.flush().await.map_err(failed)?;
    let mut file = file.into_std().await;
    file.rewind().map_err(failed)?;
    Ok(Spool { id: id_of(sum), file: BufReader::new(file) })
}

/// Returns the id of points by their sum: a UUID of version 8 (RFC 9562).
fn id_of(sum: Sha256) -> Uuid {
    let mut bytes = [0; 16];
    bytes.copy_from_slice(&sum.finalize()[..16]);
    Builder::from_custom_bytes(bytes).into_uuid()
}

/// Makes a file of a map's points by `write`; returns the body of an answer and its size.
pub(super) async fn make(
    MakerPlaces { unsent, making }: MakerPlaces,
    points: &Points,
    tiles: &[MapFile],
    write: impl FnOnce(File, Spool) -> io::Result<()> + Send + 'static,
) -> Result<(Body, u64), Error> {
    let spool = spool(points, tiles).await?;
    let out = points.revision.storage.scratch_file()?;
    let made = apart(move || {
        // The work continues if the client leaves, so it holds the place.
        let _making = making;
        let mut file = out.try_clone()?;
        write(out, spool)?;
        file.rewind()?;
        let size_bytes = file.metadata()?.len();
        Ok((file, size_bytes))
    });
    let (file, size_bytes) = made.await.map_err(failed)?;
    let pieces = ReaderStream::with_capacity(tokio::fs::File::from_std(file), PIECE_BYTES);
    Ok((holding(unsent, pieces), size_bytes))
}
