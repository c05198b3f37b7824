//! The answer of an earlier job, which a clip keeps until another job has one.

use crate::StorageError;
use crate::database::Row;
use viola_align::Alignment;

/// The answer of an earlier job of a clip.
#[derive(Debug, Clone, PartialEq)]
pub struct LastAnswer {
    /// Its poses are in the frames of the LiDAR maps of that time.
    pub alignment: Alignment,
    /// The newest revision of the home's LiDAR maps when that job was queued.
    pub lidar_map_revision: i64,
    pub(crate) result_key: String,
    pub(crate) result_bytes: u64,
}

/// Returns the last answer of a clip's row; `None` if the newest job has one, or no job had one.
pub(super) fn from_row(row: &Row) -> Result<Option<LastAnswer>, StorageError> {
    let alignment: Option<Alignment> = row.maybe_json("last_alignment")?;
    let Some((alignment, result_key)) = alignment.zip(row.maybe_text("last_result_key")?) else {
        return Ok(None);
    };
    let result_bytes = row.count("last_result_bytes")?;
    let lidar_map_revision = row.number("last_lidar_map_revision")?;
    Ok(Some(LastAnswer { alignment, lidar_map_revision, result_key, result_bytes }))
}
